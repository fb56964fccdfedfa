// Data: files and their channel maps, runs with findings, and the linked view of the ticked runs.

import { deleteFile, getData, look, putFile } from "./api.js";
import { ChannelSheet } from "./channels.js";
import {
  filesOf,
  findingList,
  firstScreen,
  jobOf,
  jobStatus,
  removal,
  resultOf,
  startButton,
  tabbed,
} from "./jobs.js";
import {
  copiesOf,
  filtersOf,
  findingsBetween,
  idOf,
  matching,
  runList,
  foreignRunsOf,
} from "./runs.js";
import { address, app, attempt, cards, choose, chosen, go, once } from "./state.js";
import {
  button,
  bytes,
  check,
  counted,
  empty,
  field,
  filePicker,
  fixed,
  fold,
  note,
  number,
  select,
  several,
  table,
  tag,
  tags,
  toggled,
} from "./ui.js";
import { characteristics, errorTable, linkedView, splitsOf, usualRuns } from "./view.js";
import { h } from "./vendor/preact.js";

const { a, aside, div, h1, h3, p, span } = tags;
const STATES = { ready: "ready", reading: "reading", unreadable: "not understood", new: "new" };

/** Return the runs that are drawn first: those that the card in the view was fitted to, or of its unit. */
function firstRuns(runs) {
  const [name] = chosen("view.cards", []);
  const fitted = name ? splitsOf(name) : new Map();
  const unit = cards().find((card) => card.name === name)?.command_unit;
  const groups = [(run) => fitted.has(run.name), (run) => run.command_unit === unit, () => true];
  return usualRuns(groups.map((is) => runs.filter(is)).find((found) => found.length) ?? []);
}

export function DataPage() {
  const runs = app.runs.filter((run) => !run.error);
  const ids = chosen("view.runs") ?? firstRuns(runs).map((run) => idOf(run, runs));
  const picked = ids
    .map((id) => runs.find((run) => idOf(run, runs) === id || run.name === id))
    .filter(Boolean);
  const missing = ids.filter(
    (id) => !runs.some((run) => idOf(run, runs) === id || run.name === id),
  );
  const drawn = chosen("view.cards", []).filter((name) =>
    cards().some((card) => card.name === name),
  );
  const file = app.state.files.find(({ name }) => name === chosen("file"));
  const others = app.state.files.map(({ name }) => name).filter((name) => name !== file?.name);
  const close = () => choose({ file: null });
  const { unnamed } = app.state;
  return [
    h1("Data"),
    p(
      { class: "sub" },
      "Measured runs of your damper. If a file cannot be read, the page shows the reason, and you can map its channels.",
    ),
    unnamed.length > 0 &&
      note(
        "warning",
        `Names that are not UTF-8 cannot be shown; rename in the folder: ${unnamed.join(", ")}`,
      ),
    div(
      { class: "split" },
      aside(
        { class: "panel", "aria-label": "Files, runs and cards" },
        dropZone(),
        runs.length > 0 && choices(runs, ids, drawn),
        sources(),
      ),
      div(
        ["rig", "fetch"].map((kind) => jobStatus(kind, jobOf(kind))),
        missing.length > 0 && note("warning", `Not in the folder: ${missing.join(", ")}`),
        app.reading > 0 && p({ class: "small" }, `Reading ${several(app.reading, "file")} …`),
        file
          ? h(ChannelSheet, { key: file.name, name: file.name, others, close })
          : overview(runs, picked, drawn),
      ),
    ),
  ];
}

// --------------------------------------------------------------------------------------------------- left

function dropZone() {
  const over = (event) =>
    event.currentTarget.classList.toggle(
      "over",
      event.type !== "dragleave" && event.type !== "drop",
    );
  const drop = (event) => {
    event.preventDefault();
    over(event);
    upload([...event.dataTransfer.files]);
  };
  const { formats, most_upload_bytes: most } = app.state;
  return div(
    {
      class: "drop",
      id: "drop",
      ondragenter: over,
      ondragover: over,
      ondragleave: over,
      ondrop: drop,
      title: `${formats.join(" ")}, up to ${bytes(most)} each`,
    },
    filePicker("Choose files", formats.join(","), upload, {
      multiple: true,
      id: "picker",
      class: "main",
    }),
    " or drop them here",
    (app.uploads ?? []).map((words) => p({ class: "small" }, words)),
  );
}

async function upload(files) {
  for (const file of files) {
    app.uploads = [`${file.name}: sending ${bytes(file.size)} …`];
    app.draw();
    await attempt(async () => {
      const most = app.state.most_upload_bytes;
      if (file.size > most) {
        throw new Error(
          `${file.name} has ${bytes(file.size)}; at most ${bytes(most)} can be sent. Copy it into the folder runs/ instead.`,
        );
      }
      await putFile(file);
    });
  }
  app.uploads = [];
  app.draw();
  if (files.length === 1) {
    const [{ name }] = files;
    const { error } = await look(name).catch(() => ({}));
    if (error) choose({ file: name }); // Its channels must be mapped.
  }
}

/** Return the choice of runs and cards, and how they are drawn. */
function choices(runs, ids, drawn) {
  const found = matching(runs, "list");
  const take = (next) =>
    choose({ "view.runs": next, "view.t": null, "view.d": null, "view.v": null }, true);
  const set = (name) => (value) => choose({ [`view.${name}`]: value || null }, true);
  const names = cards().map(({ name }) => name);
  const list = (name, words, options) =>
    field(words, select(options, chosen(`view.${name}`, ""), set(name), { id: `view-${name}` }));
  const colours = [["", "what differs"], "command", "temperature", "card", "run"];
  return [
    filtersOf(runs, "list"),
    runList(found, runs, ids, take, { words: "Runs drawn", id: "view-runs" }),
    div(
      { class: "row gap" },
      button(`Take these ${found.length}`, () => take(found.map((run) => idOf(run, runs)))),
      button("None", () => take([])),
    ),
    names.length > 0 && [
      h3({ class: "gap" }, "Cards"),
      div(
        { class: "picks", role: "group", "aria-label": "Cards drawn" },
        names.map((name) =>
          check(name, drawn.includes(name), () => set("cards")(toggled(drawn, name))),
        ),
      ),
    ],
    fold(
      "How it is drawn",
      div(
        { class: "fields" },
        list("colour", "Colour by", colours),
        drawn.length > 1 &&
          list("against", "Residual against", [["", "the measured force"], ...drawn]),
        field(
          "Cycles",
          select(
            [
              ["", "all"],
              ["1", "the last"],
              ["3", "the last 3"],
            ],
            String(chosen("view.cycles", "")),
            (text) => set("cycles")(Number(text)),
            { id: "view-cycles" },
          ),
        ),
        check("centre the displacement", chosen("view.centre", false), set("centre")),
      ),
    ),
  ];
}

/** Return other sources of runs: the virtual rig and public data. */
function sources() {
  const sets = chosen("list.public") ? once("public data", getData)?.sets : null;
  const columns = [
    {
      title: "set",
      class: "name",
      cell: (set) => [
        span(set.title),
        " ",
        span({ class: "small" }, `${set.licence}, ${set.repository}`),
      ],
    },
    {
      title: "",
      cell: (set) =>
        startButton("fetch", "Fetch", () => ({ name: set.name }), {
          id: null,
          "aria-label": `Fetch ${set.title}`,
        }),
    },
  ];
  return [
    p(
      { class: "small" },
      a({ href: address("jobs", { "show.kind": "rig" }) }, "Runs of the virtual rig"),
    ),
    tags.details(
      { ontoggle: (event) => event.target.open && choose({ "list.public": true }) },
      tags.summary("Public data of real dampers"),
      p({ class: "small" }, "The server downloads them from github.com when you press Fetch."),
      sets && table(columns, sets, { label: "Public data" }),
    ),
  ];
}

// --------------------------------------------------------------------------------------------------- right

function overview(runs, picked, drawn) {
  const { files } = app.state;
  const rig = startButton("rig", "Make runs on the virtual rig", () => ({ campaign: "short" }), {
    id: "virtual",
  });
  if (!files.length) {
    const words =
      "A run is one test: time, displacement and force, with the coil current and the temperature if known. Drop the files " +
      "of your rig at the left. Without a rig, start with a short campaign of the virtual rig.";
    return empty("No runs yet", words, rig);
  }
  const all = app.runs;
  const isSevere = ({ severity }) => severity !== "note";
  const findings = [...findingsBetween(all), ...all.flatMap((run) => run.findings ?? [])].filter(
    isSevere,
  );
  const link = (run) =>
    a({ href: address("data", { "view.runs": [idOf(run, runs)], "view.cards": drawn }) }, run.name);
  const isMapNeeded = files.some(({ state }) => state === "unreadable");
  const tabs = [
    runs.length > 0 &&
      !isMapNeeded && ["Plots", () => linkedView({ runs, picked, cards: drawn, prefix: "view" })],
    drawn.length > 0 && ["Errors", () => errorTable(picked, drawn, link)],
    ["Files", () => fileTable(files)],
    isMapNeeded &&
      runs.length > 0 && [
        "Plots",
        () => linkedView({ runs, picked, cards: drawn, prefix: "view" }),
      ],
    all.length > 0 && ["Runs", () => runTable(matching(all, "list"), all)],
    picked.length > 0 && ["Characteristic", () => characteristics(picked)],
    all.length > 0 && [`Findings`, () => checked(findings)],
  ];
  return [
    tabbed("view.tab", tabs, "Parts of the data"),
    runs.length > 0 &&
      div(
        { class: "actions" },
        button("Fit a model", () => go("model"), { class: "main" }),
      ),
  ];
}

/** Return the findings, and the check of all runs as a job with a report. */
function checked(findings) {
  const job = jobOf("check");
  const result = resultOf(job);
  return [
    findings.length
      ? findingList(findings)
      : p({ class: "small" }, "No warnings and no faults were found so far."),
    div(
      { class: "actions" },
      startButton("check", "Check all runs", () => ({}), { class: "" }),
    ),
    jobStatus("check", job),
    result && [firstScreen(result), filesOf(result, { words: "Open the report of the check" })],
  ];
}

/** Return the table of files; a file is "ready" only if at least one of its runs can be used. */
function fileTable(files) {
  const state = ({ name, state: kind }) => {
    const own = app.runs.filter((run) => run.file === name);
    const isUseless = own.length > 0 && own.every((run) => run.error);
    return isUseless ? tag("fault", "not usable") : tag(kind, STATES[kind]);
  };
  const open = (name) => () => choose({ file: name });
  const actions = ({ name, state: kind }) =>
    span(
      { class: "row" },
      button(kind === "unreadable" ? "Map channels" : "Look", open(name), {
        class: "quiet",
        "aria-label": `Look into ${name}`,
      }),
      removal(deleteFile, name),
    );
  return table(
    [
      {
        title: "file",
        class: "name",
        cell: ({ name }) =>
          button(name, open(name), { class: "quiet", title: "Look inside, map channels" }),
      },
      { title: "state", class: "whole", cell: state },
      {
        title: "runs",
        number: true,
        cell: (file) => (file.state === "ready" ? String(file.runs.length) : null),
      },
      {
        title: "remarks",
        class: "name small",
        cell: ({ error, mapped }) => error ?? (mapped ? "channels mapped by hand" : ""),
      },
      { title: "size", number: true, cell: ({ bytes: size }) => bytes(size) },
      { title: "", class: "whole", cell: actions },
    ],
    files,
    { label: "Files in the folder", tall: true },
  );
}

/** Return a table of runs. Copies and runs of another damper are found among `all` runs. */
function runTable(shown, all) {
  const units = [...new Set(all.map((run) => run.command_unit).filter(Boolean))];
  const unit = units.length === 1 ? units[0] : "";
  const [copies, foreign] = [copiesOf(all), foreignRunsOf(all)];
  const range = (pair, digits) => pair && `${fixed(pair[0], digits)} to ${fixed(pair[1], digits)}`;
  const isWide = (pair) => pair && pair[1] - pair[0] > 2;
  const temperature = (run) =>
    isWide(run.temperature_range_degC)
      ? range(run.temperature_range_degC, 0)
      : fixed(run.temperature_degC, 0);
  const command = (run) =>
    `${Number.isFinite(run.command) ? fixed(run.command, 2) : (range(run.command_range, 2) ?? "–")} ${unit ? "" : (run.command_unit ?? "")}`;
  const marks = (run) => [
    run.error && tag("fault", "not usable", run.error),
    !run.error && run.worst && tag(run.worst),
    copies.has(run) && tag("warning", "copy", `a copy of ${copies.get(run).name}`),
    foreign.has(run) && tag("warning", "other damper?", foreign.get(run)),
  ];
  const state = (run) => {
    const found = marks(run).filter(Boolean);
    if (found.length) return span({ class: "row" }, found);
    return run.checked ? tag("ok", "no findings") : tag("running", "being checked");
  };
  const link = (run) =>
    a({ href: address("data", { "view.runs": [idOf(run, all)] }), title: run.file }, run.name);
  const value = (title, unitOfValue, cell) => ({ title, unit: unitOfValue, number: true, cell });
  return table(
    [
      { title: "run", class: "name", cell: link },
      { title: "findings", cell: state },
      { title: "motion", class: "whole", cell: (run) => run.motion },
      value(unit === "A" ? "current" : unit === "V" ? "voltage" : "command", unit, command),
      value("temperature", "°C", temperature),
      value("samples", "", (run) => run.samples && counted(run.samples)),
      value("rate", "Hz", (run) => number(run.rate_Hz, 4)),
      value("stroke", "mm", (run) => number(run.stroke_mm)),
      value("speed", "mm/s", (run) => number(run.peak_velocity_mm_s)),
      value("force", "N", (run) => range(run.force_range_N, 0)),
    ],
    shown,
    {
      label: "Runs",
      note: shown.length < all.length ? `${shown.length} of ${several(all.length, "run")}` : null,
      tall: true,
    },
  );
}
