// Link the 3D view of a die, the table of its facets and its Gauss map: the facet under the pointer
// in one is shown in all. Without WebGL the table and the map are linked, beside a picture of the die.
"use strict";
(() => {
  const BLANK = [0.686, 0.651, 0.578]; // #d8d3c8 in linear light
  const FADED = 0.85; // share of it in the color of what is not shown
  const TURN_MS = 350;
  const KEY_TURN = 0.15; // radians
  const FIELD = 30; // degrees

  const linked = document.querySelectorAll("[data-facet]");
  const rows = new Map();
  const view = document.getElementById("view");
  let shown = null;
  let die = null;

  for (const part of linked) {
    const facet = part.dataset.facet;
    if (part.tagName === "TR") {
      rows.set(facet, part);
      part.addEventListener("focus", () => show(facet, true));
      part.addEventListener("blur", () => show(null));
    }
    part.addEventListener("pointerenter", () => show(facet, true));
    part.addEventListener("pointerleave", leave);
  }

  // A finger leaves an element as soon as it has tapped it.
  function leave(event) {
    if (event.pointerType !== "touch") show(null);
  }

  function show(facet, turns = false) {
    if (facet === shown) return;
    shown = facet;
    for (const part of linked) part.classList.toggle("shown", part.dataset.facet === facet);
    if (die) die.show(facet, turns);
  }

  function scrollTo(row) {
    const box = row.closest(".facets");
    const head = row.closest("table").tHead.offsetHeight;
    const top = row.offsetTop - head;
    if (top < box.scrollTop) box.scrollTop = top;
    const bottom = row.offsetTop + row.offsetHeight - box.clientHeight;
    if (bottom > box.scrollTop) box.scrollTop = bottom;
  }

  function unpacked(id) {
    const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
    const whole = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(whole);
  }

  // Vectors in the page are in the frame of the body, in mm; a GLB is in meters, and y is upward.
  function vector(text) {
    const [x, y, z] = text.split(" ").map(Number);
    return new THREE.Vector3(x, z, -y);
  }

  async function start() {
    const canvas = view.querySelector("canvas");
    const context = canvas.getContext("webgl2", { alpha: true, antialias: true });
    if (!context || typeof DecompressionStream === "undefined") return;
    const library = document.createElement("script");
    library.textContent = await unpacked("three").text();
    document.head.append(library);
    const data = await unpacked("solid").arrayBuffer();
    const file = await new Promise((done, failed) => new THREE.GLTFLoader().parse(data, "", done, failed));
    die = new Die(canvas, context, file.scene);
    view.classList.add("live");
  }

  class Die {
    constructor(canvas, context, solid) {
      this.canvas = canvas;
      this.renderer = new THREE.WebGLRenderer({ canvas, context, antialias: true, alpha: true });
      if (!("outputColorSpace" in this.renderer)) this.renderer.outputEncoding = THREE.sRGBEncoding;
      this.renderer.setClearColor(0, 0);
      this.scene = new THREE.Scene();
      this.camera = new THREE.PerspectiveCamera(FIELD, 1);
      const light = new THREE.DirectionalLight(0xffffff, 0.65);
      light.position.set(-0.5, 0.8, 1);
      this.scene.add(light, new THREE.AmbientLight(0xffffff, 0.55));
      const stands = "stands" in view.dataset;
      this.body = new THREE.Group();
      this.body.add(solid);
      this.scene.add(this.body);
      solid.position.copy(vector(view.dataset.center)).multiplyScalar(-0.001);
      this.meshes = [];
      for (const node of [...solid.children]) {
        const named = node.name.match(/^(?:facet|labels)-(\d+)/);
        node.traverse((mesh) => {
          if (!mesh.isMesh) return;
          mesh.material = mesh.material.clone();
          mesh.userData.facet = named ? named[1] : null;
          const color = mesh.material.color.clone();
          const faded = new THREE.Color().setRGB(...BLANK).lerp(color, 1 - FADED);
          this.meshes.push({ mesh, color, faded });
        });
      }
      this.radius = this.reach(solid.position);
      this.camera.near = 0.05 * this.radius;
      this.camera.far = 100 * this.radius;
      this.nearness = 1;
      if (stands) this.addTable();
      this.body.quaternion.copy(this.reading(rows.get(view.dataset.start)));
      this.caster = new THREE.Raycaster();
      this.listen();
      new ResizeObserver(() => this.resize()).observe(canvas);
      this.resize();
    }

    // Largest distance of a vertex from the center of mass, about which the die turns.
    reach(shift) {
      let far = 0;
      const corner = new THREE.Vector3();
      for (const { mesh } of this.meshes) {
        const places = mesh.geometry.attributes.position;
        for (let k = 0; k < places.count; k++) {
          far = Math.max(far, corner.fromBufferAttribute(places, k).add(shift).length());
        }
      }
      return far;
    }

    addTable() {
      const look = { color: 0x9fb3c8, transparent: true, opacity: 0.5, side: THREE.DoubleSide };
      const disc = new THREE.CircleGeometry(0.9 * this.radius, 64);
      this.table = new THREE.Mesh(disc, new THREE.MeshBasicMaterial(look));
      this.table.visible = false;
      this.body.add(this.table);
    }

    show(facet, turns) {
      for (const { mesh, color, faded } of this.meshes) {
        mesh.material.color.copy(facet === null || mesh.userData.facet === facet ? color : faded);
      }
      const row = rows.get(facet);
      this.describe(row);
      if (this.table) this.table.visible = Boolean(row);
      if (row) {
        const down = vector(row.dataset.down).normalize();
        if (this.table) {
          this.table.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), down);
          this.table.position.copy(down).multiplyScalar(0.001 * Number(row.dataset.height));
        }
        if (turns) this.turnTo(this.reading(row));
        else scrollTo(row);
      }
      view.dataset.shown = row ? facet : "";
      this.draw();
    }

    describe(row) {
      const heads = row ? [...row.closest("table").tHead.rows[0].cells] : [];
      const texts = heads.map((head, k) => `${head.textContent} ${row.cells[k].textContent}`);
      view.querySelector("output").textContent = texts.slice(0, 3).join(", ");
    }

    // Orientation in which the outcome of a row is read, as in the picture.
    reading(row) {
      const [side, level] = [vector(row.dataset.side), vector(row.dataset.level)];
      const frame = new THREE.Matrix4().makeBasis(side.clone().cross(level), side, level);
      const above = (Math.PI / 180) * Number(view.dataset.above);
      const lift = new THREE.Quaternion().setFromEuler(new THREE.Euler(above, 0, 0));
      return lift.multiply(new THREE.Quaternion().setFromRotationMatrix(frame).conjugate());
    }

    turnTo(goal) {
      const begun = performance.now();
      const from = this.body.quaternion.clone();
      const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
      const step = (now) => {
        if (this.turning !== step) return;
        const part = still ? 1 : Math.max(0, Math.min(1, (now - begun) / TURN_MS));
        this.body.quaternion.copy(from).slerp(goal, part * part * (3 - 2 * part));
        this.draw();
        if (part < 1) requestAnimationFrame(step);
        else this.turning = null;
      };
      this.turning = step;
      requestAnimationFrame(step);
    }

    turnBy(right, down) {
      this.turning = null;
      const turn = new THREE.Quaternion().setFromEuler(new THREE.Euler(down, right, 0));
      this.body.quaternion.premultiply(turn).normalize();
      this.draw();
    }

    approach(factor) {
      this.nearness = Math.max(0.5, Math.min(8, this.nearness * factor));
      this.resize();
    }

    facetAt(event) {
      const box = this.canvas.getBoundingClientRect();
      const x = (2 * (event.clientX - box.left)) / box.width - 1;
      const y = 1 - (2 * (event.clientY - box.top)) / box.height;
      this.caster.setFromCamera({ x, y }, this.camera);
      const [hit] = this.caster.intersectObjects(this.meshes.map(({ mesh }) => mesh), false);
      return hit ? hit.object.userData.facet : null;
    }

    listen() {
      const canvas = this.canvas;
      let from = null;
      canvas.addEventListener("pointerdown", (event) => {
        from = event;
        canvas.setPointerCapture(event.pointerId);
        show(this.facetAt(event));
      });
      canvas.addEventListener("pointermove", (event) => {
        if (!from) return show(this.facetAt(event));
        const scale = 4 / canvas.clientHeight;
        this.turnBy((event.clientX - from.clientX) * scale, (event.clientY - from.clientY) * scale);
        from = event;
      });
      for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => (from = null));
      canvas.addEventListener("pointerleave", leave);
      canvas.addEventListener("wheel", (event) => {
        // Until the view has been clicked, the wheel scrolls the page.
        if (document.activeElement !== canvas) return;
        event.preventDefault();
        this.approach(Math.exp(-0.001 * event.deltaY));
      }, { passive: false });
      const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
      canvas.addEventListener("keydown", (event) => {
        const [right, down] = turns[event.key] || [0, 0];
        if (right || down) this.turnBy(right * KEY_TURN, down * KEY_TURN);
        else if (event.key === "+" || event.key === "=") this.approach(1.2);
        else if (event.key === "-") this.approach(1 / 1.2);
        else return;
        event.preventDefault();
      });
      canvas.addEventListener("webglcontextlost", () => {
        view.classList.remove("live");
        die = null;
      });
    }

    resize() {
      const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
      if (!width || !height) return;
      const half = Math.sin((Math.PI * FIELD) / 360) * Math.min(1, width / height);
      this.camera.position.z = (1.03 * this.radius) / half / this.nearness;
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
      this.renderer.setSize(width, height, false);
      this.draw();
    }

    draw() {
      this.renderer.render(this.scene, this.camera);
    }
  }

  if (view.querySelector("canvas")) start();
})();
