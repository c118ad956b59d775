// @ts-check
// The view whose viewpoint is moved: the trainer's own meshes on a flat sea. World: x east, y north, z up, metres.

import * as THREE from "three";
import { OrbitControls } from "three/OrbitControls";
import { colour } from "bowwave/plane";
import { Run, decoded } from "./run.js";

/** Seconds that a splash and a strike stay. */
const SPLASH = 2;
/** Tracers that are closer to the viewpoint are not drawn, metres. */
const TRACER_NEAR = 8;
/** Rounds in the air or splashing that are drawn at a time. */
const ROUNDS_MOST = 64;

export class View {
  /** @param {HTMLCanvasElement} canvas @param {HTMLElement} says @param {Run} run */
  constructor(canvas, says, run) {
    this.canvas = canvas;
    this.says = says;
    this.run = run;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(50, 1, 0.5, 40000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = 0.499 * Math.PI;
    canvas.addEventListener("keydown", (event) => this.key(event));
    this.controls.addEventListener("start", () => {
      if (this.mode === "gun") this.setMode("free", null);
      else if (this.mode === "above") this.changed((this.mode = "free"));
    });
    this.controls.addEventListener("change", () => this.render());
    /** @type {"gun" | "above" | "free" | "boat"} */
    this.mode = "gun";
    /** @type {number | null} */
    this.followed = null;
    /** @type {(mode: string) => void} */
    this.changed = () => {};
    this.time_s = 0;
    this.furnish();
    this.boats = run.boats.map((_, i) => this.addBoat(i));
    this.flights = this.addFlights();
  }

  /** Light, sea, rings and the own gun. */
  furnish() {
    const sky = new THREE.HemisphereLight(0xffffff, 0x6688a0, 2);
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(-300, -500, 800);
    this.sea = new THREE.Mesh(new THREE.CircleGeometry(30000, 96), new THREE.MeshBasicMaterial({ color: 0x4f7690 }));
    this.scene.add(sky, sun, this.sea);
    this.rings = new THREE.Group();
    for (let ring = 1; ring <= 20; ring++) {
      const radius = ring * 100;
      const places = Array.from({ length: 180 }, (_, i) => new THREE.Vector3(radius * Math.cos((i * Math.PI) / 90), radius * Math.sin((i * Math.PI) / 90), 0));
      const line = new THREE.BufferGeometry().setFromPoints(places);
      this.rings.add(new THREE.LineLoop(line, new THREE.LineBasicMaterial({ color: 0x9db8c8, transparent: true, opacity: 0.6 })));
    }
    this.rings.position.z = 0.02;
    this.scene.add(this.rings);
    const gun = new THREE.Group();
    const post = new THREE.Mesh(new THREE.CylinderGeometry(0.12, 0.2, 1, 12), new THREE.MeshLambertMaterial({ color: 0x555a5e }));
    post.rotation.x = Math.PI / 2;
    const height = Math.max(this.run.eye_height_m - 0.4, 0.5);
    post.scale.y = height;
    post.position.z = height / 2;
    gun.add(post);
    this.barrel = new THREE.Mesh(new THREE.CylinderGeometry(0.03, 0.05, 1.4, 10), new THREE.MeshLambertMaterial({ color: 0x2c2f31 }));
    gun.add(this.barrel);
    this.gun = gun;
    this.scene.add(gun);
  }

  /** @param {number} i @returns {THREE.Group} */
  addBoat(i) {
    const boat = this.run.boats[i];
    const group = new THREE.Group();
    const coded = this.run.meshes[boat.model];
    const geometry = coded ? meshOf(coded) : boxOf(boat);
    const material = new THREE.MeshLambertMaterial({ vertexColors: Boolean(coded), color: coded ? 0xffffff : 0x9a9a9a, flatShading: true, side: THREE.DoubleSide });
    group.add(new THREE.Mesh(geometry, material));
    // A staff over the boat says whose it is, from as far as a boat is a speck.
    const tone = boat.side === "hostile" ? 0xe30019 : 0x2d548b;
    const staff = new THREE.Mesh(new THREE.CylinderGeometry(0.12, 0.12, 8, 6), new THREE.MeshBasicMaterial({ color: tone }));
    staff.rotation.x = Math.PI / 2;
    staff.position.z = boat.high_m[2] + 5;
    const shape = boat.side === "hostile" ? new THREE.ConeGeometry(1.2, 2.2, 8) : new THREE.BoxGeometry(1.6, 1.6, 1.6);
    const head = new THREE.Mesh(shape, new THREE.MeshBasicMaterial({ color: tone }));
    head.rotation.x = boat.side === "hostile" ? -Math.PI / 2 : 0;
    head.position.z = boat.high_m[2] + 10;
    const mark = new THREE.Group();
    mark.add(staff, head);
    group.add(mark);
    group.userData.mark = mark;
    this.scene.add(group);
    return group;
  }

  /** Tracers, splashes and strikes, a few of each, used again and again. */
  addFlights() {
    const flights = new THREE.Group();
    const tracer = new THREE.CylinderGeometry(0.12, 0.12, 1, 6);
    const splash = new THREE.ConeGeometry(0.45, 3, 10);
    const spark = new THREE.SphereGeometry(0.2, 12, 8);
    const wrong = new THREE.BoxGeometry(0.5, 0.5, 0.5);
    for (let i = 0; i < ROUNDS_MOST; i++) {
      const line = new THREE.Mesh(tracer, new THREE.MeshBasicMaterial({ color: 0xffb02e }));
      const cone = new THREE.Mesh(splash, new THREE.MeshBasicMaterial({ color: 0xf4f8fa, transparent: true, opacity: 0.85 }));
      cone.rotation.x = Math.PI / 2;
      const strike = new THREE.Mesh(spark, new THREE.MeshBasicMaterial({ color: 0xff6a00 }));
      const mistake = new THREE.Mesh(wrong, new THREE.MeshBasicMaterial({ color: 0xe30019 }));
      flights.add(line, cone, strike, mistake);
    }
    this.scene.add(flights);
    return flights;
  }

  /** @param {"gun" | "above" | "free" | "boat"} mode @param {number | null} boat */
  setMode(mode, boat) {
    const was = this.mode;
    this.mode = mode;
    this.followed = boat;
    if (mode === "above") {
      const places = this.run.boats.map((_, i) => this.run.boatAt(i, this.time_s)?.position ?? [0, 0]);
      const far = 1.9 * Math.max(100, ...places.map((place) => Math.hypot(place[0], place[1])));
      this.camera.position.set(0, -0.45 * far, 0.9 * far);
      this.controls.target.set(0, 0, 0);
    } else if (mode === "free" && was === "gun") {
      const ahead = new THREE.Vector3(0, 0, -1).applyQuaternion(this.camera.quaternion);
      this.controls.target.copy(this.camera.position).addScaledVector(ahead, 150).setZ(1);
    }
    if (mode === "boat" && boat !== null) this.standBehind(boat);
    this.changed(mode);
    this.draw(this.time_s);
  }

  /** @param {number} boat */
  standBehind(boat) {
    const pose = this.run.boatAt(boat, this.time_s);
    if (!pose) return;
    const ahead = Run.direction(pose, [1, 0, 0]);
    const { low_m, high_m } = this.run.boats[boat];
    const back = 2.2 * (high_m[0] - low_m[0]);
    this.controls.target.set(pose.position[0], pose.position[1], 1);
    this.camera.position.set(pose.position[0] - ahead[0] * back, pose.position[1] - ahead[1] * back, 1 + 0.5 * back);
  }

  /** Turns about what is looked at, or comes closer to it.
   * @param {KeyboardEvent} event */
  key(event) {
    const TURN = Math.PI / 36;
    /** @type {Record<string, [number, number, number]>} to the left, up, and times as far */
    const keys = { ArrowLeft: [TURN, 0, 1], ArrowRight: [-TURN, 0, 1], ArrowUp: [0, TURN, 1], ArrowDown: [0, -TURN, 1], "+": [0, 0, 0.87], "-": [0, 0, 1.15] };
    const way = keys[event.key];
    if (!way) return;
    event.preventDefault();
    if (this.mode === "gun") this.setMode("free", null);
    const from = this.camera.position.clone().sub(this.controls.target);
    const flat = Math.hypot(from.x, from.y);
    const bearing = Math.atan2(from.y, from.x) + way[0];
    const up = Math.min(Math.max(Math.atan2(from.z, flat) + way[1], 0.01), 1.55);
    const far = Math.min(Math.max(from.length() * way[2], 2), 20000);
    from.set(Math.cos(bearing) * Math.cos(up), Math.sin(bearing) * Math.cos(up), Math.sin(up)).multiplyScalar(far);
    this.camera.position.copy(this.controls.target).add(from);
    this.controls.update();
    this.render();
  }

  /** @param {number} time_s */
  draw(time_s) {
    this.time_s = time_s;
    this.boats.forEach((group, i) => {
      const pose = this.run.boatAt(i, time_s);
      group.visible = pose !== null;
      if (!pose) return;
      group.position.fromArray(pose.position);
      group.quaternion.fromArray(pose.attitude);
    });
    this.aim(time_s);
    this.drawFlights(time_s);
    this.stand(time_s);
    this.render();
  }

  /** @param {number} time_s */
  aim(time_s) {
    const pose = this.run.cameraAt(time_s);
    this.barrel.visible = pose !== null;
    if (!pose) return;
    const bore = new THREE.Vector3(...Run.direction(pose, this.run.camera.bore));
    this.barrel.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), bore);
    this.barrel.position.set(0, 0, Math.max(this.run.eye_height_m - 0.4, 0.5)).addScaledVector(bore, 0.5);
  }

  /** @param {number} time_s */
  drawFlights(time_s) {
    for (const child of this.flights.children) child.visible = false;
    let used = 0;
    for (const round of this.run.rounds) {
      if (round.fired_s > time_s || used >= ROUNDS_MOST) break;
      const since_end = time_s - round.fired_s - round.flown_s();
      if (since_end > SPLASH) continue;
      const at = round.at(time_s);
      const end = round.end();
      if (at) {
        const line = this.flights.children[4 * used++];
        const from = new THREE.Vector3(...(round.at(Math.max(time_s - 1 / 60, round.fired_s)) ?? at));
        const to = new THREE.Vector3(...at);
        const length = Math.max(from.distanceTo(to), 0.5);
        // One that has just left the barrel would cover the gun's own view.
        line.visible = to.distanceTo(this.camera.position) > TRACER_NEAR;
        line.scale.set(1, length, 1);
        line.position.copy(from).lerp(to, 0.5);
        line.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), to.sub(from).normalize());
      } else if (end && since_end >= 0) {
        const kind = { plain: 1, good: 2, alarm: 3 }[/** @type {"plain" | "good" | "alarm"} */ (round.weight)];
        const isHit = kind > 1;
        const cone = this.flights.children[4 * used++ + kind];
        const rise = Math.sin((Math.PI * since_end) / SPLASH);
        cone.visible = true;
        cone.position.set(end[0], end[1], isHit ? end[2] : end[2] + 1.5 * rise);
        if (isHit) cone.scale.setScalar(Math.max(rise, 0.05));
        else cone.scale.set(1, Math.max(rise, 0.05), 1);
      }
    }
  }

  /** Where the eye is.
   * @param {number} time_s */
  stand(time_s) {
    const inGun = this.mode === "gun";
    this.gun.visible = !inGun;
    this.camera.clearViewOffset();
    if (inGun) {
      const pose = this.run.cameraAt(time_s);
      this.says.textContent = pose ? "The whole width of the camera's picture; over and under it more is seen than the shooter saw." : "Where the gun pointed is not known at this time.";
      this.canvas.style.visibility = pose ? "visible" : "hidden";
      if (!pose) return;
      const { size, focal, centre } = this.run.camera;
      const shape = this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1);
      const tangent = focal[1] > 0 ? Math.max(size[1] / focal[1], size[0] / focal[0] / shape) / 2 : 0.4;
      this.camera.fov = (2 * Math.atan(tangent) * 180) / Math.PI;
      if (focal[1] > 0) {
        // The principal point is not in the middle of every picture.
        const [w, h] = [this.canvas.clientWidth, this.canvas.clientHeight];
        const scale = h / (2 * tangent * focal[1]);
        this.camera.setViewOffset(w, h, (size[0] / 2 - centre[0]) * scale, (size[1] / 2 - centre[1]) * scale, w, h);
      }
      this.camera.position.fromArray(pose.position);
      // three's cameras look along -z with y up, the gun's along z with y down.
      this.camera.quaternion.fromArray(pose.attitude).multiply(new THREE.Quaternion(1, 0, 0, 0));
      return;
    }
    this.says.textContent = "";
    this.canvas.style.visibility = "visible";
    this.camera.fov = 50;
    if (this.mode === "boat" && this.followed !== null) {
      const pose = this.run.boatAt(this.followed, time_s);
      if (!pose) return;
      // The eye goes with the boat and keeps what it was turned to.
      const moved = new THREE.Vector3(pose.position[0], pose.position[1], 1).sub(this.controls.target);
      this.camera.position.add(moved);
      this.controls.target.add(moved);
    }
    this.controls.update();
  }

  /** Sizes the marks over boats so that they are seen from where the eye is. */
  mark() {
    for (const group of this.boats) {
      const mark = group.userData.mark;
      mark.visible = this.mode !== "gun";
      const far = this.camera.position.distanceTo(group.position);
      mark.scale.set(Math.max(far / 220, 0.4), Math.max(far / 220, 0.4), Math.max(far / 450, 0.6));
    }
  }

  render() {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (width === 0 || height === 0) return;
    this.mark();
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.scene.background = new THREE.Color(colour(this.canvas, "container-background-color")).lerp(new THREE.Color(0xaec6d6), 0.6);
    this.renderer.render(this.scene, this.camera);
  }

  /** Where a boat is drawn, for tests: its place and its attitude x, y, z, w; null where it is not.
   * @param {number} boat @returns {number[] | null} */
  drawnAt(boat) {
    const { visible, position, quaternion } = this.boats[boat];
    return visible ? [...position.toArray(), ...quaternion.toArray()] : null;
  }
}

/** @param {import("./run.js").CodedMesh} coded */
function meshOf(coded) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(decoded(coded.positions)), 3));
  const codes = new Uint8Array(decoded(coded.colours));
  const linear = new Float32Array(codes.length);
  const one = new THREE.Color();
  for (let i = 0; i < codes.length; i += 3) {
    one.setRGB(codes[i] / 255, codes[i + 1] / 255, codes[i + 2] / 255, THREE.SRGBColorSpace).toArray(linear, i);
  }
  geometry.setAttribute("color", new THREE.BufferAttribute(linear, 3));
  geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(decoded(coded.indices)), 1));
  return geometry;
}

/** @param {import("./run.js").Boat} boat */
function boxOf(boat) {
  const [low, high] = [boat.low_m, boat.high_m];
  const geometry = new THREE.BoxGeometry(high[0] - low[0] || 1, high[1] - low[1] || 1, high[2] - low[2] || 1);
  geometry.translate((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2);
  return geometry;
}
