// Controller: force tracking of the controllers that a card supports, and export of model and controller as code.

import { cardFile, getCard } from "./api.js";
import { formOf } from "./forms.js";
import {
  filesOf,
  firstScreen,
  formPanel,
  groundsOf,
  jobOf,
  jobStatus,
  resultOf,
  startButton,
  tabbed,
  tabsOf,
} from "./jobs.js";
import { Link, nth, plot } from "./plot.js";
import { app, cardInUse, choose, chosen, go, once } from "./state.js";
import { button, empty, field, fixed, opening, select, several, tags } from "./ui.js";
import { h, useMemo } from "./vendor/preact.js";

const { a, code, div, h1, p } = tags;
const SHOWN_S = 4; // Time span that the plots show first.
const PLATFORMS = {
  linux64: "Linux (64 bit)",
  win64: "Windows (64 bit)",
  darwin64: "macOS (64 bit)",
};

/** Return a hint that names the controllers which a card does not support, with the reason. */
function missingControllers({ name, controllers }) {
  const missing = app.state.choices.controllers.filter((one) => !controllers.includes(one));
  const banks = missing.filter((one) => one.startsWith("paper"));
  const others = missing.filter((one) => !banks.includes(one));
  const reasons = [
    banks.length &&
      `${banks.join(", ")} (a bank of models, which the law of the card does not allow)`,
    others.length &&
      `${others.join(", ")} (no run of the card steps its current, so that the delay of the force is unknown)`,
  ].filter(Boolean);
  return (
    reasons.length > 0 &&
    p(
      { class: "small", id: "missing-controllers" },
      `Not available for ${name}: ${reasons.join("; ")}.`,
    )
  );
}

/** Return the damper that is tracked first: the preset if all runs of the card are of the virtual rig, else the card itself. */
function plantOf(card) {
  const sources =
    once(`card ${card.name} ${card.modified}`, () => getCard(card.name))?.sources ?? [];
  const presets = new Set(
    sources.map((name) => app.state.files.find((file) => file.name === name)?.rig ?? null),
  );
  const [preset] = presets;
  return presets.size === 1 && app.state.choices.plants.includes(preset) ? preset : card.name;
}

// ------------------------------------------------------------------------------------------------- tracking

function tracking(card) {
  const form = formOf("track", {
    only: { controllers: card.controllers },
    preset: { plant: plantOf(card) },
  });
  const job = jobOf("track", card.name);
  const result = resultOf(job);
  const nothing = empty(
    "Nothing tracked yet",
    "Choose targets, temperatures and controllers, and press Track. It takes seconds for two controllers on one target.",
  );
  return div(
    { class: "split" },
    formPanel(
      "What to track",
      form,
      startButton("track", "Track", form.read),
      missingControllers(card),
    ),
    div(
      jobStatus("track", job),
      result
        ? [
            firstScreen(result),
            exportButtons(result.answer, card),
            tabsOf("track.tab", result, {
              first: [["Plots", () => h(Traces, { answer: result.answer })]],
            }),
            groundsOf(result),
            filesOf(result),
          ]
        : !job && nothing,
    ),
  );
}

/** Return a button for each controller that exports it; the controller of the least error is first. */
function exportButtons({ worst }, { controllers }) {
  const error = (name) =>
    Math.max(
      ...worst
        .filter(({ controller }) => controller === name)
        .map((row) => row.rmse_feasible_N ?? row.rmse_N),
    );
  const names = [...new Set(worst.map(({ controller }) => controller))].filter((name) =>
    controllers.includes(name),
  );
  const one = (name, k) =>
    button(`Export ${name}`, () => choose({ controller: name, "track.page": "Export" }), {
      class: k ? "" : "main",
    });
  return div({ class: "actions" }, names.sort((x, y) => error(x) - error(y)).map(one));
}

/** Plots of force, error and current of one trace. */
function Traces({ answer: { traces = [] } }) {
  const link = useMemo(() => new Link(), []);
  const trace = traces[chosen("track.trace", 0)] ?? traces[0];
  const data = useMemo(() => trace && curvesOf(trace), [trace]);
  if (!trace) return p({ class: "small" }, "No curves.");
  const x = trace.time_s;
  const end = Math.min(x[x.length - 1], x[0] + SHOWN_S);
  const view = chosen("track.view", { x: [Math.min(x[0] + 1, end), end] });
  const onRange = (next) => choose({ "track.view": next ?? { x: [x[0], x[x.length - 1]] } }, true);
  const pane = (title, y, name, height) =>
    plot({
      title,
      x: "time, s",
      y,
      name: `tracking-${name}`,
      height,
      data: data[name],
      link,
      view,
      onRange,
    });
  const options = traces.map((one, k) => [
    String(k),
    `${one.target} at ${fixed(one.temperature_degC, 0)} °C`,
  ]);
  return div(
    field(
      "Trace",
      select(
        options,
        String(traces.indexOf(trace)),
        (k) => choose({ "track.trace": Number(k), "track.view": null }),
        { id: "trace" },
      ),
    ),
    pane("Force", "force, N", "force", 270),
    pane("Error", "error, N", "error", 150),
    pane("Current", "current, A", "current", 150),
  );
}

function curvesOf({ time_s: x, wanted_N: wanted, low_N: low, high_N: high, runs }) {
  const lines = (values, width) =>
    runs.map((run, k) => ({ name: run.controller, x, y: values(run), colour: nth(k), width }));
  const spans = [];
  wanted.forEach((value, k) => {
    const isOut = value < low[k] || value > high[k];
    const last = spans.at(-1);
    if (isOut && last?.k === k - 1) Object.assign(last, { to: x[k], k });
    else if (isOut)
      spans.push({
        from: x[k],
        to: x[k],
        k,
        name: "target out of reach",
        colour: (colours) => colours.outside,
      });
  });
  const target = {
    name: "target",
    x,
    y: wanted,
    colour: (colours) => colours.ink,
    width: 1.6,
    dash: [6, 4],
  };
  return {
    force: {
      series: [target, ...lines((run) => run.force_N, 1.5)],
      areas: [{ name: "attainable force", x, low, high, colour: (colours) => colours.band }],
    },
    error: {
      series: lines((run) => run.force_N.map((value, k) => value - wanted[k]), 1.2),
      spans,
      rules: [{ y: 0 }],
    },
    current: { series: lines((run) => run.command_A, 1.2), spans },
  };
}

// --------------------------------------------------------------------------------------------------- export

function exporting(card) {
  const { controllers, name } = card;
  const preset = { ...(controllers.length ? {} : { content: "model" }), damper: null };
  const form = formOf("export", { only: { controller: controllers }, preset });
  const job = jobOf("export", name);
  const result = resultOf(job);
  const nothing = empty(
    "Nothing made yet",
    "Tick the files and press Make and verify. The C code is compiled on this machine and compared with the model, sample by sample.",
  );
  const file = (path, words) =>
    a({ class: "button", href: cardFile(name, path), download: `${name}-${path}` }, words);
  return div(
    { class: "split" },
    formPanel(
      "What to export",
      form,
      startButton("export", "Make and verify", form.read),
      missingControllers(card),
    ),
    div(
      jobStatus("export", job),
      result ? exportView(result) : !job && nothing,
      p(
        { class: "small" },
        `The card ${name}: ${card.title || card.law}, ${several(card.runs, "run")}. The card is data without code.`,
      ),
      div(
        { class: "actions" },
        file("card.json", "card.json"),
        card.report && [
          opening(cardFile(name, "report.html"), "Report", { class: "button" }),
          file("errors.csv", "errors.csv"),
        ],
      ),
    ),
  );
}

function exportView(job) {
  const { answer } = job;
  const only = (path) => (!path.includes("/") || path.endsWith(".md")) && path !== "job.json";
  const platforms = answer.fmu_platforms?.map((folder) => PLATFORMS[folder] ?? folder);
  const binaries = platforms?.length
    ? `The FMU runs on ${platforms.join(", ")}.`
    : "The FMU has no binary.";
  return div(
    { id: "export-result" },
    firstScreen(job),
    groundsOf(job),
    filesOf(job, { only }),
    platforms &&
      p(
        { class: "small", id: "platforms" },
        `${binaries} For other platforms it contains the C sources.`,
      ),
    answer.fingerprint && p({ class: "small" }, "Fingerprint ", code(answer.fingerprint)),
    tabsOf("export.tab", job),
  );
}

export function ControllerPage() {
  const title = [
    h1("Controller"),
    p(
      { class: "sub" },
      "Force without a force sensor: controllers that are made from a card, and code for the target.",
    ),
  ];
  const card = cardInUse();
  if (!card) {
    const fit = button("Go to Model", () => go("model"), { class: "main" });
    return [
      title,
      empty("No card yet", "Controllers and code are made from a card. Identify one first.", fit),
    ];
  }
  const tabs = [
    ["Try", () => tracking(card)],
    ["Export", () => exporting(card)],
  ];
  return [title, tabbed("track.page", tabs, "Try or export")];
}
