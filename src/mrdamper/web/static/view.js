// Linked view: measured and modelled forces of runs as loops and versus time, with one cursor and one time span.
//
// The choices of a view have its prefix: `t` (time span), `d` and `v` (ranges of the loops), `colour`, `against`, `hide`,
// `without`, `centre` and `cycles`. Each zoom is a step of the browser's history, so that Back undoes it.

import { getCard, samples } from "./api.js";
import { extent, legendOf, Link, nearest, nth, plot } from "./plot.js";
import { commandOf, idOf, temperatureOf } from "./runs.js";
import { app, choose, chosen, once } from "./state.js";
import { rampColour } from "./theme.js";
import { button, counted, fixed, has, note, several, table, tags, toggled } from "./ui.js";
import { h, useEffect, useMemo, useState } from "./vendor/preact.js";

const { div, p } = tags;

const PANES = [
  {
    id: "d",
    title: "Displacement loops",
    x: "displacement, mm",
    y: "force, N",
    of: ["displacement_mm", "force_N"],
  },
  {
    id: "v",
    title: "Velocity loops",
    x: "velocity, mm/s",
    y: "force, N",
    of: ["velocity_mm_s", "force_N"],
  },
  { id: "f", title: "Force over time", y: "force, N", of: ["time_s", "force_N"], height: 160 },
  {
    id: "r",
    title: "Residual over time",
    y: "residual, N",
    of: ["time_s", "residual_N"],
    height: 130,
  },
  {
    id: "x",
    title: "Displacement over time",
    y: "displacement, mm",
    of: ["time_s", "displacement_mm"],
    height: 110,
  },
  {
    id: "A",
    title: "Current over time",
    y: "current, A",
    of: ["time_s", "command_A"],
    height: 100,
    fromZero: true,
  },
  {
    id: "V",
    title: "Voltage over time",
    y: "voltage, V",
    of: ["time_s", "command_V"],
    height: 100,
    fromZero: true,
  },
  {
    id: "T",
    title: "Temperature over time",
    y: "temperature, °C",
    of: ["time_s", "temperature_degC"],
    height: 100,
  },
];
const VALUES = [
  ["force_N", "force", "N", 0],
  ["residual_N", "residual", "N", 0],
  ["displacement_mm", "displacement", "mm", 2],
  ["velocity_mm_s", "velocity", "mm/s", 1],
  ["command_A", "current", "A", 2],
  ["temperature_degC", "temperature", "°C", 1],
];
const SAMPLES_MAX = 2_200_000; // Sum of all curves.
const REQUESTS_MAX = 4; // Parallel requests.
const SPLITS = { training: "training", held_out: "held out" };
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3]];

/** Return how a fit used its runs: name -> `training` or `held_out`; empty until the card has been fetched. */
export function splitsOf(name) {
  const card = app.state.cards.find((one) => one.name === name);
  const runs = once(`card ${name} ${card?.modified}`, () => getCard(name))?.evidence?.runs ?? [];
  return new Map(runs.map((run) => [run.name, run.split]));
}

/** Return the runs of the most frequent motion with constant command at the lowest temperature. */
export function usualRuns(runs) {
  const counts = new Map(runs.map(({ motion }) => [motion, 0]));
  for (const { motion, command } of runs) counts.set(motion, counts.get(motion) + has(command));
  const [motion] = [...counts].sort((x, y) => y[1] - x[1])[0] ?? [];
  const similar = runs.filter((run) => run.motion === motion);
  const coldest = Math.min(...similar.map((run) => run.temperature_degC ?? Infinity));
  return similar.filter((run) => coldest === Infinity || run.temperature_degC < coldest + 5);
}

// -------------------------------------------------------------------------------------------------- samples

/** Fetch the samples of runs and of the forces of cards: `{shown, ms, most}`; `shown` is null during a request. */
function useSamples(picked, cards, span) {
  const [found, set] = useState({ shown: null });
  const fraction = SAMPLES_MAX / Math.max(1, picked.length * (1 + cards.length));
  const isThinned = picked.some((run) => run.samples > fraction);
  const max = isThinned ? 2 ** Math.floor(Math.log2(Math.max(64, fraction))) : undefined;
  const part = isThinned && span ? { from: span[0], to: span[1] } : {};
  const wanted = picked.flatMap((run) => [null, ...cards].map((card) => ({ run, card })));
  const versions = cards.map(
    (name) => app.state.cards.find((card) => card.name === name)?.modified,
  );
  const key = JSON.stringify([
    wanted.map(({ run, card }) => [run.file, run.name, card]),
    versions,
    max,
    part,
  ]);
  useEffect(() => {
    const asked = new AbortController();
    const began = performance.now();
    const shown = [];
    const queue = [...wanted.entries()];
    const next = async () => {
      for (let one = queue.shift(); one; one = queue.shift())
        shown[one[0]] = await fetchOne(one[1]);
    };
    const fetchOne = async ({ run, card }) => {
      const answer = await samples(run, card, { max, ...part, signal: asked.signal }).catch(
        (fault) => {
          if (fault.name === "AbortError") throw fault;
          return { fault: fault.message, columns: {} };
        },
      );
      const { force_N: force, measured_N: measured } = answer.columns;
      if (measured) answer.columns.residual_N = force.map((value, k) => value - measured[k]);
      return { run, card, ...answer };
    };
    set({ shown: null });
    Promise.all([...Array(REQUESTS_MAX)].map(next)).then(
      () => set({ shown, ms: Math.round(performance.now() - began) }),
      (fault) =>
        fault.name === "AbortError" || set({ shown: [{ fault: fault.message, columns: {} }] }),
    );
    return () => asked.abort();
  }, [key]);
  return found;
}

/** Return the columns of the last complete cycles, or all, and with the displacement around its middle. */
function prepared(columns, count, isCentred) {
  const { displacement_mm: x } = columns;
  if (!x || (!count && !isCentred)) return columns;
  const middle = extent(x).reduce((low, high) => (low + high) / 2);
  const rises = [];
  if (count)
    for (let k = 1; k < x.length; k += 1) if (x[k - 1] < middle && x[k] >= middle) rises.push(k);
  const [from, to] =
    rises.length > count && count ? [rises.at(-1 - count), rises.at(-1) + 1] : [0, x.length];
  const all = Object.entries(columns).map(([name, values]) => [name, values?.subarray(from, to)]);
  const cut = Object.fromEntries(all);
  return isCentred
    ? { ...cut, displacement_mm: cut.displacement_mm.map((value) => value - middle) }
    : cut;
}

/** Return key and colour of a run by its command, temperature or name; each unit has its own ramp. */
function colourOf(run, by, runs) {
  if (by === "run") return [run.name, nth(runs.indexOf(run))];
  const isWarm = by === "temperature";
  const [key, value] = isWarm
    ? [temperatureOf(run), run.temperature_degC]
    : [commandOf(run), run.command];
  const similar = runs.filter((other) => isWarm || other.command_unit === run.command_unit);
  const range = extent(
    similar.map((other) => (isWarm ? other.temperature_degC : other.command)).filter(has),
  );
  if (!has(value) || !range) return [key, nth(3)]; // This colour differs from measured curves and from the ramp.
  const fraction = (value - range[0]) / (range[1] - range[0] || 1);
  return [key, (colours) => rampColour(fraction, colours, !isWarm && run.command_unit === "V")];
}

/** Return the curves of samples: measured ones grey and wide below modelled ones. */
function curvesOf(shown, { runs, cards, by, against, cycles, isCentred }) {
  const drawn = shown.map(({ run }) => run).filter((run, k, all) => run && all.indexOf(run) === k);
  const isHeld = (run) => cards.some((card) => splitsOf(card).get(run.name) === "held_out");
  const words = (run) => `${commandOf(run)}, ${temperatureOf(run)}`.replace(", unknown", "");
  const isUnique = (run) => drawn.filter((other) => words(other) === words(run)).length === 1;
  const nameOf = (run) =>
    `${isUnique(run) ? words(run) : run.name}${isHeld(run) ? ", held out" : ""}`;
  const cut = shown
    .filter(({ head }) => head)
    .map((one) => ({ ...one, columns: prepared(one.columns, cycles, isCentred) }));
  const curves = cut.map((one) => {
    const { run, card } = one;
    const [key, colour] =
      by === "card" ? [card, nth(cards.indexOf(card))] : colourOf(run, by, runs);
    if (card) {
      const dash = by === "card" ? [] : DASHES[cards.indexOf(card) % DASHES.length];
      return {
        ...one,
        name: `${nameOf(run)}, ${card}`,
        key: cards.length > 1 ? card : key,
        colour,
        width: 1.3,
        dash,
      };
    }
    const isBelow = cards.length > 0;
    const measured = {
      name: `${nameOf(run)}, measured`,
      key: "measured",
      colour: (colours) => colours.measured,
      width: 2.4,
    };
    return { ...one, ...(isBelow ? measured : { name: nameOf(run), key, colour, width: 1.3 }) };
  });
  for (const one of against ? curves.filter(({ card }) => card) : []) {
    const { force_N: other } =
      cut.find(({ run, card }) => run === one.run && card === against)?.columns ?? {};
    const residual_N =
      one.card === against || !other
        ? null
        : one.columns.force_N.map((value, k) => value - other[k]);
    one.columns = { ...one.columns, residual_N };
  }
  return curves;
}

/** Return the data of a pane. */
function dataOf({ id, of: [x, y], isLoop }, curves) {
  const isDrawn = ({ columns, card }) => columns[x] && columns[y] && (!card || "dvfr".includes(id));
  const series = curves.filter(isDrawn).map(({ columns, head, ...one }) => ({
    ...one,
    x: columns[x],
    y: columns[y],
    ...(isLoop
      ? { kind: "loop", t: columns.time_s }
      : { since: id === "r" ? (head.scored_from_s ?? 0) : 0 }),
  }));
  const start = Math.max(0, ...series.map(({ since }) => since ?? 0));
  const band = { from: 0, to: start, name: "start, not scored", colour: (colours) => colours.band };
  return { series, spans: start > 0 ? [band] : [] };
}

// ---------------------------------------------------------------------------------------------------- view

/**
 * Linked view of runs and cards.
 *
 * @param {{runs: object[], picked: object[], cards: string[], prefix: string, panes?: string}} props
 *   runs: all runs, which determine the colours; picked: drawn runs; panes: ids of the plots
 */
export function LinkedView({ runs, picked, cards, prefix, panes = "dvfrxAVT" }) {
  const [t, point] = useState(null);
  const link = useMemo(() => new Link(point), []);
  const get = (name, otherwise = null) => chosen(`${prefix}.${name}`, otherwise);
  const set = (values) =>
    choose(
      Object.fromEntries(
        Object.entries(values).map(([name, value]) => [`${prefix}.${name}`, value]),
      ),
      true,
    );
  const span = get("t");
  const { shown, ms } = useSamples(picked, cards, span);
  const isOne = (of) => new Set(picked.map(of)).size === 1;
  const usual =
    cards.length > 1
      ? "card"
      : isOne(commandOf) && !isOne(temperatureOf)
        ? "temperature"
        : "command";
  const how = {
    runs,
    cards,
    by: get("colour") ?? usual,
    against: get("against"),
    cycles: get("cycles", 0),
  };
  const isCentred = get("centre", false);
  const splits = cards.map((card) => splitsOf(card).size);
  const curves = useMemo(
    () => curvesOf(shown ?? [], { ...how, isCentred }),
    [shown, JSON.stringify([how, isCentred, splits])],
  );
  const own = useMemo(
    () =>
      PANES.filter(({ id }) => panes.includes(id)).map((pane) => {
        const isLoop = pane.id === "d" || pane.id === "v";
        return { ...pane, isLoop, data: dataOf({ ...pane, isLoop }, curves) };
      }),
    [curves],
  );
  const [hide, without] = [get("hide", []), get("without", [])];
  const known = own.filter(({ data }) => data.series.length);
  const draw = (pane) => {
    const { id, isLoop, title } = pane;
    const range = isLoop ? get(id) : span;
    const view = range && { x: range.slice(0, 2), y: isLoop ? range.slice(2) : null };
    const onRange = (next) =>
      set(isLoop ? { [id]: next && [...next.x, ...next.y] } : { t: next && next.x });
    const y = id === "r" && how.against ? `force less that of ${how.against}, N` : pane.y;
    const name = title.toLowerCase().replaceAll(" ", "-");
    return plot({
      x: "time, s",
      height: 290,
      ...pane,
      key: id,
      y,
      name,
      view,
      onRange,
      span,
      hidden: hide,
      legend: false,
      link,
    });
  };
  const visible = known.filter(({ id }) => !without.includes(id));
  const [loops, rest] = [
    visible.filter(({ isLoop }) => isLoop),
    visible.filter(({ isLoop }) => !isLoop),
  ];
  const depth = window.history.state?.depth ?? 0;
  const count = (shown ?? []).reduce((sum, { head }) => sum + (head?.n ?? 0), 0);
  const faults = [...new Set((shown ?? []).map(({ fault }) => fault).filter(Boolean))];
  const status = !picked.length
    ? "No run is chosen: tick some."
    : !shown
      ? "Fetching …"
      : `${several(picked.length, "run")}, ${counted(count)} samples drawn.`;
  const press = (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.target.matches("input")) return;
    if (event.key === "z") window.history.back();
    else if (event.key === "y") window.history.forward();
  };
  return div(
    { class: "linked", onkeydown: press },
    div(
      { class: "row" },
      button("Undo zoom", () => window.history.back(), {
        disabled: depth === 0,
        title: "Ctrl+Z, or the browser's Back",
      }),
      button("Whole", () => set({ t: null, d: null, v: null }), { title: "All of every plot" }),
      div(
        { class: "chips", role: "group", "aria-label": "Plots" },
        known.map(({ id, title }) =>
          button(title.replace(" over time", ""), () => set({ without: toggled(without, id) }), {
            "aria-pressed": String(!without.includes(id)),
          }),
        ),
      ),
    ),
    p(
      {
        class: "small",
        "aria-live": "polite",
        id: "view-status",
        "data-ms": shown ? ms : null,
        "data-samples": shown ? count : null,
      },
      status,
    ),
    faults.slice(0, 2).map((fault) => note("warning", fault)),
    own[0].data && legendOf(own[0].data, hide, (key) => set({ hide: toggled(hide, key) })),
    loops.length > 0 && div({ class: "pair" }, loops.map(draw)),
    rest.map(draw),
    curves.length > 0 &&
      readout(
        curves.filter(({ key }) => !hide.includes(key)),
        t,
      ),
  );
}

/** Return the values at the cursor, one row for each curve. */
function readout(curves, t) {
  const known = VALUES.filter(([name]) => curves.some(({ columns }) => columns[name]));
  const valueOf = ({ columns }, name, digits) => {
    const at = t === null ? null : nearest(columns.time_s, t);
    return at === null || !columns[name] ? "" : fixed(columns[name][at], digits);
  };
  const cell = ([name, title, unit, digits]) => ({
    title,
    unit,
    number: true,
    cell: (one) => valueOf(one, name, digits),
  });
  const first = {
    title: t === null ? "point at a plot over time" : `${t.toFixed(3)} s`,
    class: "name",
    cell: ({ name }) => name,
  };
  return div(
    { class: "readout-table" },
    table([first, ...known.map(cell)], curves.slice(0, 8), { label: "Values at the cursor" }),
  );
}

/** Return the errors of cards on runs. */
export function errorTable(picked, cards, link = (run) => run.name) {
  const rows = picked.flatMap((run) => cards.map((card) => ({ run, card })));
  const cell =
    (name, digits) =>
    ({ run, card }) => {
      const found = once(`error ${run.file} ${run.name} ${card}`, () =>
        samples(run, card, { max: 64 }),
      );
      return fixed(found?.head?.[name], digits);
    };
  return table(
    [
      { title: "run", class: "name", cell: ({ run }) => link(run) },
      { title: "card", class: "whole", cell: ({ card }) => card },
      {
        title: "in the fit",
        class: "whole",
        cell: ({ run, card }) => SPLITS[splitsOf(card).get(run.name)] ?? "not used",
      },
      { title: "RMS error", unit: "N", number: true, cell: cell("rmse_N", 1) },
      { title: "error", unit: "% of spread", number: true, cell: cell("nrmse_percent", 2) },
    ],
    rows,
    {
      label: "Errors of the whole run",
      note: "Errors of the whole run. Grey and wide: measured. Thin and coloured: modelled.",
      rowClass: ({ run, card }) => (splitsOf(card).get(run.name) === "held_out" ? "held" : ""),
    },
  );
}

/** Return peak forces, energy and damping of the drawn runs. */
export function characteristics(picked) {
  const valuesOf = (run) =>
    once(`samples ${run.file} ${run.name}`, () => samples(run, null, { max: 65536 }))?.columns;
  const rows = picked.map((run) => ({
    run,
    ...(valuesOf(run)?.force_N ? measuresOf(valuesOf(run)) : {}),
  }));
  const value = (title, unit, name, digits) => ({
    title,
    unit,
    number: true,
    cell: (row) => fixed(row[name], digits),
  });
  return table(
    [
      { title: "run", class: "name", cell: ({ run }) => run.name },
      { title: "command", class: "whole", cell: ({ run }) => commandOf(run) },
      value("peak speed", "mm/s", "speed", 0),
      value("highest force", "N", "high", 0),
      value("lowest force", "N", "low", 0),
      value("energy per cycle", "J", "energy", 2),
      value("equivalent damping", "kN s/m", "damping", 2),
    ],
    rows.sort((x, y) => x.run.command - y.run.command),
    {
      label: "Characteristic",
      note: "Peak forces, energy and equivalent damping of the last complete cycle of each run.",
    },
  );
}

function measuresOf(columns) {
  const { displacement_mm: x, force_N: force, time_s: time } = prepared(columns, 1, true);
  let energy = 0;
  for (let k = 1; k < x.length; k += 1)
    energy += ((force[k] + force[k - 1]) / 2) * (x[k] - x[k - 1]) * 1e-3;
  const [low, high] = extent(force);
  const amplitude = extent(x)[1] * 1e-3;
  const omega = (2 * Math.PI) / (time.at(-1) - time[0]);
  const speed = Math.max(...extent(columns.velocity_mm_s).map(Math.abs));
  return { speed, low, high, energy, damping: energy / (Math.PI * omega * amplitude ** 2) / 1e3 };
}

export const linkedView = (props) => h(LinkedView, props);
export { idOf };
