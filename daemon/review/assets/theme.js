// @ts-check
// The palette, which whoever looks at the page chooses.

/** @param {() => void} changed is called once another palette is in force */
export function followTheme(changed) {
  document.getElementById("theme")?.addEventListener("change", (event) => {
    if (event.target instanceof HTMLSelectElement) document.documentElement.dataset.obcTheme = event.target.value;
    changed();
  });
}
