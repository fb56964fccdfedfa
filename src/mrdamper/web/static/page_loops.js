// Loops: force over displacement and velocity by current and temperature, the model on top, a span of time brushed.

import { getRuns, modelled, series } from "./api.js";
import { lowerBound } from "./decimate.js";
import { button, el, empty, field, fill, fixed, note, select, table } from "./dom.js";
import { cardField, heading } from "./parts.js";
import { Plot } from "./plot.js";
import { rampColour } from "./theme.js";

const MOST_RUNS = 12;
const MANY_SAMPLES = 400_000; // of all runs together, when there are several
const MODEL_SAMPLES = 200_000;
const REFINE_MS = 250;

export async function show(place, app, query) {
  const { runs: all } = await getRuns();
  const runs = all.filter((run) => !run.error);
  if (!runs.length) {
    fill(place, heading("Loops", "Force over displacement and over velocity, as damper engineers look at it."), empty("No runs to draw", "Loops are drawn from the runs in the folder. Add files first, and map their channels if they are not understood.", button("Go to Runs", () => app.go("runs"), { class: "main" })));
    return { changed: async (what) => what.includes("files") && (await getRuns()).runs.some((run) => !run.error) && app.again() };
  }

  const id = (run) => `${run.file}\u0000${run.name}`;
  const wanted = query.get("run");
  const first = runs.find((run) => run.name === wanted && (!query.get("file") || run.file === query.get("file")));
  const motions = [...new Set(runs.map((run) => run.motion || "other motions"))];
  const commands = [...new Set(runs.map(commandOf))].sort(ordered);
  const warmths = [...new Set(runs.map(warmthOf))].sort(ordered);
  const units = [...new Set(runs.map((run) => run.command_unit).filter(Boolean))].sort();
  const levelOf = (run) => (units.length > 1 && commandOf(run) !== null ? `${fixed(commandOf(run), 2)} ${run.command_unit}` : commandOf(run)); // 1 V is not 1 A
  const inOrder = (a, b) => units.indexOf(a.command_unit) - units.indexOf(b.command_unit) || ordered(commandOf(a), commandOf(b));
  const levels = [...new Set([...runs].sort(inOrder).map(levelOf))];
  const unit = units[0] ?? "A";
  const off = { command: new Set(), warmth: new Set(warmths.length > 1 ? warmths.slice(1) : []) }; // the coldest at first
  let span = null;
  let shown = []; // {run, data, model}
  let asked = new AbortController();
  let timer = null;
  let card = query.get("card") ?? "";
  if (card && !app.state.cards.some((one) => one.name === card)) card = "";

  const one = select([["", "those chosen below"], ...runs.map((run) => [id(run), run.name])], first ? id(first) : "", { id: "one-run" });
  const motion = select([...motions.map((name) => [name, name]), ["*", "all motions"]], mostRuns(runs, motions));
  const chips = (values, dropped, words) =>
    el("div", { class: "chips" }, values.map((value) =>
      button(words(value), (event) => {
        if (dropped.has(value)) dropped.delete(value);
        else dropped.add(value);
        event.target.setAttribute("aria-pressed", String(!dropped.has(value)));
        one.value = "";
        load();
      }, { "aria-pressed": String(!dropped.has(value)) })));
  const filters = el(
    "div",
    { class: "fields" },
    field("Motion", motion, { wide: true }),
    el("div", { class: "field wide" }, el("span", { class: "small", text: units.length > 1 ? "Command" : unit === "V" ? "Voltage, V" : "Current, A" }), chips(levels, off.command, (value) => (value === null ? "varying" : units.length > 1 ? value : fixed(value, 2)))),
    warmths.some((value) => value !== null) &&
      el("div", { class: "field wide" }, el("span", { class: "small", text: "Temperature, °C" }), chips(warmths, off.warmth, (value) => (value === null ? "unknown" : String(value)))),
  );
  const cards = cardField(app, card, (name) => {
    card = name;
    load(true);
  }, { label: "Model on top", none: app.state.cards.length ? "none" : "no card yet: identify one", id: "overlay" });
  cards.list.disabled = !app.state.cards.length;

  const said = el("p", { class: "small", "aria-live": "polite", id: "loops-said" });
  const wrong = el("div");
  const displacement = new Plot({ title: "Displacement loops", x: "displacement, mm", y: "force, N", name: "force-displacement", height: 360 });
  const velocity = new Plot({ title: "Velocity loops", x: "velocity, mm/s", y: "force, N", name: "force-velocity", height: 360 });
  const strip = new Plot({ title: "Force over time: drag to choose a span", x: "time, s", y: "force, N", name: "force-time", height: 210, onBrush: brush });
  const travel = new Plot({ title: "Displacement over time", x: "time, s", y: "displacement, mm", name: "displacement-time", height: 170 });
  const plots = [displacement, velocity, strip, travel];
  for (const plot of plots) plot.options.group = plots;
  for (const plot of [velocity, strip, travel]) plot.legend.remove();
  const errors = el("div");

  const everything = button("Whole time", () => {
    span = null;
    strip.setBrush(null);
    load(true);
  });
  fill(
    place,
    heading("Loops", "Force over displacement and over velocity. Choose runs, drag over the time below to see a part of it; drag in a loop to zoom."),
    el(
      "div",
      { class: "split" },
      el("aside", { class: "panel", "aria-label": "What is drawn" }, el("div", { class: "fields" }, field("Show", one, { wide: true })), el("div", { class: "gap" }, filters), el("div", { class: "gap" }, cards.node), el("div", { class: "actions" }, everything), said),
      el("div", {}, wrong, displacement.legend, el("div", { class: "pair" }, displacement.node, velocity.node), strip.node, travel.node, errors),
    ),
  );
  one.addEventListener("change", () => load());
  motion.addEventListener("change", () => {
    one.value = "";
    load();
  });

  function picked() {
    if (one.value) return runs.filter((run) => id(run) === one.value);
    return runs.filter(
      (run) => (motion.value === "*" || (run.motion || "other motions") === motion.value) && !off.command.has(levelOf(run)) && !off.warmth.has(warmthOf(run)),
    );
  }

  /** Fetch what is chosen and draw it. */
  async function load(keepView = false) {
    asked.abort();
    asked = new AbortController();
    const { signal } = asked;
    filters.classList.toggle("dim", one.value !== "");
    if (!keepView) span = null;
    const matching = picked();
    const chosen = matching.slice(0, MOST_RUNS);
    said.textContent = chosen.length ? "Fetching …" : "Nothing is chosen: press a current or a temperature again.";
    const began = performance.now();
    const max = chosen.length > 1 ? Math.floor(MANY_SAMPLES / chosen.length) : null;
    const cut = span && max ? { from: span[0], to: span[1] } : {};
    try {
      const got = await Promise.all(
        chosen.map(async (run) => {
          const [data, model] = await Promise.all([
            series(run.name, { file: run.file, max, signal, ...cut }),
            card ? modelled(run.name, card, { file: run.file, max: max ?? MODEL_SAMPLES, signal, ...cut }).catch((fault) => (fault.name === "AbortError" ? null : { fault: fault.message })) : null,
          ]);
          return { run, data, model };
        }),
      );
      if (signal.aborted) return;
      shown = got;
      fill(wrong, got.flatMap(({ model }) => (model?.fault ? [note("warning", model.fault)] : [])).slice(0, 2));
      draw(keepView);
      const samples = got.reduce((sum, { data }) => sum + data.head.n, 0);
      const left = matching.length - chosen.length;
      said.textContent = `${got.length} run${got.length === 1 ? "" : "s"}, ${samples.toLocaleString("en-GB").replaceAll(",", " ")} samples${left > 0 ? `; ${left} more are not drawn` : ""}.`;
      said.dataset.ms = String(Math.round(performance.now() - began));
      said.dataset.samples = String(samples);
    } catch (fault) {
      if (fault.name === "AbortError") return;
      said.textContent = "";
      fill(wrong, note("fault", fault.message));
    }
  }

  function brush(from, to) {
    span = from === null ? null : [from, to];
    draw(true);
    clearTimeout(timer);
    if (shown.some(({ data }) => data.head.n < data.head.samples)) timer = setTimeout(() => load(true), REFINE_MS);
  }

  function draw(keepView = false) {
    const drawn = shown.map(({ run }) => run);
    const byWarmth = new Set(drawn.map(levelOf)).size === 1 && new Set(drawn.map(warmthOf)).size > 1;
    const scale = byWarmth ? warmths : commands;
    const colour = (run) => {
      const values = scale.filter((value) => value !== null);
      const at = byWarmth ? warmthOf(run) : commandOf(run);
      const share = values.length > 1 ? (at - values[0]) / (values[values.length - 1] - values[0]) : 0;
      return (colours) => (at === null ? colours.measured : values.length > 1 ? rampColour(share, colours) : colours.accent);
    };
    const xs = [];
    const vs = [];
    const ts = [];
    const ds = [];
    let first = true;
    for (const { run, data, model } of shown) {
      const name = overlay(model) ? `${wording(run, shown)}, measured` : wording(run, shown);
      const overlaid = overlay(model);
      const shared = overlaid ? { key: "measured", quiet: !first } : {};
      first = false;
      const measured = overlaid ? (colours) => colours.measured : colour(run);
      const width = overlaid ? 2.4 : 1.3;
      const [from, to] = within(data.columns.time_s, span);
      const part = (column) => data.columns[column].subarray(from, to);
      xs.push({ name, x: part("displacement_mm"), y: part("force_N"), colour: measured, width, kind: "loop", ...shared });
      vs.push({ name, x: part("velocity_mm_s"), y: part("force_N"), colour: measured, width, kind: "loop", ...shared });
      ts.push({ name, x: data.columns.time_s, y: data.columns.force_N, colour: measured, width: overlaid ? 2 : 1, ...shared });
      ds.push({ name, x: data.columns.time_s, y: data.columns.displacement_mm, colour: colour(run), width: 1, key: overlaid ? `${wording(run, shown)}, model` : name });
    }
    for (const { run, model } of shown) {
      if (!model?.columns) continue;
      const name = `${wording(run, shown)}, model`;
      const [from, to] = within(model.columns.time_s, span);
      const part = (column) => model.columns[column].subarray(from, to);
      xs.push({ name, x: part("displacement_mm"), y: part("force_N"), colour: colour(run), width: 1.3, kind: "loop" });
      vs.push({ name, x: part("velocity_mm_s"), y: part("force_N"), colour: colour(run), width: 1.3, kind: "loop" });
      ts.push({ name, x: model.columns.time_s, y: model.columns.force_N, colour: colour(run), width: 1 });
    }
    displacement.set({ series: xs }, { keepView });
    velocity.set({ series: vs }, { keepView });
    strip.set({ series: ts }, { keepView });
    travel.set({ series: ds }, { keepView });
    strip.setBrush(span);
    travel.setBrush(span);
    drawErrors();
  }

  function drawErrors() {
    const rows = shown.filter(({ model }) => model?.head);
    if (!rows.length) {
      fill(errors);
      return;
    }
    fill(
      errors,
      el("h2", { text: `How far ${card} is off on these runs` }),
      table(
        [
          { title: "run", class: "name", cell: ({ run }) => run.name },
          { title: "RMS error", unit: "N", number: true, cell: ({ model }) => fixed(model.head.rmse_N, 1) },
          { title: "error", unit: "% of spread", number: true, cell: ({ model }) => fixed(model.head.nrmse_percent, 2) },
          { title: "notes", class: "name", cell: ({ model }) => el("span", { class: "small", text: (model.head.notes ?? []).join("; ") }) },
        ],
        rows,
        { caption: "Grey and wide: measured. Thin and coloured: modelled." },
      ),
    );
  }

  load();
  return {
    close() {
      asked.abort();
      clearTimeout(timer);
      for (const plot of plots) plot.close();
    },
  };
}

const overlay = (model) => Boolean(model?.columns);
const commandOf = (run) => (run.command === null || run.command === undefined ? null : Math.round(run.command * 100) / 100);
const warmthOf = (run) => (run.temperature_degC === null || run.temperature_degC === undefined ? null : Math.round(run.temperature_degC / 5) * 5);
const ordered = (a, b) => (a === null ? 1 : b === null ? -1 : a - b);

/** Return the motion with most runs at a constant command. */
function mostRuns(runs, motions) {
  const count = (motion) => runs.filter((run) => (run.motion || "other motions") === motion && run.command !== null).length;
  return motions.reduce((best, each) => (count(each) > count(best) ? each : best));
}

function within(time, span) {
  return span ? [lowerBound(time, span[0]), lowerBound(time, span[1])] : [0, time.length];
}

/** Return what tells a run from the others that are drawn, in as few words as possible. */
function wording(run, shown) {
  const command = run.command === null ? "varying command" : `${fixed(run.command, 2)} ${run.command_unit}`;
  const warmth = run.temperature_degC === null || run.temperature_degC === undefined ? "" : `, ${fixed(run.temperature_degC, 0)} °C`;
  const said = (each) => `${each.command}/${warmthOf(each)}`;
  const twins = shown.filter((other) => said(other.run) === said(run)).length > 1;
  return twins ? run.name : `${command}${warmth}`;
}
