// Comparison and choice of runs: filters, copies, and runs that probably belong to another damper.

import { chosen } from "./state.js";
import { fixed, has, number, toggled } from "./text.js";
import { check, choice, rove, search, tags } from "./ui.js";

const { div } = tags;

const unitOf = (run) => (run.command_unit ? `in ${run.command_unit}` : "unknown");
export const motionOf = (run) => run.motion || "other";
export const commandOf = (run) =>
  has(run.command) ? `${fixed(run.command, 2)} ${run.command_unit}` : "varying";
export const temperatureOf = (run) =>
  has(run.temperature_degC) ? `${5 * Math.round(run.temperature_degC / 5)} °C` : "unknown";

const FILTERS = [
  ["unit", "Commanded", unitOf],
  ["motion", "Motion", motionOf],
  ["command", "Command", commandOf],
  ["temperature", "Temperature", temperatureOf],
];
const SPEED_DIFFERENCE_MAX = 0.1; // Maximum relative difference of the speeds of similar runs.
const SIMILAR_COUNT_MIN = 3; // Minimum number of similar runs for a comparison.
const FORCE_RATIO_MAX = 2; // A run with a larger (or inverse) ratio to the median force is reported.

const isRead = (run) => !run.error && run.force_range_N;

export const commonest = (values) =>
  [...Map.groupBy(values, (value) => value).values()].sort((x, y) => y.length - x.length)[0]?.[0];

/** Return the id of a run for addresses: the name of the run, with the file name if two runs have the same name. */
export const idOf = (run, runs) =>
  runs.some((other) => other !== run && other.name === run.name)
    ? `${run.file}|${run.name}`
    : run.name;

const MEASURED = ["samples", "rate_Hz", "stroke_mm", "peak_velocity_mm_s", "force_range_N"];

/** Return the copies among runs as a map from the copy to the original. */
export function copiesOf(runs) {
  const measured = (run) => MEASURED.map((name) => run[name]);
  const valuesOf = (run) => JSON.stringify([run.command_unit, run.command_range, ...measured(run)]);
  const groups = Map.groupBy(runs.filter(isRead), valuesOf);
  const pairs = [...groups.values()].flatMap(([first, ...rest]) => rest.map((run) => [run, first]));
  return new Map(pairs);
}

/** Return the runs that probably belong to a different damper, as a map from run to reason. */
export function foreignRunsOf(runs) {
  const commanded = runs.filter((run) => run.command_unit);
  const usual = commonest(commanded.map(unitOf));
  const others = commanded.filter((run) => unitOf(run) !== usual);
  const reason = (run) => `commanded ${unitOf(run)}, most runs are ${usual}`;
  const found = new Map(others.map((run) => [run, reason(run)]));
  const rest = runs.filter((run) => !found.has(run) && isRead(run) && run.peak_velocity_mm_s > 0);
  const spanOf = ({ force_range_N: [low, high] }) => high - low;
  const keyOf = (run) => JSON.stringify(FILTERS.map(([, , property]) => property(run)));
  const groups = Map.groupBy(rest, keyOf);
  for (const run of rest) {
    const isSimilar = (one) =>
      one !== run &&
      Math.abs(one.peak_velocity_mm_s / run.peak_velocity_mm_s - 1) <= SPEED_DIFFERENCE_MAX;
    const spans = groups.get(keyOf(run)).filter(isSimilar).map(spanOf);
    if (spans.length < SIMILAR_COUNT_MIN) continue;
    const ratio = spanOf(run) / spans.sort((x, y) => x - y)[Math.floor(spans.length / 2)];
    if (ratio > FORCE_RATIO_MAX || ratio < 1 / FORCE_RATIO_MAX)
      found.set(run, `its force is ${number(ratio, 2)} times the force of similar runs`);
  }
  return found;
}

/** Return findings about copies of runs and about runs that belong to a different damper. */
export function findingsBetween(runs) {
  const findings = [];
  const add = (run, found, effect, remedy) =>
    findings.push({ severity: "warning", run: run.name, found, effect, remedy });
  for (const [run, reason] of foreignRunsOf(runs))
    add(run, reason, "The card describes two dampers", "Exclude it from the fit if that is true");
  for (const [run, { name }] of copiesOf(runs))
    add(run, `a copy of ${name}`, "It counts twice", "The fit omits it unless you choose it");
  return findings;
}

/** Return the runs that match the filters of a list; `prefix` is the prefix of its choices. */
export function matching(runs, prefix) {
  const wanted = FILTERS.map(([name, , property]) => [property, chosen(`${prefix}.${name}`)]);
  const find = chosen(`${prefix}.find`, "").toLowerCase();
  const isWanted = (run) => wanted.every(([property, value]) => !value || property(run) === value);
  return runs.filter((run) => isWanted(run) && run.name.toLowerCase().includes(find));
}

/** Return the filters of a list of runs. A property with the same value in all runs gets no filter. */
export function filtersOf(runs, prefix) {
  const lists = FILTERS.map(([name, words, property]) => {
    const groups = [...Map.groupBy(runs, property)];
    groups.sort(([x], [y]) => x.localeCompare(y, undefined, { numeric: true }));
    const options = groups.map(([value, group]) => [value, `${value}: ${group.length}`]);
    return options.length > 1 && choice(words, `${prefix}.${name}`, [["", "all"], ...options]);
  });
  return div.fields(lists, search("Find a run", `${prefix}.find`, "part of a name"));
}

/** Return a list of runs with boxes; `ids` are the ticked ones, and `marks(run)` returns remarks on a run. */
export function runList(words, runs, all, ids, change, marks = () => []) {
  const box = (run) => {
    const id = idOf(run, all);
    return check([run.name, ...marks(run)].join(", "), ids.includes(id), () =>
      change(toggled(ids, id)),
    );
  };
  return div({ class: "picks gap", role: "group", "aria-label": words, ref: rove }, runs.map(box));
}
