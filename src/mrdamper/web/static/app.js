// Frame of the pages: routing, state of the folder, and notification of the page about changes.
//
// A page is a module with `show(place, app, query)`, which returns `{changed(what), address(query), close()}`; each member
// is optional. A page is loaded on its first use. The state of the folder is fetched again after each change.

import { DAMPER, getForms, getState, watchFolder } from "./api.js";
import { startDampers } from "./dampers.js";
import { addressed, button, el, fill, note, rove } from "./dom.js";
import { drawRail } from "./rail.js";
import { startShortcuts } from "./shortcuts.js";
import { startTheme } from "./theme.js";

const PAGES = {
  runs: () => import("./page_runs.js"),
  loops: () => import("./page_loops.js"),
  fit: () => import("./page_fit.js"),
  drawing: () => import("./page_drawing.js"),
  heating: () => import("./page_heating.js"),
  heatsink: () => import("./page_heatsink.js"),
  tracking: () => import("./page_tracking.js"),
  export: () => import("./page_export.js"),
  jobs: () => import("./page_jobs.js"),
};
const TITLES = { runs: "Runs", loops: "Loops", fit: "Fit", drawing: "Drawing", heating: "Heating", heatsink: "Heat sink", tracking: "Tracking", export: "Export", jobs: "Jobs" };
const TOAST_MS = { fault: 15000, warning: 12000, info: 6000, good: 5000 };

const place = document.getElementById("page");
const chosen = new Map();

/** Functions and state that all pages share. */
const app = {
  state: null,
  forms: null, // Fields of each kind of job.

  /** Fetch the state of the folder. */
  async refresh() {
    app.state = await getState();
    frame();
    return app.state;
  },

  /** Show a message at the edge of the page for some seconds. */
  toast(kind, text, ...actions) {
    const box = note(kind, el("span", { text }), actions);
    box.append(button("×", () => box.remove(), { class: "quiet", "aria-label": "Close" }));
    document.getElementById("toasts").append(box);
    setTimeout(() => box.remove(), TOAST_MS[kind]);
  },

  /** Run an action, and show its error. */
  async attempt(action) {
    try {
      return await action();
    } catch (fault) {
      if (fault.name !== "AbortError") app.toast("fault", fault.message);
      return undefined;
    }
  },

  /** Return the shared choice of a name in this window. */
  chosen: (name) => chosen.get(name) ?? fromSession(name),

  choose(name, value) {
    chosen.set(name, value);
    if (app.state) drawRail(app);
    try {
      sessionStorage.setItem(`mrdamper${DAMPER}-${name}`, value ?? "");
    } catch {
      // Without storage the choice is lost with the page.
    }
  },

  /** Show the page again, because missing items have arrived. */
  again: () => route(),

  /** Register a form of the current page. Its changed fields are stored in the address and restored from it. */
  remember(kind, form) {
    shown.forms.set(kind, form);
  },

  /** Store the value of a field in the address. */
  keepField(kind, name, value) {
    const query = addressed();
    query.delete(`${kind}.${name}`); // The address keeps the order of the changes.
    query.set(`${kind}.${name}`, JSON.stringify(value));
    app.keep(query);
  },

  /** Store the displayed job in the address instead of the fields of its form. */
  keepJob(kind, id) {
    const query = addressed();
    for (const name of [...query.keys()]) if (name.startsWith(`${kind}.`)) query.delete(name);
    query.set("job", id);
    app.keep(query);
  },

  /** Store the state of the page in its address. With `step`, Back undoes the change. */
  keep(query, step = false) {
    if (pageAsked() !== shown.name) return;
    const address = `#/${shown.name}${query.size ? `?${query}` : ""}`;
    if (address === window.location.hash) return;
    const depth = window.history.state?.depth ?? 0;
    if (step) window.history.pushState({ depth: depth + 1 }, "", address);
    else window.history.replaceState({ depth }, "", address);
  },

  /** Go to a page. */
  go(page, query = {}) {
    const asked = new URLSearchParams(query).toString();
    window.location.hash = `#/${page}${asked ? `?${asked}` : ""}`;
  },
};

function fromSession(name) {
  try {
    return sessionStorage.getItem(`mrdamper${DAMPER}-${name}`) || null;
  } catch {
    return null;
  }
}

function frame() {
  const { state } = app;
  drawRail(app);
  document.getElementById("folder").textContent = state.folder_name || "folder";
  document.getElementById("folder").title = state.folder || "";
  document.getElementById("version").textContent = state.versions?.mrdamper ?? "";
  const busy = state.jobs.filter((job) => job.state === "running" || job.state === "queued").length;
  const badge = document.getElementById("busy");
  badge.hidden = busy === 0;
  badge.textContent = String(busy);
  badge.setAttribute("aria-label", `${busy} at work`);
}

let shown = { name: null, page: null, forms: new Map() };

/** Set the fields that an address contains, in the order of their changes. */
async function restoreForms(query, forms) {
  for (const [key, text] of query) {
    const [kind, name] = key.split(".");
    if (!name || !forms.has(kind)) continue;
    try {
      await forms.get(kind).restore(name, JSON.parse(text));
    } catch {
      app.toast("warning", `The address names ${key} with a value that cannot be read; the field keeps its own.`);
    }
  }
}

/** Return the name of the page in the address. */
function pageAsked() {
  const [path] = window.location.hash.replace(/^#\/?/, "").split("?");
  return path in PAGES ? path : "runs";
}

let turn = 0;

async function route() {
  const [, asked] = window.location.hash.replace(/^#\/?/, "").split("?");
  const name = pageAsked();
  turn += 1;
  const mine = turn;
  for (const link of document.querySelectorAll("[data-page]")) {
    if (link.dataset.page === name) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  document.title = `${TITLES[name]} · mrdamper`;
  shown.page?.close?.();
  shown = { name, page: null, forms: new Map() };
  try {
    const [module] = await Promise.all([PAGES[name](), app.state ? null : app.refresh(), app.forms ? null : getForms().then((forms) => (app.forms = forms))]);
    if (mine !== turn) return;
    const body = el("div", { "data-shown": name });
    fill(place, body);
    window.scrollTo(0, 0);
    const page = (await module.show(body, app, new URLSearchParams(asked ?? ""))) ?? {};
    if (mine === turn) {
      shown.page = page;
      await restoreForms(new URLSearchParams(asked ?? ""), shown.forms);
    } else page.close?.(); // Another page was requested, so the listeners of this page are closed.
  } catch (fault) {
    if (mine === turn) fill(place, el("h1", { text: TITLES[name] }), note("fault", fault.message), button("Try again", route));
  }
}

let waiting = null;
const gathered = new Set();

/** Collect changes for a moment, fetch the state once, and notify the page once. */
function changed(what) {
  for (const each of what) gathered.add(each);
  waiting ??= setTimeout(async () => {
    waiting = null;
    const all = [...gathered];
    gathered.clear();
    try {
      await app.refresh();
    } catch {
      return; // The events are repeated when the server is available again.
    }
    shown.page?.changed?.(all);
  }, 120);
}

// Without these listeners the browser would open a dropped file and leave the page.
for (const name of ["dragover", "drop"]) window.addEventListener(name, (event) => event.preventDefault());

document.querySelector("a.skip").addEventListener("click", (event) => {
  event.preventDefault(); // The address of the link is not the address of a page.
  place.focus();
});
window.addEventListener("beforeprint", () => {
  const { state } = app;
  const names = state.files.map((file) => file.name);
  const files = names.length > 12 ? `${names.slice(0, 12).join(", ")} and ${names.length - 12} more` : names.join(", ");
  const used = ["card", "drawing"].map((name) => app.chosen(name)).filter(Boolean);
  document.getElementById("printed").textContent = [`Damper: ${state.folder_name}`, `Printed: ${new Date().toLocaleString()}`, `Files: ${files || "none"}`, used.length && `In use: ${used.join(", ")}`, `mrdamper ${state.versions.mrdamper}`].filter(Boolean).join(" · ");
});
startDampers(app, document.getElementById("folder"));
startTheme(document.getElementById("theme"));
startShortcuts(app.go, TITLES);
rove(document.querySelector(".rail .apart"))();
window.addEventListener("hashchange", () => {
  const [path, query] = window.location.hash.replace(/^#\/?/, "").split("?");
  if (path === shown.name && shown.page?.address) shown.page.address(new URLSearchParams(query ?? ""));
  else route().then(() => place.focus({ preventScroll: true }));
});
window.addEventListener("unhandledrejection", (event) => {
  if (event.reason?.name !== "AbortError") app.toast("fault", event.reason?.message ?? String(event.reason));
});
route();
watchFolder(changed, (there) => (document.getElementById("lost").hidden = there));
