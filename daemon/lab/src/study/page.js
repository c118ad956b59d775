"use strict";
// Shown for three seconds each (Nelson 2009, IV.A); the answer may come as soon as the picture does.
const SHOWN_MS = 3000, PAUSE_MS = 600;
const picture = document.getElementById("picture"), text = document.getElementById("text");
let state = "start", participant = 0, order = [], position = 0, answers = [], since = 0, timer = 0;

function say(html) { text.innerHTML = html; }

function start() {
  const most = STUDY.orders.length;
  say(`<p>You will see ${STUDY.pictures.length} pictures of reflections in the sea, each for three seconds. Some are photographs of
    real reflections, some were drawn by a computer. Say of each which it is, as soon as you like.</p>
    <p>Participant <input id="number" type="number" min="1" max="${most}" autofocus> of 1 to ${most}, then <kbd>Enter</kbd></p>`);
  document.getElementById("number").focus();
}

function begin() {
  const number = Number(document.getElementById("number").value);
  if (!Number.isInteger(number) || number < 1 || number > STUDY.orders.length) { return; }
  participant = number;
  order = STUDY.orders[number - 1];
  answers = kept();
  position = answers.length;
  state = "ready";
  if (position >= order.length) { finish(); return; }
  const again = position > 0 ? `<p>${position} pictures are answered already; it goes on after them.</p>` : "";
  say(`${again}<p><kbd>&rarr;</kbd> or <kbd>R</kbd>: real &nbsp; <kbd>&larr;</kbd> or <kbd>N</kbd>: not real &nbsp;
    <kbd>Backspace</kbd>: take the last answer back</p><p><kbd>Space</kbd> begins</p>`);
}

function show() {
  state = "shown";
  picture.onload = () => {
    picture.style.visibility = "visible";
    since = performance.now();
    timer = setTimeout(() => { picture.style.visibility = "hidden"; }, SHOWN_MS);
  };
  say(`<p>${position + 1} of ${order.length}: real <kbd>&rarr;</kbd> or not <kbd>&larr;</kbd>?</p>`);
  since = performance.now();
  picture.src = STUDY.pictures[order[position]][1];
}

function answer(real) {
  clearTimeout(timer);
  picture.style.visibility = "hidden";
  const ms = Math.round(performance.now() - since);
  answers.push([position + 1, STUDY.pictures[order[position]][0], real ? "real" : "generated", ms]);
  position += 1;
  keep();
  next();
}

function next() {
  state = "pause";
  say("");
  setTimeout(() => { if (position >= order.length) { finish(); } else { show(); } }, PAUSE_MS);
}

function back() {
  if (answers.length === 0) { return; }
  clearTimeout(timer);
  picture.style.visibility = "hidden";
  answers.pop();
  position -= 1;
  keep();
  next();
}

function csv() {
  const lines = answers.map(row => [participant, ...row, STUDY.study].join(","));
  return "participant,position,picture,answer,time_ms,study\n" + lines.join("\n") + "\n";
}

function save() {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([csv()], { type: "text/csv" }));
  link.download = `answers-${participant}.csv`;
  link.click();
}

function finish() {
  state = "done";
  picture.style.visibility = "hidden";
  say(`<p>Thank you. The answers are in the file <b>answers-${participant}.csv</b>.</p>
    <p><button id="save">Save it again</button></p>`);
  document.getElementById("save").onclick = save;
  save();
}

// What was answered outlives a closed window. A browser that keeps nothing for local files loses only that.
const name = () => `study-${STUDY.study}-${participant}`;
function keep() { try { localStorage.setItem(name(), JSON.stringify(answers)); } catch (error) { } }
function kept() {
  try { return JSON.parse(localStorage.getItem(name())) || []; } catch (error) { return []; }
}

document.addEventListener("keydown", event => {
  if (event.repeat) { return; }
  const key = event.key.toLowerCase();
  if (state === "start" && key === "enter") { begin(); }
  else if (state === "ready" && key === " ") { show(); }
  else if (state === "shown" && (key === "arrowright" || key === "r")) { answer(true); }
  else if (state === "shown" && (key === "arrowleft" || key === "n")) { answer(false); }
  else if (state === "shown" && key === "backspace") { back(); }
  else { return; }
  event.preventDefault();
});
start();
