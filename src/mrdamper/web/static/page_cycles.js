// Cycles: energy, forces, stiffness and temperature of every cycle of a record, over the life of the damper.

import { button, counted, el, empty, fill } from "./dom.js";
import { jobForm } from "./forms.js";
import { filesOf, heading, JobPanel } from "./parts.js";
import { Link, nth, Plot } from "./plot.js";
import { firstScreen, groundsOf, notesOf, tablesOf } from "./shown.js";
import { tint } from "./theme.js";

const PLOTS = [
  { title: "Energy per cycle", y: "energy, J", name: "energy", of: ["energy_J"] },
  { title: "Peak forces", y: "force, N", name: "peak-forces", of: ["highest_force_N", "lowest_force_N"] },
  { title: "Secant stiffness", y: "stiffness, N/mm", name: "stiffness", of: ["stiffness_N_per_mm"] },
  { title: "Mean temperature", y: "temperature, °C", name: "temperature", of: ["temperature_degC"] },
  { title: "Amplitude", y: "amplitude, mm", name: "amplitude", of: ["amplitude_mm"] },
  { title: "Period", y: "period, s", name: "period", of: ["period_s"] },
];
const FEW = 60; // points that are marked one by one

export async function show(place, app, query) {
  const title = heading("Cycles", "Energy, forces, stiffness and temperature of every cycle of a record, and how they change over the life of the damper.");
  const names = recordsOf(app);
  if (!names.length) {
    fill(place, title, empty("No record yet", "A record is one file with time, displacement, force and current: an endurance test, or any run. Drop it on the page Runs, or put a large file into the folder's records/: it is read here and nowhere else.", button("Go to Runs", () => app.go("runs"), { class: "main" })));
    return { changed: () => recordsOf(app).length && app.again() };
  }
  const form = jobForm(app, "cycles");
  const record = form.control("record");
  record.set(query.get("record") ?? names[0]);
  let plots = [];
  const panel = new JobPanel(app, "cycles", {
    form,
    press: "Count the cycles",
    done: drawResult,
    begun: close,
  });
  const { result } = panel;

  function close() {
    for (const plot of plots) plot.close();
    plots = [];
  }

  function drawResult(job) {
    const { answer } = job;
    close();
    const words = (name) => answer.titles[name].split(", ");
    fill(
      result,
      firstScreen(job),
      groundsOf(job),
      answer.cycles > 0 && el("div", { class: "pair gap" }, drawPlots(answer, words)),
      answer.group_cycles > 1 && el("p", { class: "small", text: `Lines are means of ${counted(answer.group_cycles)} cycles each, bands reach from the min to the max of their cycles.` }),
      tablesOf(job),
      notesOf(job),
      filesOf(job, "cycles.html"),
    );
  }

  /** Return the plots of all figures that are known, one below the other or side by side; their views move together. */
  function drawPlots(answer, words) {
    const { cycle, figures } = answer.curves;
    const link = new Link();
    for (const { of, ...options } of PLOTS) {
      const shown = of.filter((name) => figures[name]);
      if (!shown.length) continue;
      const plot = new Plot({ x: "cycle, number", height: 230, ...options, name: `cycles-${options.name}`, link });
      const line = (name, rest) => ({ name: words(name)[0], x: cycle, y: numbers(figures[name].mean), ...rest });
      plot.set({
        series: shown.map((name) => line(name, { colour: nth(of.indexOf(name)), width: 1.5, ...(cycle.length < FEW ? { radius: 2 } : {}) })),
        areas: shown.filter((name) => figures[name].min).map((name) => ({ x: cycle, low: numbers(figures[name].min), high: numbers(figures[name].max), colour: (colours) => tint(nth(of.indexOf(name))(colours), colours.back) })),
      });
      plots.push(plot);
    }
    return plots.map((plot) => plot.node);
  }

  const map = button("Map channels on Runs", () => app.go("runs", app.state.files.some((file) => file.name === record.read()) ? { file: record.read() } : {}), { class: "quiet" });
  const nothing = empty("Nothing counted yet", "Choose a record and press Count the cycles.");
  panel.fillPage(place, { title, label: "What to count", first: [el("p", { class: "small" }, map)], empty: nothing });
  await panel.resume(null, query.get("job"));
  return {
    changed(what) {
      if (what.includes("records") || what.includes("files")) record.draw();
    },
    close() {
      close();
      panel.close();
    },
  };
}

/** Return the names of records and runs' files. */
const recordsOf = (app) => [...app.state.records, ...app.state.files].map((one) => one.name);

const numbers = (values) => values.map((value) => value ?? NaN);
