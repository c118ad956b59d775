// @ts-check
// Plots of aimed misses: about the target, and over time.

import uPlot from "uplot";
import { colour } from "bowwave/plane";

/** @typedef {import("./run.js").Run} Run */

/** @param {HTMLElement} host @param {string} title @param {string} x @param {string} y @param {boolean} isTime */
function options(host, title, x, y, isTime) {
  const ink = colour(host, "element-active-color");
  const grid = { stroke: colour(host, "border-divider-color"), width: 1 };
  const tone = colour(host, "instrument-enhanced-secondary-color");
  return {
    title,
    width: Math.max(host.clientWidth, 200),
    height: isTime ? 200 : 320,
    legend: { show: false },
    cursor: { drag: { x: false, y: false } },
    scales: { x: { time: false } },
    axes: [
      { label: x, stroke: ink, grid },
      { label: y, stroke: ink, grid },
    ],
    series: [{}, { stroke: tone, paths: () => null, points: { show: true, size: 7, fill: tone } }],
  };
}

/** @param {HTMLElement | null} group @param {HTMLElement | null} errors @param {Run} run */
export function drawShots(group, errors, run) {
  const aimed = run.rounds.filter((round) => round.error_m !== null);
  /** @param {any} round */
  const error = (round) => /** @type {number[]} */ (round.error_m);
  if (group) {
    const sorted = [...aimed].sort((a, b) => error(a)[0] - error(b)[0]);
    const sizes = aimed.map((round) => Math.max(Math.abs(error(round)[0]), Math.abs(error(round)[1]))).sort((a, b) => a - b);
    // A few that went far off must not hide how the others lie.
    const reach = 1.3 * Math.max(2, sizes[Math.floor(0.8 * (sizes.length - 1))] ?? 0);
    const beyond = sizes.filter((size) => size > reach).length;
    const title = beyond > 0 ? `Misses about the target, ${beyond} farther off` : "Misses about the target";
    const shape = options(group, title, "to the right, m", "over, m", false);
    const scales = { x: { time: false, range: () => [-reach, reach] }, y: { range: () => [-reach, reach] } };
    group.replaceChildren();
    new uPlot(/** @type {any} */ ({ ...shape, scales }), [sorted.map((r) => error(r)[0]), sorted.map((r) => error(r)[1])], group);
  }
  if (errors) {
    const shape = options(errors, "Error over the run", "seconds", "m", true);
    errors.replaceChildren();
    const size = aimed.map((round) => Math.hypot(error(round)[0], error(round)[1]));
    new uPlot(/** @type {any} */ (shape), [aimed.map((round) => round.fired_s), size], errors);
  }
}
