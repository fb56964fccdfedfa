// What to cite for a card: works by what each is cited for, as text and BibTeX.

import { citeCard } from "./api.js";
import { button, el, save } from "./dom.js";
import { askOnce, notes } from "./parts.js";

/** Return a panel that asks for a card's works when it is opened. */
export function citePanel(card) {
  const body = el("div", { "aria-live": "polite" });
  const node = el("details", { class: "panel", id: "cite" }, el("summary", { text: `Cite: the works behind ${card}` }), body);
  askOnce(node, body, "Looking …", async () => {
    const told = await citeCard(card);
    const bibtex = told.citations.map((one) => one.bibtex).filter(Boolean).join("\n\n");
    return [
      el("ul", { class: "notes" }, told.citations.map((one) => el("li", {}, el("b", { text: `${one.for}: ` }), one.text))),
      notes(told.notes),
      bibtex && el("div", { class: "actions" }, button("Save as BibTeX", () => save(`${card}.bib`, new Blob([`${bibtex}\n`], { type: "text/plain" })), { id: "save-bib" })),
    ];
  });
  return node;
}
