// Tracking: comparison of force controllers on a simulated damper. The attainable force is shaded.

import { getCard } from "./api.js";
import { button, el, empty, field, fill, fixed, select } from "./dom.js";
import { jobForm } from "./forms.js";
import { cardPage, filesOf, heading, JobPanel, missingControllers } from "./parts.js";
import { Link, nth, Plot } from "./plot.js";
import { firstScreen, restOf } from "./shown.js";

export async function show(place, app, query) {
  const title = heading("Tracking", "Force without a force sensor: controllers made from a card follow targets on a simulated damper: the card itself, or a virtual damper.");
  const { card, about, cards, without } = cardPage(place, app, query, "tracking", title, "A controller is made from a card whose command is in amperes. Identify one first.");
  if (without) return without;
  const form = jobForm(app, "track", { given: { card }, only: { controllers: about.controllers } });
  form.set({ plant: plantOf(app, card, await getCard(card)) });
  const link = new Link();
  const force = new Plot({ title: "Force", x: "time, s", y: "force, N", name: "tracking-force", height: 330, link });
  const error = new Plot({ title: "Error", x: "time, s", y: "error, N", name: "tracking-error", height: 180, link });
  const current = new Plot({ title: "Current", x: "time, s", y: "current, A", name: "tracking-current", height: 180, link });
  const plots = [force, error, current];
  const panel = new JobPanel(app, "track", { form, press: "Track", done: drawResult });

  function drawResult(job) {
    const { answer } = job;
    const traces = answer.traces ?? [];
    const which = select(traces.map((trace, k) => [String(k), `${trace.target} at ${fixed(trace.temperature_degC, 0)} °C`]), "0", { id: "trace" });
    which.addEventListener("change", () => drawTrace(traces[Number(which.value)]));
    fill(
      panel.result,
      firstScreen(job),
      traces.length > 0 && el("div", { class: "row end" }, field("Drawn", which)),
      traces.length > 0 && el("div", { class: "gap" }, force.node, error.node, current.node),
      restOf(job),
      el("div", { class: "actions" }, exported(answer)),
      filesOf(job, "track.html"),
    );
    if (traces.length) drawTrace(traces[0]);
  }

  /** Return a button for each controller that exports it; the controller of the least error is first. */
  function exported(answer) {
    const error = (name) => Math.max(...answer.worst.filter((row) => row.controller === name).map((row) => row.rmse_feasible_N ?? row.rmse_N));
    const names = [...new Set(answer.worst.map((row) => row.controller))].filter((name) => about.controllers.includes(name));
    return names.sort((a, b) => error(a) - error(b)).map((name, k) => button(`Export ${name}`, () => {
      app.choose("controller", name);
      app.go("export", { card });
    }, { class: k ? "" : "main" }));
  }

  function drawTrace(trace) {
    const x = trace.time_s;
    const outside = spansOf(x, trace.wanted_N.map((wanted, k) => wanted < trace.low_N[k] || wanted > trace.high_N[k]));
    const spans = outside.map(([from, to]) => ({ from, to, name: "target out of reach", colour: (colours) => colours.outside }));
    const lines = (values, width) => trace.runs.map((run, k) => ({ name: run.controller, x, y: values(run), colour: nth(k), width }));
    force.set({
      series: [{ name: "wanted", x, y: trace.wanted_N, colour: (colours) => colours.ink, width: 1.6, dash: [6, 4] }, ...lines((run) => run.force_N, 1.5)],
      areas: [{ name: "attainable force", x, low: trace.low_N, high: trace.high_N, colour: (colours) => colours.band }],
    });
    error.set({ series: lines((run) => run.force_N.map((value, k) => value - trace.wanted_N[k]), 1.2), spans, rules: [{ y: 0 }] });
    current.set({ series: lines((run) => run.command_A, 1.2), spans });
    const end = Math.min(x[x.length - 1], x[0] + 4);
    force.look([Math.min(x[0] + 1, end), end]);
  }

  const nothing = empty("Nothing tracked yet", "Choose targets, temperatures and controllers, and press Track. It takes seconds for two controllers on one target.");
  panel.fillPage(place, { title, label: "What to track", first: [cards.node, missingControllers(app, about)], empty: nothing });
  await panel.resume(card, query.get("job"));
  return {
    close() {
      for (const each of [...plots, panel]) each.close();
    },
  };
}

/** Return the damper that is tracked first: the preset if all runs of the card are of the virtual rig, else the card itself. */
function plantOf(app, card, { sources }) {
  const presets = new Set((sources ?? []).map((name) => app.state.files.find((file) => file.name === name)?.rig ?? null));
  const [preset] = presets;
  return presets.size === 1 && app.state.choices.plants.includes(preset) ? preset : card;
}

/** Return the intervals of x in which a condition is true. */
function spansOf(x, holds) {
  const spans = [];
  let from = null;
  holds.forEach((on, k) => {
    if (on && from === null) from = x[k];
    if (!on && from !== null) {
      spans.push([from, x[k]]);
      from = null;
    }
  });
  if (from !== null) spans.push([from, x[x.length - 1]]);
  return spans;
}
