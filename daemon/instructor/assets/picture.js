// @ts-check
// The live picture.

import { by, say } from "./dom.js";

/** @typedef {import("./connection.js").Connection} Connection */

/** Milliseconds without a picture after which it is said to be old. */
const OLD = 1000;

export class LivePicture {
  /** @param {Connection} connection */
  constructor(connection) {
    this.connection = connection;
    this.canvas = /** @type {HTMLCanvasElement} */ (by("picture"));
    /** @type {number[]} */
    this.delays = [];
    this.drawn = 0;
    this.count = 0;
    connection.on("picture", (data) => this.show(data));
    connection.on("state", ({ open }) => open && this.ask());
    document.addEventListener("visibilitychange", () => this.ask());
    setInterval(() => this.report(), 500);
  }

  /** Pictures are asked for while somebody can see them. */
  ask() {
    this.connection.send({ kind: "pictures", on: !document.hidden });
  }

  /** @param {ArrayBuffer} data */
  async show(data) {
    const received = performance.now();
    const head = new DataView(data);
    const [age_us, frame] = [head.getBigUint64(0, true), head.getBigUint64(8, true)];
    try {
      const image = await createImageBitmap(new Blob([new Uint8Array(data, 16)], { type: "image/jpeg" }));
      const { canvas } = this;
      if (canvas.width !== image.width || canvas.height !== image.height) [canvas.width, canvas.height] = [image.width, image.height];
      canvas.getContext("2d")?.drawImage(image, 0, 0);
      image.close();
      this.drawn = performance.now();
      this.count++;
      this.delays.push(Number(age_us) / 1000 + this.connection.round_trip / 2 + this.drawn - received);
      if (this.delays.length > 300) this.delays.shift();
      if (this.count === 1) performance.mark("first-picture");
    } catch (error) {
      console.warn(error);
    }
    this.connection.send({ kind: "drawn", frame: Number(frame) });
  }

  report() {
    const since = performance.now() - this.drawn;
    const isOld = this.count === 0 || since > OLD;
    by("picture-note").hidden = !isOld;
    if (isOld) {
      say(by("delay"), "-");
      say(by("picture-note"), this.count === 0 ? "no picture yet" : `no picture for ${(since / 1000).toFixed(0)} s`);
    } else {
      const newest = this.delays.slice(-8);
      say(by("delay"), `${Math.round(newest.reduce((sum, delay) => sum + delay, 0) / newest.length)} ms behind`);
    }
    this.canvas.classList.toggle("old", isOld);
  }
}
