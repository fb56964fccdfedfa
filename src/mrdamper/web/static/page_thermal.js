// Page Thermal: heating in a load cycle, geometry, and search for a heat sink.

import { at, get, post } from "./api.js";
import { formOf, inputsOf, numberField, readNumber, readSine } from "./forms.js";
import { jobColumns, jobOf, jobStatus, keepInput, resultOf, startButton } from "./jobs.js";
import { empty, fold, keptFold, note, notes, pageHead, tabbed, tile } from "./layout.js";
import { nth, plot } from "./plot.js";
import { beyondCard, filesOf, firstScreen, groundsOf, resultView, tableOf } from "./results.js";
import { sectionOf } from "./section.js";
import { app, attempt, cardInUse, choose, chosen, go, once, toast } from "./state.js";
import { fixed, several } from "./text.js";
import { button, tags, textField } from "./ui.js";
import { h, useEffect, useMemo, useRef, useState } from "./vendor/preact.js";

const { aside, div, form: formOfNodes, h3, p } = tags;
const FIRST_FIELDS = {
	body: ["outer_diameter_mm", "length_mm", "wall_mm"],
	piston: ["diameter_mm", "length_mm"],
	rod: ["diameter_mm"],
	coil: ["resistance_ohm"],
	fluid: ["preset"],
};
const CALIBRATED = ["body", "piston", "rod", "coil", "fluid", "seals"]; // geometry tables on which a calibration depends
const NEAR_LIMIT_K = 40; // The plot shows the fluid limit if the coil comes closer to it.

/** Return `{value, fault}`: answer or error of the newest request. Requests are sent one after another. */
function useLatest(key, ask) {
	const [found, set] = useState({});
	const { current: work } = useRef({});
	useEffect(() => {
		work.next = ask;
		const run = async () => {
			for (; work.next; work.isBusy = Boolean(work.next)) {
				work.isBusy = true;
				const next = work.next;
				work.next = null;
				await next().then(
					(value) => set({ value }),
					(fault) => set((before) => ({ ...before, fault: fault.message })),
				);
			}
		};
		if (!work.isBusy) run();
	}, [key]);
	return found;
}

function tried(read) {
	try {
		return [read(), ""];
	} catch (error) {
		return [null, error.message];
	}
}

/** Return the chosen geometry, or else the newest of the user; the preset if there is none. */
function geometryInUse() {
	const names = [...app.state.choices.dampers, ...inputsOf(".toml", ["geometry"])];
	if (names.includes(chosen("geometry"))) return chosen("geometry");
	const own = app.state.inputs.filter(({ name }) => names.includes(name));
	return own.sort((x, y) => y.modified.localeCompare(x.modified))[0]?.name ?? names[0];
}

function geometry(name) {
	const file = app.state.inputs.find((one) => one.name === name);
	return once(`geometry ${name} ${file?.modified}`, () => get(at`dampers/${name}`));
}

const saveGeometry = (base, entries, more = {}) =>
	attempt(async () => {
		const { name } = await post(at`dampers/${base}`, entries);
		toast("good", `${name} is saved with the inputs. All pages use it now.`);
		choose({ geometry: name, "heat.tab": "Heating", ...more });
	});

function Heating({ card, form, facts }) {
	const isTable = Boolean(chosen("duty")?.table);
	const share = chosen("heat.share", 100);
	const names = app.forms["heat curve"].map(({ name }) => name);
	const [request, fault] = tried(() => {
		const given = Object.entries(form.read()).filter(([name]) => names.includes(name));
		const duty_share = readNumber("Duty", share) / 100;
		return { ...Object.fromEntries(given), ...readSine(), card: card.name, duty_share };
	});
	const ask = async () => request && post(at`heat/curve`, request);
	const { value: found, fault: refused } = useLatest(JSON.stringify(request), ask);
	const data = useMemo(() => found && curvesOf(found), [found]);
	const job = jobOf("heat", card.name);
	const study = resultOf(job);
	const setShare = (value) => choose({ "heat.share": value });
	const percent = () => numberField("Duty", share, setShare, { unit: "%", id: "heat-share" });
	const axes = { x: "time, min", height: 290 };
	const force = { y: "force, N", name: "peak-force", fromZero: true };
	const heat = { y: "temperature, °C", name: "temperatures" };
	const quick = () => [
		div.tiles(
			{ "aria-live": "polite", id: "quick-tiles" },
			found.tiles.map(({ label, value, mark }) => tile(label, value, mark)),
		),
		div.pair(
			{ "data-asked": "yes" },
			plot({ title: "Temperatures", ...axes, ...heat, data: data.heat }),
			plot({ title: "Peak force of a cycle", ...axes, ...force, data: data.force }),
		),
		notes(found.notes),
	];
	return div(
		(fault || refused) && note("fault", fault || refused),
		p.small({ id: "calibration" }, facts?.calibration),
		isTable
			? note("info", "The quick curve is for a sine. Start the full study for the table.")
			: div.fields(percent()),
		found && !isTable && quick(),
		div.actions(
			button("Search a heat sink", () => choose({ "heat.tab": "Heat sink" }), "main"),
			button("Control it", () => go("controller", { card: card.name })),
			startButton("heat", "Full study", form.read, { id: "full-study", look: "" }),
		),
		jobStatus("heat", job),
		study && studyView(study),
	);
}

function curvesOf({ curve, limit_degC: limit }) {
	const x = curve.time_s.map((second) => second / 60);
	const line = (name, y, k, width, dash) => ({ name, x, y, colour: nth(k), width, dash });
	const isNear = Math.max(...curve.coil_degC) > limit - NEAR_LIMIT_K;
	const ends = { x: [0, x.at(-1)], y: [limit, limit], colour: (colours) => colours.soft };
	const force = curve.peak_force_N.map((value) => value ?? NaN);
	return {
		heat: {
			series: [
				line("fluid, hottest point", curve.hottest_degC, 1, 1.2, [6, 4]),
				line("fluid", curve.fluid_degC, 1, 2.2),
				line("coil", curve.coil_degC, 2, 1.5),
				line("wall", curve.wall_degC, 0, 1.5),
				isNear && { ...ends, name: `limit, ${fixed(limit, 0)} °C`, dash: [5, 4] },
			].filter(Boolean),
		},
		force: { series: [line("peak force", force, 3, 2)] },
	};
}

function studyView(job) {
	const name = `${job.id}-calibrated.toml`;
	const take = async () => {
		await attempt(() => keepInput(job, "calibrated.toml", name));
		choose({ geometry: name });
	};
	const isCalibrated = job.files.some(({ path }) => path === "calibrated.toml");
	const own = isCalibrated && button("Take the calibrated geometry", take);
	const { damper, duty } = job.options;
	return [h3.gap(`Full study: ${damper}, ${duty}`), resultView(job, "heat.part", { own })];
}

function Geometry({ base, facts }) {
	const changed = Object.keys(app.choice).filter((key) => key.startsWith("geometry-"));
	const isOther = CALIBRATED.some((kind) =>
		changed.some((key) => key.startsWith(`geometry-${kind}.`)),
	);
	const { calibration, sink, ...others } = facts.tables;
	const isDropped = isOther && (calibration || (sink?.film_multiplier ?? 1) !== 1);
	const bare = { ...others, sink: { ...sink, film_multiplier: undefined } };
	const tables = isOther ? bare : facts.tables;
	const names = Object.keys(app.forms).filter((name) => name.startsWith("geometry-"));
	const forms = names.map((name) => {
		const kind = name.slice("geometry-".length);
		return [kind, formOf(name, { preset: tables[kind] ?? {} })];
	});
	const read = () => {
		const filled = (form) => Object.entries(form.read()).filter(([, value]) => value !== null);
		const all = forms.map(([kind, form]) => [kind, Object.fromEntries(filled(form))]);
		const isUsed = ([kind, values]) =>
			kind === "sink" ? values.fins > 0 : Object.keys(values).length;
		return Object.fromEntries(all.filter(isUsed));
	};
	const [request, fault] = tried(() => ({ tables: read() }));
	const ask = async () => request && post(at`dampers/${base}`, request);
	const { value: drawn, fault: refused } = useLatest(JSON.stringify([base, request]), ask);
	const isPreset = app.state.choices.dampers.includes(base);
	const name = chosen("heat.name", isPreset ? "damper" : base.replace(/\.toml$/, ""));
	const isTaken = app.state.inputs.some((one) => one.name === `${name}.toml`);
	const save = () => {
		const entries = { name: name.trim(), replace: isTaken, tables: read() };
		return saveGeometry(base, entries, { "heat.name": null });
	};
	const table = (kind, nodes) => {
		const title = `${kind[0].toUpperCase()}${kind.slice(1).replace("_", " ")}`;
		return [h3.gap(title), div.fields(nodes)];
	};
	const first = ([kind, form]) => FIRST_FIELDS[kind] && table(kind, form.pick(FIRST_FIELDS[kind]));
	const rest = ([kind, form]) => table(kind, form.rest(FIRST_FIELDS[kind] ?? []));
	const setName = (value) => choose({ "heat.name": value });
	const action = isTaken ? "Replace and use it" : "Save and use it";
	const wrong = fault || refused;
	return div.split(
		formOfNodes(
			{ "aria-label": "Geometry of the damper", onsubmit: (event) => event.preventDefault() },
			forms.map(first),
			keptFold("heat.all", "all-fields", "All fields", () => forms.map(rest)),
			div.gap(
				textField("Name of the geometry", name, setName, { maxlength: 60, id: "geometry-name" }),
			),
			div.actions(button(action, save, "main", { id: "save-geometry", disabled: Boolean(wrong) })),
		),
		div.stays(
			drawn && sectionOf(drawn),
			isDropped &&
				note(
					"info",
					`The calibration factors of ${base} were removed, because they hold for its geometry only.`,
				),
			wrong && note("fault", wrong),
		),
	);
}

/** Return a design with its lengths in millimetres. */
const finsOf = ({ width_m: width, thickness_m: thickness, pitch_m: pitch, ...one }) => {
	const { fins, material, emissivity } = one;
	const lengths = { width_mm: 1e3 * width, thickness_mm: 1e3 * thickness, pitch_mm: 1e3 * pitch };
	return { fins, material, emissivity, ...lengths };
};
const isSame = (one, other) => JSON.stringify(one) === JSON.stringify(other);

function heatSink(card, shared, facts) {
	const mass_g = "enter the largest mass of the fins, because the geometry has no fins.";
	const needed = facts && !facts.sink ? { mass_g } : {};
	const form = formOf("heatsink", { given: { card: card.name, damper: null, duty: null }, needed });
	const read = () => {
		const { damper, duty } = shared.read();
		return { ...form.read(), damper, duty };
	};
	const nothing = "Enter the limits of the fins and press Search.";
	const view = (job) => h(Front, { job, key: job.id });
	const options = { card: card.name, read, nothing, view };
	return jobColumns("heatsink", "What to search", "Search", form, options);
}

function Front({ job }) {
	const { front, reference, bare, listed = [], shown } = job.answer;
	const kept = chosen("design");
	const all = [...front, ...listed, reference, bare];
	const isKept = (one) => kept?.job === job.id && isSame(one, kept.design);
	const design = all.find(isKept) ?? front.at(-1);
	const base = job.options.damper;
	const facts = geometry(base);
	const data = useMemo(() => {
		const x = (one) => 1e3 * one.mass_kg;
		const y = (one) => one.temperature_degC;
		const series = (name, designs, look) => {
			const radius = (k) => (isSame(designs[k], design) ? 7 : 4.5);
			const points = { x: designs.map(x), y: designs.map(y), radius };
			return { name, kind: "points", ...points, ...look };
		};
		const soft = (colours) => colours.soft;
		return {
			series: [
				series("front", front, { colour: nth(0), line: true }),
				series("present geometry", [reference], { colour: nth(1), hollow: true }),
				series("without fins", [bare], { colour: soft, hollow: true }),
			],
		};
	}, [design]);
	const choice = {
		pick: (k) => choose({ design: { job: job.id, design: listed[k] } }),
		isPicked: (k) => isSame(listed[k], design),
		words: ([name, fins]) => name || `${fins} fin${fins === "1" ? "" : "s"}`,
	};
	const use = () => {
		const stem = base.replace(/\.toml$/, "").replace(/-(\d+-fins|bare)$/, "");
		const name = `${stem}-${design.fins ? `${design.fins}-fins` : "bare"}`;
		const bare = { tables: { ...facts.tables, sink: undefined } };
		const entries = design.fins ? { fins: finsOf(design) } : bare;
		return saveGeometry(base, { name, replace: true, ...entries });
	};
	const { fins, mass_kg: mass, temperature_degC: fluid } = design;
	const axes = { x: "mass of the fins, g", y: "fluid at the end, °C", name: "front", height: 260 };
	const isThere = facts && !facts.fault;
	const [first, ...rest] = shown?.tables ?? [];
	return div(
		h3(`${base}, ${job.options.duty}`),
		firstScreen(job),
		div.tiles(
			tile("chosen", fins ? several(fins, "fin") : "no fins"),
			tile("mass", `${fixed(1e3 * mass, 0)} g`),
			tile("fluid", `${fixed(fluid, 1)} °C`, beyondCard(job.answer)),
		),
		div.actions(isThere && button("Use this sink", use, "main", { id: "use-sink" })),
		plot({ title: "Front", ...axes, isLoop: true, data }),
		isThere
			? sectionOf(facts, finsOf(design))
			: note("warning", "The geometry of this search is not in the folder."),
		first && tableOf(first, { choice }),
		filesOf(job),
		fold(
			"More",
			groundsOf(job),
			rest.map((one) => [h3(one.title), tableOf(one)]),
			notes(shown?.notes),
		),
	);
}

export function ThermalPage() {
	const title = pageHead(
		"Thermal",
		"The temperature of the damper in a load cycle, and a heat sink for it.",
	);
	const card = cardInUse();
	const base = geometryInUse();
	const facts = geometry(base);
	const shape = () => facts?.tables && h(Geometry, { key: base, base, facts });
	if (!card) {
		const words = "Heating needs a card. Fit a model first, or bring a card there.";
		return [title, empty(words, "model"), shape()];
	}
	const around = facts?.tables ? { ambient_degC: facts.ambient_degC, air_m_s: facts.air_m_s } : {};
	const preset = { damper: base, ...around };
	const isBare = facts?.tables && facts.sink === null;
	const form = formOf("heat", { given: isBare ? { with_sink: false } : {}, preset });
	const tabs = [
		["Heating", () => h(Heating, { card, form, facts })],
		["Geometry", shape],
		["Heat sink", () => heatSink(card, form, facts)],
	];
	return [
		title,
		div.split(
			aside.panel(
				{ "aria-label": "Card, geometry and load cycle" },
				form.nodes(),
				form.more("More of the study: a heat sink, calibration"),
			),
			tabbed("Parts of the thermal model", "heat.tab", tabs),
		),
	];
}
