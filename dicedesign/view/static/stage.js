// The die on its table: light, shadow, camera, motion. z is up; the die's farthest point is SIZE from its center.
import * as THREE from './three.mjs';

const SIZE = 15;
const EDGE = 63, BLANK = 62, LABEL = 128; // Codes of triangles, as in dice.py.
const EDGE_COSINE = 0.35; // A rounded edge takes normal and color of a facet within this cosine.
const CREASE_COSINE = 0.8; // Curved surfaces are smooth up to this cosine between neighbors.
const FIELD_OF_VIEW = 19, ELEVATION = new THREE.Vector3(0.12, -1, 0.6).normalize();
const SHARE = { usual: [0.72, 0.74], table: [0.48, 0.5] }; // Of the free width and height that the die fills.
const MAX_THROW_SECONDS = 2.6, DROP_SECONDS = 0.34, DROP = 7;
const LIFT = { up: 0.75, hold: 1.3, down: 0.6 };
const SLOW_FRAME = 0.1, SLOW_FRAMES = 4, DRAFT_PIXELS = 6e5, REST_MS = 250;
const CALM = matchMedia('(prefers-reduced-motion: reduce)');
const DOWN = new THREE.Vector3(0, 0, -1), UP = new THREE.Vector3(0, 0, 1);

const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
const ease = (x) => (x < 0.5 ? 4 * x ** 3 : 1 - (2 - 2 * x) ** 3 / 2);
const INK = new THREE.Color('#14171a'), WHITE = new THREE.Color('#ffffff');

/** Geometry of a mesh from the server. Facets and labels are flat; rounded edges and curved surfaces are smooth. */
export function readMesh(mesh, isSmooth = true) {
  const points = new Float32Array(bytes(mesh.points)), corners = new Uint32Array(bytes(mesh.triangles));
  const codes = new Uint8Array(bytes(mesh.codes)), count = codes.length;
  const position = new Float32Array(9 * count), normal = new Float32Array(9 * count), flat = new Float32Array(3 * count);
  const code = new Uint8Array(3 * count), a = new THREE.Vector3(), b = new THREE.Vector3(), c = new THREE.Vector3();
  const facetsAt = new Map(), sumAt = new Float32Array(points.length);
  for (let t = 0; t < count; t++) {
    [a, b, c].forEach((corner, k) => {
      corner.fromArray(points, 3 * corners[3 * t + k]).toArray(position, 9 * t + 3 * k);
    });
    const weighted = b.sub(a).cross(c.sub(a)).clone();
    b.normalize().toArray(flat, 3 * t);
    for (let k = 0; k < 3; k++) {
      const corner = corners[3 * t + k];
      if (codes[t] === EDGE || codes[t] === BLANK) for (let x = 0; x < 3; x++) sumAt[3 * corner + x] += weighted.getComponent(x);
      else if (codes[t] < BLANK && isSmooth) facetsAt.set(corner, [...(facetsAt.get(corner) ?? []), t]);
    }
  }
  for (let t = 0; t < count; t++) for (let k = 0; k < 3; k++) {
    const corner = corners[3 * t + k];
    let own = codes[t];
    a.fromArray(flat, 3 * t);
    if (isSmooth && own === EDGE) {
      let nearest = -1, cosine = EDGE_COSINE;
      for (const facet of facetsAt.get(corner) ?? []) {
        const dot = a.dot(b.fromArray(flat, 3 * facet));
        if (dot > cosine) [nearest, cosine] = [facet, dot];
      }
      if (nearest >= 0) { a.fromArray(flat, 3 * nearest); own = codes[nearest]; } else a.fromArray(sumAt, 3 * corner).normalize();
    } else if (isSmooth && own === BLANK) {
      b.fromArray(sumAt, 3 * corner).normalize();
      if (a.dot(b) > CREASE_COSINE) a.copy(b);
    }
    a.toArray(normal, 9 * t + 3 * k);
    code[3 * t + k] = own;
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(position, 3));
  geometry.setAttribute('normal', new THREE.BufferAttribute(normal, 3));
  geometry.setAttribute('color', new THREE.BufferAttribute(new Float32Array(9 * count), 3));
  let radius = 0;
  for (let i = 0; i < points.length; i += 3) radius = Math.max(radius, Math.hypot(points[i], points[i + 1], points[i + 2]));
  return { geometry, code, points, radius, rests: mesh.rests, show: mesh.show };
}

/** Color a model: `colors` and `texts` by outcome, or `scheme` [body, label]; `only` one outcome bright. */
export function paint(model, { colors, texts: inks, blank, scheme = null, only = null }) {
  const target = model.geometry.getAttribute('color'), none = new THREE.Color(blank);
  const [facets, texts] = [colors, inks].map((all) => all.map((color) => new THREE.Color(color)));
  const [body, label] = scheme ? scheme.map((color) => new THREE.Color(color)) : [];
  const edge = (body ?? none).clone().lerp(WHITE, 0.18), mixed = new THREE.Color();
  model.code.forEach((code, i) => {
    const outcome = code & 63, isLabel = code & LABEL;
    const color = isLabel ? label ?? texts[outcome] ?? INK : body ? (outcome === EDGE ? edge : body) : outcome === EDGE ? edge : facets[outcome] ?? none;
    mixed.copy(color);
    if (only !== null && outcome !== only) mixed.lerp(none, 0.72);
    target.setXYZ(i, mixed.r, mixed.g, mixed.b);
  });
  target.needsUpdate = true;
}

function light(scene, hasShadow) {
  const key = new THREE.DirectionalLight('#fff6ea', 1.7), fill = new THREE.DirectionalLight('#dfe9ff', 0.75), rim = new THREE.DirectionalLight('#ffffff', 1.25);
  key.position.set(-46, -58, 96);
  fill.position.set(90, -50, 36);
  rim.position.set(36, 96, 52);
  const sky = new THREE.HemisphereLight('#ffffff', '#d9d2c6', 0.85);
  scene.add(key, fill, rim, sky);
  if (hasShadow) {
    key.castShadow = true;
    key.shadow.mapSize.set(512, 512);
    Object.assign(key.shadow, { radius: 8, blurSamples: 12, bias: -0.0004 });
    Object.assign(key.shadow.camera, { left: -70, bottom: -70, right: 70, top: 70, near: 10, far: 300 });
  }
  return { key, sky };
}

function makeRenderer(canvas) {
  const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
  renderer.toneMapping = THREE.NeutralToneMapping;
  renderer.toneMappingExposure = 0.86;
  return renderer;
}

function reflections(renderer, scene) {
  scene.environment = new THREE.PMREMGenerator(renderer).fromScene(new THREE.RoomEnvironment(), 0.04).texture;
  scene.environmentIntensity = 0.36;
  scene.environmentRotation.set(Math.PI / 2, 0, 0);
  return scene.environment;
}

const makeMaterial = () => new THREE.MeshPhysicalMaterial({ vertexColors: true, roughness: 0.5, clearcoat: 0.25, clearcoatRoughness: 0.3 });

/** Soft shadow under the die: its depth seen from below, blurred twice. */
class ContactShadow {
  constructor(scene) {
    const half = 42;
    this.targets = [0, 1].map(() => new THREE.WebGLRenderTarget(256, 256));
    this.camera = new THREE.OrthographicCamera(-half, half, half, -half, 0, 26);
    this.camera.up.set(0, 1, 0);
    this.camera.lookAt(0, 0, 1);
    this.depth = new THREE.ShaderMaterial({
      side: THREE.DoubleSide,
      vertexShader: 'varying float z; void main() { vec4 w = modelMatrix * vec4(position, 1.); z = w.z; gl_Position = projectionMatrix * viewMatrix * w; }',
      fragmentShader: 'varying float z; void main() { float d = clamp(1. - z / 13., 0., 1.); gl_FragColor = vec4(0., 0., 0., d * d); }',
    });
    this.blur = new THREE.ShaderMaterial({
      uniforms: { image: { value: null }, step: { value: new THREE.Vector2() } }, depthTest: false, depthWrite: false, blending: THREE.NoBlending,
      vertexShader: 'varying vec2 at; void main() { at = uv; gl_Position = vec4(position.xy, 0., 1.); }',
      fragmentShader: 'uniform sampler2D image; uniform vec2 step; varying vec2 at; void main() { float sum = 0., weight = 0.; for (int i = -6; i <= 6; i++) { float w = exp(-float(i * i) / 16.); sum += texture2D(image, at + step * float(i)).a * w; weight += w; } gl_FragColor = vec4(0., 0., 0., sum / weight); }',
    });
    this.quad = new THREE.Scene();
    const screen = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), this.blur);
    screen.frustumCulled = false;
    this.quad.add(screen);
    this.plane = new THREE.Mesh(new THREE.PlaneGeometry(2 * half, 2 * half), new THREE.ShaderMaterial({
      transparent: true, depthWrite: false, uniforms: { image: { value: this.targets[0].texture }, opacity: { value: 0.5 } },
      vertexShader: 'varying vec2 at; void main() { at = vec2(1. - uv.x, uv.y); gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.); }',
      fragmentShader: 'uniform sampler2D image; uniform float opacity; varying vec2 at; void main() { gl_FragColor = vec4(.05, .04, .03, texture2D(image, at).a * opacity); }',
    }));
    this.plane.renderOrder = 1;
    scene.add(this.plane);
  }

  /** Draw the shadow of `object` alone. */
  update(renderer, scene, object) {
    const hidden = scene.children.filter((child) => child !== object && child.visible && !child.isLight);
    const due = renderer.shadowMap.needsUpdate, environment = scene.environment;
    hidden.forEach((child) => { child.visible = false; });
    this.plane.position.set(object.position.x, object.position.y, 0.02);
    this.camera.position.set(object.position.x, object.position.y, 0);
    this.camera.updateMatrixWorld();
    scene.environment = null;
    scene.overrideMaterial = this.depth;
    renderer.shadowMap.needsUpdate = false;
    renderer.setRenderTarget(this.targets[0]);
    renderer.clear();
    renderer.render(scene, this.camera);
    scene.overrideMaterial = null;
    for (const size of [0.011, 0.005]) for (const [from, to, x, y] of [[0, 1, size, 0], [1, 0, 0, size]]) {
      this.blur.uniforms.image.value = this.targets[from].texture;
      this.blur.uniforms.step.value.set(x, y);
      renderer.setRenderTarget(this.targets[to]);
      renderer.render(this.quad, new THREE.Camera());
    }
    renderer.setRenderTarget(null);
    renderer.shadowMap.needsUpdate = due;
    scene.environment = environment;
    hidden.forEach((child) => { child.visible = true; });
  }
}

export class Stage {
  /** freeArea: returns {x, y, width, height} of the canvas that nothing covers, in CSS pixels. */
  constructor(canvas, freeArea) {
    Object.assign(this, { canvas, freeArea, model: null, share: SHARE.usual, spin: 0, frames: 2, drop: 0, film: null, lifted: null, isHeld: false, isDraft: false, slow: 0, box: { radius: SIZE, height: SIZE } });
    this.renderer = makeRenderer(canvas);
    Object.assign(this.renderer.shadowMap, { enabled: true, type: THREE.VSMShadowMap, autoUpdate: false });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 1, 4000);
    this.camera.up.copy(UP);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { enablePan: false, enableDamping: true, dampingFactor: 0.08, minPolarAngle: 0.15, maxPolarAngle: 1.52, rotateSpeed: 0.8 });
    this.lights = light(this.scene, true);
    this.room = reflections(this.renderer, this.scene);
    this.material = makeMaterial();
    this.holder = new THREE.Group();
    this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), this.material);
    this.mesh.castShadow = true;
    this.holder.add(this.mesh);
    this.ground = new THREE.Mesh(new THREE.PlaneGeometry(900, 900), new THREE.ShadowMaterial({ opacity: 0.17 }));
    this.ground.receiveShadow = true;
    this.scene.add(this.holder, this.ground);
    this.contact = new ContactShadow(this.scene);
    const line = new THREE.MeshBasicMaterial({ color: INK, depthTest: false, transparent: true });
    this.center = new THREE.Mesh(new THREE.SphereGeometry(0.7, 24, 16), line);
    this.handle = new THREE.Mesh(new THREE.SphereGeometry(0.55, 24, 16), new THREE.MeshBasicMaterial({ color: '#c2571a', depthTest: false, transparent: true }));
    this.center.visible = this.handle.visible = false;
    this.center.renderOrder = this.handle.renderOrder = 5;
    this.holder.add(this.center, this.handle);
    this.ruler = new THREE.Group();
    this.ruler.visible = false;
    this.scene.add(this.ruler);
    this.controls.addEventListener('change', () => this.redraw());
    this.controls.addEventListener('start', () => { this.isHeld = true; });
    canvas.addEventListener('keydown', (event) => this.turnByKey(event));
    addEventListener('resize', () => this.fit());
    this.last = 0;
    requestAnimationFrame((now) => this.loop(now));
  }

  redraw(frames = 2) { this.frames = Math.max(this.frames, frames); }

  /** Show a model on one of its rests; `moved`, of its origin, keeps pose and camera for another state of the same body. */
  show(model, { moved = null, unit = null } = {}) {
    this.mesh.geometry.dispose();
    this.model = model;
    this.mesh.geometry = model.geometry;
    this.unit = unit ?? SIZE / model.radius;
    this.mesh.scale.setScalar(this.unit);
    if (moved) {
      if (!this.film && !this.lifted) {
        this.holder.position.add(new THREE.Vector3(...moved).multiplyScalar(this.unit).applyQuaternion(this.holder.quaternion));
        this.holder.position.z = -this.lowest(this.holder.quaternion);
      }
      this.pose = '';
      return this.redraw();
    }
    this.film = this.lifted = null;
    this.stand(model.rests[model.show]?.down ?? [0, 0, -1], 0.45);
    this.fit(true);
    this.drop = CALM.matches ? 0 : 1;
  }

  /** Lowest height of the model turned by a quaternion, over its center. */
  lowest(quaternion) {
    const { points } = this.model, v = new THREE.Vector3();
    let low = Infinity;
    for (let i = 0; i < points.length; i += 3) low = Math.min(low, v.fromArray(points, i).applyQuaternion(quaternion).z);
    return low * this.unit;
  }

  /** Stand on the facet with a normal. */
  stand(normal, yaw = null) {
    const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(...normal).normalize(), DOWN);
    if (yaw !== null) turn.premultiply(new THREE.Quaternion().setFromAxisAngle(UP, yaw));
    const v = new THREE.Vector3();
    let [low, high, radius] = [Infinity, -Infinity, 0];
    for (let i = 0; i < this.model.points.length; i += 3) {
      v.fromArray(this.model.points, i).applyQuaternion(turn);
      [low, high, radius] = [Math.min(low, v.z), Math.max(high, v.z), Math.max(radius, Math.hypot(v.x, v.y))];
    }
    this.film = this.lifted = null;
    this.box = { radius: radius * this.unit, height: (high - low) * this.unit };
    this.holder.quaternion.copy(turn);
    this.holder.position.set(0, 0, -low * this.unit);
    this.redraw();
  }

  /** Frame the die in the free area: its projection is shifted there, and its distance chosen so that it fills it. */
  fit(isFresh = false) {
    const area = this.freeArea(), { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.sharpen();
    const way = isFresh || !this.isPlaced ? ELEVATION.clone() : this.camera.position.clone().sub(this.controls.target).normalize();
    this.camera.aspect = width / height;
    this.camera.setViewOffset(width, height, width / 2 - area.x - area.width / 2, height / 2 - area.y - area.height / 2, width, height);
    const { radius, height: tall } = this.box, sine = Math.max(0.25, way.z), cosine = Math.sqrt(1 - sine * sine);
    const perPixel = Math.max((2 * radius) / (area.width * this.share[0]), (2 * radius * sine + tall * cosine) / (area.height * this.share[1]));
    const distance = (perPixel * height) / 2 / Math.tan((FIELD_OF_VIEW * Math.PI) / 360) + 0.6 * radius;
    Object.assign(this.controls, { minDistance: 0.55 * distance, maxDistance: 2 * distance });
    this.controls.target.set(0, 0, 0.46 * tall);
    this.camera.position.copy(this.controls.target).addScaledVector(way, distance);
    Object.assign(this.camera, { near: distance / 30, far: 12 * distance });
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.isPlaced = true;
    this.redraw();
  }

  setShare(name) { this.share = SHARE[name]; this.fit(); }

  /** Length scale on the table, as long as the die. */
  drawRuler(size, color) {
    for (const { geometry, material } of this.ruler.children) {
      material.map?.dispose();
      material.dispose();
      geometry.dispose();
    }
    this.ruler.clear();
    const material = new THREE.MeshBasicMaterial({ color, transparent: true, opacity: 0.75, toneMapped: false });
    const bar = (width, height, x) => {
      const part = new THREE.Mesh(new THREE.PlaneGeometry(width, height), material);
      part.position.set(x, 0, 0.03);
      this.ruler.add(part);
    };
    const long = size * this.unit;
    bar(long, 0.16, 0);
    bar(0.16, 1.5, -long / 2);
    bar(0.16, 1.5, long / 2);
    const canvas = Object.assign(document.createElement('canvas'), { width: 256, height: 64 }), pen = canvas.getContext('2d');
    Object.assign(pen, { font: '600 44px system-ui, sans-serif', textAlign: 'center', textBaseline: 'middle', fillStyle: color });
    pen.fillText(`${+size.toFixed(1)} mm`, 128, 34);
    const map = new THREE.CanvasTexture(canvas);
    map.colorSpace = THREE.SRGBColorSpace;
    const text = new THREE.Mesh(new THREE.PlaneGeometry(9.6, 2.4), new THREE.MeshBasicMaterial({ map, transparent: true, toneMapped: false, depthWrite: false }));
    text.position.set(0, -2.1, 0.03);
    this.ruler.add(text);
    this.ruler.position.y = -this.box.radius - 3.2;
    this.redraw();
  }

  setDark(isDark) {
    this.ground.material.opacity = isDark ? 0.42 : 0.17;
    this.contact.plane.material.uniforms.opacity.value = isDark ? 0.85 : 0.5;
    this.redraw();
  }

  /** Let the die show what is inside. */
  setGlass(isGlass) {
    Object.assign(this.material, { transparent: isGlass, opacity: isGlass ? 0.45 : 1, depthWrite: !isGlass, needsUpdate: true });
    this.redraw();
  }

  /** Play a motion from the server: lengths in the unit of the model. */
  play(motion, done) {
    const seconds = motion.seconds, positions = new Float32Array(bytes(motion.positions)), turns = new Float32Array(bytes(motion.quaternions));
    const count = seconds.length, near = 5.5 * SIZE / this.unit;
    let first = 0;
    // Motions begin where they come into view.
    while (first < count - 12 && Math.hypot(positions[3 * first], positions[3 * first + 1]) > near) first++;
    const comes = Math.atan2(positions[3 * first + 1], positions[3 * first]);
    const yaw = Math.hypot(positions[3 * first], positions[3 * first + 1]) > 1e-9 ? -2.35 - comes + 0.5 * (Math.random() - 0.5) : 0;
    const length = seconds[count - 1] - seconds[first];
    this.lifted = null;
    this.film = { seconds, positions, turns, done, time: CALM.matches ? seconds[count - 1] : seconds[first], speed: Math.max(1, length / MAX_THROW_SECONDS), yaw: new THREE.Quaternion().setFromAxisAngle(UP, yaw) };
    this.redraw();
  }

  stepFilm(elapsed) {
    const film = this.film, end = film.seconds.length - 1;
    film.time += elapsed * film.speed;
    let at = 0;
    while (at < end && film.seconds[at + 1] <= film.time) at++;
    const next = Math.min(at + 1, end), span = film.seconds[next] - film.seconds[at];
    const part = span > 0 ? Math.min(1, (film.time - film.seconds[at]) / span) : 0;
    const from = new THREE.Quaternion().fromArray(film.turns, 4 * at), to = new THREE.Quaternion().fromArray(film.turns, 4 * next);
    this.holder.quaternion.copy(from.slerp(to, part)).premultiply(film.yaw);
    this.holder.position.fromArray(film.positions, 3 * at).lerp(new THREE.Vector3().fromArray(film.positions, 3 * next), part).multiplyScalar(this.unit).applyQuaternion(film.yaw);
    this.redraw();
    if (at === end) {
      this.film = null;
      this.holder.position.z = -this.lowest(this.holder.quaternion);
      film.done?.();
    }
  }

  /** Lift the die, turn the facet with a normal to the viewer, and put it back. */
  lift(normal, done) {
    const from = this.holder.quaternion.clone(), toViewer = this.camera.position.clone().sub(this.controls.target).normalize();
    const now = new THREE.Vector3(...normal).applyQuaternion(from).normalize();
    const to = new THREE.Quaternion().setFromUnitVectors(now, toViewer).multiply(from);
    this.lifted = { from, to, base: this.holder.position.clone(), time: CALM.matches ? LIFT.up : 0, done };
    this.redraw();
  }

  stepLift(elapsed) {
    const lifted = this.lifted, { up, hold, down } = LIFT;
    lifted.time += elapsed;
    const late = (lifted.time - up - hold) / down, part = ease(Math.max(0, Math.min(1, lifted.time < up ? lifted.time / up : 1 - Math.max(0, late))));
    this.holder.quaternion.slerpQuaternions(lifted.from, lifted.to, part);
    this.holder.position.copy(lifted.base).addScaledVector(UP, 0.55 * SIZE * part);
    if (lifted.time >= up) { lifted.done?.(); lifted.done = null; }
    if (late >= 1) {
      this.holder.quaternion.copy(lifted.from);
      this.holder.position.copy(lifted.base);
      this.lifted = null;
    }
    this.redraw();
  }

  turnByKey(event) {
    const turn = { ArrowLeft: [-0.16, 0], ArrowRight: [0.16, 0], ArrowUp: [0, -0.12], ArrowDown: [0, 0.12] }[event.key];
    if (!turn) return;
    event.preventDefault();
    this.isHeld = true;
    const way = this.camera.position.clone().sub(this.controls.target), flat = Math.hypot(way.x, way.y), length = way.length();
    const around = Math.atan2(way.y, way.x) + turn[0], above = Math.max(0.15, Math.min(1.52, Math.atan2(flat, way.z) + turn[1]));
    this.camera.position.copy(this.controls.target).add(new THREE.Vector3(Math.cos(around) * Math.sin(above), Math.sin(around) * Math.sin(above), Math.cos(above)).multiplyScalar(length));
    this.redraw();
  }

  /** Without a graphics card: while anything moves no cast shadow, no reflections and fewer pixels; all of it at rest. */
  setDraft(isDraft) {
    if (isDraft === this.isDraft) return;
    this.isDraft = isDraft;
    this.lights.key.castShadow = this.ground.visible = !isDraft;
    this.scene.environment = isDraft ? null : this.room;
    Object.assign(this.material, { clearcoat: isDraft ? 0 : 0.25, roughness: isDraft ? 0.7 : 0.5 });
    this.lights.sky.intensity = isDraft ? 1.9 : 0.85;
    this.sharpen();
  }

  sharpen() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.renderer.setPixelRatio(this.isDraft ? Math.min(1, Math.sqrt(DRAFT_PIXELS / (width * height))) : Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
  }

  loop(now) {
    requestAnimationFrame((later) => this.loop(later));
    const elapsed = Math.min(0.3, (now - this.last) / 1000);
    this.last = now;
    this.controls.update();
    if (!this.model) return;
    if (this.film) this.stepFilm(elapsed);
    else if (this.lifted) this.stepLift(elapsed);
    else if (this.drop > 0) {
      const before = this.drop;
      this.drop = Math.max(0, before - Math.min(elapsed, 0.05) / DROP_SECONDS);
      this.holder.position.z += DROP * (this.drop ** 2 - (before === 1 ? 0 : before ** 2));
      this.redraw();
    } else if (this.spin && !this.isHeld && !CALM.matches && this.slow <= SLOW_FRAMES) {
      this.holder.quaternion.premultiply(new THREE.Quaternion().setFromAxisAngle(UP, this.spin * elapsed));
      this.redraw();
    }
    if (this.frames > 0) {
      this.slow = elapsed > SLOW_FRAME ? this.slow + 1 : this.slow > SLOW_FRAMES ? this.slow : 0;
      if (this.slow > SLOW_FRAMES) this.setDraft(true);
    } else if (this.isDraft && now - this.drawn > REST_MS) {
      this.setDraft(false);
      this.frames = 1;
    }
    if (this.frames > 0) {
      this.frames--;
      const pose = [...this.holder.position, ...this.holder.quaternion, this.mesh.geometry.id, this.isDraft].join();
      if (pose !== this.pose) {
        this.pose = pose;
        this.renderer.shadowMap.needsUpdate = !this.isDraft;
        this.contact.update(this.renderer, this.scene, this.holder);
      }
      this.renderer.render(this.scene, this.camera);
      this.drawn = now;
    }
  }

  /** Ray of a pointer event: {point on the model, triangle} or null, in the frame of the model. */
  pick(event) {
    const ray = this.ray(event), hit = ray.intersectObject(this.mesh)[0];
    return hit ? { point: this.mesh.worldToLocal(hit.point.clone()), triangle: hit.faceIndex } : null;
  }

  ray(event) {
    const box = this.canvas.getBoundingClientRect(), ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height), this.camera);
    return ray;
  }

  /** Point of the model's frame under a pointer, in the plane through `point` that faces the viewer. */
  pointUnder(event, point) {
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new THREE.Vector3()), this.mesh.localToWorld(new THREE.Vector3(...point)));
    const hit = this.ray(event).ray.intersectPlane(plane, new THREE.Vector3());
    return hit ? this.mesh.worldToLocal(hit) : null;
  }

  /** Place a dot, `center` or `handle`, at a point of the model; null hides it. */
  mark(name, point) {
    this[name].visible = point !== null;
    if (point !== null) this[name].position.set(...point).multiplyScalar(this.unit);
    this.redraw();
  }
}

/** Small turning pictures; one renderer paints them in turn. */
export class Thumbnails {
  constructor() {
    this.items = [];
    this.next = 0;
  }

  add(canvas, model, number) {
    if (!this.renderer) {
      this.renderer = makeRenderer(document.createElement('canvas'));
      this.renderer.setSize(320, 160, false);
      this.scene = new THREE.Scene();
      light(this.scene, false);
      reflections(this.renderer, this.scene);
      this.camera = new THREE.PerspectiveCamera(24, 2, 1, 1000);
      this.camera.up.copy(UP);
      this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), makeMaterial());
      this.scene.add(this.mesh);
      this.tick();
    }
    Object.assign(canvas, { width: 320, height: 160 });
    const down = new THREE.Vector3(...(model.rests[model.show]?.down ?? [0, 0, -1]));
    this.items.push({ pen: canvas.getContext('2d'), model, number, canvas, turn: new THREE.Quaternion().setFromUnitVectors(down, DOWN) });
    this.draw(this.items.at(-1), 0);
  }

  clear() { this.items = []; }

  /** Draw one picture, and wait longer than that took. */
  tick() {
    const began = performance.now();
    if (this.items.length && !CALM.matches && this.items[0].canvas.offsetParent) this.draw(this.items[this.next++ % this.items.length], began);
    setTimeout(() => this.tick(), Math.max(30, 5 * (performance.now() - began)));
  }

  draw({ pen, model, number, turn }, now) {
    this.mesh.geometry = model.geometry;
    this.mesh.quaternion.copy(turn).premultiply(new THREE.Quaternion().setFromAxisAngle(UP, 0.9 * number + 0.5 + now / 2600));
    const distance = (1.06 * model.radius) / Math.tan((12 * Math.PI) / 180);
    this.camera.position.set(0, -0.83 * distance, 0.52 * distance);
    this.camera.near = distance / 10;
    this.camera.far = 3 * distance;
    this.camera.updateProjectionMatrix();
    this.camera.lookAt(0, 0, 0);
    this.renderer.render(this.scene, this.camera);
    pen.clearRect(0, 0, 320, 160);
    pen.save();
    pen.translate(0, 142);
    pen.scale(1, 0.26);
    const shade = pen.createRadialGradient(160, 0, 4, 160, 0, 90);
    shade.addColorStop(0, 'rgb(30 24 14 / .34)');
    shade.addColorStop(1, 'rgb(30 24 14 / 0)');
    pen.fillStyle = shade;
    pen.fillRect(0, -110, 320, 220);
    pen.restore();
    pen.drawImage(this.renderer.domElement, 0, 0);
  }
}
