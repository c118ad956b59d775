// @ts-check
// Joins time, chart, view, events and tables.

import { colour, fitted } from "bowwave/plane";
import { Chart } from "./chart.js";
import { Clock } from "./clock.js";
import { Film } from "./film.js";
import { Run } from "./run.js";
import { drawShots } from "./shots.js";
import { followTheme } from "./theme.js";
import { View } from "./view.js";

/** @template {HTMLElement} T @param {string} id @returns {T} */
const by = (id) => /** @type {T} */ (document.getElementById(id));

const run = new Run(JSON.parse(by("data").textContent ?? "{}"));
const clock = new Clock(run.end_s);
const chart = new Chart(by("chart"), by("chart-scale"), run);
/** @type {View | null} */
let view = null;
try {
  view = new View(by("view"), by("view-note"), run);
} catch (error) {
  by("view-note").textContent = "This browser draws nothing in three dimensions (WebGL): switch it on, or use the chart.";
  console.warn(error);
}

/** @typedef {{time_s: number, weight: string, words: string, boat: number | null, shot: number | null}} Happening */
/** @type {Happening[]} */
const happenings = [
  ...run.events.map((event) => ({ ...event, shot: null })),
  ...run.rounds.map((r) => ({ time_s: r.fired_s, weight: r.weight, words: `round ${r.shot} ${r.words}`, boat: r.boat, shot: r.shot })),
].sort((a, b) => a.time_s - b.time_s);

/** @type {HTMLTableRowElement[]} */
const rows = happenings.map((happening) => {
  const row = document.createElement("tr");
  row.dataset.time = String(happening.time_s);
  row.tabIndex = 0;
  const [time, what] = [row.insertCell(), row.insertCell()];
  time.className = "number";
  time.textContent = happening.time_s.toFixed(1);
  if (happening.weight !== "plain") {
    const badge = document.createElement("span");
    badge.className = `badge ${happening.weight === "alarm" ? "alarm" : "good"}`;
    badge.textContent = happening.weight === "alarm" ? "!" : "\u2713";
    what.append(badge, " ");
  }
  if (happening.shot === null && happening.boat !== null) what.append(Object.assign(document.createElement("b"), { textContent: run.boats[happening.boat].name }), " ");
  what.append(happening.words);
  return row;
});
by("events").append(...rows);

/** Shows the rows that are wanted. */
function filter() {
  const [rounds, plain] = [by("show-rounds"), by("show-plain")].map((box) => /** @type {HTMLInputElement} */ (box).checked);
  rows.forEach((row, i) => {
    row.hidden = (!rounds && happenings[i].shot !== null) || (!plain && happenings[i].weight === "plain");
  });
  draw();
}
by("show-rounds").addEventListener("change", filter);
by("show-plain").addEventListener("change", filter);

/** Jumps to the time of a row.
 * @param {Event} event */
function jump(event) {
  const row = event.target instanceof Element ? event.target.closest("tr[data-time]") : null;
  if (row instanceof HTMLElement) clock.set(Number(row.dataset.time));
}
for (const id of ["events", "rounds"]) {
  by(id)?.addEventListener("click", jump);
  by(id)?.addEventListener("keydown", (event) => {
    if (event instanceof KeyboardEvent && event.key === "Enter") jump(event);
  });
}
document.querySelectorAll("#rounds tr").forEach((row) => row.setAttribute("tabindex", "0"));

const slider = /** @type {HTMLInputElement} */ (by("time"));
slider.max = String(run.end_s);
slider.addEventListener("input", () => clock.set(Number(slider.value)));
by("play").addEventListener("click", () => clock.play(!clock.plays));
clock.addEventListener("state", () => (by("play").textContent = clock.plays ? "Pause" : "Play"));
by("speed").addEventListener("change", (event) => {
  if (event.target instanceof HTMLSelectElement) clock.speed = Number(event.target.value);
});

/** To the event before or the next one that is shown.
 * @param {number} way */
function stepEvent(way) {
  const shown = happenings.filter((_, i) => !rows[i].hidden).map((happening) => happening.time_s);
  const next = way > 0 ? shown.find((t) => t > clock.now_s + 1e-6) : shown.filter((t) => t < clock.now_s - 1e-6).pop();
  clock.set(next ?? (way > 0 ? run.end_s : 0));
}
by("back").addEventListener("click", () => stepEvent(-1));
by("on").addEventListener("click", () => stepEvent(1));
document.addEventListener("keydown", (event) => {
  const inControl = event.target instanceof Element && event.target.closest("input, select, button, canvas");
  if (inControl || event.ctrlKey || event.altKey || event.metaKey) return;
  /** @type {Record<string, () => void>} */
  const keys = {
    " ": () => clock.play(!clock.plays),
    ArrowLeft: () => stepEvent(-1),
    ArrowRight: () => stepEvent(1),
    ",": () => clock.set(clock.now_s - 0.1),
    ".": () => clock.set(clock.now_s + 0.1),
    Home: () => clock.set(0),
    End: () => clock.set(run.end_s),
  };
  if (event.key in keys) {
    event.preventDefault();
    keys[event.key]();
  }
});

document.querySelectorAll("[data-view]").forEach((button) =>
  button.addEventListener("click", () => {
    /** @type {HTMLSelectElement} */ (by("view-boat")).value = "";
    view?.setMode(/** @type {any} */ (button.getAttribute("data-view")), null);
  }),
);
by("view-boat").addEventListener("change", (event) => {
  const value = event.target instanceof HTMLSelectElement ? event.target.value : "";
  if (value !== "") view?.setMode("boat", Number(value));
});
if (view) {
  view.changed = (mode) =>
    document.querySelectorAll("[data-view]").forEach((b) => b.setAttribute("aria-pressed", String(b.getAttribute("data-view") === mode)));
}
by("chart-in").addEventListener("click", () => (chart.zoom(1 / 1.5), draw()));
by("chart-out").addEventListener("click", () => (chart.zoom(1.5), draw()));
by("chart").addEventListener("wheel", (event) => {
  event.preventDefault();
  if (event instanceof WheelEvent) chart.zoom(event.deltaY > 0 ? 1.15 : 1 / 1.15);
  draw();
});

/** Marks of alarms and successes over the slider. */
function drawMarks() {
  const canvas = /** @type {HTMLCanvasElement} */ (by("marks"));
  const c = fitted(canvas);
  c.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  for (const happening of happenings) {
    const x = (happening.time_s / run.end_s) * canvas.clientWidth;
    const tones = { alarm: "alert-alarm-color", good: "alert-running-color", plain: "instrument-tick-mark-tertiary-color" };
    c.fillStyle = colour(canvas, tones[/** @type {"alarm" | "good" | "plain"} */ (happening.weight)]);
    const high = { alarm: 14, good: 9, plain: 5 }[/** @type {"alarm" | "good" | "plain"} */ (happening.weight)];
    c.fillRect(x - 1, 14 - high, 2, high);
    // An alarm has a flag: colour alone says nothing.
    if (happening.weight === "alarm") c.fillRect(x, 0, 6, 5);
  }
}

let current = -1;
/** Draws everything at the clock's time. */
function draw() {
  const now = clock.now_s;
  slider.value = String(now);
  slider.setAttribute("aria-valuetext", `${now.toFixed(1)} seconds`);
  by("now").textContent = `${now.toFixed(1)} s`;
  chart.draw(now);
  view?.draw(now);
  let newest = happenings.filter((happening) => happening.time_s <= now + 1e-6).length - 1;
  while (newest >= 0 && rows[newest].hidden) newest--;
  if (newest !== current) {
    rows[current]?.removeAttribute("aria-current");
    rows[newest]?.setAttribute("aria-current", "true");
    const row = rows[newest];
    const host = row?.closest(".scroll");
    if (row && host) host.scrollTop = row.offsetTop - host.clientHeight / 2;
    current = newest;
  }
}
clock.addEventListener("time", draw);

/** What depends on size and palette. */
function dress() {
  drawMarks();
  drawShots(by("group"), by("errors"), run);
  draw();
}
followTheme(dress);
window.addEventListener("resize", dress);
dress();
performance.mark("interactive");
/** @type {Film | null} */
let film = null;
if (run.video !== null) {
  film = new Film(/** @type {HTMLVideoElement} */ (by("video")), by("video-note"), run.video, clock);
  film.illustrate(document.querySelectorAll("#rounds tr"));
}
// Tests and those who look into the page find the run here.
Object.assign(window, { bowwave: { run, clock, chart, view, film } });
