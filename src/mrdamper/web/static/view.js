// Linked view: measured and modelled forces of runs as loops and versus time, with one cursor and one time span.
//
// The address contains all choices: `run`, `card`, `colour`, `against`, `hide`, `without`, `t` (time span), `d` and `v`
// (ranges of the loops). Each zoom is a step of the browser's history, so that Back undoes it.

import { getCard, getRuns, modelled, series } from "./api.js";
import { addressed, button, check, counted, el, field, fill, fixed, note, select, table } from "./dom.js";
import { cardsOf } from "./forms.js";
import { Link, nth, Plot } from "./plot.js";
import { commandOf, motionOf, runFilters, temperatureOf } from "./run_marks.js";
import { rampColour } from "./theme.js";

const PANES = [
  { id: "d", title: "Displacement loops", x: "displacement, mm", y: "force, N", of: ["displacement_mm", "force_N"], name: "force-displacement", height: 350 },
  { id: "v", title: "Velocity loops", x: "velocity, mm/s", y: "force, N", of: ["velocity_mm_s", "force_N"], name: "force-velocity", height: 350 },
  { id: "f", title: "Force over time", y: "force, N", of: ["time_s", "force_N"], name: "force-time", height: 200 },
  { id: "r", title: "Residual over time", y: "residual, N", of: ["time_s", "residual_N"], name: "residual-time", height: 165 },
  { id: "x", title: "Displacement over time", y: "displacement, mm", of: ["time_s", "displacement_mm"], name: "displacement-time", height: 175 },
  { id: "A", title: "Current over time", y: "current, A", of: ["time_s", "command_A"], name: "current-time", height: 145, fromZero: true },
  { id: "V", title: "Voltage over time", y: "voltage, V", of: ["time_s", "command_V"], name: "voltage-time", height: 145, fromZero: true },
  { id: "T", title: "Temperature over time", y: "temperature, °C", of: ["time_s", "temperature_degC"], name: "temperature-time", height: 165 },
];
/** Keys of the view in an address. */
export const CHOSEN = ["run", "file", "card", "colour", "against", "hide", "without", "t", "d", "v"];

const MOST_SAMPLES = 2_200_000; // Sum of all curves.
const AT_ONCE = 4; // Parallel requests.
const SPLITS = { training: "training", held_out: "held out" };
const STEP_MS = 150;
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3]];

/** Return the id of a run in an address: its name, with the file if another run has the same name. */
export const idOf = (run, runs) => (runs.some((other) => other !== run && other.name === run.name) ? `${run.file}|${run.name}` : run.name);

/** Linked view of a page. */
export class LinkedView {
  /**
   * @param {object} app
   * @param {object[]} runs available runs
   * @param {{runs?: object[], cards?: string[]}} first choice if the address contains no choice
   */
  constructor(app, runs, first = {}) {
    Object.assign(this, { app, runs, first, fetched: new Map(), splits: new Map(), shown: [], timer: null, asked: new AbortController() });
    this.link = new Link();
    this.link.onToggle = () => this.write(true);
    this.plots = PANES.map(({ of, id, ...options }) => {
      const plot = new Plot({ x: "time, s", ...options, link: this.link, onView: () => this.zoomed(plot), onSelect: (span) => this.select(span ?? this.state.t) });
      plot.pane = { id, of };
      if (id !== "d") plot.legend.remove();
      return plot;
    });
    this.said = el("p", { class: "small", "aria-live": "polite", id: "loops-said" });
    this.wrong = el("div");
    this.errors = el("div");
    this.panes = el("div", { class: "chips", role: "group", "aria-label": "Plots" });
    this.undo = button("Undo zoom", () => window.history.back(), { title: "Ctrl+Z, or the browser's Back" });
    this.redo = button("Redo zoom", () => window.history.forward(), { title: "Ctrl+Y, or the browser's Forward" });
    const [d, v, ...over] = this.plots;
    this.node = el("div", { class: "linked" },
      el("div", { class: "row" }, this.undo, this.redo, button("Whole", () => this.change({ t: null, d: null, v: null }), { title: "All of every plot" }), this.panes),
      this.wrong, d.legend, el("div", { class: "pair" }, d.node, v.node), over.map((plot) => plot.node), this.errors);
    this.node.addEventListener("keydown", (event) => this.key(event));
    this.aside = el("div");
    this.deepest = window.history.state?.depth ?? 0;
    this.read(addressed());
  }

  /** Read the choices from an address. */
  read(query) {
    const file = query.get("file");
    const wanted = query.getAll("run").filter((id) => id !== "");
    const known = new Set(this.app.state.cards.map((card) => card.name));
    const ranges = (name, count) => {
      const values = (query.get(name) ?? "").split("_").map(Number);
      return query.get(name) && values.length === count && values.every(Number.isFinite) ? values : null;
    };
    const find = (id) => this.runs.find((run) => idOf(run, this.runs) === id || (run.name === id && run.file === file));
    const named = wanted.map(find).filter(Boolean);
    this.missing = wanted.filter((id) => !find(id));
    this.state = {
      runs: query.has("run") ? named : this.first.runs ?? [],
      cards: query.has("card") ? query.getAll("card").filter((name) => known.has(name)) : this.first.cards ?? [],
      colour: query.get("colour") ?? "",
      against: query.get("against") ?? "",
      without: new Set(query.getAll("without")),
      t: ranges("t", 2),
      d: ranges("d", 4),
      v: ranges("v", 4),
    };
    this.link.hidden = new Set(query.getAll("hide"));
    this.drawChoice();
    return this.load();
  }

  /** Write the choices into the address. With `step`, Back undoes the change. */
  write(step) {
    const query = addressed();
    for (const name of CHOSEN) query.delete(name);
    const { runs, cards, colour, against, without, ...ranges } = this.state;
    const add = (name, values) => values.forEach((value) => query.append(name, value));
    add("run", runs.length ? runs.map((run) => idOf(run, this.runs)) : [""]);
    add("card", cards.length ? cards : [""]);
    if (colour) query.set("colour", colour);
    if (against) query.set("against", against);
    add("without", [...without]);
    add("hide", [...this.link.hidden]);
    for (const [name, values] of Object.entries(ranges)) if (values) query.set(name, values.join("_"));
    this.app.keep(query, step);
    this.deepest = window.history.state?.depth ?? 0;
    this.drawSteps();
  }

  /** Change the choices, write them into the address, and show them. */
  change(values) {
    Object.assign(this.state, values);
    this.write(true);
    this.drawChoice();
    return this.load();
  }

  drawSteps() {
    const depth = window.history.state?.depth ?? 0;
    this.deepest = Math.max(this.deepest, depth);
    this.undo.disabled = depth === 0;
    this.redo.disabled = depth === this.deepest;
  }

  key(event) {
    if (!(event.ctrlKey || event.metaKey) || event.target.matches("input")) return;
    const undo = event.key === "z" && !event.shiftKey;
    if (!undo && event.key !== "y" && event.key !== "Z") return;
    event.preventDefault();
    (undo ? this.undo : this.redo).click();
  }

  /** Show a time span in the loops while it is dragged. */
  select(span) {
    this.due ??= requestAnimationFrame(() => {
      this.due = null;
      for (const plot of this.plots.slice(0, 2)) plot.setSpan(this.selected);
    });
    this.selected = span;
  }

  /** Store a range that the user has changed. */
  zoomed(plot) {
    const { id } = plot.pane;
    const loop = id === "d" || id === "v";
    const range = plot.view && (loop ? [...plot.view.x, ...plot.view.y] : plot.view.x);
    this.state[loop ? id : "t"] = range;
    if (!loop) this.select(range);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      this.write(true);
      if (!loop && this.most) this.load(); // Not all samples were fetched.
    }, STEP_MS);
  }

  // ---------------------------------------------------------------------------------------- data

  /** Fetch the chosen data and draw them. */
  async load() {
    this.asked.abort();
    this.asked = new AbortController();
    const { signal } = this.asked;
    const { runs, cards } = this.state;
    delete this.said.dataset.ms;
    this.said.textContent = runs.length ? "Fetching …" : "No run is chosen.";
    const began = performance.now();
    const share = MOST_SAMPLES / Math.max(1, runs.length * (1 + cards.length));
    this.most = runs.some((run) => run.samples > share) ? 2 ** Math.floor(Math.log2(Math.max(64, share))) : null;
    const cut = this.most && this.state.t ? { from: this.state.t[0], to: this.state.t[1] } : {};
    const wanted = runs.flatMap((run) => [null, ...cards].map((card) => ({ run, card, key: JSON.stringify([run.file, run.name, card, this.most, cut]) })));
    for (const key of this.fetched.keys()) if (!wanted.some((one) => one.key === key)) this.fetched.delete(key);
    try {
      const queue = wanted.filter(({ key }) => !this.fetched.has(key));
      const next = async () => {
        for (let one = queue.shift(); one; one = queue.shift()) this.fetched.set(one.key, await this.fetch(one, { max: this.most, ...cut, signal }));
      };
      await Promise.all([...Array(AT_ONCE)].map(next));
      for (const card of cards) if (!this.splits.has(card)) this.splits.set(card, await splitsOf(card));
      if (signal.aborted) return;
      this.shown = wanted.map((one) => ({ ...one, ...this.fetched.get(one.key) }));
      const faults = this.shown.filter(({ fault }) => fault).map(({ fault }) => note("warning", fault));
      fill(this.wrong, this.missing.length > 0 && note("warning", `Not in the folder: ${this.missing.join(", ")}`), faults.slice(0, 2));
      this.draw();
      const samples = this.shown.reduce((sum, { head }) => sum + (head?.n ?? 0), 0);
      this.said.textContent = runs.length ? `${runs.length} run${runs.length === 1 ? "" : "s"}, ${counted(samples)} samples drawn.` : "No run is chosen: tick some, or take another motion.";
      this.said.dataset.ms = String(Math.round(performance.now() - began));
      this.said.dataset.samples = String(samples);
    } catch (fault) {
      if (fault.name === "AbortError") return;
      this.said.textContent = "";
      fill(this.wrong, note("fault", fault.message));
    }
  }

  async fetch({ run, card }, options) {
    if (!card) return series(run.name, { file: run.file, ...options });
    try {
      const found = await modelled(run.name, card, { file: run.file, ...options });
      const { force_N: force, measured_N: measured } = found.columns;
      found.columns.residual_N = force.map((value, k) => value - measured[k]);
      return found;
    } catch (fault) {
      if (fault.name === "AbortError") throw fault;
      return { fault: fault.message, columns: {} };
    }
  }

  // ------------------------------------------------------------------------------------------ drawing

  /** Return the property that colours the curves. */
  colouring() {
    const { colour, cards, runs } = this.state;
    if (colour) return colour;
    if (cards.length > 1) return "card";
    return new Set(runs.map(commandOf)).size === 1 && new Set(runs.map(temperatureOf)).size > 1 ? "temperature" : "command";
  }

  /** Return key and colour of a run by its command or temperature; each unit has its own ramp. */
  colourOf(run, by) {
    if (by === "run") return [run.name, nth(this.runs.indexOf(run))];
    const hot = by === "temperature";
    const [key, value] = hot ? [temperatureOf(run), run.temperature_degC] : [commandOf(run), run.command];
    const alike = this.runs.filter((other) => hot || other.command_unit === run.command_unit);
    const values = alike.map((other) => (hot ? other.temperature_degC : other.command)).filter((each) => each !== null && each !== undefined);
    if (value === null || value === undefined) return [key, nth(3)]; // This colour differs from measured curves and from the ramp.
    const [low, high] = [Math.min(...values), Math.max(...values)];
    if (low === high) return [key, (colours) => colours.accent];
    return [key, (colours) => rampColour((value - low) / (high - low), colours, !hot && run.command_unit === "V")];
  }

  draw() {
    const by = this.colouring();
    const { cards, against, t, d, v } = this.state;
    const curves = this.shown.filter(({ columns }) => columns && Object.keys(columns).length).map((one) => {
      const which = this.wording(one.run);
      const [key, colour] = by === "card" ? [one.card, nth(cards.indexOf(one.card))] : this.colourOf(one.run, by);
      if (one.card) return { ...one, name: `${which}, ${one.card}`, key: by === "card" || cards.length > 1 ? one.card : key, colour, width: 1.3, dash: by === "card" ? [] : DASHES[cards.indexOf(one.card) % DASHES.length] };
      const behind = cards.length > 0 || by === "card"; // Measured curves are grey and wide, below the modelled ones.
      return { ...one, name: behind ? `${which}, measured` : which, key: behind ? "measured" : key, colour: behind ? (colours) => colours.measured : colour, width: behind ? 2.4 : 1.3 };
    });
    if (against) this.subtract(curves, against);
    const named = new Set();
    for (const plot of this.plots) {
      const { id, of: [x, y] } = plot.pane;
      const loop = id === "d" || id === "v";
      const series = curves.filter(({ columns, card }) => columns[x] && columns[y] && (!card || loop || id === "f" || id === "r")).map((one) => ({
        since: id === "r" ? one.head.scored_from_s ?? 0 : 0,
        name: one.name, key: one.key, quiet: id !== "d" || named.has(one.key) || !named.add(one.key), colour: one.colour, width: loop ? one.width : Math.min(2, one.width), dash: one.dash ?? [],
        x: one.columns[x], y: one.columns[y], ...(loop ? { kind: "loop", t: one.columns.time_s } : {}),
      }));
      plot.pane.known = series.length > 0;
      plot.node.hidden = !series.length || this.state.without.has(id);
      const range = loop ? this.state[id] : t;
      plot.view = range ? { x: range.slice(0, 2), y: loop ? range.slice(2) : null } : null;
      plot.span = t;
      plot.options.y = id === "r" && against ? `force less that of ${against}, N` : plot.options.y.replace(/^force less.*/, "residual, N");
      const start = Math.max(0, ...series.map(({ since }) => since));
      const spans = start > 0 ? [{ from: 0, to: start, name: "start, not scored", colour: (colours) => colours.band }] : [];
      plot.set({ series: plot.node.hidden ? [] : series, spans }, { keepView: true });
    }
    this.drawPanes();
    this.drawErrors();
    this.drawSteps();
  }

  /** Subtract the force of one card, instead of the measured force, from the forces of the others. */
  subtract(curves, against) {
    for (const one of curves.filter(({ card }) => card)) {
      const other = curves.find(({ run, card }) => run === one.run && card === against);
      if (other === one) one.columns = { ...one.columns, residual_N: null };
      else if (other) one.columns = { ...one.columns, residual_N: one.columns.force_N.map((value, k) => value - other.columns.force_N[k]) };
    }
  }

  /** Return the shortest text that distinguishes a run from the other shown runs. */
  wording(run) {
    const held = (one) => (this.state.cards.some((card) => this.splits.get(card)?.get(one.name) === "held_out") ? ", held out" : "");
    const said = (each) => `${commandOf(each)}, ${temperatureOf(each)}${held(each)}`.replace(", unknown", "");
    return this.state.runs.filter((other) => said(other) === said(run)).length > 1 ? `${run.name}${held(run)}` : said(run);
  }

  drawPanes() {
    fill(this.panes, this.plots.filter(({ pane }) => pane.known).map(({ pane: { id }, options }) =>
      button(options.title.replace(" over time", ""), () => {
        if (!this.state.without.delete(id)) this.state.without.add(id);
        this.write(true);
        this.draw();
      }, { "aria-pressed": String(!this.state.without.has(id)) })));
  }

  drawErrors() {
    const rows = this.shown.filter(({ head, card }) => card && head);
    if (!rows.length) {
      fill(this.errors);
      return;
    }
    fill(
      this.errors,
      el("h2", { text: rows.length > 1 ? "Errors on these runs" : `Error of ${rows[0].card} on this run` }),
      table(
        [
          { title: "run", class: "name", cell: ({ run }) => run.name },
          { title: "card", class: "whole", cell: ({ card }) => card },
          { title: "in the fit", class: "whole", cell: ({ run, card }) => SPLITS[this.splits.get(card)?.get(run.name)] ?? "not used" },
          { title: "RMS error", unit: "N", number: true, cell: ({ head }) => fixed(head.rmse_N, 1) },
          { title: "error", unit: "% of spread", number: true, cell: ({ head }) => fixed(head.nrmse_percent, 2) },
          { title: "notes", class: "name", cell: ({ head }) => el("span", { class: "small", text: (head.notes ?? []).join("; ") }) },
        ],
        rows,
        { caption: "Errors of the whole run. Grey and wide: measured. Thin and coloured: modelled.", tall: rows.length > 12, rowClass: ({ run, card }) => (this.splits.get(card)?.get(run.name) === "held_out" ? "held" : "") },
      ),
    );
  }

  // ------------------------------------------------------------------------------------------ choices

  /** Draw the lists of runs, cards and colours. */
  drawChoice() {
    const { state, runs } = this;
    const box = (checked, text, onchange) => {
      const made = check(text, checked);
      made.box.addEventListener("change", () => onchange(made.box.checked));
      return made.node;
    };
    const toggled = (values, value, on) => (on ? [...values, value] : values.filter((one) => one !== value));
    this.find ??= el("input", { type: "search", id: "find-run", placeholder: "part of a name" });
    const rows = runs.map((run) => ({ run, node: box(state.runs.includes(run), run.name, (on) => this.change({ runs: toggled(this.state.runs, run, on), t: null, d: null, v: null })) }));
    const found = () => rows.filter(({ run }) => matching.has(run) && run.name.toLowerCase().includes(this.find.value.toLowerCase()));
    this.filters ??= runFilters(runs, "view", { changed: () => this.narrow() });
    let matching = new Set();
    this.narrow = () => {
      matching = new Set(this.filters.matching());
      const shown = new Set(found());
      for (const row of rows) row.node.hidden = !shown.has(row);
      take.textContent = `Take these ${shown.size}`;
    };
    const take = button("", () => this.change({ runs: found().map(({ run }) => run), t: null, d: null, v: null }));
    this.find.oninput = this.narrow;
    const names = cardsOf(this.app).map((card) => card.name);
    const colour = select([["", "what differs"], ["command", "command"], ["temperature", "temperature"], ["card", "card"], ["run", "run"]], state.colour, { id: "colour-by" });
    colour.addEventListener("change", () => this.change({ colour: colour.value }));
    const against = select([["", "the measured force"], ...state.cards], state.against, { id: "against" });
    against.addEventListener("change", () => this.change({ against: against.value }));
    const scrolled = this.aside.querySelector(".picks")?.scrollTop ?? 0;
    fill(
      this.aside,
      el("div", { class: "fields" }, this.filters.nodes, runs.length > 8 && field("Find a run", this.find, { wide: true })),
      el("div", { class: "picks gap", id: "view-runs", role: "group", "aria-label": "Runs drawn" }, rows.map(({ node }) => node)),
      el("div", { class: "row gap" }, take, button("None", () => this.change({ runs: [] }))),
      el("h3", { class: "gap", text: "Cards" }),
      names.length ? el("div", { class: "picks", id: "view-cards", role: "group", "aria-label": "Cards drawn" }, names.map((name) => box(state.cards.includes(name), name, (on) => this.change({ cards: toggled(this.state.cards, name, on) })))) : el("p", { class: "small", text: "None yet: identify one." }),
      el("div", { class: "fields gap" }, field("Colour by", colour), state.cards.length > 1 && field("Residual against", against)),
      this.said,
    );
    this.aside.querySelector(".picks").scrollTop = scrolled;
    this.narrow();
  }

  close() {
    this.asked.abort();
    clearTimeout(this.timer);
    for (const plot of this.plots) plot.close();
  }
}

/** Return how a fit used its runs: name -> `training` or `held_out`. */
export const splitsOf = async (card) => new Map((await getCard(card)).evidence.runs.map((run) => [run.name, run.split]));

/** Return the runs of the most frequent motion with constant command at the lowest temperature. */
export function usualRuns(runs) {
  const motions = [...new Set(runs.map(motionOf))];
  const count = (motion) => runs.filter((run) => motionOf(run) === motion && run.command !== null).length;
  const motion = motions.reduce((best, each) => (count(each) > count(best) ? each : best), motions[0]);
  const alike = runs.filter((run) => motionOf(run) === motion);
  const coldest = Math.min(...alike.map((run) => run.temperature_degC ?? Infinity));
  return alike.filter((run) => coldest === Infinity || Math.abs((run.temperature_degC ?? Infinity) - coldest) < 5);
}

/** Return the runs that can be drawn. */
export const drawable = async () => (await getRuns()).runs.filter((run) => !run.error);
