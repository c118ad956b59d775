// @ts-check
// What every chart has: true scale, north up, the gun in the middle.

/** @typedef {{left: number, top: number, right: number, bottom: number}} Box */

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
export function ringStep(reach_m) {
  const power = 10 ** Math.floor(Math.log10(reach_m / 4));
  return power * ([1, 2, 5, 10].find((factor) => factor * power >= reach_m / 4) ?? 10);
}

/** A canvas as a plane about the gun. */
export class Plane {
  /** @param {HTMLCanvasElement} canvas @param {number} reach_m half of what the shorter side shows */
  constructor(canvas, reach_m) {
    this.canvas = canvas;
    this.c = fitted(canvas);
    this.w = canvas.clientWidth;
    this.h = canvas.clientHeight;
    this.reach_m = reach_m;
    this.scale = Math.min(this.w, this.h) / 2 / reach_m;
    this.ink = colour(canvas, "element-active-color");
    /** @type {Box[]} */
    this.taken = [];
    this.c.fillStyle = colour(canvas, "container-background-color");
    this.c.fillRect(0, 0, this.w, this.h);
    this.c.font = "12px sans-serif";
  }

  /** @param {ArrayLike<number>} p east and north, metres @returns {[number, number]} */
  place(p) {
    return [this.w / 2 + p[0] * this.scale, this.h / 2 - p[1] * this.scale];
  }

  /** Rings of round distances, and north.
   * @returns {number} metres from one ring to the next */
  rings() {
    const { c, w, h, scale } = this;
    const ring = ringStep(this.reach_m);
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
    return ring;
  }

  /** The range to be kept.
   * @param {number} range_m */
  keepOff(range_m) {
    if (range_m <= 0) return;
    const { c } = this;
    c.strokeStyle = colour(this.canvas, "alert-warning-color");
    c.lineWidth = 2;
    c.setLineDash([6, 4]);
    c.beginPath();
    c.arc(this.w / 2, this.h / 2, range_m * this.scale, 0, 2 * Math.PI);
    c.stroke();
    c.setLineDash([]);
  }

  /** The field of view between two directions.
   * @param {number[]} left @param {number[]} right east and north of points far off */
  sector(left, right) {
    const { c } = this;
    c.globalAlpha = 0.18;
    c.fillStyle = colour(this.canvas, "instrument-enhanced-secondary-color");
    c.beginPath();
    c.moveTo(...this.place([0, 0]));
    c.lineTo(...this.place(left));
    c.lineTo(...this.place(right));
    c.fill();
    c.globalAlpha = 1;
  }

  /** The barrel's bearing.
   * @param {number[]} towards east and north of a point far off */
  bearing(towards) {
    const { c } = this;
    c.strokeStyle = this.ink;
    c.lineWidth = 1.5;
    c.beginPath();
    c.moveTo(...this.place([0, 0]));
    c.lineTo(...this.place(towards));
    c.stroke();
  }

  gun() {
    const { c } = this;
    c.fillStyle = this.ink;
    c.beginPath();
    c.arc(this.w / 2, this.h / 2, 4, 0, 2 * Math.PI);
    c.fill();
  }

  /** @param {string} side @returns {string} */
  tone(side) {
    return colour(this.canvas, side === "hostile" ? "alert-alarm-color" : "instrument-enhanced-secondary-color");
  }

  /** A boat with its name: hostile ones are arrowheads, neutral ones squares.
   * @param {string} name @param {string} side @param {ArrayLike<number>} position @param {number} heading radians clockwise from north */
  boat(name, side, position, heading) {
    const { c } = this;
    const [x, y] = this.place(position);
    c.save();
    c.translate(x, y);
    c.rotate(heading);
    c.fillStyle = this.tone(side);
    c.beginPath();
    if (side === "hostile") {
      c.moveTo(0, -9);
      c.lineTo(6, 7);
      c.lineTo(-6, 7);
    } else c.rect(-5, -5, 10, 10);
    c.fill();
    c.restore();
    this.label(name, x, y);
  }

  /** A name beside a place where it covers no other, if there is one.
   * @param {string} name @param {number} x @param {number} y */
  label(name, x, y) {
    const { c } = this;
    const wide = c.measureText(name).width;
    const places = [[10, -8], [10, 16], [-10 - wide, -8], [-10 - wide, 16], [10, -22], [10, 30], [-10 - wide, -22], [-10 - wide, 30]];
    const boxes = places.map(([dx, dy]) => ({ left: x + dx, top: y + dy - 11, right: x + dx + wide, bottom: y + dy + 3 }));
    const isFree = (/** @type {Box} */ box) =>
      !this.taken.some((other) => box.left < other.right && other.left < box.right && box.top < other.bottom && other.top < box.bottom);
    const box = boxes.find(isFree);
    if (!box) return;
    this.taken.push(box);
    c.fillStyle = this.ink;
    c.fillText(name, box.left, box.bottom - 3);
  }
}
