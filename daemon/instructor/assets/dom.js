// @ts-check
// The page's elements.

/** @template {HTMLElement} T @param {string} id @returns {T} */
export const by = (id) => /** @type {T} */ (document.getElementById(id));

/** @param {string} name @param {string} [className] @param {(Node | string)[]} content @returns {HTMLElement} */
export function element(name, className = "", ...content) {
  const made = document.createElement(name);
  if (className) made.className = className;
  made.append(...content);
  return made;
}

/** Sets a text where it differs: what does not change is not read out once more.
 * @param {HTMLElement} host @param {string} text */
export function say(host, text) {
  if (host.textContent !== text) host.textContent = text;
}

/** @param {(string | Node)[]} cells @param {boolean} isHead @returns {HTMLElement} a row; the first cell heads it */
export function row(cells, isHead = false) {
  return element("tr", "", ...cells.map((cell, i) => element(isHead || i === 0 ? "th" : "td", i > 0 ? "number" : "", cell)));
}

/** Adds words to the messages, and has them read out.
 * @param {string} words @param {"" | "alarm"} [weight] */
export function log(words, weight = "") {
  const time = new Date().toTimeString().slice(0, 8);
  const line = element("li", weight, element("time", "muted", time), " ", words);
  by("log").prepend(line);
  while (by("log").children.length > 100) by("log").lastElementChild?.remove();
  by("spoken").textContent = words;
}

/** @param {string} method @param {string} path @param {string} [body] @returns {Promise<Response>} an answer that is none of an error */
export async function ask(method, path, body) {
  const request = { method, body, headers: body === undefined ? undefined : { "Content-Type": "text/plain; charset=utf-8" } };
  const answer = await fetch(path, request).catch(() => null);
  if (!answer) throw new Error("the server is not reached: try again");
  if (!answer.ok) throw new Error((await answer.text()) || `the server answers ${answer.status}`);
  return answer;
}
