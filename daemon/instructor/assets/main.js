// @ts-check
// Joins connection, picture, chart, commands and panels.

import { LiveChart } from "./chart.js";
import { Commands } from "./commands.js";
import { Connection } from "./connection.js";
import { ask, by, log, say } from "./dom.js";
import { showScore, showStatus } from "./panels.js";
import { LivePicture } from "./picture.js";
import { Scenarios } from "./scenarios.js";

/** Milliseconds without news after which the page says so. */
const NO_NEWS = 2000;

const connection = new Connection();
const picture = new LivePicture(connection);
const chart = new LiveChart();
const commands = new Commands(connection);
const scenarios = new Scenarios();

const state = {
  /** @type {{joined: boolean, words: string}} */
  link: { joined: false, words: "the trainer is not reached yet" },
  /** @type {string | null} */
  name: null,
  asks: true,
  /** A session that ends was ended here. */
  leaves: false,
  /** Control is taken once somebody is logged in. */
  wants: false,
  number: -1,
  /** When the number rose last. */
  risen: performance.now(),
};

/** @param {HTMLElement} dialog */
const open = (dialog) => /** @type {HTMLDialogElement} */ (dialog).showModal();
/** @param {HTMLElement} dialog */
const close = (dialog) => /** @type {HTMLDialogElement} */ (dialog).close();

/** Says what is lost or old. */
function showStrip() {
  const since = (performance.now() - state.risen) / 1000;
  const old = since * 1000 > NO_NEWS;
  let words = "";
  if (!connection.isOpen) words = `Server lost, trying again. No news for ${since.toFixed(0)} s.`;
  else if (!state.link.joined) words = `Trainer lost, trying again: ${state.link.words}`;
  else if (old) words = `No news of the trainer for ${since.toFixed(0)} s.`;
  const isOld = !connection.isOpen || !state.link.joined || old;
  document.body.classList.toggle("old", isOld);
  by("strip").hidden = !isOld;
  // Seconds that pass are seen, and not read out each time.
  by("strip").setAttribute("aria-live", by("strip").textContent ? "off" : "assertive");
  say(by("strip"), words);
}
setInterval(showStrip, 500);

connection.on("state", ({ open: isOpen }) => {
  if (!isOpen) showControl(null, false);
  showStrip();
});
connection.on("link", (news) => {
  if (news.joined !== state.link.joined) log(news.joined ? `${news.words} is joined` : "the trainer is lost", news.joined ? "" : "alarm");
  state.link = news;
  // A trainer that was started again counts from the beginning.
  state.number = -1;
  showStrip();
});
connection.on("status", ({ status }) => {
  if (status.number > state.number) state.risen = performance.now();
  state.number = status.number;
  showStatus(status);
  chart.update(status);
  commands.isPaused = status.is_paused;
  say(/** @type {HTMLElement} */ (by("pause").firstElementChild), status.is_paused ? "Go on" : "Pause");
  by("pause").classList.toggle("strong", status.is_paused);
  document.querySelectorAll("[data-command*=rules]").forEach((button) => {
    const isSet = status.rules !== null && (button.getAttribute("data-command") ?? "").includes(`"${status.rules}"`);
    button.setAttribute("aria-pressed", String(isSet));
  });
  canLoad = status.can_load;
  say(by("start-note"), canLoad ? "" : "The trainer cannot begin another scenario now.");
  showStrip();
  enable();
});
let canLoad = true;

connection.on("score", showScore);
connection.on("notice", ({ words }) => log(words));
connection.on("refused", ({ words }) => log(words, "alarm"));
connection.on("ended", ({ words }) => state.leaves || log(words, "alarm"));
connection.on("you", ({ name, asks_for_token }) => {
  state.name = name;
  state.leaves = false;
  state.asks = asks_for_token;
  say(by("session"), name === null ? "Log in" : "Log out");
  by("session").title = name === null ? "with a token" : `logged in as ${name}`;
  scenarios.load(name !== null);
  enable();
  if (name !== null && state.wants) commands.control();
  state.wants = false;
});
connection.on("control", ({ holder, is_own }) => showControl(holder, is_own));

/** @param {string | null} holder @param {boolean} isOwn */
function showControl(holder, isOwn) {
  commands.hasControl = isOwn;
  commands.holder = holder;
  const words = !connection.isOpen ? "control: not known" : isOwn ? "you have control" : holder ? `${holder} has control` : "nobody has control";
  say(by("holder"), words);
  by("holder").classList.toggle("own", isOwn);
  by("control").replaceChildren(isOwn ? "Hand back " : holder ? "Take over " : "Take control ", Object.assign(document.createElement("kbd"), { textContent: "K" }));
  enable();
}

/** Switches on what may be used. */
function enable() {
  document.querySelectorAll(".commands button, .inject button, .words button").forEach((button) => {
    /** @type {HTMLButtonElement} */ (button).disabled = !commands.hasControl;
  });
  for (const id of ["reset", "stand-by", "start"]) /** @type {HTMLButtonElement} */ (by(id)).disabled = !commands.hasControl || !canLoad;
  /** @type {HTMLButtonElement} */ (by("control")).disabled = !connection.isOpen;
  document.body.classList.toggle("watches", !commands.hasControl);
}
enable();

/** Asks for a token where one is wanted. */
async function logIn() {
  if (state.asks) open(by("login"));
  else await login("");
}
by("control").addEventListener("click", () => {
  if (state.name !== null) return commands.control();
  state.wants = true;
  return logIn();
});
by("session").addEventListener("click", async () => {
  if (state.name === null) await logIn();
  else {
    state.leaves = true;
    await ask("POST", "/logout", "").catch((error) => log(error.message, "alarm"));
    connection.again();
  }
});
by("login-cancel").addEventListener("click", () => {
  state.wants = false;
  close(by("login"));
});
by("login").addEventListener("cancel", () => (state.wants = false));
by("login-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  await login(/** @type {HTMLInputElement} */ (by("token")).value);
});

/** @param {string} token */
async function login(token) {
  try {
    const { name } = await (await ask("POST", "/login", token)).json();
    close(by("login"));
    log(`logged in as ${name}`);
    connection.again();
  } catch (error) {
    say(by("login-note"), error instanceof Error ? error.message : String(error));
    if (!state.asks) log(by("login-note").textContent ?? "", "alarm");
  }
  /** @type {HTMLInputElement} */ (by("token")).value = "";
}

by("help-open").addEventListener("click", () => open(by("help")));
by("help-close").addEventListener("click", () => close(by("help")));

const theme = /** @type {HTMLSelectElement} */ (by("theme"));
theme.value = localStorage.getItem("theme") ?? "day";
/** Puts the palette on. */
function dress() {
  document.documentElement.dataset.obcTheme = theme.value;
  localStorage.setItem("theme", theme.value);
  chart.draw();
  scenarios.preview();
}
theme.addEventListener("change", dress);
dress();
performance.mark("interactive");
// Tests and those who look into the page find its parts here.
Object.assign(window, { bowwave: { connection, picture, chart, commands, scenarios, state } });
