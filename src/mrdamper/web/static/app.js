// Frame of the pages: navigation, dampers, keyboard shortcuts, messages and the printed head.

import { addDamper, DAMPER_NAME, deleteDamper, getDampers, getForms } from "./api.js";
import { removal } from "./jobs.js";
import { ControllerPage } from "./page_controller.js";
import { DataPage } from "./page_data.js";
import { JobsPage } from "./page_jobs.js";
import { ModelPage } from "./page_model.js";
import { ThermalPage } from "./page_thermal.js";
import {
  app,
  attempt,
  cardInUse,
  chosen,
  dismiss,
  go,
  isRunning,
  PAGES,
  refresh,
  route,
  toast,
  watch,
} from "./state.js";
import { startTheme, switchTheme, theme } from "./theme.js";
import { button, field, note, table, tags } from "./ui.js";
import { h, render, useErrorBoundary } from "./vendor/preact.js";

const { a, b, dialog, div, form, h1, h2, header, input, kbd, li, main, nav, ol, p, span } = tags;
const VIEWS = {
  data: DataPage,
  model: ModelPage,
  thermal: ThermalPage,
  controller: ControllerPage,
  jobs: JobsPage,
};
const JOBS_OF = { thermal: ["heat", "heatsink"], controller: ["export", "track"] };
const USES_GEOMETRY = ["heat", "heatsink", "export"];
const FILES_MAX = 12; // Longer lists are shortened in print.

// -------------------------------------------------------------------------------------------- finished steps

/** Return the state `[state, words]` of the step of a page: `done`, `old` (out of date) or `open`. */
function stepOf(page) {
  const { files, jobs } = app.state;
  const card = cardInUse();
  if (page === "data")
    return files.some(({ state }) => state === "ready") ? ["done", "runs are read"] : ["open", ""];
  if (!card) return ["open", ""];
  const lastOf = (kind) =>
    jobs.find((job) => job.kind === kind && job.state === "done" && job.options.card === card.name);
  if (page === "model") {
    if (card.cancelled || !card.converged)
      return ["old", `the fit of ${card.name} was cancelled or did not converge`];
    const isLater = files.some(
      ({ modified }) => modified > (lastOf("fit")?.asked_at ?? card.modified),
    );
    return isLater
      ? ["old", `runs were added or changed after the fit of ${card.name}`]
      : ["done", `card ${card.name}`];
  }
  const [job] = (JOBS_OF[page] ?? []).map(lastOf).filter(Boolean);
  if (!job) return ["open", ""];
  const reason = reasonOf(job, card);
  return reason ? ["old", reason] : ["done", job.id];
}

/** Return the reason why a job is out of date; empty if it is not. */
function reasonOf({ kind, asked_at: asked, options }, card) {
  if (card.modified > asked) return `${card.name} has been fitted since`;
  if (!USES_GEOMETRY.includes(kind) || !options.damper) return "";
  const geometry = app.state.inputs.find(({ name }) => name === options.damper);
  if (geometry?.modified > asked) return `${geometry.name} has changed since`;
  const now = chosen("drawing");
  return now && now !== options.damper
    ? `it is of ${options.damper}, the geometry is ${now} now`
    : "";
}

// --------------------------------------------------------------------------------------------------- frame

function rail() {
  const { state } = app;
  const busy = state?.jobs.filter(isRunning).length ?? 0;
  const link = ([page, { title }]) => {
    const [step, words] = state ? stepOf(page) : ["open", ""];
    const current = page === app.page ? "page" : null;
    const badge =
      page === "jobs" &&
      span({ id: "busy", class: "badge", hidden: !busy, "aria-label": `${busy} at work` }, busy);
    return li(
      a(
        {
          href: `#/${page}`,
          "data-page": page,
          "data-step": step,
          title: words,
          "aria-current": current,
        },
        title,
        badge,
      ),
    );
  };
  return header(
    { class: "rail" },
    p(
      { class: "brand" },
      b("mrdamper"),
      button(state?.folder_name ?? "", openDampers, {
        id: "folder",
        class: "quiet",
        "aria-haspopup": "dialog",
        title: state?.folder,
      }),
    ),
    nav({ "aria-label": "Pages" }, ol(Object.entries(PAGES).map(link))),
    p(
      { class: "foot" },
      button(theme() === "dark" ? "Light" : "Dark", () => (switchTheme(), app.draw()), {
        id: "theme",
        "aria-label": "Change the colours",
      }),
      span({ id: "version" }, state?.versions.mrdamper),
    ),
  );
}

/** Return damper, date and files for a printed page. */
function printed() {
  const { files, folder_name: damper, versions } = app.state;
  const names = files.slice(0, FILES_MAX).map(({ name }) => name);
  const more = files.length > FILES_MAX ? ` and ${files.length - FILES_MAX} more` : "";
  const used = [cardInUse()?.name, chosen("drawing")].filter(Boolean).join(", ");
  const words = [
    `Damper: ${damper}`,
    `Printed: ${new Date().toLocaleString()}`,
    `Files: ${names.join(", ") || "none"}${more}`,
    used && `In use: ${used}`,
    `mrdamper ${versions.mrdamper}`,
  ];
  return p({ id: "printed" }, words.filter(Boolean).join(" · "));
}

function Body() {
  const [fault, again] = useErrorBoundary();
  if (fault)
    return div(h1(PAGES[app.page].title), note("fault", fault.message), button("Try again", again));
  if (!app.state || !app.forms || !app.runs) return p({ class: "sub" }, "Reading the folder …");
  return div({ "data-shown": app.page }, h(VIEWS[app.page]));
}

function App() {
  const skip = (event) => {
    event.preventDefault(); // The address of the link is not the address of a page.
    document.getElementById("page").focus();
  };
  return [
    a({ class: "skip", href: "#page", onclick: skip }, "Skip to the page"),
    rail(),
    app.state && printed(),
    main({ id: "page", tabindex: -1 }, h(Body, { key: app.page })),
    p(
      { id: "lost", class: "notice fault", role: "alert", hidden: !app.lost },
      "The server does not answer. The page shows its last state.",
    ),
    div(
      { id: "toasts", role: "status", "aria-live": "polite" },
      app.toasts.map((one) =>
        note(
          one.kind,
          span(one.text),
          one.actions,
          button("×", () => dismiss(one), { class: "quiet", "aria-label": "Close" }),
        ),
      ),
    ),
    dampers(),
    shortcuts(),
  ];
}

// -------------------------------------------------------------------------------------------------- dialogs

const sheetOf = (id) => document.getElementById(id);

async function openDampers() {
  app.dampers = (await attempt(getDampers))?.dampers ?? [];
  app.draw();
  sheetOf("dampers").showModal();
}

/** Return the list of dampers of the server; each has its own folder. */
function dampers() {
  const placeOf = (name) => (name === null ? "/" : `/damper/${encodeURIComponent(name)}/`);
  const isOpen = ({ name }) => (name ?? "") === DAMPER_NAME;
  const add = async (event) => {
    event.preventDefault();
    try {
      window.location.assign(
        placeOf((await addDamper(event.target.elements.name.value.trim())).name),
      );
    } catch (fault) {
      app.faults.dampers = fault.message; // The entry stays, to be corrected.
      app.draw();
    }
  };
  const link = (one) => (isOpen(one) ? b(one.shown) : a({ href: placeOf(one.name) }, one.shown));
  const columns = [
    { title: "damper", class: "name", cell: link },
    { title: "files", number: true, cell: ({ files }) => String(files) },
    { title: "fits", number: true, cell: ({ cards }) => String(cards) },
    {
      title: "",
      cell: (one) =>
        !DAMPER_NAME &&
        !isOpen(one) &&
        removal(deleteDamper, one.name, () => sheetOf("dampers").close()),
    },
  ];
  return dialog(
    { id: "dampers", "aria-label": "Dampers" },
    h2("Dampers"),
    p(
      { class: "small" },
      "Each has its own runs, geometry, fits, heat sinks, controllers and exports, in a folder of its own.",
    ),
    table(columns, app.dampers ?? []),
    form(
      { class: "row end", onsubmit: add },
      field(
        "Another damper",
        input({
          id: "new-damper",
          name: "name",
          maxlength: 60,
          placeholder: "such as RD-8040 no. 2",
        }),
      ),
      tags.button({ class: "main" }, "Create"),
    ),
    app.faults.dampers && note("fault", app.faults.dampers),
    div(
      { class: "actions" },
      button("Close", () => sheetOf("dampers").close()),
    ),
  );
}

function shortcuts() {
  const pages = Object.values(PAGES).map(({ letter, title }) => [`g ${letter}`, title]);
  const lists = [
    ["Tab", "the next field or list"],
    ["Arrows, Home, End", "within a list or a long table"],
    ["?", "this sheet"],
    ["Esc", "close it"],
  ];
  return dialog(
    { id: "shortcuts", "aria-label": "Keys" },
    h2("Keys"),
    div(
      { class: "keys" },
      [...pages, ...lists].map(([keys, words]) => p(kbd(keys), span(words))),
    ),
    button("Close", () => sheetOf("shortcuts").close()),
  );
}

let before = "";

function press(event) {
  const isTyping = event.target.closest(
    "input:not([type=checkbox]):not([type=range]), textarea, select",
  );
  if (isTyping || event.ctrlKey || event.altKey || event.metaKey) return;
  const page = Object.keys(PAGES).find((name) => PAGES[name].letter === event.key);
  if (event.key === "?") sheetOf("shortcuts").showModal();
  else if (before === "g" && page) go(page);
  before = event.key;
}

// --------------------------------------------------------------------------------------------------- start

app.draw = () => render(h(App), document.getElementById("root"));
startTheme(app.draw);
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
Promise.all([getForms(), refresh()])
  .then(([forms]) => {
    app.forms = forms;
    route();
  })
  .catch((fault) => toast("fault", fault.message))
  .finally(watch);
