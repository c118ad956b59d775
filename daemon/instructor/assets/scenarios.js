// @ts-check
// The library: choose, look at, edit, save, start. And the runs that were kept.

import { Plane } from "bowwave/plane";
import { ask, by, element, log, say } from "./dom.js";

/** @typedef {{origin: string, name: string, title: string, briefing: string | null, boats: number, duration_s: number | null, error: string | null}} Listed */
/** @typedef {{line: number, column: number, key: string, problem: string}} Mistake */

/** @param {number | null} seconds @returns {string} */
const lasts = (seconds) => (seconds === null ? "without end" : seconds < 120 ? `${seconds.toFixed(0)} s` : `${(seconds / 60).toFixed(seconds % 60 ? 1 : 0)} min`);

/** @param {unknown} error @returns {string} */
const words = (error) => (error instanceof Error ? error.message : String(error));

export class Scenarios {
  constructor() {
    this.list = /** @type {HTMLSelectElement} */ (by("scenario-list"));
    this.text = /** @type {HTMLTextAreaElement} */ (by("scenario-text"));
    this.name = /** @type {HTMLInputElement} */ (by("save-name"));
    /** @type {Listed[]} */
    this.all = [];
    /** @type {Mistake[]} */
    this.mistakes = [];
    /** @type {any} */
    this.checked = null;
    this.timer = 0;
    this.list.addEventListener("change", () => this.choose());
    this.text.addEventListener("input", () => {
      this.number();
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.check(), 600);
    });
    this.text.addEventListener("scroll", () => (by("gutter").scrollTop = this.text.scrollTop));
    by("check").addEventListener("click", () => this.check());
    by("save").addEventListener("click", () => this.save());
    by("start").addEventListener("click", () => this.start());
    by("edit").addEventListener("click", () => {
      const opens = by("editor").hidden;
      by("editor").hidden = !opens;
      by("edit").setAttribute("aria-expanded", String(opens));
      if (opens) this.text.focus();
    });
    by("runs-load").addEventListener("click", () => this.loadRuns());
    new ResizeObserver(() => this.preview()).observe(by("preview"));
  }

  /** @param {boolean} isKnown whoever is here has a session */
  async load(isKnown) {
    if (!isKnown) {
      this.all = [];
      this.list.replaceChildren();
      say(by("scenarios-note"), "log in to see them");
      return;
    }
    try {
      const { scenarios, can_save } = await (await ask("GET", "/api/scenarios")).json();
      this.all = scenarios;
      say(by("scenarios-note"), `${this.all.length}${can_save ? "" : "; no folder to save in is configured"}`);
      /** @type {HTMLButtonElement} */ (by("save")).disabled = !can_save;
      const chosen = this.list.selectedIndex;
      const option = (/** @type {Listed} */ s) => new Option(`${s.error ? "\u25a0 " : ""}${s.title}${s.origin === "own" ? " (own)" : ""}`);
      this.list.replaceChildren(...this.all.map(option));
      this.list.selectedIndex = chosen;
    } catch (error) {
      say(by("scenarios-note"), words(error));
    }
  }

  async choose() {
    const chosen = this.all[this.list.selectedIndex];
    if (!chosen) return;
    say(by("about-title"), chosen.title);
    say(by("about-facts"), `${chosen.boats} boats, ${lasts(chosen.duration_s)}`);
    say(by("about-briefing"), chosen.briefing ?? "");
    this.name.value = chosen.name;
    try {
      this.text.value = await (await ask("GET", `/api/scenarios/${chosen.origin}/${chosen.name}`)).text();
      await this.check();
    } catch (error) {
      log(words(error), "alarm");
    }
  }

  /** @returns {Promise<void>} */
  async check() {
    try {
      this.checked = await (await ask("POST", "/api/check", this.text.value)).json();
    } catch (error) {
      log(words(error), "alarm");
      return;
    }
    const { mistakes, warnings, title, briefing, boats, duration_s, rules } = this.checked;
    this.mistakes = mistakes;
    this.number();
    if (mistakes.length === 0) {
      say(by("about-title"), title);
      say(by("about-facts"), `${boats.length} boats, ${lasts(duration_s)}${rules ? `, rules ${rules}` : ""}`);
      say(by("about-briefing"), briefing ?? "");
    }
    const lines = mistakes.map((/** @type {Mistake} */ mistake) => {
      const button = element("button", "link", `line ${mistake.line}: ${mistake.key ? `${mistake.key}: ` : ""}${mistake.problem}`);
      button.addEventListener("click", () => this.show(mistake));
      return element("li", "wrong", button);
    });
    by("mistakes").replaceChildren(...lines, ...warnings.map((/** @type {string} */ warning) => element("li", "", warning)));
    this.preview();
  }

  /** Puts the cursor where a mistake is.
   * @param {Mistake} mistake */
  show(mistake) {
    by("editor").hidden = false;
    const lines = this.text.value.split("\n");
    const from = lines.slice(0, mistake.line - 1).reduce((sum, line) => sum + line.length + 1, 0);
    this.text.focus();
    this.text.setSelectionRange(from, from + (lines[mistake.line - 1] ?? "").length);
    this.text.scrollTop = (this.text.scrollHeight / Math.max(lines.length, 1)) * Math.max(mistake.line - 5, 0);
  }

  /** Numbers the lines, and marks those with a mistake. */
  number() {
    const wrong = new Map(this.mistakes.map((mistake) => [mistake.line, mistake.problem]));
    const count = this.text.value.split("\n").length;
    const rows = Array.from({ length: count }, (_, i) => {
      const line = element("span", wrong.has(i + 1) ? "wrong" : "", `${wrong.has(i + 1) ? "\u25a0 " : ""}${i + 1}\n`);
      line.title = wrong.get(i + 1) ?? "";
      return line;
    });
    by("gutter").replaceChildren(...rows);
    by("gutter").scrollTop = this.text.scrollTop;
    this.text.setAttribute("aria-invalid", String(wrong.size > 0));
  }

  preview() {
    const canvas = /** @type {HTMLCanvasElement} */ (by("preview"));
    const boats = this.checked?.boats ?? [];
    canvas.hidden = boats.length === 0;
    if (canvas.hidden) return;
    const far = Math.max(...boats.map((/** @type {any} */ b) => Math.hypot(b.east_m, b.north_m)), this.checked.keep_off_m);
    const plane = new Plane(canvas, far * 1.2);
    plane.rings();
    plane.keepOff(this.checked.keep_off_m);
    boats.forEach((/** @type {any} */ b) => plane.boat(b.name, b.side, [b.east_m, b.north_m], (b.heading_deg * Math.PI) / 180));
    plane.gun();
  }

  async save() {
    try {
      const { saved } = await (await ask("PUT", `/api/scenarios/own/${encodeURIComponent(this.name.value)}`, this.text.value)).json();
      log(`saved as ${saved}`);
      await this.load(true);
    } catch (error) {
      log(words(error), "alarm");
    }
  }

  async start() {
    const day = /** @type {HTMLSelectElement} */ (by("day")).value;
    const name = this.name.value || "scenario";
    try {
      const { changed } = await (await ask("POST", `/api/start/${day}/${encodeURIComponent(name)}`, this.text.value)).json();
      if (changed) log(changed);
    } catch (error) {
      log(words(error), "alarm");
    }
  }

  async loadRuns() {
    try {
      const { runs } = await (await ask("GET", "/api/runs")).json();
      say(by("runs-note"), runs.length === 0 ? "the journal has no runs" : "");
      const rows = runs.map((/** @type {any} */ run) => {
        const link = /** @type {HTMLAnchorElement} */ (element("a", "button", `Review ${run.run}`));
        link.href = `/review/${run.run}`;
        link.target = "_blank";
        link.rel = "noopener";
        const started = (run.started ?? "-").replace("T", " ").replace("Z", " UTC");
        const cells = [link, run.scenario, started, `${run.hits} of ${run.shots}`, run.finished ? "ended" : "goes on"];
        return element("tr", "", ...cells.map((cell) => element("td", "", cell)));
      });
      const head = element("thead", "", element("tr", "", ...["Run", "Scenario", "Begun", "Hits", "State"].map((name) => element("th", "", name))));
      by("runs").replaceChildren(head, element("tbody", "", ...rows));
    } catch (error) {
      say(by("runs-note"), words(error));
    }
  }
}
