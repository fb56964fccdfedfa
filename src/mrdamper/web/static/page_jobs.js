// Jobs: list of jobs with states and results, a form for any other job, inputs, and trash.

import {
  cancelJob,
  deleteInput,
  deleteJob,
  emptyTrash,
  getTrash,
  inputFile,
  restore,
  resumeJob,
} from "./api.js";
import { bringInput, fillForm, formOf } from "./forms.js";
import {
  filesOf,
  firstScreen,
  formPanel,
  groundsOf,
  jobStatus,
  keepInput,
  removal,
  resultOf,
  section,
  startButton,
  tabsOf,
} from "./jobs.js";
import { app, attempt, choose, chosen, go, isRunning, once } from "./state.js";
import {
  button,
  bytes,
  duration,
  empty,
  field,
  note,
  opening,
  select,
  table,
  tag,
  tags,
  when,
} from "./ui.js";

const { b, div, h1, h2, p, span } = tags;
const PAGE_OF = {
  fit: "model",
  heat: "thermal",
  heatsink: "thermal",
  track: "controller",
  export: "controller",
};
const TAB_OF = {
  heat: { "heat.tab": "Heating" },
  heatsink: { "heat.tab": "Heat sink" },
  track: { "track.page": "Try" },
  export: { "track.page": "Export" },
};
/** Jobs without a page of their own: titles of their forms. */
const OTHERS = {
  evaluate: "Predict runs with a card",
  compare: "Compare two cards",
  check: "Check all runs",
  rig: "Runs of the virtual rig",
  cycles: "Count the cycles of a long record",
  derate: "The largest current that keeps every limit",
  fluid: "Fit a fluid to rheometer tables",
  sweep: "Sweep: many fits, random dampers or heat sinks",
  demo: "Demonstration on the virtual rig",
};

/** Return the subject of a job: a card, a record, an input. */
function subjectOf({ options, card }) {
  const { first, second, record, campaign, name, tables } = options;
  const both = first && `${first}, ${second}`;
  return (
    options.card ?? card ?? record ?? both ?? [campaign ?? tables ?? name ?? []].flat().join(", ")
  );
}

/** Show a job on its page, with its options in the form there. */
function open({ id, kind, options }) {
  if (!(kind in PAGE_OF))
    return choose({ "show.job": id, "show.kind": kind in OTHERS ? kind : null });
  fillForm(kind, options);
  return go(PAGE_OF[kind], { [`${kind}.job`]: id, card: options.card ?? null, ...TAB_OF[kind] });
}

function jobTable(jobs) {
  const took = ({ started_at: from, ended_at: to }) =>
    from && duration(((to ? new Date(to) : new Date()) - new Date(from)) / 1000);
  const actions = (job) => {
    const { id, kind, state, resumable } = job;
    const isShown = state === "done" || (state === "cancelled" && kind === "fit");
    return span(
      { class: "row" },
      isRunning(job) &&
        button("Cancel", () => attempt(() => cancelJob(id)), {
          class: "quiet",
          "aria-label": `Cancel ${id}`,
        }),
      isShown && button("Show", () => open(job), { class: "quiet", "aria-label": `Show ${id}` }),
      resumable &&
        button("Resume", () => attempt(() => resumeJob(id)), {
          class: "quiet",
          "aria-label": `Resume ${id}`,
        }),
      !isRunning(job) && removal(deleteJob, id),
    );
  };
  return table(
    [
      { title: "job", class: "whole", cell: ({ id }) => b(id) },
      { title: "subject", class: "name", cell: subjectOf },
      { title: "state", cell: ({ state }) => tag(state) },
      { title: "started", class: "whole", cell: ({ asked_at: asked }) => when(asked) },
      { title: "duration", number: true, cell: took },
      {
        title: "progress",
        class: "name",
        cell: ({ message, progress, state }) =>
          message ?? (state === "done" ? "" : (progress?.text ?? "")),
      },
      { title: "files", number: true, cell: ({ files }) => String(files.length) },
      { title: "", cell: actions },
    ],
    jobs,
    { label: "Jobs, newest first", tall: true },
  );
}

/** Return the result of a job without a page. */
function resultView(job) {
  const result = resultOf(job);
  const use = () => attempt(() => keepInput(job, "fluid.toml", `${job.id}.toml`));
  return div(
    { id: "job-result" },
    h2(`${job.id}: ${subjectOf(job)}`),
    jobStatus(job.kind, job),
    result && [
      firstScreen(result),
      groundsOf(result),
      result.answer.title &&
        note(
          "good",
          `${result.answer.title}: ${result.answer.runs?.join(", ")}. Licence: ${result.answer.licence}.`,
        ),
      filesOf(result),
      job.kind === "fluid" &&
        button("Use this fluid", use, { "aria-label": `Use the fluid of ${job.id}` }),
      tabsOf("show.tab", result),
    ],
  );
}

/** Return the form of a job without a page. */
function otherJob() {
  const kind = chosen("show.kind", "evaluate");
  const form = formOf(kind);
  const started = () => choose({ "show.job": app.choice[`${kind}.job`] });
  const kinds = field(
    "Job",
    select(Object.entries(OTHERS), kind, (next) => choose({ "show.kind": next }), {
      id: "other-kind",
    }),
  );
  return formPanel("Another job", form, startButton(kind, "Start", form.read, { started }), kinds);
}

function inputTable() {
  const { inputs } = app.state;
  const columns = [
    { title: "input", class: "name", cell: ({ name }) => opening(inputFile(name), name) },
    { title: "kind", cell: ({ kind }) => kind },
    { title: "size", number: true, cell: ({ bytes: size }) => bytes(size) },
    { title: "", cell: ({ name }) => removal(deleteInput, name) },
  ];
  return section(
    "Inputs",
    p(
      { class: "small" },
      "Geometry, heat sinks, fluids, scenarios and campaigns (TOML), load cycles and rheometer tables (CSV).",
    ),
    inputs.length > 0 && table(columns, inputs, { label: "Inputs in the folder" }),
    bringInput("Bring an input", ".toml,.csv", () => {}),
  );
}

function trashTable() {
  const { trash = [] } =
    once(
      `trash ${app.trashed ?? 0} ${JSON.stringify(app.state.files.map(({ name }) => name))} ${app.state.jobs.length} ${app.state.inputs.length} ${app.state.cards.length}`,
      getTrash,
    ) ?? {};
  if (!trash.length) return null;
  const clear = () =>
    window.confirm("Delete all items in the trash permanently?") &&
    attempt(emptyTrash).then(() => Object.assign(app, { trashed: Date.now() }).draw());
  const back = (one) =>
    button("Put back", () => attempt(() => restore(one.id)), {
      class: "quiet",
      "aria-label": `Put back ${one.names[0]}`,
    });
  const columns = [
    { title: "removed", class: "name", cell: ({ names }) => names.join(", ") },
    { title: "", class: "whole", cell: back },
  ];
  return section(
    "Trash",
    table(columns, trash, { label: "Trash, newest first" }),
    div({ class: "actions" }, button("Empty the trash", clear, { class: "danger" })),
  );
}

export function JobsPage() {
  const { jobs } = app.state;
  const shown = jobs.find(({ id }) => id === chosen("show.job"));
  const nothing = empty(
    "No jobs yet",
    "Fits, heat sinks, tracking and exports are listed here, with their files.",
    button("Go to Data", () => go("data")),
  );
  return [
    h1("Jobs"),
    p(
      { class: "sub" },
      "Two jobs run at a time. Their results are files in the folder, which the command line reads as well.",
    ),
    jobs.length ? jobTable(jobs) : nothing,
    div(
      { class: "split gap" },
      otherJob(),
      div(
        shown && resultView(shown),
        !shown &&
          app.faults[chosen("show.kind", "evaluate")] &&
          note("fault", app.faults[chosen("show.kind", "evaluate")]),
      ),
    ),
    inputTable(),
    trashTable(),
  ];
}
