// @ts-check
// The video of what the display showed, in step with the clock.

/** @typedef {import("./clock.js").Clock} Clock */
/** @typedef {{address: string | null, marks: [number, number][], frames_per_s: number}} Coded */

/** The address of the video's bytes: its file, or a blob of what the page holds.
 * @param {Coded} coded @returns {string} */
function addressOf(coded) {
  if (coded.address !== null) return coded.address;
  const holder = document.getElementById("video-data");
  const text = holder?.textContent ?? "";
  // Four characters are three bytes: parts of a million of these are decoded one by one.
  const PART = 4 << 20;
  const parts = [];
  for (let from = 0; from < text.length; from += PART) {
    const bytes = atob(text.slice(from, from + PART));
    const part = new Uint8Array(bytes.length);
    for (let i = 0; i < bytes.length; i++) part[i] = bytes.charCodeAt(i);
    parts.push(part);
  }
  holder?.remove();
  return URL.createObjectURL(new Blob(parts, { type: "video/mp4" }));
}

/** The video. */
export class Film {
  /** @param {HTMLVideoElement} video @param {HTMLElement} says @param {Coded} coded @param {Clock} clock */
  constructor(video, says, coded, clock) {
    this.video = video;
    this.says = says;
    this.coded = coded;
    this.clock = clock;
    this.address = addressOf(coded);
    this.isBroken = false;
    video.src = this.address;
    video.addEventListener("loadedmetadata", () => this.follow());
    video.addEventListener("seeked", () => this.follow());
    video.addEventListener("error", () => {
      this.isBroken = true;
      this.say(coded.address === null ? "This browser cannot play the video." : `The video ${decodeURI(coded.address)} is not there, or this browser cannot play it.`);
    });
    clock.addEventListener("time", () => this.follow());
    clock.addEventListener("state", () => this.follow());
  }

  /** @param {string} words */
  say(words) {
    if (this.says.textContent !== words) this.says.textContent = words;
  }

  /** @param {number} time_s @returns {number} the number of the frame that shows that time of the run; below 0 before the first */
  frameAt(time_s) {
    const { marks, frames_per_s } = this.coded;
    let last = 0;
    while (last + 1 < marks.length && marks[last + 1][1] <= time_s + 0.5 / frames_per_s) last++;
    const [frame, shown_s] = marks[last];
    const there = frame + Math.round((time_s - shown_s) * frames_per_s);
    return last + 1 < marks.length ? Math.min(there, marks[last + 1][0] - 1) : there;
  }

  /** @param {number} time_s @param {number} duration_s @returns {number | null} the video's own time in the middle of that frame, seconds; null where it has none */
  placeOf(time_s, duration_s) {
    const place = (this.frameAt(time_s) + 0.5) / this.coded.frames_per_s;
    return place >= 0 && place <= duration_s ? place : null;
  }

  /** Shows the clock's time. */
  follow() {
    const { video, clock } = this;
    if (this.isBroken || video.readyState === 0) return;
    const place = this.placeOf(clock.now_s, video.duration);
    video.style.visibility = place === null ? "hidden" : "visible";
    this.say(place === null ? "The video does not reach this time." : "");
    if (place === null || !clock.plays) video.pause();
    if (place === null) return;
    if (clock.plays) {
      video.playbackRate = clock.speed;
      if (video.paused) video.play().catch(() => {});
      // It runs by itself, and is put right where it is off by more than is seen.
      if (!video.seeking && Math.abs(video.currentTime - place) > 0.1 * Math.max(clock.speed, 1)) video.currentTime = place;
    } else if (!video.seeking && Math.abs(video.currentTime - place) > 0.1 / this.coded.frames_per_s) video.currentTime = place;
  }

  /** Has each row show the moment of its round, once the row is seen.
   * @param {NodeListOf<HTMLTableRowElement>} rows */
  illustrate(rows) {
    const reader = document.createElement("video");
    reader.muted = true;
    reader.preload = "auto";
    reader.src = this.address;
    /** @type {HTMLTableRowElement[]} */
    const waiting = [];
    let isBusy = false;
    /** @returns {void} */
    const next = () => {
      const row = waiting.pop();
      isBusy = row !== undefined;
      if (row === undefined) return;
      const place = this.placeOf(Number(row.dataset.time), reader.duration);
      const canvas = row.querySelector("canvas");
      if (place === null || canvas === null) return next();
      reader.addEventListener(
        "seeked",
        () => {
          canvas.height = Math.round((canvas.width * reader.videoHeight) / Math.max(reader.videoWidth, 1));
          canvas.getContext("2d")?.drawImage(reader, 0, 0, canvas.width, canvas.height);
          canvas.dataset.drawn = String(this.frameAt(Number(row.dataset.time)));
          next();
        },
        { once: true },
      );
      reader.currentTime = place;
    };
    const seen = new IntersectionObserver((entries) => {
      for (const { isIntersecting, target } of entries) {
        if (!isIntersecting || !(target instanceof HTMLTableRowElement)) continue;
        seen.unobserve(target);
        waiting.push(target);
      }
      if (!isBusy) next();
    });
    reader.addEventListener("loadeddata", () => rows.forEach((row) => seen.observe(row)), { once: true });
  }
}
