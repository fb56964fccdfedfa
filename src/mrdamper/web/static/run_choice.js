// Which runs are fitted: by unit, motion, command and temperature, and run by run; copies are left aside and marked.

import { check, el, field, fill, fixed, select } from "./dom.js";

const KINDS = [
  ["command_unit", "Commanded", (run) => (run.command_unit ? `in ${run.command_unit}` : "unknown")],
  ["motion", "Motion", (run) => run.motion || "other"],
  ["command", "Command", (run) => (run.command === null || run.command === undefined ? "varying" : `${fixed(run.command, 2)} ${run.command_unit}`)],
  ["temperature", "Temperature", (run) => (run.temperature_degC === null || run.temperature_degC === undefined ? "unknown" : `${5 * Math.round(run.temperature_degC / 5)} °C`)],
];

/** Return what two runs share that are the same measurement: figures to the last digit. */
const mark = (run) => JSON.stringify([run.command_unit, run.samples, run.rate_Hz, run.stroke_mm, run.peak_velocity_mm_s, run.force_range_N, run.command_range]);

/** Return the copies among runs: run -> the first one that it equals. */
function copiesOf(runs) {
  const first = new Map();
  const copies = new Map();
  for (const run of runs) {
    if (first.has(mark(run))) copies.set(run, first.get(mark(run)));
    else first.set(mark(run), run);
  }
  return copies;
}

const literal = (name) => name.replace(/[[*?]/g, (sign) => `[${sign}]`);

/**
 * Return the choice of runs: `{node, runs(), read()}`.
 *
 * @param {object[]} runs that can be fitted
 * @param {() => void} changed called when others are chosen
 */
export function runChoice(runs, changed) {
  const copies = copiesOf(runs);
  const aside = new Set(copies.keys());
  const units = new Set(runs.map(KINDS[0][2]));
  const usual = [...units].sort((a, b) => count(KINDS[0][2], b) - count(KINDS[0][2], a))[0];
  const lists = KINDS.map(([id, label, of]) => ({ of, label, list: listOf(id, of) })).filter(({ list }) => list);
  const said = el("summary");
  const picks = el("div", { class: "picks" });
  const each = el("details", { id: "chosen-runs" }, said, picks);

  function count(of, value) {
    return runs.filter((run) => of(run) === value).length;
  }

  function listOf(id, of) {
    const values = [...new Set(runs.map(of))].sort((a, b) => a.localeCompare(b, undefined, { numeric: true }));
    if (values.length < 2) return null;
    const one = values.map((value) => [value, `${value}: ${count(of, value)}`]);
    if (id === "command_unit") return select(one, usual, { id: "commanded" }); // volts and amperes do not go into one card
    return select([["", "all"], ...one], "", { id: `choose-${id}` });
  }

  const matching = () => runs.filter((run) => lists.every(({ of, list }) => !list.value || of(run) === list.value));
  const chosen = () => matching().filter((run) => !aside.has(run));

  function draw() {
    const found = matching();
    const copied = found.filter((run) => copies.has(run)).length;
    said.textContent = `${chosen().length} of ${runs.length} runs${copied ? `; ${copied} ${copied === 1 ? "is a copy" : "are copies"}` : ""}`;
    if (!each.open) return;
    fill(picks, found.map((run) => {
      const { box, node } = check(`${run.name}${copies.has(run) ? `, a copy of ${copies.get(run).name}` : ""}${run.worst === "fault" ? ", with a fault" : ""}`, !aside.has(run));
      box.addEventListener("change", () => {
        if (box.checked) aside.delete(run);
        else aside.add(run);
        draw.later();
      });
      return node;
    }));
  }
  draw.later = () => {
    said.textContent = `${chosen().length} of ${runs.length} runs`;
    changed();
  };
  for (const { list } of lists) list.addEventListener("change", () => (draw(), changed()));
  each.addEventListener("toggle", draw);
  draw();
  return {
    node: el("div", { class: "wide" }, el("div", { class: "fields" }, lists.map(({ label, list }) => field(label, list))), each),
    runs: chosen,
    /** Choose the runs that a job was asked for. */
    take({ files, only }) {
      const wanted = runs.filter((run) => (!files || files.includes(run.file)) && (!only?.length || only.includes(literal(run.name))));
      for (const { of, list } of lists) list.value = list.id === "commanded" && wanted.length ? of(wanted[0]) : "";
      aside.clear();
      for (const run of runs) if (!wanted.includes(run)) aside.add(run);
      draw();
      changed();
    },
    /** Return the files and the names of what was chosen, as a job takes them; all runs: neither. */
    read() {
      const wanted = new Set(chosen());
      if (wanted.size === runs.length) return { files: null, only: [] };
      const files = [...new Set([...wanted].map((run) => run.file))];
      const whole = runs.every((run) => wanted.has(run) || !files.includes(run.file));
      return { files, only: whole ? [] : [...wanted].map((run) => literal(run.name)) };
    },
  };
}
