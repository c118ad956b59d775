// @ts-check
// The chart of the boats as they are now.

import { Plane } from "bowwave/plane";
import { by, say } from "./dom.js";

/** Seconds of a track that are drawn behind a boat. */
const TRAIL = 60;

/** @typedef {{name: string, side: string, east_m: number, north_m: number, heading_deg: number, swims: boolean, in_reserve: boolean, is_struck: boolean}} Boat */
/** @typedef {{bearing_deg: number, elevation_deg: number, view_deg: number}} Gun */

/** @param {number} bearing_deg @param {number} range_m @returns {number[]} east and north */
const at = (bearing_deg, range_m) => [Math.sin((bearing_deg * Math.PI) / 180) * range_m, Math.cos((bearing_deg * Math.PI) / 180) * range_m];

export class LiveChart {
  constructor() {
    this.canvas = /** @type {HTMLCanvasElement} */ (by("chart"));
    this.reach_m = 600;
    this.isChosen = false;
    /** @type {Boat[]} */
    this.boats = [];
    /** @type {Gun | null} */
    this.gun = null;
    /** @type {Map<string, {clock_s: number, place: number[]}[]>} */
    this.trails = new Map();
    this.session = -1;
    by("chart-in").addEventListener("click", () => this.zoom(1 / 1.5));
    by("chart-out").addEventListener("click", () => this.zoom(1.5));
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(event.deltaY > 0 ? 1.15 : 1 / 1.15);
    });
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  /** @param {number} factor */
  zoom(factor) {
    this.isChosen = true;
    this.reach_m = Math.min(Math.max(this.reach_m * factor, 20), 50000);
    this.draw();
  }

  /** @param {{boats: Boat[], gun: Gun | null, clock_s: number, session: number}} status */
  update(status) {
    if (status.session !== this.session) {
      this.trails.clear();
      this.session = status.session;
      this.isChosen = false;
    }
    this.boats = status.boats.filter((boat) => boat.swims);
    this.gun = status.gun;
    for (const boat of this.boats) {
      const trail = this.trails.get(boat.name) ?? [];
      const last = trail[trail.length - 1];
      if (!last || status.clock_s > last.clock_s) trail.push({ clock_s: status.clock_s, place: [boat.east_m, boat.north_m] });
      while (trail.length > 0 && trail[0].clock_s < status.clock_s - TRAIL) trail.shift();
      this.trails.set(boat.name, trail);
    }
    // All that swims is in sight until somebody chooses another scale; steps keep it from creeping.
    const far = Math.max(...this.boats.map((boat) => Math.hypot(boat.east_m, boat.north_m)), 80) * 1.15;
    if (!this.isChosen && (far > this.reach_m || far < this.reach_m * 0.6)) this.reach_m = far;
    this.draw();
  }

  draw() {
    const plane = new Plane(this.canvas, this.reach_m);
    say(by("chart-scale"), `rings every ${plane.rings()} m`);
    if (this.gun) {
      const { bearing_deg, view_deg } = this.gun;
      const far = this.reach_m * 2;
      plane.sector(at(bearing_deg - view_deg / 2, far), at(bearing_deg + view_deg / 2, far));
      plane.bearing(at(bearing_deg, far));
    }
    for (const boat of this.boats) {
      this.trail(plane, boat);
      const place = [boat.east_m, boat.north_m];
      plane.boat(boat.name, boat.side, place, (boat.heading_deg * Math.PI) / 180);
      if (boat.is_struck) this.struck(plane, place);
    }
    plane.gun();
  }

  /** @param {Plane} plane @param {Boat} boat */
  trail(plane, boat) {
    const { c } = plane;
    c.strokeStyle = plane.tone(boat.side);
    c.lineWidth = 1.5;
    c.beginPath();
    for (const { place } of this.trails.get(boat.name) ?? []) c.lineTo(...plane.place(place));
    c.stroke();
  }

  /** @param {Plane} plane @param {number[]} place */
  struck(plane, place) {
    const { c } = plane;
    const [x, y] = plane.place(place);
    c.strokeStyle = plane.ink;
    c.lineWidth = 2;
    c.beginPath();
    for (const [dx, dy] of [[9, 9], [9, -9]]) {
      c.moveTo(x - dx, y - dy);
      c.lineTo(x + dx, y + dy);
    }
    c.stroke();
  }
}
