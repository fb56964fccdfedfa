// Channel map of a file: role, unit and gain of each column. The file is read again after each change.

import { at, get, put } from "./api.js";
import { numberField, numberInput, readNumber } from "./forms.js";
import { fold, note, notes, table } from "./layout.js";
import { plot } from "./plot.js";
import { findingList } from "./results.js";
import { commandOf } from "./runs.js";
import { app, attempt, toast } from "./state.js";
import { bytes, fixed, number, several, toggled } from "./text.js";
import { button, check, select, tags, textField } from "./ui.js";
import { h, useEffect, useMemo, useRef, useState } from "./vendor/preact.js";

const { b, div, h2, h3, p, section, small, span } = tags;
const WAIT_MS = 350; // Time without a change before the file is read.
const ANSWERS_MAX = 12;
// Units of a gain, with the value of each unit in SI units per volt.
const GAIN_UNITS = {
	displacement: { "mm/V": 1e-3, "m/V": 1 },
	velocity: { "mm/s per V": 1e-3, "m/s per V": 1 },
	force: { "kN/V": 1e3, "N/V": 1 },
};
const CONSTANTS = [
	["current_A", "Coil current", "A", "in the file"],
	["voltage_V", "Coil voltage", "V", "in the file"],
	["temperature_degC", "Temperature", "°C", "not known"],
	["rate_Hz", "Sampling rate", "Hz", "in the file"],
];

const roleOf = (name) => app.state.choices.roles.find(({ role }) => role === name);
const gainUnits = (role) => (role ? (GAIN_UNITS[role] ?? { [`${roleOf(role).unit}/V`]: 1 }) : {});
const scaleOf = ({ role, unit }) => gainUnits(role)[unit];
const labelOf = ({ name, index }) => name || `column ${index}`;
const rounded = (value) => Number(value.toPrecision(12));
const quantityOf = (unit) => unit.replace(/(\/| per )V$/, "");
const neededFor = (unit) => `enter how many ${quantityOf(unit)} are one volt.`;

/** Return the form entries of a channel map: `{columns: {index: {role, unit, gain, sign, offset}}, rest}`. */
function entriesOf({ columns, map }) {
	const one = ({ name, index, role: known, guess, unit: given }) => {
		const isMapped = ([, entry]) => entry.name === name || entry.index === index;
		const mapped = Object.entries(map?.channel ?? {}).find(isMapped);
		const [role, entry] = mapped ?? [known ?? guess?.role ?? "", {}];
		const { sign = 1, offset } = entry;
		const base = { role, unit: entry.unit ?? guess?.unit ?? given ?? "", sign, offset };
		if (entry.gain === undefined) return [index, base];
		const [unit, scale] = Object.entries(gainUnits(role))[0];
		return [index, { ...base, unit, gain: rounded(entry.gain / scale) }];
	};
	const { constant = {}, segments = {}, session = {}, file } = map ?? {};
	const levels = segments.current_A ?? segments.voltage_V ?? [];
	const kind = segments.voltage_V ? "voltage_V" : "current_A";
	const split = segments.split ?? "";
	return {
		columns: Object.fromEntries(columns.filter(({ kind: type }) => type === "number").map(one)),
		rest: { ...constant, split, levels, kind, session: session.name ?? "", file },
	};
}

const gainOf = (column, { gain, unit }) =>
	readNumber(`${labelOf(column)} gain`, gain, { needed: neededFor(unit) });

/** Return the channel map for the form entries; an invalid number throws an error. */
function mapOf({ columns: entries, rest }, { columns }) {
	const map = {};
	for (const column of columns) {
		const one = entries[column.index];
		if (!one?.role) continue;
		const isUnique = column.name && columns.filter(({ name }) => name === column.name).length === 1;
		const entry = isUnique ? { name: column.name } : { index: column.index };
		if (scaleOf(one))
			Object.assign(entry, { unit: "V", gain: rounded(scaleOf(one) * gainOf(column, one)) });
		else if (one.unit) entry.unit = one.unit;
		if (one.offset) entry.offset = one.offset;
		if (one.sign === -1) entry.sign = -1;
		map.channel = { ...map.channel, [one.role]: entry };
	}
	for (const [key, words] of CONSTANTS) {
		const value = readNumber(words, rest[key]);
		if (value !== null) map.constant = { ...map.constant, [key]: value };
	}
	const levels = readNumber("Currents of the tests", rest.levels, { many: true });
	if (rest.split && levels.length) map.segments = { split: rest.split, [rest.kind]: levels };
	if (rest.session) map.session = { name: rest.session };
	if (rest.file) map.file = rest.file;
	return map;
}

/** Form for the channel map of a file, which can also be saved for the files `others`. */
export function ChannelSheet({ name, others, close }) {
	const [found, setFound] = useState(null);
	const [entry, setEntry] = useState(null);
	const [previews, setPreviews] = useState([]);
	const [fault, setFault] = useState("");
	const [same, setSame] = useState([]);
	const touched = useRef(false);
	const show = (next) => {
		setFound(next);
		setEntry(entriesOf(next));
		setPreviews([next]);
	};
	const change = (next) => {
		touched.current = true;
		setEntry({ ...entry, ...next });
	};
	const failed = ({ name: kind, message }) => kind !== "AbortError" && setFault(message);

	useEffect(() => {
		const asked = new AbortController();
		const read = async () => {
			const beginning = await get(`${at`files/${name}/look`}?head=1`, asked.signal);
			show(beginning);
			if (beginning.head_share === undefined) return;
			const whole = await get(at`files/${name}/look`, asked.signal);
			if (touched.current) setFound(whole);
			else show(whole);
		};
		read().catch(failed);
		return () => asked.abort();
	}, [name]);

	useEffect(() => {
		if (!touched.current) return undefined;
		const asked = new AbortController();
		const timer = setTimeout(() => send(false, [name], asked.signal).catch(failed), WAIT_MS);
		return () => (clearTimeout(timer), asked.abort());
	}, [entry, found]);

	async function send(save, files, signal) {
		const head = found.head_share !== undefined && !save ? { head: true } : {};
		const body = { files, map: mapOf(entry, found), save, ...head };
		const answer = await put(at`channels`, { body, signal });
		setPreviews(answer.previews);
		setFault("");
		if (!answer.saved) return;
		toast("good", `The map of ${name} is saved.`);
		setFound({ ...found, map: {} });
	}
	const drop = async () => {
		await put(at`channels`, { body: { files: [name], map: null, save: true } });
		touched.current = false;
		show(await get(at`files/${name}/look`));
	};

	const title = div.row(h2(name), button("Close", close, "quiet"));
	const frame = (...body) =>
		section.panel({ id: "sheet", "aria-label": `Inside ${name}` }, title, body);
	if (!found) return frame(fault ? note("fault", fault) : p.sub(`Reading ${name} …`));
	if (!found.columns.length) return frame(note("fault", found.error ?? "Nothing could be read."));

	const columns = found.columns.filter(({ kind }) => kind === "number");
	const set = (index, values) =>
		change({ columns: { ...entry.columns, [index]: { ...entry.columns[index], ...values } } });
	const setRest = (values) => change({ rest: { ...entry.rest, ...values } });
	const take = ({ index, guess, unit }, role) =>
		set(index, { role, unit: (guess?.role === role ? guess.unit : unit) ?? "" });
	const answered = ({ role, topic }, value) => {
		const index = columns.find((one) => entry.columns[one.index].role === role)?.index;
		const constant = CONSTANTS.find(([, words]) => words.toLowerCase().includes(role))?.[0];
		const named = () => columns.find((one) => one.name === value);
		const unit = () => (value === "V" ? Object.keys(gainUnits(role))[0] : value);
		const file = () => ({ ...entry.rest.file, common_time: value === "common" });
		const act = {
			column: () => take(named(), role),
			unit: () => set(index, { unit: unit() }),
			part: () => setRest({ file: file() }),
			rate: () => setRest({ rate_Hz: parseFloat(value) }),
		}[topic];
		if (act) act();
		else setRest({ [constant]: parseFloat(value) });
	};
	const offers = touched.current ? [] : (found.offers ?? []);
	const offer = (one) => {
		const words = `Use ${one.name.replaceAll("_", " ")}: ${several(one.runs, "run")}`;
		return button(words, () => change(entriesOf({ ...found, map: one.map })), "main");
	};
	const save = () => attempt(() => send(true, [name, ...same]));
	return frame(
		p.small(found.understood),
		offers.length > 0 &&
			note("info", "A known map can read this file. ", span.row(offers.map(offer))),
		div.sheet(columnTable(columns, entry.columns, set, take)),
		h(QuickLoop, { columns, entries: entry.columns }),
		h3("Values that the file does not contain"),
		restFields(found, entry.rest, setRest),
		others.length > 0 &&
			fold(
				"Save the same map for other files",
				div.picks(
					others.map((one) => check(one, same.includes(one), () => setSame(toggled(same, one)))),
				),
			),
		div.actions(
			button("Save this map", save, "main", { id: "save-map" }),
			found.map && button("Remove the map", () => attempt(drop), "danger"),
		),
		h3.gap("With these channels"),
		div(
			{ "aria-live": "polite", id: "preview" },
			fault && note("fault", fault),
			previews.map((one) => previewOf(one, previews.length > 1, answered)),
		),
	);
}

function columnTable(columns, entries, set, take) {
	const roles = [["", "not used"], ...app.state.choices.roles.map(({ role }) => role)];
	const about = (column, words) => ({
		"aria-label": `${labelOf(column)} ${words}`,
		disabled: !entries[column.index].role,
	});
	const roleField = (column) => {
		const props = { "aria-label": `${labelOf(column)} is` };
		return select(roles, entries[column.index].role, (role) => take(column, role), props);
	};
	const unitField = (column) => {
		const { role, unit } = entries[column.index];
		const gains = Object.keys(gainUnits(role)).map((name) => [name, `V, gain in ${name}`]);
		const units = [...(role ? roleOf(role).units.map((one) => [one, one]) : []), ...gains];
		if (role && !units.some(([value]) => value === unit)) units.unshift(["", "which unit?"]);
		return select(units, unit, (next) => set(column.index, { unit: next }), about(column, "in"));
	};
	const gainField = (column) => {
		const one = entries[column.index];
		const isScaled = Boolean(scaleOf(one));
		const needed = isScaled ? neededFor(one.unit) : "";
		const props = { ...about(column, "gain"), disabled: !isScaled, placeholder: "–", needed };
		return numberInput(isScaled ? one.gain : "", (gain) => set(column.index, { gain }), props);
	};
	const turn = (column) => {
		const change = (isTurned) => set(column.index, { sign: isTurned ? -1 : 1 });
		return check("", entries[column.index].sign === -1, change, about(column, "turned"));
	};
	const content = ({ least, most, unit }) =>
		small(`${number(least, 4)} to ${number(most, 4)} ${unit ?? ""}`);
	const shown = [
		["column", labelOf, "name"],
		["holds", content],
		["is", roleField],
		["in", unitField],
		["gain", gainField],
		["turned", turn],
	];
	return table("Columns that hold numbers", shown, columns);
}

function QuickLoop({ columns, entries }) {
	const columnOf = (role) => columns.find(({ index }) => entries[index].role === role);
	const [x, y] = [columnOf("displacement"), columnOf("force")];
	const key = [x, y].map((column) => column && [column.index, entries[column.index]]);
	const data = useMemo(() => {
		const valuesOf = (column) => {
			const one = entries[column.index];
			const factor = one.sign * (scaleOf(one) ? gainOf(column, one) : 1);
			return Float64Array.from(column.sample ?? [], (value) => factor * (value ?? NaN));
		};
		const look = { name: "loop", kind: "loop", colour: (colours) => colours.accent };
		try {
			return { series: [{ ...look, x: valuesOf(x), y: valuesOf(y) }] };
		} catch {
			return null; // A column or gain is missing.
		}
	}, [JSON.stringify(key)]);
	if (!data) return null;
	const words = ({ index }) => {
		const { role, unit } = entries[index];
		return `${role}, ${scaleOf(entries[index]) ? quantityOf(unit) : unit || "as in the file"}`;
	};
	const axes = { x: words(x), y: words(y), name: "columns", height: 240, isLoop: true };
	return plot({ title: "Loop of these columns in the middle of the file", ...axes, data });
}

function restFields({ columns }, rest, set) {
	const texts = columns.filter(({ kind }) => kind === "text").map(labelOf);
	const change = (key) => (value) => set({ [key]: value });
	const about = (key, placeholder, more) => ({ id: `rest-${key}`, placeholder, ...more });
	const line = (words, key, placeholder, title) =>
		textField(words, rest[key], change(key), about(key, placeholder, { title }));
	const value = ([key, words, unit, placeholder]) =>
		numberField(words, rest[key], change(key), about(key, placeholder, { unit }));
	const levels = about("levels", "0; 0.25; 0.5", { many: true, unit: "A" });
	return div.fields(
		CONSTANTS.map(value),
		line("Session", "session", "this file", "Runs of a session share one tare."),
		texts.length > 0 && [
			line("A new test begins at", "split", "one test", `A word in ${texts.join(", ")}`),
			numberField("Currents of the tests", rest.levels, change("levels"), levels),
		],
	);
}

function questionOf({ role, topic, candidates }, answered) {
	const units = topic === "unit" ? (roleOf(role)?.units ?? []) : [];
	const offered = [...(candidates.length ? candidates : units), ...(topic === "unit" ? ["V"] : [])];
	const words = {
		column: `Which column is the ${role}?`,
		unit: `In which unit is the ${role}?`,
		rate: "How many samples a second?",
		value: `What was the ${role}?`,
		scale: `How much ${role} is one volt?`,
		part: "Which part of the time?",
	}[topic];
	const one = (value) =>
		button(value, () => answered({ role, topic }, value), "", `${words} ${value}`);
	const choices = span.row(offered.slice(0, ANSWERS_MAX).map(one));
	return note("warning", b(words), " ", offered.length ? choices : "Fill it in above.");
}

function previewOf(found, isNamed, answered) {
	const { runs = [], questions = [], findings = [], error, head_share: head } = found;
	const unusable = runs.filter((run) => run.error).length;
	const line = (run) => {
		const [low, high] = run.force_range_N ?? [];
		const found = `${run.motion || "no motion recognised"}, ${commandOf(run)}, ${number(run.stroke_mm)} mm stroke`;
		const words = `${run.name}: ${found}, ${fixed(low, 0)} to ${fixed(high, 0)} N`;
		return run.error ? `${words}: ${run.error}` : words;
	};
	const bad = unusable ? `, ${unusable} not usable` : "";
	const names = runs.map(({ name }) => name).join(", ");
	const begin = `Only the first ${number(100 * head, 2)} % of ${bytes(found.bytes)} have been read.`;
	const kind = unusable ? "warning" : "good";
	return div(
		isNamed && h3(found.name),
		questions.map((one) => questionOf(one, answered)),
		error && (questions.length ? fold("In full", note("fault", error)) : note("fault", error)),
		head !== undefined && note("info", begin),
		runs.length > 0 &&
			!error && [
				note(kind, `${several(runs.length, "run")}${bad}: ${names}`),
				notes(runs.map(line)),
			],
		findings.length > 0 && fold(several(findings.length, "finding"), findingList(findings)),
	);
}
