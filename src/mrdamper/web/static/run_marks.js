// Comparison of runs: filters, copies, and runs that probably belong to another damper.

import { field, fixed, has, number, select } from "./dom.js";

const unitOf = (run) => (run.command_unit ? `in ${run.command_unit}` : "unknown");
export const motionOf = (run) => run.motion || "other";
export const commandOf = (run) => (has(run.command) ? `${fixed(run.command, 2)} ${run.command_unit}` : "varying");
export const temperatureOf = (run) => (has(run.temperature_degC) ? `${5 * Math.round(run.temperature_degC / 5)} °C` : "unknown");

const KINDS = [
  ["command_unit", "Commanded", unitOf],
  ["motion", "Motion", motionOf],
  ["command", "Command", commandOf],
  ["temperature", "Temperature", temperatureOf],
];
const ALIKE = 0.1; // Maximum relative difference of the speeds of similar runs.
const FEW = 3; // Minimum number of similar runs for a comparison.
const FAR = 2; // Ratio to the median force (or its inverse) from which on a run is reported.

const isRead = (run) => !run.error && run.force_range_N;

/** Return the most frequent text. */
function commonest(texts) {
  const count = new Map();
  for (const text of texts) count.set(text, (count.get(text) ?? 0) + 1);
  return [...count].sort((a, b) => b[1] - a[1])[0]?.[0];
}

/** Return items by their keys. */
function grouped(all, keyOf) {
  const groups = new Map();
  for (const one of all) groups.set(keyOf(one), [...(groups.get(keyOf(one)) ?? []), one]);
  return groups;
}

/** Return a text that is equal for two runs of the same measurement. */
const measurement = (run) => JSON.stringify([run.command_unit, run.samples, run.rate_Hz, run.stroke_mm, run.peak_velocity_mm_s, run.force_range_N, run.command_range]);

/** Return the copies among runs: run -> its original. */
export function copiesOf(runs) {
  return new Map([...grouped(runs.filter(isRead), measurement).values()].flatMap(([first, ...others]) => others.map((run) => [run, first])));
}

/** Return the runs that probably belong to another damper: run -> reason. */
export function strangersOf(runs) {
  const commanded = runs.filter((run) => run.command_unit);
  const usual = commonest(commanded.map(unitOf));
  const found = new Map(commanded.filter((run) => unitOf(run) !== usual).map((run) => [run, `commanded ${unitOf(run)}, most runs are ${usual}`]));
  const rest = runs.filter((run) => !found.has(run) && isRead(run) && run.peak_velocity_mm_s > 0);
  const span = (run) => run.force_range_N[1] - run.force_range_N[0];
  for (const group of grouped(rest, (run) => JSON.stringify(KINDS.map(([, , of]) => of(run)))).values()) {
    for (const run of group) {
      const like = group.filter((one) => one !== run && Math.abs(one.peak_velocity_mm_s / run.peak_velocity_mm_s - 1) <= ALIKE).map(span);
      if (like.length < FEW) continue;
      const ratio = span(run) / like.sort((a, b) => a - b)[Math.floor(like.length / 2)];
      if (ratio > FAR || ratio < 1 / FAR) found.set(run, `its force is ${number(ratio, 2)} times the force of similar runs`);
    }
  }
  return found;
}

/** Return copies and runs of another damper as findings. */
export function findingsBetween(runs) {
  const copies = [...copiesOf(runs)].map(([run, first]) => ({ severity: "warning", run: run.name, file: run.file, found: `a copy of ${first.name}`, effect: "counts twice without new information", remedy: "The fit omits it unless you choose it" }));
  const strangers = [...strangersOf(runs)].map(([run, why]) => ({ severity: "warning", run: run.name, file: run.file, found: why, effect: "the card describes two dampers", remedy: "Exclude it from the fit if it belongs to another damper" }));
  return [...strangers, ...copies];
}

/**
 * Return lists that filter runs: `{lists, nodes, matching()}`; a property that all runs share has no list.
 *
 * @param {object[]} runs
 * @param {string} prefix prefix of the ids
 * @param {{oneUnit?: boolean, changed: () => void}} how oneUnit: volts and amperes exclude each other
 */
export function runFilters(runs, prefix, { oneUnit = false, changed }) {
  const lists = KINDS.flatMap(([id, label, of]) => {
    const values = [...new Set(runs.map(of))].sort((a, b) => a.localeCompare(b, undefined, { numeric: true }));
    if (values.length < 2) return [];
    const single = oneUnit && id === "command_unit";
    const counted = values.map((value) => [value, `${value}: ${runs.filter((run) => of(run) === value).length}`]);
    const list = select(single ? counted : [["", "all"], ...counted], single ? commonest(runs.map(of)) : "", { id: `${prefix}-${id}` });
    list.addEventListener("change", changed);
    return [{ id, label, of, list, single }];
  });
  return {
    lists,
    nodes: lists.map(({ label, list }) => field(label, list)),
    matching: () => runs.filter((run) => lists.every(({ of, list }) => !list.value || of(run) === list.value)),
  };
}
