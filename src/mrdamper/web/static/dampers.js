// Dampers of the server: list, creation and removal. Each damper has its own folder.

import { addDamper, DAMPER_NAME, deleteDamper, getDampers } from "./api.js";
import { button, el, field, fill, note, table } from "./dom.js";
import { removal } from "./parts.js";

const addressOf = (name) => (name === null ? "/" : `/damper/${encodeURIComponent(name)}/`);

const isOpen = ({ name }) => (name ?? "") === DAMPER_NAME;

/** Open the list of dampers when `opener` is pressed. */
export function startDampers(app, opener) {
  const list = el("div");
  const wrong = el("div");
  const name = el("input", { id: "new-damper", maxlength: 60, placeholder: "such as RD-8040 no. 2" });
  const sheet = el("dialog", { id: "dampers", "aria-label": "Dampers" },
    el("h2", { text: "Dampers" }),
    el("p", { class: "small", text: "Each has its own runs, drawing, fits, sinks, controllers and exports, in a folder of its own." }),
    list,
    el("form", { class: "row end", onsubmit: add }, field("Another damper", name), el("button", { class: "main", text: "Create" })),
    wrong,
    el("div", { class: "actions" }, button("Close", () => sheet.close())));
  document.body.append(sheet);
  opener.addEventListener("click", () => draw().then(() => sheet.showModal()));

  async function draw() {
    const told = await app.attempt(getDampers);
    fill(list, told && table([
      { title: "damper", class: "name", cell: (one) => (isOpen(one) ? el("b", { text: one.shown }) : el("a", { href: addressOf(one.name), text: one.shown })) },
      { title: "files", number: true, cell: (one) => String(one.files) },
      { title: "fits", number: true, cell: (one) => String(one.cards) },
      { title: "", class: "whole", cell: (one) => !DAMPER_NAME && !isOpen(one) && removal(app, deleteDamper, one.name, () => sheet.close()) },
    ], told.dampers, { caption: "Dampers on this server" }));
  }

  async function add(event) {
    event.preventDefault();
    try {
      window.location.assign(addressOf((await addDamper(name.value.trim())).name));
    } catch (fault) {
      fill(wrong, note("fault", fault.message)); // The entry stays, to be corrected.
    }
  }
}
