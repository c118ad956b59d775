// @ts-check
// The one time of the page: everything that moves follows it.

/** Time that is set, played and stepped. */
export class Clock extends EventTarget {
  /** @param {number} end_s */
  constructor(end_s) {
    super();
    this.end_s = end_s;
    this.now_s = 0;
    this.speed = 1;
    this.plays = false;
    /** @type {number | null} */
    this.last = null;
    this.frame = this.frame.bind(this);
  }

  /** @param {number} time_s */
  set(time_s) {
    this.now_s = Math.min(Math.max(time_s, 0), this.end_s);
    this.dispatchEvent(new Event("time"));
  }

  /** @param {boolean} plays */
  play(plays) {
    if (plays && this.now_s >= this.end_s) this.now_s = 0;
    this.plays = plays;
    this.last = null;
    this.dispatchEvent(new Event("state"));
    if (plays) requestAnimationFrame(this.frame);
  }

  /** @param {number} stamp */
  frame(stamp) {
    if (!this.plays) return;
    if (this.last !== null) this.set(this.now_s + ((stamp - this.last) / 1000) * this.speed);
    this.last = stamp;
    if (this.now_s >= this.end_s) this.play(false);
    else requestAnimationFrame(this.frame);
  }
}
