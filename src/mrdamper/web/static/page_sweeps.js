// Sweeps: many fits, random dampers or heat sinks as one job. Resume goes on with the finished tasks.

import { empty, fill } from "./dom.js";
import { jobForm } from "./forms.js";
import { cardInUse, filesOf, heading, JobPanel } from "./parts.js";
import { firstScreen, restOf } from "./shown.js";

export async function show(place, app, query) {
  const form = jobForm(app, "sweep");
  form.set({ card: cardInUse(app) });
  const panel = new JobPanel(app, "sweep", { form, press: "Start the sweep", done: drawResult });
  const { result } = panel;

  function drawResult(job) {
    fill(result, firstScreen(job), restOf(job), !job.answer.cancelled && filesOf(job, "sweep.html"));
  }

  const nothing = empty("No sweep yet", "Choose campaigns to fit, or a card and a number of random dampers to track, or a card and dampers that get a heat sink. Each result is stored at once: Resume goes on after any end.");
  const title = heading("Sweeps", "Fits of many campaigns, tracking on random dampers, or heat sinks for several dampers: one job, one table.");
  panel.fillPage(place, { title, label: "What to sweep", empty: nothing });
  await panel.resume(null, query.get("job"));
  return {
    changed: (what) => (what.includes("inputs") || what.includes("files")) && form.draw(),
    close: () => panel.close(),
  };
}
