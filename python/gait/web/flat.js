// Draws the figure, floor and way of scene.js on a 2-D canvas, without shading: for browsers without a graphics
// card, where WebGL costs several times as much, and without WebGL.
import * as THREE from 'three';

const NEAR = 0.05; // metres before the camera, from where on things are drawn

/** The part of THREE.WebGLRenderer's interface that scene.js uses. */
export class FlatRenderer {
  constructor() {
    this.domElement = document.createElement('canvas');
    this.context = this.domElement.getContext('2d');
    this.ratio = 1;
  }

  setPixelRatio(ratio) {
    this.ratio = ratio;
  }

  setSize(wide, high) {
    Object.assign(this.domElement, { width: wide * this.ratio, height: high * this.ratio });
  }

  dispose() {}

  render(scene, camera) {
    const { width, height } = this.domElement, { context } = this, solids = [];
    this.focal = height / 2 / Math.tan(camera.fov * Math.PI / 360); // pixels
    this.middle = [width / 2, height / 2];
    scene.updateMatrixWorld();
    camera.updateMatrixWorld();
    context.fillStyle = scene.background.getStyle();
    context.fillRect(0, 0, width, height);
    context.lineCap = 'round';
    scene.traverseVisible((object) => {
      if (!object.isLine && !object.isMesh) return;
      const matrix = camera.matrixWorldInverse.clone().multiply(object.matrixWorld);
      if (object.isLine) this.#line(object, matrix);
      else solids.push({ object, matrix, depth: -matrix.elements[14] });
    });
    for (const solid of solids.sort((a, b) => b.depth - a.depth)) {
      if (solid.depth > NEAR) this.#solid(solid);
    }
    context.globalAlpha = 1;
  }

  /** Pixel of a point in the camera's coordinates. */
  #pixel({ x, y, z }) {
    return [this.middle[0] - this.focal * x / z, this.middle[1] + this.focal * y / z];
  }

  /** THREE.Line or THREE.LineSegments, without what is behind the camera. */
  #line({ geometry, material, isLineSegments }, matrix) {
    const { context } = this, { position, color } = geometry.attributes;
    const points = Array.from({ length: position?.count ?? 0 }, (_, k) => new THREE.Vector3().fromBufferAttribute(position, k).applyMatrix4(matrix));
    const ink = color ? new THREE.Color().fromBufferAttribute(color, color.count - 1) : material.color;
    context.strokeStyle = ink.getStyle();
    context.lineWidth = this.ratio;
    context.beginPath();
    for (let k = 1; k < points.length; k += isLineSegments ? 2 : 1) {
      const ends = [points[k - 1], points[k]].sort((a, b) => a.z - b.z);
      if (ends[0].z > -NEAR) continue;
      if (ends[1].z > -NEAR) ends[1] = ends[0].clone().lerp(ends[1], (-NEAR - ends[0].z) / (ends[1].z - ends[0].z));
      context.moveTo(...this.#pixel(ends[0]));
      context.lineTo(...this.#pixel(ends[1]));
    }
    context.stroke();
  }

  /** A scaled cylinder of radius 1 along y, or a scaled sphere. */
  #solid({ object: { geometry, material }, matrix, depth }) {
    const { context } = this, size = new THREE.Vector3().setFromMatrixScale(matrix), scale = this.focal / depth;
    context.globalAlpha = material.opacity;
    context.fillStyle = context.strokeStyle = material.color.getStyle();
    context.beginPath();
    if (geometry.type === 'CylinderGeometry') {
      const ends = [-0.5, 0.5].map((y) => new THREE.Vector3(0, y, 0).applyMatrix4(matrix));
      if (ends.some(({ z }) => z > -NEAR)) return;
      context.moveTo(...this.#pixel(ends[0]));
      context.lineTo(...this.#pixel(ends[1]));
      context.lineWidth = 2 * size.x * scale;
      context.stroke();
      return;
    }
    // Its outline is the image of the unit circle under a root of the 2 x 2 matrix A A', A the first rows of `matrix`.
    const [a, b, , , c, d, , , e, f] = matrix.elements;
    const [xx, xy, yy] = [a * a + c * c + e * e, a * b + c * d + e * f, b * b + d * d + f * f];
    const root = Math.sqrt(xx), below = xy / root;
    context.save();
    context.translate(...this.#pixel({ x: matrix.elements[12], y: matrix.elements[13], z: -depth }));
    context.transform(scale * root, -scale * below, 0, scale * Math.sqrt(Math.max(yy - below * below, 0)), 0, 0);
    context.arc(0, 0, 1, 0, 2 * Math.PI);
    context.restore();
    context.fill();
  }
}
