// The turning 3-D view: floor grid, trajectory, stick or cylinder figure, uncertainty ellipsoids.
// The object that it draws is described in motion_data.py.
import * as THREE from 'three';
import { OrbitControls } from 'three/OrbitControls.js';
import { FlatRenderer } from 'gait/flat.js';

const DEGREE = Math.PI / 180;
const SPHERE = new THREE.SphereGeometry(1, 16, 12);
const CYLINDER = new THREE.CylinderGeometry(1, 1, 1, 14, 1);
const NINETY = 2.5003; // radius of the ellipsoid that holds 90 % of a Gaussian in three dimensions, sd
const UP = new THREE.Vector3(0, 1, 0); // axis of CYLINDER

/** Colour of a custom property of style.css. */
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/** Whether there is no graphics card: the processor draws, and each picture costs it tens of milliseconds. */
export const SOFTWARE = (() => {
  const gl = document.createElement('canvas').getContext('webgl2', { failIfMajorPerformanceCaveat: true });
  const named = gl?.getExtension('WEBGL_debug_renderer_info');
  return !gl || /SwiftShader|llvmpipe|Basic Render/i.test(named ? gl.getParameter(named.UNMASKED_RENDERER_WEBGL) : '');
})();

function makeRenderer(flat) {
  try {
    return flat ? new FlatRenderer() : new THREE.WebGLRenderer({ antialias: !SOFTWARE });
  } catch { // no WebGL
    return new FlatRenderer();
  }
}

export class Scene {
  /**
   * @param {HTMLElement} element  filled by the view
   * @param {object} data          see motion_data.py
   * @param {boolean} flat         whether to draw without WebGL
   */
  constructor(element, data, flat = false) {
    this.element = element;
    element.classList.add('scene');
    this.shown = { cylinders: true, ellipsoids: true, trajectory: true };
    this.index = 0;
    this.renderer = makeRenderer(flat);
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', 'The figure in space. Drag to turn it, use the wheel to zoom and the right button to move it.');
    element.append(canvas);
    this.scene = new THREE.Scene();
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x777777, 2.4));
    const sun = new THREE.DirectionalLight(0xffffff, 1.2);
    sun.position.set(3, -4, 8);
    this.scene.add(sun);
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.05, 500);
    this.camera.up.set(0, 0, 1); // before the controls, which take it over
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = 89 * DEGREE;
    this.controls.addEventListener('change', () => this.#draw());
    this.figure = new THREE.Group();
    this.ground = new THREE.Group();
    this.scene.add(this.figure, this.ground);
    this.#buttons();
    this.sized = new ResizeObserver(() => this.#resize());
    this.sized.observe(element);
    this.dark = matchMedia('(prefers-color-scheme: dark)');
    this.dark.addEventListener('change', (this.recolour = () => {
      this.#build();
      this.setData(this.data);
    }));
    this.setData(data);
    this.lookFrom(30);
  }

  /** Draw another motion, keeping the view and, if it exists, the frame. */
  setData(data) {
    const same = this.limbs && [data.bones, data.joints].join() === [this.data.bones, this.data.joints].join();
    this.data = data;
    if (!same) this.#build();
    this.#floor();
    this.show(Math.min(this.index, data.times.length - 1));
  }

  /** Make the figure, in the colours of the page. */
  #build() {
    const { data } = this;
    this.#clear(this.figure);
    this.cells = null; // the floor's colours, too
    this.scene.background = new THREE.Color(colour('panel'));
    const solid = (side) => new THREE.MeshLambertMaterial({ color: colour(side) });
    this.makeLimbs = () => ({
      parts: data.bone_sides.map((side) => this.#add(CYLINDER, solid(side))),
      balls: data.sides.map((side) => this.#add(SPHERE, solid(side))),
    });
    this.limbs = this.makeLimbs();
    this.others = [];
    const glass = (side) => new THREE.MeshLambertMaterial({
      color: colour(side), transparent: true, opacity: 0.22, depthWrite: false });
    this.clouds = data.sides.map((side) => this.#add(SPHERE, glass(side)));
  }

  /** Append frames: an object with the keys by frame alone. */
  append(more) {
    for (const key of ['times', 'points', 'sd', 'uv', 'status']) if (more[key]) (this.data[key] ||= []).push(...more[key]);
    this.#floor();
  }

  /** Draw a frame, by its index. */
  show(index) {
    this.index = Math.max(0, index);
    const { points, sd } = this.data;
    const body = points[this.index];
    this.figure.visible = Boolean(body);
    if (body) {
      const at = this.#pose(this.limbs, body, this.shown.cylinders), spread = sd?.[this.index];
      this.clouds.forEach((cloud, j) => {
        cloud.visible = Boolean(this.shown.ellipsoids && spread);
        cloud.position.copy(at[j]);
        if (spread) cloud.scale.set(...spread[j].map((s) => Math.min(Math.max(NINETY * s, 1e-3), 5)));
      });
      this.#follow(at);
    }
    this.#draw();
  }

  /** Draw further people as stick figures: joints of each, as in `points`. */
  showOthers(bodies) {
    while (this.others.length < bodies.length) this.others.push(this.makeLimbs());
    this.others.forEach((limbs, k) => {
      for (const mesh of [...limbs.parts, ...limbs.balls]) mesh.visible = k < bodies.length;
      if (k < bodies.length) this.#pose(limbs, bodies[k], false);
    });
    this.#draw();
  }

  /** Put the limbs of a figure where its joints are; return these as vectors. */
  #pose(limbs, body, thick) {
    const { bones, radii, joints } = this.data, at = body.map((p) => new THREE.Vector3(...p));
    bones.forEach(([a, b], k) => {
      const part = limbs.parts[k], along = at[b].clone().sub(at[a]);
      const radius = thick ? radii?.[k] ?? 0.04 : 0.012;
      part.position.copy(at[a]).addScaledVector(along, 0.5);
      part.scale.set(radius, Math.max(along.length(), 1e-6), radius);
      part.quaternion.setFromUnitVectors(UP, along.normalize());
    });
    limbs.balls.forEach((ball, j) => {
      ball.position.copy(at[j]);
      ball.scale.setScalar(thick ? (joints[j] === 'head' ? 0.1 : 0.04) : 0.022);
    });
    return at;
  }

  /** Look at the figure from so many degrees above the floor, and about z from the camera (0) or the side (90). */
  lookFrom(elevation, azimuth = 30) {
    const middle = this.#middle(), camera = this.data.camera;
    const seen = camera ? Math.atan2(camera[1] - middle.y, camera[0] - middle.x) : -Math.PI / 2;
    const about = seen + azimuth * DEGREE, up = Math.min(elevation, 89) * DEGREE, far = 4.3;
    this.controls.target.copy(middle);
    this.camera.position.set(
      middle.x + far * Math.cos(about) * Math.cos(up), middle.y + far * Math.sin(about) * Math.cos(up),
      middle.z + far * Math.sin(up));
    this.controls.update();
    this.#draw();
  }

  /** Switch ``cylinders``, ``ellipsoids`` or ``trajectory``. */
  set(name, on) {
    this.shown[name] = on;
    if (this.way) this.way.visible = this.shown.trajectory;
    this.show(this.index);
  }

  dispose() {
    this.sized.disconnect();
    this.dark.removeEventListener('change', this.recolour);
    this.controls.dispose();
    this.renderer.dispose();
  }

  #middle() {
    const body = this.data.points[this.index] ?? this.data.points.find(Boolean);
    if (!body) return new THREE.Vector3(0, 0, 0.9);
    return body.reduce((sum, p) => sum.add(new THREE.Vector3(...p)), new THREE.Vector3()).divideScalar(body.length);
  }

  /** Move the view with the person, so that they stay in it. */
  #follow(at) {
    const middle = at.reduce((sum, p) => sum.add(p), new THREE.Vector3()).divideScalar(at.length);
    middle.z = this.controls.target.z;
    const moved = middle.sub(this.controls.target);
    this.controls.target.add(moved);
    this.camera.position.add(moved);
  }

  /** Grid of the floor, a metre a cell, and the way over it. */
  #floor() {
    const seen = this.data.points.filter(Boolean), root = Math.max(0, this.data.joints.indexOf('pelvis'));
    const xs = seen.map((p) => p[root][0]), ys = seen.map((p) => p[root][1]);
    const [left, right] = xs.length ? [Math.min(...xs), Math.max(...xs)] : [0, 0];
    const [near, far] = ys.length ? [Math.min(...ys), Math.max(...ys)] : [0, 0];
    const cells = Math.min(200, Math.ceil(Math.max(right - left, far - near)) + 4);
    if (this.cells !== cells) { // only then: new materials are compiled again
      this.cells = cells;
      this.#clear(this.ground);
      this.grid = new THREE.GridHelper(cells, cells, colour('line'), colour('grid'));
      this.grid.rotation.x = Math.PI / 2;
      this.way = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: colour('good') }));
      this.way.visible = this.shown.trajectory;
      this.ground.add(this.grid, this.way);
    }
    this.grid.position.set(Math.round((left + right) / 2), Math.round((near + far) / 2), 0);
    this.way.geometry.dispose();
    this.way.geometry = new THREE.BufferGeometry().setFromPoints(seen.map((p) => new THREE.Vector3(p[root][0], p[root][1], 0.005)));
  }

  #add(geometry, material) {
    const mesh = new THREE.Mesh(geometry, material);
    this.figure.add(mesh);
    return mesh;
  }

  #clear(group) {
    for (const child of [...group.children]) {
      if (![SPHERE, CYLINDER].includes(child.geometry)) child.geometry.dispose();
      child.material.dispose();
      group.remove(child);
    }
  }

  #buttons() {
    const bar = document.createElement('div');
    bar.className = 'views';
    const add = (text, title, press) => {
      const button = Object.assign(document.createElement('button'), { type: 'button', textContent: text, title });
      button.addEventListener('click', () => press(button));
      bar.append(button);
      return button;
    };
    add('30°', 'View from 30 degrees above the floor', () => this.lookFrom(30));
    add('Side', 'View from the camera’s side', () => this.lookFrom(5, 90));
    add('Camera', 'View from the camera', () => this.lookFrom(8, 0));
    add('Top', 'View from above', () => this.lookFrom(88, 0));
    for (const [name, text] of [['cylinders', 'Body'], ['ellipsoids', 'Uncertainty'], ['trajectory', 'Way']]) {
      const button = add(text, `Show or hide: ${text.toLowerCase()}`, () => {
        this.set(name, !this.shown[name]);
        button.setAttribute('aria-pressed', this.shown[name]);
      });
      button.setAttribute('aria-pressed', this.shown[name]);
    }
    this.element.append(bar);
  }

  #resize() {
    const { clientWidth: wide, clientHeight: high } = this.element;
    if (!wide || !high) return;
    this.renderer.setPixelRatio(SOFTWARE ? 1 : Math.min(devicePixelRatio, 2));
    this.renderer.setSize(wide, high, false);
    this.camera.aspect = wide / high;
    this.camera.updateProjectionMatrix();
    this.#draw();
  }

  /** Draw at the next refresh of the screen, once however often it is asked. */
  #draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.renderer.render(this.scene, this.camera);
    });
  }
}
