// Frame of all pages: navigation, dampers, shortcuts, messages, and heading of printed pages.

import { at, DAMPER_NAME, get, post } from "./api.js";
import { removal } from "./jobs.js";
import { note, table } from "./layout.js";
import { ControllerPage } from "./page_controller.js";
import { DataPage } from "./page_data.js";
import { JobsPage } from "./page_jobs.js";
import { ModelPage } from "./page_model.js";
import { ThermalPage } from "./page_thermal.js";
import { app, attempt, cardInUse, chosen, dismiss, go, isRunning, PAGES } from "./state.js";
import { refresh, route, toast, watch } from "./state.js";
import { dark } from "./theme.js";
import { button, tags, textField } from "./ui.js";
import { h, render, useErrorBoundary } from "./vendor/preact.js";

const { a, b, dialog, div, form, h1, h2, header, kbd, li, main, nav, ol, p, span } = tags;
const VIEWS = {
	data: DataPage,
	model: ModelPage,
	thermal: ThermalPage,
	controller: ControllerPage,
	jobs: JobsPage,
};
const JOBS_OF = { thermal: ["heat", "heatsink"], controller: ["export", "track"] };
const USES_GEOMETRY = ["heat", "heatsink", "export"];
const FILES_MAX = 12;

/** Return the state of a page (`done`, `old`: out of date, or `open`), and a remark. */
function stepOf(page) {
	const { files, jobs } = app.state;
	const card = cardInUse();
	if (page === "data") return [files.some(({ state }) => state === "ready") ? "done" : "open"];
	if (!card) return ["open"];
	const lastOf = (kind) =>
		jobs.find((job) => job.kind === kind && job.state === "done" && job.options.card === card.name);
	if (page === "model") {
		if (card.cancelled || !card.converged)
			return ["old", "The fit was cancelled or did not converge."];
		const fitted = lastOf("fit")?.asked_at ?? card.modified;
		const isOld = files.some(({ modified }) => modified > fitted);
		return isOld ? ["old", "Runs were added or changed after the fit."] : ["done"];
	}
	const job = (JOBS_OF[page] ?? []).map(lastOf).find(Boolean);
	const reason = job && reasonOf(job, card);
	return reason ? ["old", reason] : [job ? "done" : "open"];
}

/** Return the reason why a result is out of date; empty if it is up to date. */
function reasonOf({ kind, asked_at: asked, options: { damper } }, card) {
	if (card.modified > asked) return `${card.name} has been fitted since`;
	if (!USES_GEOMETRY.includes(kind) || !damper) return "";
	const geometry = app.state.inputs.find(({ name }) => name === damper);
	if (geometry?.modified > asked) return `${damper} has changed since`;
	const now = chosen("geometry", damper);
	return now === damper ? "" : `it is of ${damper}, the geometry is ${now} now`;
}

function rail() {
	const { state } = app;
	const busy = state?.jobs.filter(isRunning).length ?? 0;
	const badge = () =>
		span.badge({ id: "busy", hidden: !busy, "aria-label": `${busy} at work` }, busy);
	const link = ([page, { title }]) => {
		const [step, words = ""] = state ? stepOf(page) : ["open"];
		const about = { href: `#/${page}`, "data-page": page, "data-step": step, title: words };
		const current = page === app.page ? "page" : null;
		return li(a({ ...about, "aria-current": current }, title, page === "jobs" && badge()));
	};
	const folder = { id: "folder", "aria-haspopup": "dialog", title: state?.folder };
	return header.rail(
		p.brand(b("mrdamper"), button(state?.folder_name ?? "", openDampers, "quiet", folder)),
		nav({ "aria-label": "Pages" }, ol(Object.entries(PAGES).map(link))),
		p.foot(state?.version),
	);
}

function printed() {
	const { files, folder_name: damper, version } = app.state;
	const names = files.slice(0, FILES_MAX).map(({ name }) => name);
	const more = files.length > FILES_MAX ? ` and ${files.length - FILES_MAX} more` : "";
	const used = [cardInUse()?.name, chosen("geometry")].filter(Boolean).join(", ") || "none";
	return p(
		{ id: "printed" },
		`Damper: ${damper} · Printed: ${new Date().toLocaleString()} · In use: ${used} · ` +
			`Files: ${names.join(", ") || "none"}${more} · mrdamper ${version}`,
	);
}

function Body() {
	const [fault, again] = useErrorBoundary();
	if (fault)
		return div(h1(PAGES[app.page].title), note("fault", fault.message), button("Try again", again));
	if (!app.state || !app.forms || !app.runs) return p.sub("Reading the folder …");
	return div({ "data-shown": app.page }, h(VIEWS[app.page]));
}

function App() {
	const skip = (event) => {
		event.preventDefault(); // The target of this link is not a page.
		document.getElementById("page").focus();
	};
	const close = (one) => button("×", () => dismiss(one), "quiet", "Close");
	const message = (one) => note(one.kind, span(one.text), one.actions, close(one));
	return [
		a.skip({ href: "#page", onclick: skip }, "Skip to the page"),
		rail(),
		app.state && printed(),
		main({ id: "page", tabindex: -1 }, h(Body, { key: app.page })),
		p(
			{ id: "lost", class: "notice fault", role: "alert", hidden: !app.lost },
			"The server does not answer. The page shows its last state.",
		),
		div({ id: "toasts", role: "status", "aria-live": "polite" }, app.toasts.map(message)),
		dampers(),
		shortcuts(),
	];
}

const sheetOf = (id) => document.getElementById(id);
const sheet = (id, title, ...body) =>
	dialog(
		{ id, "aria-label": title },
		h2(title),
		body,
		div.actions(button("Close", () => sheetOf(id).close())),
	);

async function openDampers() {
	app.dampers = (await attempt(() => get(at`workspaces`)))?.dampers ?? [];
	app.draw();
	sheetOf("dampers").showModal();
}

function dampers() {
	const placeOf = (name) => (name === null ? "/" : `/damper/${encodeURIComponent(name)}/`);
	const isOpen = ({ name }) => (name ?? "") === DAMPER_NAME;
	const add = async (event) => {
		event.preventDefault();
		try {
			window.location.assign(
				placeOf((await post(at`workspaces`, { name: (app.newDamper ?? "").trim() })).name),
			);
		} catch (fault) {
			app.faults.dampers = fault.message; // The entry stays so that the user can correct it.
			app.draw();
		}
	};
	const link = (one) => (isOpen(one) ? b(one.shown) : a({ href: placeOf(one.name) }, one.shown));
	const discard = ({ name }) => removal("workspaces", name, () => sheetOf("dampers").close());
	const columns = [
		["damper", link, "name"],
		["files", ({ files }) => files, "n"],
		["fits", ({ cards }) => cards, "n"],
		["", (one) => !DAMPER_NAME && !isOpen(one) && discard(one)],
	];
	const type = (text) => Object.assign(app, { newDamper: text }).draw();
	const about = { id: "new-damper", maxlength: 60, placeholder: "such as RD-8040 no. 2" };
	return sheet(
		"dampers",
		"Dampers",
		p.small("Each damper has its own folder."),
		table("Dampers", columns, app.dampers ?? []),
		form(
			{ class: "row end", onsubmit: add },
			textField("Another damper", app.newDamper ?? "", type, about),
			tags.button.main("Create"),
		),
		app.faults.dampers && note("fault", app.faults.dampers),
	);
}

function shortcuts() {
	const pages = Object.values(PAGES).map(({ letter, title }) => [`g ${letter}`, title]);
	const others = [
		["Arrows, Home, End", "within a list or a long table"],
		["?", "this sheet"],
	];
	const rows = [...pages, ...others].map(([keys, words]) => p(kbd(keys), span(" ", words)));
	return sheet("shortcuts", "Keys", rows);
}

let before = "";

function press(event) {
	const typed = "input:not([type=checkbox]):not([type=range]), textarea, select";
	if (event.target.closest(typed) || event.ctrlKey || event.altKey || event.metaKey) return;
	const page = Object.keys(PAGES).find((name) => PAGES[name].letter === event.key);
	if (event.key === "?") sheetOf("shortcuts").showModal();
	else if (before === "g" && page) go(page);
	before = event.key;
}

app.draw = () => render(h(App), document.getElementById("root"));
dark.addEventListener("change", app.draw);
document.addEventListener("keydown", press);
// Without these listeners the browser would open a dropped file and leave the page.
for (const name of ["dragover", "drop"])
	window.addEventListener(name, (event) => event.preventDefault());
window.addEventListener("beforeprint", app.draw);
window.addEventListener("popstate", () => {
	const page = app.page;
	route();
	if (app.page === page) return;
	window.scrollTo(0, 0);
	document.getElementById("page").focus({ preventScroll: true });
});
window.addEventListener("unhandledrejection", ({ reason }) => {
	if (reason?.name !== "AbortError") toast("fault", reason?.message ?? String(reason));
});
route();
Promise.all([get(at`forms`), refresh()])
	.then(([forms]) => {
		app.forms = forms;
		route();
	})
	.catch((fault) => toast("fault", fault.message))
	.finally(watch);
