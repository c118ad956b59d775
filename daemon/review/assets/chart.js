// @ts-check
// The chart of a run at a time of it.

import { colour, Plane } from "bowwave/plane";
import { Run } from "./run.js";

/** Seconds of a track that are drawn behind a boat. */
const TRAIL = 60;
/** Seconds that the end of a round stays on the chart. */
const MARK = 8;

export class Chart {
  /** @param {HTMLCanvasElement} canvas @param {HTMLElement} says @param {Run} run */
  constructor(canvas, says, run) {
    this.canvas = canvas;
    this.says = says;
    this.run = run;
    this.reach_m = run.reach() * 1.05;
  }

  /** @param {number} factor */
  zoom(factor) {
    this.reach_m = Math.min(Math.max(this.reach_m * factor, 20), 50000);
  }

  /** @param {number} time_s */
  draw(time_s) {
    const plane = new Plane(this.canvas, this.reach_m);
    this.says.textContent = `rings every ${plane.rings()} m`;
    plane.keepOff(this.run.keep_off_m);
    this.sector(plane, time_s);
    this.rounds(plane, time_s);
    this.run.boats.forEach((boat, i) => {
      this.trail(plane, i, time_s, plane.tone(boat.side));
      this.boat(plane, i, time_s);
    });
    plane.gun();
  }

  /** The camera's field of view and the barrel.
   * @param {Plane} plane @param {number} time_s */
  sector(plane, time_s) {
    const pose = this.run.cameraAt(time_s);
    if (!pose) return;
    const { size, focal, centre, bore } = this.run.camera;
    const far = this.reach_m * 2;
    /** @param {number[]} v @returns {[number, number]} */
    const towards = (v) => {
      const d = Run.direction(pose, v);
      const flat = Math.hypot(d[0], d[1]) || 1;
      return [(d[0] / flat) * far, (d[1] / flat) * far];
    };
    if (focal[0] > 0) plane.sector(towards([-centre[0] / focal[0], 0, 1]), towards([(size[0] - centre[0]) / focal[0], 0, 1]));
    plane.bearing(towards(bore));
  }

  /** @param {Plane} plane @param {number} i @param {number} time_s @param {string} tone */
  trail(plane, i, time_s, tone) {
    const { c } = plane;
    c.strokeStyle = tone;
    c.lineWidth = 1.5;
    c.beginPath();
    let draws = false;
    for (let t = Math.max(time_s - TRAIL, 0); t <= time_s; t += 0.5) {
      const pose = this.run.boatAt(i, t);
      if (!pose) draws = false;
      else if (draws) c.lineTo(...plane.place(pose.position));
      else {
        c.moveTo(...plane.place(pose.position));
        draws = true;
      }
    }
    c.stroke();
  }

  /** @param {Plane} plane @param {number} i @param {number} time_s */
  boat(plane, i, time_s) {
    const pose = this.run.boatAt(i, time_s);
    if (!pose) return;
    const ahead = Run.direction(pose, [1, 0, 0]);
    plane.boat(this.run.boats[i].name, this.run.boats[i].side, pose.position, Math.atan2(ahead[0], ahead[1]));
  }

  /** Rounds in the air and where others ended.
   * @param {Plane} plane @param {number} time_s */
  rounds(plane, time_s) {
    const { c } = plane;
    for (const round of this.run.rounds) {
      if (round.fired_s > time_s) break;
      const ended = time_s - round.fired_s - round.flown_s();
      const [at, end] = [round.at(time_s), round.end()];
      c.strokeStyle = colour(this.canvas, "element-active-color");
      c.lineWidth = 1.5;
      if (at) {
        const before = round.at(Math.max(time_s - 0.05, round.fired_s)) ?? at;
        c.beginPath();
        c.moveTo(...plane.place(before));
        c.lineTo(...plane.place(at));
        c.stroke();
      } else if (end && ended >= 0 && ended < MARK) {
        const [x, y] = plane.place(end);
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
