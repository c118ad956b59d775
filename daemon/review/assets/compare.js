// @ts-check
// The page of several runs: palette, and the runs that are shown in the plot of misses.

import { followTheme } from "./theme.js";

followTheme(() => {});
document.querySelectorAll("[data-run-shown]").forEach((box) =>
  box.addEventListener("change", () => {
    const isShown = /** @type {HTMLInputElement} */ (box).checked;
    const marks = document.querySelector(`.misses .plot .run-${box.getAttribute("data-run-shown")}`);
    if (marks instanceof SVGElement) marks.style.display = isShown ? "" : "none";
  }),
);
performance.mark("interactive");
// Tests and those who look into the page find this here.
Object.assign(window, { bowwave: {} });
