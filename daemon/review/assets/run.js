// @ts-check
// The run as the page's data has it: where everything was at any time.

/**
 * @typedef {{name: string, side: string, model: string, low_m: number[], high_m: number[]}} Boat
 * @typedef {{positions: string, colours: string, indices: string}} CodedMesh
 * @typedef {{size: number[], focal: number[], centre: number[], bore: number[]}} Camera
 * @typedef {{shot: number, fired_s: number, weight: string, words: string, boat: number | null, error_m: number[] | null,
 *   path: string}} CodedRound
 * @typedef {{time_s: number, weight: string, words: string, boat: number | null}} RunEvent
 * @typedef {{end_s: number, boats: Boat[], camera: Camera, keep_off_m: number, eye_height_m: number, pauses: number[][],
 *   tracks: {time_s: string, camera: string, boats: string}, rounds: CodedRound[], events: RunEvent[], meshes: Record<string, CodedMesh>,
 *   video: import("./film.js").Coded | null}} PageData
 * @typedef {{position: number[], attitude: number[]}} Pose  Place (east, north, up) in metres; rotation to the world x, y, z, w.
 */

/** Seven numbers a pose, and a point of a path. */
const POSE = 7;

/** @param {string} text @returns {ArrayBuffer} */
export function decoded(text) {
  const bytes = atob(text);
  const buffer = new Uint8Array(bytes.length);
  for (let i = 0; i < bytes.length; i++) buffer[i] = bytes.charCodeAt(i);
  return buffer.buffer;
}

/** @param {ArrayLike<number>} list @param {number} value @returns {number} how many of a sorted list are not above the value */
function countUpTo(list, value) {
  let low = 0;
  let high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** The cubic through b and c with the slopes of its neighbours (Catmull and Rom 1974).
 * @param {number} a @param {number} b @param {number} c @param {number} d @param {number} s */
function cubic(a, b, c, d, s) {
  return hermite(b, (c - a) / 2, c, (d - b) / 2, s);
}

/** The cubic from a to b by their slopes over the span (Hermite).
 * @param {number} a @param {number} from @param {number} b @param {number} to @param {number} s */
function hermite(a, from, b, to, s) {
  return a + s * (from + s * (3 * (b - a) - 2 * from - to + s * (2 * (a - b) + from + to)));
}

/** @param {Float32Array} q @param {number} a @param {number} b @param {number} s @returns {number[]} */
function turned(q, a, b, s) {
  const dot = q[a] * q[b] + q[a + 1] * q[b + 1] + q[a + 2] * q[b + 2] + q[a + 3] * q[b + 3];
  const sign = dot < 0 ? -1 : 1;
  const mixed = [0, 1, 2, 3].map((k) => q[a + k] * (1 - s) + sign * q[b + k] * s);
  const length = Math.hypot(...mixed);
  return mixed.map((v) => v / length);
}

/** A round with its path. */
class Round {
  /** @param {CodedRound} coded */
  constructor(coded) {
    this.shot = coded.shot;
    this.fired_s = coded.fired_s;
    this.weight = coded.weight;
    this.words = coded.words;
    this.boat = coded.boat;
    this.error_m = coded.error_m;
    this.points = new Float32Array(decoded(coded.path));
    this.count = this.points.length / POSE;
  }

  /** @returns {number} seconds of its flight */
  flown_s() {
    return this.count > 0 ? this.points[(this.count - 1) * POSE] : 0;
  }

  /** @returns {number[] | null} where it ended */
  end() {
    const at = (this.count - 1) * POSE;
    return this.count > 0 ? [this.points[at + 1], this.points[at + 2], this.points[at + 3]] : null;
  }

  /** @param {number} time_s @returns {number[] | null} where it is, while it flies: the cubic by places and velocities (Hermite) */
  at(time_s) {
    const after = time_s - this.fired_s;
    // A microsecond is what the sum of two times may be off by.
    if (this.count < 2 || after < -1e-6 || after > this.flown_s() + 1e-6) return null;
    let i = 0;
    while (i + 2 < this.count && this.points[(i + 1) * POSE] <= after) i++;
    const [a, b] = [i * POSE, (i + 1) * POSE];
    const p = this.points;
    const span = p[b] - p[a];
    const s = span > 0 ? Math.min(Math.max((after - p[a]) / span, 0), 1) : 0;
    return [1, 2, 3].map((k) => hermite(p[a + k], p[a + k + 3] * span, p[b + k], p[b + k + 3] * span, s));
  }
}

/** A run. */
export class Run {
  /** @param {PageData} data */
  constructor(data) {
    this.end_s = Math.max(data.end_s, 0.1);
    this.boats = data.boats;
    this.camera = data.camera;
    this.keep_off_m = data.keep_off_m;
    this.eye_height_m = data.eye_height_m;
    this.meshes = data.meshes;
    this.video = data.video;
    this.events = data.events;
    this.pauses = data.pauses;
    this.rounds = data.rounds.map((coded) => new Round(coded));
    this.times = new Float64Array(decoded(data.tracks.time_s));
    this.cameras = new Float32Array(decoded(data.tracks.camera));
    this.poses = new Float32Array(decoded(data.tracks.boats));
  }

  /** @param {number} boat @param {number} time_s @returns {Pose | null} */
  boatAt(boat, time_s) {
    return this.poseIn(this.poses, this.boats.length, boat, time_s);
  }

  /** @param {number} time_s @returns {Pose | null} camera on the gun: x right, y down, z forward */
  cameraAt(time_s) {
    return this.poseIn(this.cameras, 1, 0, time_s);
  }

  /** @param {Float32Array} poses @param {number} count @param {number} which @param {number} time_s @returns {Pose | null} */
  poseIn(poses, count, which, time_s) {
    /** Longer without a sample is a gap, seconds: two steps, and a little more. Within it only the nearest moment of a sample counts. */
    const [GAP, MOMENT] = [0.12, 0.03];
    const next = countUpTo(this.times, time_s);
    const from = Math.max(next - 1, 0);
    const to = Math.min(next, this.times.length - 1);
    if (this.times.length === 0) return null;
    const span = this.times[to] - this.times[from];
    const [before, after] = [time_s - this.times[from], this.times[to] - time_s];
    const isGap = span > GAP || span === 0;
    // While the exercise stands still everything stays where it is.
    const stands = isGap && this.pauses.some(([since, until]) => time_s > since - GAP && time_s < until + GAP && this.times[from] < until);
    if (isGap && !stands && Math.abs(before) > MOMENT && Math.abs(after) > MOMENT) return null;
    const s = stands ? 0 : isGap ? (Math.abs(before) <= Math.abs(after) ? 0 : 1) : before / span;
    /** @param {number} sample */
    const at = (sample) => (sample * count + which) * POSE;
    const [b, c] = [at(from), at(to)];
    if (Number.isNaN(poses[b]) || Number.isNaN(poses[c])) return null;
    // Beyond a gap or an end the nearest sample stands for the one that is missing.
    /** @param {number} sample @param {number} beside */
    const near = (sample, beside) => {
      const is = sample >= 0 && sample < this.times.length && Math.abs(this.times[sample] - this.times[beside]) < GAP;
      return is && !Number.isNaN(poses[at(sample)]) ? at(sample) : at(beside);
    };
    const [a, d] = [near(from - 1, from), near(to + 1, to)];
    const position = [0, 1, 2].map((k) => cubic(poses[a + k], poses[b + k], poses[c + k], poses[d + k], s));
    return { position, attitude: turned(poses, b + 3, c + 3, s) };
  }

  /** @param {Pose} pose @param {number[]} v @returns {number[]} a direction of the body's axes in the world */
  static direction(pose, v) {
    const [x, y, z, w] = pose.attitude;
    const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
    return [
      v[0] + w * t[0] + y * t[2] - z * t[1],
      v[1] + w * t[1] + z * t[0] - x * t[2],
      v[2] + w * t[2] + x * t[1] - y * t[0],
    ];
  }

  /** @returns {number} farthest that any boat was from the gun, metres */
  reach() {
    let most = 100;
    for (let i = 0; i < this.poses.length; i += POSE) {
      const far = Math.hypot(this.poses[i], this.poses[i + 1]);
      if (far > most) most = far;
    }
    return most;
  }
}
