// Runs: upload of files, channel maps, list of runs, and findings with their positions.

import { deleteFile, getRuns, putFile } from "./api.js";
import { channelSheet } from "./channels.js";
import { addressed, bytes, button, counted, el, empty, field, filePicker, fill, fixed, note, number, table } from "./dom.js";
import { checkAll, publicData } from "./more_runs.js";
import { jobForm } from "./forms.js";
import { findingTable, heading, JobPanel, removal } from "./parts.js";
import { copiesOf, findingsBetween, runFilters, strangersOf } from "./run_marks.js";

const WORDS = { ready: "ready", reading: "reading", unreadable: "not understood", new: "new" };

export function show(place, app, query) {
  const uploads = el("div", { "aria-live": "polite" });
  const files = el("div");
  const misnamed = el("div");
  const sheet = el("div");
  const runs = el("div");
  const rig = new JobPanel(app, "rig");
  const data = publicData(app);
  const checking = checkAll(app);
  let open = query.get("file");
  let opened = null;
  let known = null;
  let only = Object.fromEntries(query); // Filters of the runs.

  const campaign = jobForm(app, "rig");
  const virtual = el(
    "details",
    {},
    el("summary", { text: "Runs of the virtual rig" }),
    el("p", { class: "small", text: "Simulated runs with sensor noise. Their physics differs from all laws. Your own campaign is a TOML input." }),
    campaign.panel("What to measure", button("Run the campaign", () => rig.start(campaign.read))),
  );

  const { picker, pick } = filePicker(app.state.formats.join(","), upload, { multiple: true, id: "picker" });
  const drop = el(
    "div",
    { class: "drop", id: "drop" },
    el("p", {}, button("Choose files", pick, { class: "main", id: "choose" }), " or drop them here"),
    el("p", { class: "small", text: `${app.state.formats.join(" ")} · up to ${bytes(app.state.most_upload_bytes)} each · they stay in the folder on this machine` }),
    picker,
  );
  for (const name of ["dragenter", "dragover"]) {
    drop.addEventListener(name, (event) => {
      event.preventDefault();
      drop.classList.add("over");
    });
  }
  drop.addEventListener("dragleave", () => drop.classList.remove("over"));
  drop.addEventListener("drop", (event) => {
    event.preventDefault();
    drop.classList.remove("over");
    upload([...event.dataTransfer.files]);
  });

  async function upload(chosen) {
    for (const file of chosen) {
      const line = el("p", { class: "small", text: `${file.name}: sending ${bytes(file.size)} …` });
      uploads.append(line);
      try {
        if (file.size > app.state.most_upload_bytes) throw new Error(`${file.name}: is ${bytes(file.size)}; at most ${bytes(app.state.most_upload_bytes)} can be sent. Put it into the folder's runs/ instead`);
        await putFile(file);
        line.remove();
      } catch (fault) {
        line.replaceWith(note("fault", fault.message));
      }
    }
    await app.attempt(() => app.refresh());
    await draw();
  }

  /** Return the state of a file: "ready" only if at least one of its runs can be used. */
  function stateTag({ name, state }) {
    const own = known?.runs.filter((run) => run.file === name) ?? [];
    const unusable = own.length > 0 && own.every((run) => run.error);
    return el("span", { class: `tag ${unusable ? "fault" : state}`, text: unusable ? "not usable" : WORDS[state] ?? state });
  }

  function drawFiles() {
    const all = app.state.files;
    if (!all.length) {
      fill(
        files,
        empty(
          "No runs yet",
          "A run is one test: time, displacement and force, with the coil current and the temperature where you have them. Drop the files of your rig above. No rig at hand? Take a short campaign of the virtual one.",
          button("Make runs on the virtual rig", (event) => {
            event.target.disabled = true;
            rig.start({ campaign: "short" }).then((taken) => (event.target.disabled = taken));
          }, { id: "virtual" }),
        ),
      );
      return;
    }
    fill(
      files,
      table(
        [
          { title: "file", class: "name", cell: (file) => button(file.name, () => openFile(file.name), { class: "quiet", "aria-expanded": String(open === file.name), title: "Look inside, map channels" }) },
          { title: "state", class: "whole", cell: stateTag },
          { title: "runs", number: true, cell: (file) => (file.state === "ready" ? String(file.runs.length) : "–") },
          { title: "remarks", class: "name", cell: (file) => el("span", { class: "small", text: file.error ?? (file.mapped ? "channels mapped by hand" : "") }) },
          { title: "size", number: true, cell: (file) => bytes(file.bytes) },
          {
            title: "",
            class: "whole",
            cell: (file) =>
              el(
                "span",
                {},
                button(file.state === "unreadable" ? "Map channels" : "Look", () => openFile(file.name), { class: "quiet", "aria-label": `Look into ${file.name}` }),
                removal(app, deleteFile, file.name, () => open === file.name && closeFile()),
              ),
          },
        ],
        all,
        { caption: "Files in the folder", tall: true, rowClass: (file) => (file.name === open ? "chosen" : "") },
      ),
    );
  }

  function closeFile() {
    opened?.close();
    opened = null;
    open = null;
    fill(sheet);
    drawFiles();
  }

  function openFile(name, again = false) {
    if (open === name && opened && !again) {
      closeFile();
      return;
    }
    opened?.close();
    open = name;
    const unread = app.state.files.filter((file) => file.name !== name).map((file) => file.name);
    opened = channelSheet(app, name, unread, { saved: () => app.refresh().then(draw), close: closeFile });
    fill(sheet, opened.node);
    drawFiles();
    sheet.scrollIntoView({ block: "nearest" });
  }

  async function drawRuns() {
    checking.node.hidden = !app.state.files.some((file) => file.state === "ready");
    const told = await app.attempt(() => getRuns());
    if (!told) return;
    known = told;
    drawFiles();
    if (!told.runs.length) {
      fill(runs, told.reading ? el("p", { class: "sub", text: `Reading ${told.reading} file${told.reading > 1 ? "s" : ""} …` }) : null);
      return;
    }
    const inferred = told.runs.flatMap((run) => run.inferred ?? []).slice(0, 12);
    const findings = [...findingsBetween(told.runs), ...told.runs.flatMap((run) => (run.findings ?? []).map((one) => ({ ...one, file: run.file })))].filter((one) => one.severity !== "note");
    const filters = runFilters(told.runs, "filter", { changed: filter });
    const rows = el("div", { class: "gap" });
    for (const { id, list } of filters.lists) list.value = [...list.options].some((one) => one.value === only[id]) ? only[id] : "";

    /** Show the matching runs, and store the filters in the address. */
    function filter() {
      const kept = addressed();
      only = Object.fromEntries(filters.lists.map(({ id, list }) => [id, list.value]));
      for (const [id, value] of Object.entries(only)) {
        if (value) kept.set(id, value);
        else kept.delete(id);
      }
      app.keep(kept);
      fill(rows, runTable(filters.matching(), told.runs));
    }
    filter();

    fill(
      runs,
      el("h2", { text: `${told.runs.length} run${told.runs.length > 1 ? "s" : ""}` }),
      told.reading > 0 && el("p", { class: "small", text: `Still reading ${told.reading} …` }),
      el("div", { class: "row end" }, filters.nodes),
      rows,
      findings.length > 0 && el("h2", { text: "Findings" }),
      findings.length > 0 && findingTable(findings),
      inferred.length > 0 && el("p", { class: "small", text: `Not in a column, taken from names: ${inferred.join("; ")}.` }),
      el("div", { class: "actions" }, button("Look at the loops", () => app.go("loops"), { class: "main" }), button("Fit a model", () => app.go("fit"))),
    );
  }

  async function draw() {
    const { unnamed } = app.state;
    fill(misnamed, unnamed.length > 0 && note("warning", `Names that are not UTF-8 cannot be shown; rename in the folder: ${unnamed.join(", ")}`));
    drawFiles();
    await drawRuns();
  }

  fill(place, heading("Runs", "Measured runs of your damper. If a file cannot be read, the page shows the reason, and you can map its channels."), drop, uploads, virtual, rig.node, data.node, el("h2", { class: "skip", text: "Files" }), misnamed, el("div", { class: "gap" }, files), sheet, runs, checking.node);
  draw();
  rig.resume().catch(() => {});
  checking.panel.resume(null, query.get("job")).catch(() => {});
  if (open) openFile(open, true);
  return {
    changed: (what) => {
      if (what.includes("files") || (known?.reading ?? 0) > 0) draw();
    },
    close: () => {
      opened?.close();
      for (const each of [rig, data, checking]) each.close();
    },
  };
}

/** Return a table of runs. Copies and runs of another damper are found among `all` runs. */
function runTable(shown, all) {
  const units = [...new Set(all.map((run) => run.command_unit).filter(Boolean))];
  const mixed = units.length > 1;
  const unit = units[0] ?? "A";
  const copies = copiesOf(all);
  const strangers = strangersOf(all);
  const isPlain = (run) => !run.error && !run.worst && !copies.has(run) && !strangers.has(run);
  const marks = (run) => [
    isPlain(run) && (run.checked ? el("span", { class: "tag ok", text: "no findings" }) : el("span", { class: "tag running", text: "being checked" })),
    (run.error || run.worst) && el("span", { class: `tag ${run.error ? "fault" : run.worst}`, text: run.error ? "not usable" : run.worst, title: run.error ?? "" }),
    copies.has(run) && el("span", { class: "tag warning", text: "copy", title: `a copy of ${copies.get(run).name}` }),
    strangers.has(run) && el("span", { class: "tag warning", text: "stranger", title: strangers.get(run) }),
  ];
  return table(
    [
      { title: "run", class: "name", cell: (run) => el("a", { href: `#/loops?${new URLSearchParams({ run: run.name, file: run.file })}`, text: run.name, title: run.file }) },
      { title: "findings", cell: (run) => el("span", { class: "row" }, marks(run)) },
      { title: "motion", class: "whole", cell: (run) => run.motion },
      { title: mixed ? "command" : unit === "V" ? "voltage" : "current", unit: mixed ? "" : unit, number: true, cell: (run) => (mixed ? `${commandOf(run)} ${run.command_unit ?? ""}` : commandOf(run)) },
      { title: "temperature", unit: "°C", number: true, cell: (run) => spanOf(run.temperature_range_degC, run.temperature_degC) },
      { title: "samples", number: true, cell: (run) => run.samples && counted(run.samples) },
      { title: "rate", unit: "Hz", number: true, cell: (run) => number(run.rate_Hz, 4) },
      { title: "stroke", unit: "mm", number: true, cell: (run) => number(run.stroke_mm) },
      { title: "speed", unit: "mm/s", number: true, cell: (run) => number(run.peak_velocity_mm_s) },
      { title: "force", unit: "N", number: true, cell: (run) => (run.force_range_N ? `${fixed(run.force_range_N[0], 0)} to ${fixed(run.force_range_N[1], 0)}` : "–") },
    ],
    shown,
    { caption: shown.length < all.length ? `${shown.length} of ${all.length} runs` : "Runs" },
  );
}

function commandOf(run) {
  if (run.command !== null && run.command !== undefined) return fixed(run.command, 2);
  return run.command_range ? `${fixed(run.command_range[0], 2)} to ${fixed(run.command_range[1], 2)}` : "–";
}

function spanOf(range, value) {
  if (value === null || value === undefined) return "–";
  return range && range[1] - range[0] > 2 ? `${fixed(range[0], 0)} to ${fixed(range[1], 0)}` : fixed(value, 0);
}
