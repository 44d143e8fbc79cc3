// Drawing: a view for each robot, with shadows and a camera that follows its torso.

import * as THREE from "three";

const SPHERE = 2, CAPSULE = 3, ELLIPSOID = 4, CYLINDER = 5, BOX = 6; // of mjtGeom; the floor is drawn apart
const SKY = 0xe9eef3, LIGHT_TILE = "#f7f8fa", DARK_TILE = "#dde3ea";
const TILE = 1; // [m]
const FLOOR = 60; // [m] shown around the robot
const NEAREST = 1.5, FARTHEST = 20; // [m] of the camera
const SHADOWS = 1024; // [pixels]
const LAG = 100; // [ms] of the camera behind the torso

const SHAPES = {
  [SPHERE]: ([r]) => new THREE.SphereGeometry(r, 24, 16),
  [CAPSULE]: ([r, half]) => new THREE.CapsuleGeometry(r, 2 * half, 8, 20).rotateX(Math.PI / 2),
  [ELLIPSOID]: (size) => new THREE.SphereGeometry(1, 24, 16).scale(...size),
  [CYLINDER]: ([r, half]) => new THREE.CylinderGeometry(r, r, 2 * half, 24).rotateX(Math.PI / 2),
  [BOX]: (size) => new THREE.BoxGeometry(...size.map((own) => 2 * own)),
};

export class Stage {
  // Draws on a canvas by its WebGL context, with a label for each slot's view.
  constructor(canvas, context, labels) {
    Object.assign(this, { canvas, labels });
    this.renderer = new THREE.WebGLRenderer({ canvas, context });
    this.renderer.shadowMap.enabled = true;
    this.renderer.setScissorTest(true);
    this.views = [];
    this.camera = new THREE.PerspectiveCamera(45, 1, 0.1, 200);
    this.camera.up.set(0, 0, 1);
    this.orbit = { azimuth: 2.2, elevation: 0.2, distance: 6 };
    this.changed = true; // whether the picture differs from the one drawn last
  }

  // Show a robot in a slot, of some parts and colour, or with null none.
  place(slot, geoms, colour) {
    this.views[slot]?.dispose();
    this.views[slot] = geoms && new View(geoms, colour);
    this.changed = true;
  }

  // Move a slot's robot to a share of the way between two poses.
  move(slot, previous, current, share) {
    this.views[slot]?.move(previous, current, share);
    this.changed = true;
  }

  // Show or hide what pulls a slot's torso.
  pull(slot, target) {
    this.views[slot]?.pull(target);
    this.changed = true;
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = Math.min(devicePixelRatio, 2);
    if (this.width !== width || this.height !== height || this.ratio !== ratio) {
      Object.assign(this, { width, height, ratio });
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
      this.changed = true;
    }
    if (!this.changed) return;
    this.changed = false;
    const areas = this.areas();
    this.labels.forEach((label, slot) => {
      const area = areas.find((own) => own.slot === slot);
      label.hidden = !area;
      if (area) Object.assign(label.style, { left: `${area.x}px`, top: `${area.y}px` });
    });
    for (const { view, x, y, w, h } of areas) {
      this.renderer.setViewport(x, height - y - h, w, h);
      this.renderer.setScissor(x, height - y - h, w, h);
      this.look(view, w / h);
      this.renderer.render(view.scene, this.camera);
    }
  }

  // Return each view's part of the canvas: side by side, or on narrow screens one above the other.
  areas() {
    const shown = this.views.map((view, slot) => ({ view, slot })).filter(({ view }) => view);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const isWide = width > height;
    return shown.map(({ view, slot }, i) => {
      const share = shown.length;
      return isWide
        ? { view, slot, x: (i * width) / share, y: 0, w: width / share, h: height }
        : { view, slot, x: 0, y: (i * height) / share, w: width, h: height / share };
    });
  }

  look(view, aspect) {
    const { azimuth, elevation, distance } = this.orbit, { camera } = this;
    const centre = view.centre;
    camera.position.set(
      centre.x - distance * Math.cos(elevation) * Math.cos(azimuth),
      centre.y - distance * Math.cos(elevation) * Math.sin(azimuth),
      Math.max(0.1, centre.z + distance * Math.sin(elevation)));
    camera.aspect = aspect;
    camera.lookAt(centre);
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
  }

  turn(across, up) {
    this.changed = true;
    this.orbit.azimuth -= across;
    this.orbit.elevation = Math.min(1.5, Math.max(-0.1, this.orbit.elevation + up));
  }

  zoom(factor) {
    this.changed = true;
    this.orbit.distance = Math.min(FARTHEST, Math.max(NEAREST, this.orbit.distance * factor));
  }

  // Return the slot whose robot is at a place of the canvas [pixels], with the ray there; no slot if none is.
  hit(px, py) {
    const area = this.areas().find(({ x, y, w, h }) => px >= x && px < x + w && py >= y && py < y + h);
    if (!area) return null;
    const ray = this.ray(area, px, py);
    const found = ray.intersectObjects(area.view.parts, false).length > 0;
    return { slot: found ? area.slot : null, area };
  }

  ray(area, px, py) {
    this.look(area.view, area.w / area.h);
    const at = new THREE.Vector2((2 * (px - area.x)) / area.w - 1, 1 - (2 * (py - area.y)) / area.h);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(at, this.camera);
    return ray;
  }

  // Return the point under a place of the canvas, as far away as the torso, as [x, y, z] [m].
  point(area, px, py) {
    const { ray } = this.ray(area, px, py);
    const facing = this.camera.getWorldDirection(new THREE.Vector3());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(facing, area.view.torso);
    return (ray.intersectPlane(plane, new THREE.Vector3()) ?? area.view.torso).toArray();
  }
}

class View {
  constructor(geoms, colour) {
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(SKY);
    this.scene.fog = new THREE.Fog(SKY, 12, FLOOR / 2);
    this.torso = new THREE.Vector3();
    this.centre = new THREE.Vector3(0, 0, 1); // what the camera looks at, which follows the torso
    this.moved = -Infinity; // [ms] when it last did
    this.sun = sun();
    this.floor = floor();
    this.line = new THREE.Line(
      new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0xc2185b, depthTest: false }));
    this.line.visible = this.line.frustumCulled = false;
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb0b8c0, 1.6), this.sun, this.sun.target, this.floor, this.line);
    this.meshes = geoms.map((geom) => (geom.world || !SHAPES[geom.type] ? null : part(geom, colour)));
    this.parts = this.meshes.filter((mesh) => mesh);
    this.scene.add(...this.parts);
  }

  move(previous, current, share) {
    const turns = [new THREE.Quaternion(), new THREE.Quaternion()];
    this.meshes.forEach((mesh, i) => {
      if (!mesh) return;
      [previous, current].forEach((pose, which) => turns[which].setFromRotationMatrix(rotation(pose.turns, i)));
      mesh.quaternion.slerpQuaternions(...turns, share);
      mesh.position.fromArray(previous.places, 3 * i).lerp(new THREE.Vector3().fromArray(current.places, 3 * i), share);
    });
    this.torso.fromArray(previous.torso).lerp(new THREE.Vector3(...current.torso), share);
    const { x, y, z } = this.torso;
    const now = performance.now(), behind = Math.exp((this.moved - now) / LAG);
    this.moved = now;
    this.centre.lerp(new THREE.Vector3(x, y, 0.4 + 0.75 * z), 1 - behind);
    this.floor.position.set(TILE * 2 * Math.round(x / TILE / 2), TILE * 2 * Math.round(y / TILE / 2), 0);
    this.sun.position.set(x - 3, y - 2, 10);
    this.sun.target.position.set(x, y, 0);
    if (this.line.visible) this.pull(this.target);
  }

  pull(target) {
    this.target = target;
    this.line.visible = Boolean(target);
    if (target) this.line.geometry.setFromPoints([this.torso, new THREE.Vector3(...target)]);
  }

  dispose() {
    this.scene.traverse((own) => {
      own.geometry?.dispose();
      own.material?.dispose();
    });
    this.floor.material.map.dispose();
    this.sun.dispose();
  }
}

function part({ type, size, colour: [r, g, b, a] }, tint) {
  const material = new THREE.MeshStandardMaterial({ color: new THREE.Color(r, g, b), roughness: 0.6 });
  if (type === SPHERE) material.color.set(tint); // the torso shows whose robot it is
  Object.assign(material, { transparent: a < 1, opacity: a });
  const mesh = new THREE.Mesh(SHAPES[type](size), material);
  mesh.castShadow = mesh.receiveShadow = true;
  return mesh;
}

function sun() {
  const light = new THREE.DirectionalLight(0xffffff, 2);
  light.castShadow = true;
  light.shadow.mapSize.set(SHADOWS, SHADOWS);
  Object.assign(light.shadow.camera, { left: -5, right: 5, top: 5, bottom: -5, near: 1, far: 20 });
  return light;
}

function floor() {
  const tiles = document.createElement("canvas");
  tiles.width = tiles.height = 64;
  const context = tiles.getContext("2d");
  context.fillStyle = LIGHT_TILE;
  context.fillRect(0, 0, 64, 64);
  context.fillStyle = DARK_TILE;
  context.fillRect(0, 0, 32, 32);
  context.fillRect(32, 32, 32, 32);
  const texture = new THREE.CanvasTexture(tiles);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.repeat.set(FLOOR / TILE / 2, FLOOR / TILE / 2);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.anisotropy = 8;
  const material = new THREE.MeshStandardMaterial({ map: texture, roughness: 1 });
  const mesh = new THREE.Mesh(new THREE.PlaneGeometry(FLOOR, FLOOR), material);
  mesh.receiveShadow = true;
  return mesh;
}

function rotation(turns, i) {
  const m = turns.slice(9 * i, 9 * i + 9);
  return new THREE.Matrix4().set(m[0], m[1], m[2], 0, m[3], m[4], m[5], 0, m[6], m[7], m[8], 0, 0, 0, 0, 1);
}
