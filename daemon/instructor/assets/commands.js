// @ts-check
// Buttons, keys and forms that order something.

import { by, log } from "./dom.js";

/** @typedef {import("./connection.js").Connection} Connection */

/** Milliseconds within which a second press confirms the first. */
const CONFIRM = 4000;

export class Commands {
  /** @param {Connection} connection */
  constructor(connection) {
    this.connection = connection;
    this.isPaused = false;
    this.hasControl = false;
    /** @type {string | null} */
    this.holder = null;
    /** When somebody else's control was asked for. */
    this.asked = -CONFIRM;
    document.querySelectorAll("[data-command]").forEach((button) =>
      button.addEventListener("click", () => {
        this.give(button.getAttribute("data-command") ?? "");
        this.flash(button);
      }),
    );
    by("pause").addEventListener("click", () => this.order({ order: this.isPaused ? "resume" : "pause" }));
    this.confirmed(by("reset"), () => this.give({ kind: "reset" }));
    this.confirmed(by("stand-by"), () => this.give({ kind: "stand_by" }));
    this.form("message", (text) => ({ order: "message", text }));
    this.form("note", (text) => ({ order: "note", text }));
    by("inject-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.inject();
    });
    document.addEventListener("keydown", (event) => this.key(event));
  }

  /** Takes control, or hands it back. From somebody else it is taken with the second press. */
  control() {
    const now = performance.now();
    if (this.hasControl) this.give({ kind: "hand_back" });
    else if (this.holder && now - this.asked > CONFIRM) {
      this.asked = now;
      log(`${this.holder} has control: once more within ${CONFIRM / 1000} s takes it over`);
    } else this.give({ kind: "take_control" });
  }

  /** @param {any} command @returns {boolean} */
  give(command) {
    const sent = this.connection.send(command);
    if (!sent) log("not sent: the server is not reached", "alarm");
    return sent;
  }

  /** @param {any} order @returns {boolean} */
  order(order) {
    return this.give({ kind: "order", order });
  }

  /** @param {string} id @param {(text: string) => any} order */
  form(id, order) {
    by(`${id}-form`).addEventListener("submit", (event) => {
      event.preventDefault();
      const field = /** @type {HTMLInputElement} */ (by(id));
      const text = field.value.trim();
      if (this.order(order(text)) && this.hasControl) {
        field.value = "";
        log(`${id}: ${text}`);
      }
      field.blur();
    });
  }

  inject() {
    const value = (/** @type {string} */ id) => /** @type {HTMLInputElement} */ (by(id)).value;
    const [bearing, range] = [value("inject-bearing"), value("inject-range")];
    if ((bearing === "") !== (range === "")) {
      log("give both bearing and range, or neither", "alarm");
      return;
    }
    const at = bearing === "" ? null : { bearing_deg: Number(bearing), range_m: Number(range) };
    this.order({ order: "join", boat: value("reserve"), at });
  }

  /** Shows that a button was pressed, whoever pressed it.
   * @param {Element} button */
  flash(button) {
    button.classList.add("pressed");
    setTimeout(() => button.classList.remove("pressed"), 250);
  }

  /** Does something with the second press: the first one may be a slip.
   * @param {HTMLElement} button @param {() => void} does */
  confirmed(button, does) {
    const label = button.textContent ?? "";
    let timer = 0;
    const calm = () => {
      clearTimeout(timer);
      timer = 0;
      button.textContent = label;
      button.classList.remove("sure");
    };
    button.addEventListener("click", () => {
      if (timer) {
        calm();
        does();
      } else {
        button.textContent = `${label}: press again`;
        button.classList.add("sure");
        timer = setTimeout(calm, CONFIRM);
      }
    });
    button.addEventListener("blur", calm);
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const target = event.target instanceof HTMLElement ? event.target : null;
    if (event.key === "Escape") target?.blur();
    const inField = target?.closest("input:not([type=checkbox]), textarea, select");
    const isOff = !(/** @type {HTMLInputElement} */ (by("keys")).checked);
    if (inField || isOff || event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
    if (document.querySelector("dialog[open]")) return;
    const key = event.key.toUpperCase();
    /** @type {Record<string, () => void>} */
    const others = {
      K: () => by("control").click(),
      M: () => by("message").focus(),
      O: () => by("note").focus(),
      "+": () => by("chart-in").click(),
      "-": () => by("chart-out").click(),
      "?": () => by("help-open").click(),
    };
    const button = /^[A-Z]$/.test(key) ? document.querySelector(`[data-key="${key}"]`) : null;
    if (button instanceof HTMLButtonElement && button.disabled) log("you have no control: press K first", "alarm");
    else if (button instanceof HTMLElement) button.click();
    else if (key in others) others[key]();
    else return;
    event.preventDefault();
  }
}
