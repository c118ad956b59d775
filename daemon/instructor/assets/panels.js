// @ts-check
// What the trainer says, in words and tables.

import { by, element, row, say } from "./dom.js";

/** @param {number} seconds @returns {string} */
const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;
/** @param {number | null | undefined} value @param {number} [digits] @returns {string} */
const shown = (value, digits = 0) => (typeof value === "number" ? value.toFixed(digits) : "-");

/** Word, shape and look of a level. */
const LEVELS = /** @type {Record<string, [string, string]>} */ ({
  works: ["\u25cf", "good"],
  warning: ["\u25b2", "warning"],
  fault: ["\u25a0", "alarm"],
  absent: ["\u25cb", ""],
  good: ["\u25cf", "good"],
  attention: ["\u25b2", "warning"],
  bad: ["\u25a0", "alarm"],
});
const RULES = /** @type {Record<string, string>} */ ({ hold: "cease fire", warn: "warn first", tight: "weapons tight", free: "weapons free" });

/** @param {any} status */
export function showStatus(status) {
  say(by("scenario"), status.stands_by ? "Standing by" : status.scenario || "no scenario");
  const of = status.duration_s ? ` of ${clock(status.duration_s)}` : "";
  say(by("clock"), `${clock(status.clock_s)}${of}${status.is_paused ? " \u2013 paused" : ""}`);
  const [shape, look] = LEVELS[status.level] ?? ["", ""];
  by("word").className = `badge ${look}`;
  say(by("word"), `${shape} ${status.word}`);
  say(by("cause"), [status.cause, status.action].filter(Boolean).join(": "));
  say(by("rules"), status.rules ? RULES[status.rules] : "-");
  say(by("weapon"), status.weapon || "-");
  say(by("rounds"), String(status.rounds_left));
  say(by("hits"), `${status.hits} of ${status.shots}${status.neutral_hits > 0 ? `, ${status.neutral_hits} NEUTRAL` : ""}`);
  say(by("shown"), status.message || "nothing");
  showDevices(status.devices);
  showReserve(status.boats);
  showBoats(status.boats);
}

/** Boats of the score, by name.
 * @type {Map<string, any>} */
let scored = new Map();
by("boats-head").append(row(["Boat", "Side", "Bearing", "Range m", "Speed kn", "Crew", "Detected s", "Called", "Hits", "State"], true));

/** @param {any} boat @param {any} score @returns {string} */
function ending(boat, score) {
  if (boat.in_reserve) return "in reserve";
  const end = score?.ending ? `${score.ending.replace("_", " ")} at ${shown(score.ended_m)} m` : "";
  return [boat.swims ? "" : "not on the water", boat.is_struck && !end ? "struck" : "", end].filter(Boolean).join(", ") || "swims";
}

/** @param {any[]} boats */
function showBoats(boats) {
  const rows = boats.map((boat) => {
    const score = scored.get(boat.name);
    const range = Math.hypot(boat.east_m, boat.north_m);
    const bearing = ((Math.atan2(boat.east_m, boat.north_m) * 180) / Math.PI + 360) % 360;
    const isThere = boat.swims;
    return [
      boat.name,
      `${boat.side === "hostile" ? "\u25b2" : "\u25a0"} ${boat.side}`,
      isThere ? `${String(Math.round(bearing) % 360).padStart(3, "0")}\u00b0` : "-",
      isThere ? shown(range) : "-",
      isThere ? shown(boat.speed_m_s * 1.943844) : "-",
      boat.crew ?? "-",
      shown(score?.detected_s, 1),
      score?.identified_as ?? "-",
      String(score?.hits ?? "-"),
      ending(boat, score),
    ];
  });
  const body = by("boats");
  while (body.children.length > rows.length) body.lastElementChild?.remove();
  rows.forEach((cells, i) => {
    const line = body.children[i] ?? body.appendChild(row(cells));
    cells.forEach((cell, k) => say(/** @type {HTMLElement} */ (line.children[k]), cell));
  });
}

/** @param {any[]} devices */
function showDevices(devices) {
  const key = JSON.stringify(devices);
  if (by("devices").dataset.key === key) return;
  by("devices").dataset.key = key;
  const severity = ["fault", "warning", "works", "absent"];
  const sorted = [...devices].sort((a, b) => severity.indexOf(a.level) - severity.indexOf(b.level));
  by("devices").replaceChildren(
    ...sorted.map((device) => {
      const [shape, look] = LEVELS[device.level] ?? ["?", ""];
      const badge = element("span", `badge ${look}`, `${shape} ${device.level}`);
      const line = element("div", "", badge, " ", element("b", "", device.name), " ", element("span", "muted", device.level === "works" ? "" : device.cause));
      return element("li", "", line, ...(device.action ? [element("div", "todo", `\u2192 ${device.action}`)] : []));
    }),
  );
}

/** @param {any[]} boats */
function showReserve(boats) {
  const names = boats.filter((boat) => boat.in_reserve).map((boat) => boat.name);
  const list = /** @type {HTMLSelectElement} */ (by("reserve"));
  by("inject-form").hidden = names.length === 0;
  say(by("reserve-note"), names.length === 0 ? "the scenario has none, or all have joined" : "Without bearing and range a boat joins where the scenario says.");
  if (list.dataset.key === names.join("\n")) return;
  list.dataset.key = names.join("\n");
  const chosen = list.value;
  list.replaceChildren(...names.map((name) => new Option(name, name, false, name === chosen)));
}

/** @param {any} news */
export function showScore(news) {
  const { score, error, unknown, run, finished } = news;
  const of = `run ${run}, ${finished ? "ended" : "goes on"}${unknown ? `; ${unknown} events are of a newer version and do not count` : ""}`;
  say(by("score-note"), error ?? of);
  scored = new Map((score?.boats ?? []).map((/** @type {any} */ boat) => [boat.name, boat]));
  if (!score) {
    say(by("points"), "-");
    by("score").replaceChildren();
    return;
  }
  say(by("points"), score.points === null ? "no points" : `${shown(score.points)} of 100`);
  const { rounds, calls } = score;
  by("score").replaceChildren(
    ...score.items.map((/** @type {any} */ item) => row([item.item, `${shown(item.points)} of ${shown(item.of)}`])),
    row(["rounds, hits", `${rounds.fired}, ${rounds.hits}`]),
    ...(rounds.neutral_hits ? [row(["NEUTRAL boats struck, rounds", String(rounds.neutral_hits)])] : []),
    ...(score.breaches.length ? [row(["RULES broken, bursts", String(score.breaches.length)])] : []),
    row(["threats stopped, turned away", `${score.stopped} and ${score.turned_away} of ${score.hostile}`]),
    row(["calls in time, late, missing", `${calls.in_time}, ${calls.late}, ${calls.missing} of ${calls.asked}`]),
  );
}
