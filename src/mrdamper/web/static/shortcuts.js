// Keyboard shortcuts: g and a letter open a page, ? shows all keys.

import { button, el } from "./dom.js";

const LETTERS = { r: "runs", l: "loops", i: "fit", d: "drawing", h: "heating", s: "heatsink", t: "tracking", e: "export", j: "jobs" };
const LISTS = [["Tab", "the next field or list"], ["Arrows, Home, End", "within a list or a long table"], ["?", "this sheet"], ["Esc", "close it"]];

/** Listen to the keys outside of text fields. */
export function startShortcuts(go, titles) {
  const rows = [...Object.entries(LETTERS).map(([key, page]) => [`g ${key}`, titles[page]]), ...LISTS];
  const sheet = el("dialog", { id: "shortcuts", "aria-label": "Keys" }, el("h2", { text: "Keys" }),
    el("div", { class: "keys" }, rows.map(([keys, what]) => el("p", {}, el("kbd", { text: keys }), el("span", { text: what })))), button("Close", () => sheet.close()));
  document.body.append(sheet);
  let before = "";
  document.addEventListener("keydown", (event) => {
    const typing = event.target.closest("input:not([type=checkbox]):not([type=range]), textarea, select");
    if (typing || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === "?") sheet.showModal();
    else if (before === "g" && event.key in LETTERS) go(LETTERS[event.key]);
    before = event.key;
  });
}
