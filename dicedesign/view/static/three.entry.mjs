// What the page uses of three.js. three.mjs is made of it by:
//   npm install three@0.180.0 esbuild@0.28.2
//   npx esbuild three.entry.mjs --bundle --minify --format=esm --banner:js='// three.js 0.180.0, MIT license, see three.LICENSE' --outfile=three.mjs
export {
  BufferAttribute,
  BufferGeometry,
  Camera,
  CanvasTexture,
  Color,
  DirectionalLight,
  DoubleSide,
  Group,
  HemisphereLight,
  Mesh,
  MeshBasicMaterial,
  MeshPhysicalMaterial,
  NeutralToneMapping,
  NoBlending,
  OrthographicCamera,
  PMREMGenerator,
  PerspectiveCamera,
  Plane,
  PlaneGeometry,
  Quaternion,
  Raycaster,
  SRGBColorSpace,
  Scene,
  ShaderMaterial,
  ShadowMaterial,
  SphereGeometry,
  VSMShadowMap,
  Vector2,
  Vector3,
  WebGLRenderTarget,
  WebGLRenderer,
} from 'three';
export { OrbitControls } from 'three/addons/controls/OrbitControls.js';
export { RoomEnvironment } from 'three/addons/environments/RoomEnvironment.js';
