// Navigation: marks of finished steps and of steps that are out of date.

import { cardInUse } from "./parts.js";

const JOB_OF = { heating: "heat", heatsink: "heatsink", tracking: "track", export: "export" };
const DRAWN = ["heat", "heatsink", "export"]; // Kinds of jobs that use the geometry.

/** Return the state `[state, words]` of the step of each page; open steps have no entry. */
export function stepsOf(app) {
  const { state } = app;
  const card = state.cards.find((one) => one.name === cardInUse(app));
  const drawing = app.chosen("drawing");
  const lastOf = (kind, name) => state.jobs.find((job) => job.kind === kind && job.state === "done" && job.options.card === name);
  const steps = {};
  if (state.files.some((file) => file.state === "ready")) steps.runs = ["done", "runs are read"];
  if (card) {
    const since = lastOf("fit", card.name)?.asked_at ?? card.modified;
    const later = state.files.some((file) => file.modified > since);
    if (card.cancelled || !card.converged) steps.fit = ["old", `the fit of ${card.name} ${card.cancelled ? "was cancelled" : "did not converge"}`];
    else steps.fit = later ? ["old", `runs were added or changed after the fit of ${card.name}`] : ["done", `card ${card.name}`];
  }
  if (state.inputs.some((input) => input.kind === "drawing")) steps.drawing = ["done", drawing ?? "a drawing of your own"];
  for (const [page, kind] of Object.entries(JOB_OF)) {
    const job = card && lastOf(kind, card.name);
    if (job) steps[page] = because(job) ? ["old", because(job)] : ["done", job.id];
  }
  return steps;

  /** Return the reason why a job is out of date; empty if it is not. */
  function because(job) {
    if (card.modified > job.asked_at) return `${card.name} has been fitted since`;
    if (!DRAWN.includes(job.kind)) return "";
    const own = job.options.damper;
    if (state.inputs.some((input) => input.name === own && input.modified > job.asked_at)) return `${own} has changed since`;
    return job.kind !== "heatsink" && drawing && own && own !== drawing ? `it is of ${own}, the drawing is ${drawing} now` : "";
  }
}

/** Mark the steps in the navigation. */
export function drawRail(app) {
  const steps = stepsOf(app);
  for (const link of document.querySelectorAll("[data-page]")) {
    const [state, words] = steps[link.dataset.page] ?? ["open", ""];
    link.dataset.step = state;
    link.title = words;
  }
}
