// Forms of jobs, built from the declared fields (/api/forms). The state contains the entries as the user typed them.

import { at, put } from "./api.js";
import { fold } from "./layout.js";
import { app, attempt, cardInUse, cards, choose, chosen } from "./state.js";
import { has, toggled } from "./text.js";
import { check, field, filePicker, rove, select, tags, textField } from "./ui.js";

const { div, h3, input, p, span } = tags;
const MORE = "More";
const BOXES_MAX = 6; // A list with more check boxes is scrolled.

const DECIMAL = /^[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?$/i;
const THOUSANDS = /^[+-]?[1-9]\d{0,2},\d{3}$/; // 1,234 can mean 1234 or 1.234.

/** Return the number in a text, with decimal point or comma; NaN if it is invalid or ambiguous. */
function parseNumber(text) {
	const plain = text.trim().replace("−", "-");
	return DECIMAL.test(plain) && !THOUSANDS.test(plain) ? Number(plain.replace(",", ".")) : NaN;
}

/** Return the numbers in a list with semicolons, blanks, or commas and blanks. */
function parseNumbers(text) {
	const parts = text.split(text.includes(";") ? ";" : /,?\s+/).map((part) => part.trim());
	const values = parts.filter(Boolean);
	return values.length === 1 && /\d,\d/.test(values[0]) ? [NaN] : values.map(parseNumber); // 20,60 can be one or two numbers.
}

const textOf = (value) => (Array.isArray(value) ? value.join("; ") : String(value ?? ""));

function faultOf(text, { many, needed = "" }) {
	if (!text.trim()) return needed;
	const values = many ? parseNumbers(text) : [parseNumber(text)];
	const more = many ? ", and separate several by semicolons" : "";
	return !values.some(Number.isNaN)
		? ""
		: `“${text.trim()}” is not a number. Enter one such as 2.5 or 2,5${more}.`;
}

/** Return the number (with `many`: numbers) of an entry; an invalid entry throws an error that names the field. */
export function readNumber(words, entry, { many, needed, otherwise = many ? [] : null } = {}) {
	const text = textOf(entry);
	const fault = faultOf(text, { many, needed });
	if (fault) throw new Error(`${words}: ${fault}`);
	if (!text.trim()) return otherwise;
	return many ? parseNumbers(text) : parseNumber(text);
}

/** Return the input of a number, marked if it is invalid; `needed`: message if it is empty. */
export function numberInput(entry, change, { many, needed, ...props } = {}) {
	const title = faultOf(textOf(entry), { many, needed });
	const oninput = (event) => change(event.target.value);
	const look = { type: "text", inputmode: "decimal", autocomplete: "off", class: "number" };
	const marked = { title, "aria-invalid": String(Boolean(title)) };
	return input({ ...look, value: textOf(entry), ...marked, oninput, ...props });
}

export const numberField = (words, entry, change, { unit, ...props } = {}) =>
	field(words, numberInput(entry, change, props), unit);

/** Return the key of the choice that a field sets. All forms share card, geometry, load cycle and controller. */
function keyOf(kind, { name, word, places }) {
	if (["geometry", "duty"].includes(word)) return word;
	if (name === "controller" || (name === "card" && places.includes("cards"))) return name;
	return `${kind}.${name}`;
}

/** Return a glob pattern that matches only this name. */
export const literal = (name) => name.replace(/[[*?]/g, (sign) => `[${sign}]`);

export const inputsOf = (suffix, kinds) =>
	app.state.inputs
		.filter(({ name }) => name.endsWith(suffix))
		.filter(({ kind }) => !kinds.length || !kind || kinds.includes(kind))
		.map(({ name }) => name);

function itemsOf(one) {
	const { files, records } = app.state;
	const named = (all, words = (name) => name) => all.map(({ name }) => [name, words(name)]);
	const mapped = files.filter((file) => file.mapped);
	const found = {
		inputs: () => inputsOf(one.files, one.looks).map((name) => [name, name]),
		cards: () => cards().map((card) => [card.name, `${card.name} (${card.law})`]),
		records: () => named(records),
		runs: () => named(files),
		maps: () => named(mapped, (name) => `as for ${name}`),
	};
	return one.places.flatMap((place) => found[place]());
}

/**
 * Return the form of a kind of job: `{read(), nodes(), more(), pick(names), rest(names)}`.
 *
 * `given`: values that the page sets; `only`: allowed choices of a field; `offered`: offered names by kind;
 * `needed`: messages if a field is empty; `preset`: initial values instead of the declared ones
 */
export function formOf(kind, options = {}) {
	const { given = {}, only = {}, offered = {}, needed = {}, preset = {} } = options;
	const shown = app.forms[kind].filter((one) => !(one.name in given));
	const controls = shown.map((one) => {
		const key = keyOf(kind, one);
		const begins = preset[one.name] ?? (key === "card" ? cardInUse()?.name : one.begins);
		const names = (offered[one.offers] ?? []).map((name) => [literal(name), name]);
		const keeps = ([value]) => !(one.name in only) || only[one.name].includes(value);
		const items = [...one.choices, ...itemsOf(one), ...names].filter(keeps);
		const id = `${kind}-${one.name.replaceAll("_", "-")}`;
		const entry = chosen(key) ?? begins;
		const about = { ...one, key, id, begins, options: items, needed: needed[one.name], entry };
		const { node, read } = controlOf(about, (value) => choose({ [key]: value }));
		const look = { class: isWide(one) ? "wide" : "", title: one.help };
		return { ...one, read, node: () => div(look, node()) };
	});
	const folds = controls.filter(({ group }) => group === MORE).length > 2;
	const groupOf = ({ group }) => (group === MORE && !folds ? "" : group);
	const nodesOf = (isShown) => controls.filter(isShown).map(({ node }) => node());
	const under = (group) => nodesOf((one) => groupOf(one) === group);
	const groups = [...new Set(controls.map(groupOf))].filter((group) => group !== MORE);
	const section = (group) => [group && h3.gap(group), div({ class: "fields gap" }, under(group))];
	const read = () => Object.fromEntries(controls.map((one) => [one.name, one.read()]));
	return {
		read: () => ({ ...read(), ...given }),
		pick: (names) => nodesOf(({ name }) => names.includes(name)),
		rest: (names) => nodesOf(({ name }) => !names.includes(name)),
		nodes: () => groups.map(section),
		more: (title = MORE) => folds && fold(title, div.fields(under(MORE))),
	};
}

const isWide = ({ many, choices, places, type }) =>
	many || choices.length > 0 || places.length > 0 || ["yes", "text"].includes(type);

function controlOf(one, change) {
	const { id, entry, unit, label: words, needed } = one;
	if (one.word === "duty") return { node: () => dutyFields(id), read: readDuty };
	if (one.type === "yes") {
		const node = () => check(words, Boolean(entry), change, { id });
		return { node, read: () => Boolean(entry) };
	}
	if (one.many && one.places.includes("runs") && one.word !== "campaigns") {
		const all = [["", "all runs in the folder"], ...one.options];
		const take = (name) => change(name ? [name] : null);
		const node = () => field(words, select(all, entry?.[0] ?? "", take, { id }));
		return { node, read: () => entry ?? null };
	}
	if (one.many) return severalControl(one);
	if (one.choices.length || one.places.length) return choiceControl(one, change);
	if (one.type === "text") {
		const props = { maxlength: 160, id, placeholder: one.none };
		const read = () => String(entry ?? "").trim() || one.default;
		return { node: () => textField(words, entry ?? "", change, props), read };
	}
	const read = () => readNumber(words, entry, { needed, otherwise: one.default });
	const about = { unit, id, needed, placeholder: one.none };
	return { node: () => numberField(words, entry, change, about), read };
}

function choiceControl(one, change) {
	const { id, word, entry, required } = one;
	const first = required ? `choose a ${word}` : one.none || "none";
	const named = new Map([...(one.default === null ? [["", first]] : []), ...one.options]);
	const isItem = entry && one.places.length > 0 && !one.choices.length;
	const initial = named.has(one.begins) ? one.begins : [...named.keys()][0];
	let value = named.has(entry) || isItem ? entry : initial;
	if (required && !value) value = one.options[0]?.[0] ?? "";
	if (value && !named.has(value)) named.set(value, `${value} (deleted)`);
	const node = () => [
		field(one.label, select([...named], value, change, { id })),
		one.places.includes("inputs") && bringInput(`Bring a ${word}`, one.files, change),
	];
	return { node, read: () => value || null };
}

function severalControl(one) {
	const { key, id, options, free, places, label: words, none } = one;
	const names = options.map(([value]) => value);
	const many = one.type !== "text";
	const values = one.entry ?? (one.required ? names : []);
	const offered = values.filter((value) => names.includes(value));
	const isLimited = names.length < one.choices.length; // The card does not support all choices.
	const picked = offered.length || !isLimited ? offered : names.slice(0, 1);
	const others = values.filter((value) => !names.includes(value));
	const typed = chosen(`${key}.text`) ?? (many ? textOf(others) : others.join(", "));
	const change = (value) => choose({ [key]: toggled(picked, value), [`${key}.text`]: typed });
	const write = (text) => choose({ [`${key}.text`]: text });
	const props = { id, placeholder: one.offers === "runs" ? "*_060C_*" : none, "aria-label": words };
	const oninput = (event) => write(event.target.value);
	const line = many
		? numberInput(typed, write, { ...props, many })
		: input({ ...props, type: "text", value: typed, oninput });
	const box = ([value, text]) => check(text, picked.includes(value), () => change(value));
	const isLong = options.length > BOXES_MAX;
	const list = { class: isLong ? "picks" : "", ref: isLong ? rove : null };
	const hint = none && !free ? `; without a choice: ${none}` : "";
	const node = () =>
		div(
			{ role: "group", "aria-label": words },
			words !== one.group && span.small(words, one.unit && `, ${one.unit}`, hint),
			options.length > 0 && div(list, options.map(box)),
			free && line,
			places.includes("inputs") && bringInput(`Bring a ${one.word}`, one.files, change),
		);
	const read = () => {
		const texts = () => typed.split(/[,;]+/).map((text) => text.trim());
		const more = many ? () => readNumber(words, typed, { many }) : () => texts().filter(Boolean);
		const all = [...new Set([...picked, ...(free ? more() : [])])];
		return all.length ? all : one.default;
	};
	return { node, read };
}

export function bringInput(words, suffixes, brought = () => {}) {
	const bring = ([file]) =>
		attempt(() => put(at`inputs/${file.name}`, { raw: file })).then(
			(answer) => answer && brought(file.name),
		);
	const kinds = suffixes.replaceAll(".", "").toUpperCase();
	return p.small(filePicker(`${words} (${kinds})`, suffixes, bring));
}

export function fillForm(kind, options, more = {}) {
	const values = {};
	for (const one of app.forms[kind]) {
		const [key, value] = [keyOf(kind, one), options[one.name]];
		values[key] = has(value) ? value : null;
		values[`${key}.text`] = null;
		if (one.word === "duty") values[key] = sineOf(value) ?? { table: value };
	}
	choose({ ...values, ...more });
}

const SINE = /^sine:([-+\d.e]+)mm:([-+\d.e]+)Hz:([-+\d.e]+)([AV]):([-+\d.e]+)s$/;
function sineOf(text) {
	const [amplitude_mm, frequency_Hz, command, , duration_s] = (SINE.exec(text) ?? [])
		.slice(1)
		.map(Number);
	return duration_s && { amplitude_mm, frequency_Hz, command, duration_s };
}

const SINE_FIELDS = [
	["command", "Current", "A"],
	["amplitude_mm", "Amplitude", "mm"],
	["frequency_Hz", "Frequency", "Hz"],
	["duration_s", "Duration", "s"],
];
const needed = "enter a number.";

/** Return the entered load cycle, or else a sine inside the range of the card in use. */
const dutyInUse = () => ({ unit: "A", ...cardInUse()?.sine, ...chosen("duty") });

export function readSine() {
	const duty = dutyInUse();
	const read = ([name, words]) => [name, readNumber(words, duty[name], { needed })];
	return Object.fromEntries(SINE_FIELDS.map(read));
}

function readDuty() {
	const { table, unit } = dutyInUse();
	if (table) return table;
	const { amplitude_mm, frequency_Hz, command, duration_s } = readSine();
	return `sine:${amplitude_mm}mm:${frequency_Hz}Hz:${command}${unit}:${duration_s}s`;
}

function dutyFields(id) {
	const duty = dutyInUse();
	const change = (values) => choose({ duty: { ...chosen("duty"), ...values } });
	const take = (table) => change({ table });
	const tables = [["", "a sine"], ...inputsOf(".csv", ["duty"]).map((name) => [name, name])];
	const sine = ([name, words, unit]) => {
		const isVolts = unit === "A" && duty.unit === "V";
		const set = (value) => change({ [name]: value });
		const about = { unit: isVolts ? "V" : unit, id: `${id}-${name}`, needed };
		return numberField(isVolts ? "Voltage" : words, duty[name], set, about);
	};
	return div.fields(
		div.wide(
			field("Motion", select(tables, duty.table ?? "", take, { id })),
			bringInput("Bring a table", ".csv", take),
		),
		!duty.table && SINE_FIELDS.map(sine),
	);
}
