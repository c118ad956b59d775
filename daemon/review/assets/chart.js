// @ts-check
// The chart: true scale, north up, the gun in the middle.

import { Run } from "./run.js";

/** Seconds of a track that are drawn behind a boat. */
const TRAIL = 60;
/** Seconds that the end of a round stays on the chart. */
const MARK = 8;

/** @param {HTMLElement} element @param {string} name @returns {string} the value of a variable of the palette */
export function colour(element, name) {
  return getComputedStyle(element).getPropertyValue(`--${name}`).trim();
}

/** @param {HTMLCanvasElement} canvas @returns {CanvasRenderingContext2D} with a unit of a CSS pixel */
export function fitted(canvas) {
  const scale = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(Math.round(side * scale), 1));
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  context.setTransform(scale, 0, 0, scale, 0, 0);
  return context;
}

/** @param {number} reach_m @returns {number} a round distance of which some four reach as far */
function step(reach_m) {
  const power = 10 ** Math.floor(Math.log10(reach_m / 4));
  return power * ([1, 2, 5, 10].find((factor) => factor * power >= reach_m / 4) ?? 10);
}

export class Chart {
  /** @param {HTMLCanvasElement} canvas @param {HTMLElement} says @param {Run} run */
  constructor(canvas, says, run) {
    this.canvas = canvas;
    this.says = says;
    this.run = run;
    this.reach_m = run.reach() * 1.05;
    /** @type {{left: number, top: number, right: number, bottom: number}[]} */
    this.taken = [];
  }

  /** @param {number} factor */
  zoom(factor) {
    this.reach_m = Math.min(Math.max(this.reach_m * factor, 20), 50000);
  }

  /** @param {number} time_s */
  draw(time_s) {
    const c = fitted(this.canvas);
    const [w, h] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const scale = Math.min(w, h) / 2 / this.reach_m;
    /** @param {ArrayLike<number>} p @returns {[number, number]} */
    const place = (p) => [w / 2 + p[0] * scale, h / 2 - p[1] * scale];
    const ink = colour(this.canvas, "element-active-color");
    c.fillStyle = colour(this.canvas, "container-background-color");
    c.fillRect(0, 0, w, h);
    c.font = "12px sans-serif";
    this.rings(c, w, h, scale);
    this.sector(c, time_s, place);
    this.rounds(c, time_s, place);
    this.taken = [];
    this.run.boats.forEach((boat, i) => {
      const tone = colour(this.canvas, boat.side === "hostile" ? "alert-alarm-color" : "instrument-enhanced-secondary-color");
      this.trail(c, i, time_s, place, tone);
      this.boat(c, i, time_s, place, tone, ink);
    });
    c.fillStyle = ink;
    c.beginPath();
    c.arc(w / 2, h / 2, 4, 0, 2 * Math.PI);
    c.fill();
  }

  /** @param {CanvasRenderingContext2D} c @param {number} w @param {number} h @param {number} scale */
  rings(c, w, h, scale) {
    const ring = step(this.reach_m);
    this.says.textContent = `rings every ${ring} m`;
    c.strokeStyle = colour(this.canvas, "border-divider-color");
    c.fillStyle = colour(this.canvas, "element-neutral-color");
    c.lineWidth = 1;
    for (let i = 1; i * ring * scale < Math.hypot(w, h) / 2; i++) {
      c.beginPath();
      c.arc(w / 2, h / 2, i * ring * scale, 0, 2 * Math.PI);
      c.stroke();
      c.fillText(`${i * ring} m`, w / 2 + 4, h / 2 - i * ring * scale - 3);
    }
    c.fillText("N", w / 2 - 4, 12);
    if (this.run.keep_off_m > 0) {
      c.strokeStyle = colour(this.canvas, "alert-warning-color");
      c.lineWidth = 2;
      c.setLineDash([6, 4]);
      c.beginPath();
      c.arc(w / 2, h / 2, this.run.keep_off_m * scale, 0, 2 * Math.PI);
      c.stroke();
      c.setLineDash([]);
    }
  }

  /** The camera's field of view and the barrel.
   * @param {CanvasRenderingContext2D} c @param {number} time_s
   * @param {(p: ArrayLike<number>) => [number, number]} place */
  sector(c, time_s, place) {
    const pose = this.run.cameraAt(time_s);
    if (!pose) return;
    const { size, focal, centre, bore } = this.run.camera;
    const far = this.reach_m * 2;
    /** @param {number[]} v @returns {[number, number]} */
    const towards = (v) => {
      const d = Run.direction(pose, v);
      const flat = Math.hypot(d[0], d[1]) || 1;
      return place([(d[0] / flat) * far, (d[1] / flat) * far]);
    };
    if (focal[0] > 0) {
      c.globalAlpha = 0.18;
      c.fillStyle = colour(this.canvas, "instrument-enhanced-secondary-color");
      c.beginPath();
      c.moveTo(...place([0, 0]));
      c.lineTo(...towards([-centre[0] / focal[0], 0, 1]));
      c.lineTo(...towards([(size[0] - centre[0]) / focal[0], 0, 1]));
      c.fill();
      c.globalAlpha = 1;
    }
    c.strokeStyle = colour(this.canvas, "element-active-color");
    c.lineWidth = 1.5;
    c.beginPath();
    c.moveTo(...place([0, 0]));
    c.lineTo(...towards(bore));
    c.stroke();
  }

  /** @param {CanvasRenderingContext2D} c @param {number} i @param {number} time_s @param {(p: ArrayLike<number>) => [number, number]} place
   * @param {string} tone */
  trail(c, i, time_s, place, tone) {
    c.strokeStyle = tone;
    c.lineWidth = 1.5;
    c.beginPath();
    let draws = false;
    for (let t = Math.max(time_s - TRAIL, 0); t <= time_s; t += 0.5) {
      const pose = this.run.boatAt(i, t);
      if (!pose) draws = false;
      else if (draws) c.lineTo(...place(pose.position));
      else {
        c.moveTo(...place(pose.position));
        draws = true;
      }
    }
    c.stroke();
  }

  /** @param {CanvasRenderingContext2D} c @param {number} i @param {number} time_s @param {(p: ArrayLike<number>) => [number, number]} place
   * @param {string} tone @param {string} ink */
  boat(c, i, time_s, place, tone, ink) {
    const pose = this.run.boatAt(i, time_s);
    if (!pose) return;
    const [x, y] = place(pose.position);
    const ahead = Run.direction(pose, [1, 0, 0]);
    c.save();
    c.translate(x, y);
    c.rotate(Math.atan2(ahead[0], ahead[1]));
    c.fillStyle = tone;
    c.beginPath();
    if (this.run.boats[i].side === "hostile") {
      c.moveTo(0, -9);
      c.lineTo(6, 7);
      c.lineTo(-6, 7);
    } else c.rect(-5, -5, 10, 10);
    c.fill();
    c.restore();
    this.label(c, this.run.boats[i].name, x, y, ink);
  }

  /** A name beside a place where it covers no other, if there is one.
   * @param {CanvasRenderingContext2D} c @param {string} name
   * @param {number} x @param {number} y @param {string} ink */
  label(c, name, x, y, ink) {
    const wide = c.measureText(name).width;
    const places = [[10, -8], [10, 16], [-10 - wide, -8], [-10 - wide, 16], [10, -22], [10, 30], [-10 - wide, -22], [-10 - wide, 30]];
    const boxes = places.map(([dx, dy]) => ({ left: x + dx, top: y + dy - 11, right: x + dx + wide, bottom: y + dy + 3 }));
    const isFree = (/** @type {{left: number, top: number, right: number, bottom: number}} */ box) =>
      !this.taken.some((other) => box.left < other.right && other.left < box.right && box.top < other.bottom && other.top < box.bottom);
    const box = boxes.find(isFree);
    if (!box) return;
    this.taken.push(box);
    c.fillStyle = ink;
    c.fillText(name, box.left, box.bottom - 3);
  }

  /** Rounds in the air and where others ended.
   * @param {CanvasRenderingContext2D} c @param {number} time_s
   * @param {(p: ArrayLike<number>) => [number, number]} place */
  rounds(c, time_s, place) {
    for (const round of this.run.rounds) {
      if (round.fired_s > time_s) break;
      const ended = time_s - round.fired_s - round.flown_s();
      const [at, end] = [round.at(time_s), round.end()];
      c.strokeStyle = colour(this.canvas, "element-active-color");
      c.lineWidth = 1.5;
      if (at) {
        const before = round.at(Math.max(time_s - 0.05, round.fired_s)) ?? at;
        c.beginPath();
        c.moveTo(...place(before));
        c.lineTo(...place(at));
        c.stroke();
      } else if (end && ended >= 0 && ended < MARK) {
        const [x, y] = place(end);
        c.beginPath();
        if (round.weight === "good" || round.weight === "alarm") {
          c.moveTo(x - 5, y - 5);
          c.lineTo(x + 5, y + 5);
          c.moveTo(x + 5, y - 5);
          c.lineTo(x - 5, y + 5);
          if (round.weight === "alarm") c.rect(x - 7, y - 7, 14, 14);
        } else c.arc(x, y, 2.5, 0, 2 * Math.PI);
        c.stroke();
      }
    }
  }
}
