// Comparison and choice of runs: filters, copies, and runs that probably belong to another damper.

import { choose, chosen } from "./state.js";
import { check, field, fixed, has, number, rove, select, tags, toggled } from "./ui.js";

const { div, input } = tags;

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
const FORCE_RATIO_MAX = 2; // Ratio to the median force (or its inverse) from which on a run is reported.

const isRead = (run) => !run.error && run.force_range_N;

/** Return items by their keys. */
function grouped(all, keyOf) {
  const groups = new Map();
  for (const one of all) groups.set(keyOf(one), [...(groups.get(keyOf(one)) ?? []), one]);
  return groups;
}

/** Return the most frequent value. */
export const commonest = (values) =>
  [...grouped(values, (value) => value).values()].sort((x, y) => y.length - x.length)[0]?.[0];

/** Return the id of a run in an address: its name, with the file if another run has the same name. */
export const idOf = (run, runs) =>
  runs.some((other) => other !== run && other.name === run.name)
    ? `${run.file}|${run.name}`
    : run.name;

/** Return the copies among runs: run -> its original. */
export function copiesOf(runs) {
  const names = [
    "command_unit",
    "samples",
    "rate_Hz",
    "stroke_mm",
    "peak_velocity_mm_s",
    "force_range_N",
    "command_range",
  ];
  const groups = grouped(runs.filter(isRead), (run) =>
    JSON.stringify(names.map((name) => run[name])),
  );
  return new Map(
    [...groups.values()].flatMap(([first, ...others]) => others.map((run) => [run, first])),
  );
}

/** Return the runs that probably belong to another damper: run -> reason. */
export function foreignRunsOf(runs) {
  const commanded = runs.filter((run) => run.command_unit);
  const usual = commonest(commanded.map(unitOf));
  const others = commanded.filter((run) => unitOf(run) !== usual);
  const found = new Map(
    others.map((run) => [run, `commanded ${unitOf(run)}, most runs are ${usual}`]),
  );
  const rest = runs.filter((run) => !found.has(run) && isRead(run) && run.peak_velocity_mm_s > 0);
  const spanOf = ({ force_range_N: [low, high] }) => high - low;
  for (const group of grouped(rest, (run) =>
    JSON.stringify(FILTERS.map(([, , of]) => of(run))),
  ).values()) {
    for (const run of group) {
      const isSimilar = (one) =>
        one !== run &&
        Math.abs(one.peak_velocity_mm_s / run.peak_velocity_mm_s - 1) <= SPEED_DIFFERENCE_MAX;
      const spans = group.filter(isSimilar).map(spanOf);
      if (spans.length < SIMILAR_COUNT_MIN) continue;
      const ratio = spanOf(run) / spans.sort((x, y) => x - y)[Math.floor(spans.length / 2)];
      const words = `its force is ${number(ratio, 2)} times the force of similar runs`;
      if (ratio > FORCE_RATIO_MAX || ratio < 1 / FORCE_RATIO_MAX) found.set(run, words);
    }
  }
  return found;
}

/** Return copies and runs of another damper as findings. */
export function findingsBetween(runs) {
  const finding = (run, found, effect, remedy) => ({
    severity: "warning",
    run: run.name,
    found,
    effect,
    remedy,
  });
  return [
    ...[...foreignRunsOf(runs)].map(([run, reason]) =>
      finding(
        run,
        reason,
        "The card describes two dampers",
        "Exclude it from the fit if it belongs to another damper",
      ),
    ),
    ...[...copiesOf(runs)].map(([run, first]) =>
      finding(
        run,
        `a copy of ${first.name}`,
        "It counts twice without new information",
        "The fit omits it unless you choose it",
      ),
    ),
  ];
}

/** Return the runs that match the filters of a list; `prefix` is the prefix of its choices. */
export const matching = (runs, prefix) =>
  runs.filter(
    (run) =>
      FILTERS.every(
        ([name, , of]) => !chosen(`${prefix}.${name}`) || of(run) === chosen(`${prefix}.${name}`),
      ) && run.name.toLowerCase().includes(chosen(`${prefix}.find`, "").toLowerCase()),
  );

/** Return the filters of a list of runs; a property that all runs share has no filter. */
export function filtersOf(runs, prefix) {
  const lists = FILTERS.flatMap(([name, words, of]) => {
    const key = `${prefix}.${name}`;
    const values = [...grouped(runs, of)].sort(([x], [y]) =>
      x.localeCompare(y, undefined, { numeric: true }),
    );
    const options = [
      ["", "all"],
      ...values.map(([value, group]) => [value, `${value}: ${group.length}`]),
    ];
    const change = (value) => choose({ [key]: value || null });
    return values.length < 2
      ? []
      : [field(words, select(options, chosen(key, ""), change, { id: key.replace(".", "-") }))];
  });
  const [id, key] = [`${prefix}-find`, `${prefix}.find`];
  const find = { type: "search", id, value: chosen(key, ""), placeholder: "part of a name" };
  return div(
    { class: "fields" },
    lists,
    field(
      "Find a run",
      input({ ...find, oninput: (event) => choose({ [key]: event.target.value || null }) }),
    ),
  );
}

/** Return a list of runs with boxes; `ids` are the ticked ones, and `marks(run)` returns remarks on a run. */
export const runList = (runs, all, ids, change, { words, id, marks = () => [] }) =>
  div(
    { class: "picks gap", id, role: "group", "aria-label": words, ref: rove },
    runs.map((run) => {
      const one = idOf(run, all);
      return check([run.name, ...marks(run)].join(", "), ids.includes(one), () =>
        change(toggled(ids, one)),
      );
    }),
  );
