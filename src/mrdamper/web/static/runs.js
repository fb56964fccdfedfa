// Choice of runs: filters and lists.

import { chosen } from "./state.js";
import { fixed, has, toggled } from "./text.js";
import { check, choice, rove, search, tags } from "./ui.js";

const { div } = tags;

const unitOf = (run) => (run.command_unit ? `in ${run.command_unit}` : "unknown");
const motionOf = (run) => run.motion || "other";
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
export const commonest = (values) =>
	[...Map.groupBy(values, (value) => value).values()].sort((x, y) => y.length - x.length)[0]?.[0];

/** Return the id of a run: its name, with the file if two runs have the same name. */
export const idOf = (run, runs) =>
	runs.some((other) => other !== run && other.name === run.name)
		? `${run.file}|${run.name}`
		: run.name;

export const findingsBetween = (runs) =>
	runs.flatMap(({ name: run, foreign, copy_of: original }) =>
		[
			foreign && [
				foreign,
				"The card describes two dampers",
				"Exclude it from the fit if that is true",
			],
			original && [
				`a copy of ${original}`,
				"It counts twice",
				"The fit omits it unless you choose it",
			],
		]
			.filter(Boolean)
			.map(([found, effect, remedy]) => ({ severity: "warning", run, found, effect, remedy })),
	);

export function matching(runs, prefix) {
	const wanted = FILTERS.map(([name, , property]) => [property, chosen(`${prefix}.${name}`)]);
	const find = chosen(`${prefix}.find`, "").toLowerCase();
	const isWanted = (run) => wanted.every(([property, value]) => !value || property(run) === value);
	return runs.filter((run) => isWanted(run) && run.name.toLowerCase().includes(find));
}

export function filtersOf(runs, prefix) {
	const lists = FILTERS.map(([name, words, property]) => {
		const groups = [...Map.groupBy(runs, property)];
		groups.sort(([x], [y]) => x.localeCompare(y, undefined, { numeric: true }));
		const options = groups.map(([value, group]) => [value, `${value}: ${group.length}`]);
		return options.length > 1 && choice(words, `${prefix}.${name}`, [["", "all"], ...options]);
	});
	return div.fields(lists, search("Find a run", `${prefix}.find`, "part of a name"));
}

/** Return check boxes of runs; `ids` are selected, `marks(run)` returns remarks. */
export function runList(words, runs, all, ids, change, marks = () => []) {
	const box = (run) => {
		const id = idOf(run, all);
		return check([run.name, ...marks(run)].join(", "), ids.includes(id), () =>
			change(toggled(ids, id)),
		);
	};
	return div({ class: "picks gap", role: "group", "aria-label": words, ref: rove }, runs.map(box));
}
