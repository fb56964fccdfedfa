// Cycles: a record of any length, read in one pass; what energy, forces, stiffness and temperature do over its life.

import { button, counted, el, empty, fill, fixed, note, number, table } from "./dom.js";
import { jobForm } from "./forms.js";
import { filesOf, findingTable, heading, JobPanel, notes, tile } from "./parts.js";
import { Link, nth, Plot } from "./plot.js";
import { tint } from "./theme.js";

const PLOTS = [
  { title: "Energy per cycle", y: "energy, J", name: "energy", of: ["energy_J"], beside: ["model_energy_J"] },
  { title: "Peak forces", y: "force, N", name: "peak-forces", of: ["highest_force_N", "lowest_force_N"], beside: ["model_highest_force_N", "model_lowest_force_N"] },
  { title: "The model's error", y: "error, N", name: "model-error", of: ["error_N", "mean_error_N"] },
  { title: "Error, share of spread", y: "RMS error, %", name: "model-error-percent", of: ["error_percent"] },
  { title: "Secant stiffness", y: "stiffness, N/mm", name: "stiffness", of: ["stiffness_N_per_mm"] },
  { title: "Mean temperature", y: "temperature, °C", name: "temperature", of: ["temperature_degC"] },
  { title: "Amplitude", y: "amplitude, mm", name: "amplitude", of: ["amplitude_mm"] },
  { title: "Period", y: "period, s", name: "period", of: ["period_s"] },
];
const FEW = 60; // points that are marked one by one

export async function show(place, app, query) {
  const title = heading("Cycles", "A record of hours or weeks, read in one pass: what every cycle took up, how stiff, strong and warm it was, and how that changes over the damper's life.");
  const names = recordsOf(app);
  if (!names.length) {
    fill(place, title, empty("No record yet", "A record is one file with time, displacement, force and current: an endurance test, or any run. Drop it on the page Runs, or put a file of gigabytes into the folder's records/: it is read here and nowhere else.", button("Go to Runs", () => app.go("runs"), { class: "main" })));
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
    const figures = Object.entries(answer.figures);
    const about = el("p", { class: "small", text: `${job.options.record}: ${answer.understood}` });
    const findings = answer.findings ?? [];
    if (!answer.cycles) {
      fill(result, el("h2", { text: "No cycle was found" }), about, note("warning", `Nothing moves to and fro by ${number(answer.least_stroke_mm)} mm or more in ${counted(answer.rows)} rows. Set a smaller least stroke, or look at the record's channels on the page Runs.`), findings.length > 0 && findingTable(findings, { ofOne: true }));
      return;
    }
    fill(
      result,
      el("div", { class: "tiles", id: "cycles-tiles" },
        tile("cycles", counted(answer.cycles)),
        tile("left out at breaks", counted(answer.broken_cycles)),
        tile("rows read", counted(answer.rows)),
        tile("energy in all", energyOf(answer.energy_J)),
        tile("least stroke", `${number(answer.least_stroke_mm)} mm`)),
      about,
      findings.length > 0 && findingTable(findings, { ofOne: true }),
      answer.model && drawModel(answer.model),
      el("div", { class: "pair gap" }, drawPlots(answer, words)),
      answer.group_cycles > 1 && el("p", { class: "small", text: `Lines are means of ${counted(answer.group_cycles)} cycles each, bands reach from the least cycle to the most.` }),
      el("h2", { text: "Over the record" }),
      table(
        [
          { title: "figure", class: "name", cell: ([name]) => words(name)[0] },
          { title: "unit", class: "whole", cell: ([name]) => words(name)[1] },
          { title: "first", number: true, cell: ([, one]) => number(one.first, 4) },
          { title: "last", number: true, cell: ([, one]) => number(one.last, 4) },
          { title: "change", unit: "% of the first", number: true, cell: ([name, one]) => changeOf(name, one) },
          { title: "mean", number: true, cell: ([, one]) => number(one.mean, 4) },
          { title: "least", number: true, cell: ([, one]) => number(one.least, 4) },
          { title: "most", number: true, cell: ([, one]) => number(one.most, 4) },
          { title: "trend", unit: "per 1000 cycles", number: true, cell: ([, one]) => trendOf(one) },
        ],
        figures,
        { caption: answer.group_cycles > 1 ? `First and last are of ${counted(answer.group_cycles)} cycles each, least and most of single cycles` : "Of single cycles" },
      ),
      filesOf(job, "cycles.html"),
    );
  }

  /** Return the plots of all figures that are known, one below the other or side by side; their views move together. */
  function drawPlots(answer, words) {
    const { cycle, figures } = answer.curves;
    const link = new Link();
    for (const { of, beside = [], ...options } of PLOTS) {
      const shown = of.filter((name) => figures[name]);
      if (!shown.length) continue;
      const plot = new Plot({ x: "cycle, number", height: 230, ...options, name: `cycles-${options.name}`, link });
      const line = (name, rest) => ({ name: words(name)[0], x: cycle, y: numbers(figures[name].mean), ...rest });
      plot.set({
        series: [
          ...shown.map((name) => line(name, { colour: nth(of.indexOf(name)), width: 1.5, ...(cycle.length < FEW ? { radius: 2 } : {}) })),
          ...beside.filter((name) => figures[name]).map((name) => line(name, { colour: (colours) => colours.ink, width: 1.2, dash: [6, 4] })),
        ],
        areas: shown.filter((name) => figures[name].least).map((name) => ({ x: cycle, low: numbers(figures[name].least), high: numbers(figures[name].most), colour: (colours) => tint(nth(of.indexOf(name))(colours), colours.back) })),
      });
      plots.push(plot);
    }
    return plots.map((plot) => plot.node);
  }

  const map = button("Map channels on Runs", () => app.go("runs", app.state.files.some((file) => file.name === record.read()) ? { file: record.read() } : {}), { class: "quiet" });
  const nothing = empty("Nothing counted yet", "Choose a record and press Count the cycles. It is read in batches, a gigabyte in some ten seconds, and a record larger than the memory does no harm. Cancel keeps what was counted until then.");
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

/** Return how far the card that was replayed is off, in all and by temperature. */
function drawModel(model) {
  const more = model.energy_J > 0 ? 100 * (model.model_energy_J / model.energy_J - 1) : null;
  return [
    el("h2", { text: `The model: ${model.title || model.law}` }),
    model.cycles > 0
      ? el("div", { class: "tiles", id: "model-tiles" },
          tile("RMS error", `${number(model.rmse_N)} N`),
          tile("of the spread of the force", `${number(model.nrmse_percent)} %`),
          tile("of its peak", `${number(model.percent_of_peak)} %`),
          tile("mean error", `${number(model.mean_error_N)} N`),
          more !== null && tile("energy against measured", `${more > 0 ? "+" : ""}${fixed(more, 1)} %`))
      : note("warning", "No cycle has a force of the model."),
    (model.by_temperature ?? []).length > 0 && table(
      [
        { title: "cycles at", unit: "°C", class: "whole", cell: (bin) => `${fixed(bin.from_degC, 0)} to ${fixed(bin.to_degC, 0)}` },
        { title: "cycles", number: true, cell: (bin) => counted(bin.cycles) },
        { title: "RMS error", unit: "N", number: true, cell: (bin) => number(bin.rmse_N) },
        { title: "RMS error", unit: "% of spread", number: true, cell: (bin) => number(bin.nrmse_percent) },
        { title: "mean error", unit: "N", number: true, cell: (bin) => number(bin.mean_error_N) },
        { title: "energy", unit: "J per cycle", number: true, cell: (bin) => number(bin.energy_J / bin.cycles) },
        { title: "the model's", unit: "J per cycle", number: true, cell: (bin) => number(bin.model_energy_J / bin.cycles) },
      ],
      model.by_temperature,
      { caption: "Errors by the mean temperature of the cycle", tall: true },
    ),
    notes(model.notes),
  ];
}

const numbers = (values) => values.map((value) => value ?? NaN);
const energyOf = (joules) => (Math.abs(joules) >= 1e6 ? `${number(joules / 1e6)} MJ` : Math.abs(joules) >= 1e3 ? `${number(joules / 1e3)} kJ` : `${number(joules)} J`);

function changeOf(name, one) {
  if (name === "temperature_degC" || !one.first) return "–"; // degrees have no share
  return fixed(100 * (one.last / one.first - 1), 1); // a force that comes nearer to zero gets less, whatever its sign
}

function trendOf({ trend_per_1000_cycles: trend, mean }) {
  return number(Math.abs(trend) < 1e-9 * Math.abs(mean) ? 0 : trend, 3); // else the rounding of sums is shown
}
