// One state for all pages: the folder as the server reports it, and the choices of the user.
//
// A choice has a key such as `card` or `fit.law`. `choose` changes choices, writes the address and draws the page again. The
// address of a page contains the choices of its prefixes. The session storage keeps all choices.

import { at, DAMPER, get } from "./api.js";

const SHARED = ["card", "geometry", "duty", "controller"];

const page = (title, keys) => ({ title, letter: title[0].toLowerCase(), keys: keys.split(" ") });

/** Pages: title, letter of the keyboard shortcut, and prefixes of the choices in their addresses. */
export const PAGES = {
	data: page("Data", "view list file rig"),
	model: page("Model", "card fit choose loops fits"),
	thermal: page("Thermal", "card geometry duty heat heatsink design"),
	controller: page("Controller", "card geometry controller track export"),
	jobs: page("Jobs", "card geometry duty show"),
};

export const app = {
	state: null,
	forms: null,
	runs: null,
	reading: 0,
	page: "data",
	choice: decode(sessionStorage.getItem(`mrdamper${DAMPER}`)) ?? {},
	toasts: [],
	faults: {}, // Errors of jobs that did not start, by kind.
	draw: () => {},
};

const encode = (value) =>
	typeof value === "string" && decode(value) === value ? value : JSON.stringify(value);

function decode(text) {
	try {
		return JSON.parse(text);
	} catch {
		return text;
	}
}

const belongs = (key) => {
	const [prefix] = key.split(/[.-]/);
	const isJob = app.page === "jobs" && prefix in (app.forms ?? {});
	return PAGES[app.page].keys.includes(prefix) || isJob;
};

export function address(name, choices = {}) {
	const pairs = Object.entries(choices).map(([key, value]) => [key, encode(value)]);
	return `#/${name}${pairs.length ? `?${new URLSearchParams(pairs)}` : ""}`;
}

export const chosen = (key, otherwise = null) => app.choice[key] ?? otherwise;

function remove(isWanted) {
	for (const key of Object.keys(app.choice)) if (isWanted(key)) delete app.choice[key];
}

/** Set choices (null: the default). With `step`, the Back button undoes the change. */
export function choose(values, step = false) {
	// The entries of the geometry form belong to the previous geometry.
	if ("geometry" in values && values.geometry !== app.choice.geometry)
		remove((key) => key.startsWith("geometry-"));
	Object.assign(app.choice, values);
	remove((key) => (app.choice[key] ?? null) === null);
	write(step);
	app.draw();
}

export function go(name, values = {}) {
	choose(values);
	window.location.hash = address(name);
}

function write(step) {
	sessionStorage.setItem(`mrdamper${DAMPER}`, JSON.stringify(app.choice));
	const own = Object.entries(app.choice).filter(([key]) => belongs(key));
	const next = address(app.page, Object.fromEntries(own));
	if (next === window.location.hash) return;
	const depth = window.history.state?.depth ?? 0;
	if (step) window.history.pushState({ depth: depth + 1 }, "", next);
	else window.history.replaceState({ depth }, "", next);
}

/** Read page and choices from the address. Without choices, the page is shown as it was left. */
export function route() {
	const [path, query] = window.location.hash.replace(/^#\/?/, "").split("?");
	app.page = path in PAGES ? path : "data";
	document.title = `${PAGES[app.page].title} · mrdamper`;
	if (query) remove((key) => belongs(key) && !SHARED.includes(key));
	for (const [key, text] of new URLSearchParams(query)) app.choice[key] = decode(text);
	if (app.forms) write(false); // The forms determine which choices belong to a page.
	app.draw();
}

export async function refresh(files = true) {
	const [state, found] = await Promise.all([get(at`state`), (files || !app.runs) && get(at`runs`)]);
	app.state = state;
	if (found) Object.assign(app, { runs: found.runs, reading: found.reading });
	app.draw();
}

const WATCH_MS = 1000;
let before = null;

/** Request changes every second. Fetch the state after a change, and while a job runs. */
export async function watch() {
	try {
		if (document.visibilityState === "visible") {
			const now = await get(at`changes`);
			const isNew = JSON.stringify(now) !== JSON.stringify(before);
			if (isNew || app.lost || app.state?.jobs.some(isRunning))
				await refresh(now.files !== before?.files || app.lost);
			before = now;
			if (app.lost) Object.assign(app, { lost: false }).draw();
		}
	} catch {
		Object.assign(app, { lost: true }).draw();
	}
	setTimeout(watch, WATCH_MS);
}

export const isRunning = ({ state }) => state === "queued" || state === "running";

export function toast(kind, text, ...actions) {
	const one = { kind, text, actions };
	app.toasts = [...app.toasts, one];
	setTimeout(() => dismiss(one), kind === "fault" ? 15000 : 6000);
	app.draw();
}

export function dismiss(one) {
	app.toasts = app.toasts.filter((other) => other !== one);
	app.draw();
}

export async function attempt(action) {
	try {
		const result = await action();
		await refresh();
		return result;
	} catch (fault) {
		if (fault.name !== "AbortError") toast("fault", fault.message);
		return undefined;
	}
}

const fetched = new Map();

/** Send the request `key` once; return its answer, or null until it arrives. */
export function once(key, ask) {
	if (!fetched.has(key)) {
		const keep = (value) => fetched.set(key, value);
		keep(null);
		ask()
			.then(keep, (fault) => keep({ fault: fault.message }))
			.then(() => app.draw());
	}
	return fetched.get(key);
}

export const cards = () => app.state.cards.filter((card) => !card.error);

/** Return the chosen card, or else the newest; undefined if there is no card. */
export function cardInUse() {
	const newest = cards().reduce(
		(one, other) => (one && String(one.modified) >= String(other.modified) ? one : other),
		undefined,
	);
	return cards().find(({ name }) => name === chosen("card")) ?? newest;
}

export function cardDetails(name) {
	const card = app.state.cards.find((one) => one.name === name);
	return once(`card ${name} ${card?.modified}`, () => get(at`cards/${name}`));
}
