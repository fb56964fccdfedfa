// Loops: runs and cards in one linked view.

import { button, el, empty, fill } from "./dom.js";
import { heading } from "./parts.js";
import { drawable, LinkedView, splitsOf, usualRuns } from "./view.js";

export async function show(place, app, query) {
  const runs = await drawable();
  if (!runs.length) {
    fill(place, heading("Loops", "Force over displacement and over velocity, as damper engineers look at it."), empty("No runs to draw", "Loops are drawn from the runs in the folder. Add files first, and map their channels if they are not understood.", button("Go to Runs", () => app.go("runs"), { class: "main" })));
    return { changed: async (what) => what.includes("files") && (await drawable()).length && app.again() };
  }
  const card = app.state.cards.find(({ name, error }) => name === query.get("card") && !error);
  const fitted = card ? await splitsOf(card.name) : new Map();
  const alike = [(run) => fitted.has(run.name), (run) => run.command_unit === card?.command_unit].map((is) => runs.filter(is)).find((found) => found.length) ?? [];
  const view = new LinkedView(app, runs, { runs: usualRuns(alike.length ? alike : runs) });
  fill(
    place,
    heading("Loops", "Any runs, with any cards over them. Drag over time to see that part in all plots; drag in a loop to zoom into it. The address keeps what you see."),
    el("div", { class: "split" }, el("aside", { class: "panel", "aria-label": "Drawn runs and cards" }, view.aside), view.node),
  );
  return {
    address: (query) => view.read(query),
    changed: (what) => what.includes("cards") && view.drawChoice(),
    close: () => view.close(),
  };
}
