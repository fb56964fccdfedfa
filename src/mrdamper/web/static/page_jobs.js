// Jobs: list of jobs with states and files, inputs, further jobs, and trash.

import { cancelJob, deleteInput, deleteJob, emptyTrash, getTrash, inputFile, jobFile, restore, resumeJob, startJob } from "./api.js";
import { bytes, button, duration, el, empty, fill, opening, table } from "./dom.js";
import { inputPicker, jobForm } from "./forms.js";
import { heading, keepInput, removal } from "./parts.js";

const PAGE_OF = { fit: "fit", evaluate: "fit", heat: "heating", heatsink: "heatsink", track: "tracking", export: "export", check: "runs" };
const MORE_JOBS = {
  fluid: ["A fluid from rheometer tables", "Fit a fluid"],
  derate: ["The largest current that keeps every limit", "Derate"],
  cycles: ["The cycles of a long record", "Count the cycles"],
  sweep: ["Many fits, random dampers or heat sinks", "Start the sweep"],
  demo: ["The demonstration on the virtual rig", "Run the demo on the virtual rig"],
}; // Jobs without a page: [title, label of the button].

export function show(place, app) {
  const list = el("div");
  const inputs = el("div");
  const more = el("div");
  const thrown = el("div");
  const forms = [];
  fill(place, heading("Jobs", "Two jobs run at a time. Their results are files in the folder, which the command line reads as well."), list, inputs, more, thrown);

  const actions = (job) => {
    const busy = job.state === "running" || job.state === "queued";
    return el(
      "span",
      { class: "row" },
      busy && button("Cancel", () => app.attempt(() => cancelJob(job.id)), { class: "quiet", "aria-label": `Cancel ${job.id}` }),
      (job.state === "done" || (job.state === "cancelled" && job.kind === "fit")) && PAGE_OF[job.kind] &&
        button("Show", () => app.go(PAGE_OF[job.kind], { job: job.id, ...(job.options.card ? { card: job.options.card } : {}) }), { class: "quiet", "aria-label": `Show ${job.id}` }),
      job.kind === "fluid" && job.state === "done" && button("Use", () => app.attempt(() => keepInput(app, job, "fluid.toml", `${job.id}.toml`, "Identify can take it.")), { class: "quiet", "aria-label": `Use the fluid of ${job.id}` }),
      job.resumable && button("Resume", () => app.attempt(() => resumeJob(job.id)), { class: "quiet", "aria-label": `Resume ${job.id}` }),
      !busy && removal(app, deleteJob, job.id),
    );
  };
  const draw = () => {
    const { jobs } = app.state;
    if (!jobs.length) {
      fill(list, empty("No jobs yet", "Fits, heat sinks, tracking and exports are listed here, with their files. Begin with runs of your damper.", button("Go to Runs", () => app.go("runs"))));
      return;
    }
    fill(
      list,
      table(
        [
          { title: "job", class: "whole", cell: (job) => el("b", { text: job.id }) },
          { title: "subject", class: "name", cell: (job) => subjectOf(job) },
          { title: "state", cell: (job) => el("span", { class: `tag ${job.state}`, text: job.state }) },
          { title: "asked", class: "whole", cell: (job) => when(job.asked_at) },
          { title: "took", number: true, cell: (job) => took(job) },
          { title: "progress", cell: (job) => job.message ?? (job.state === "done" ? "" : job.progress?.text ?? "") },
          { title: "files", class: "name", cell: (job) => files(job) },
          { title: "", cell: actions },
        ],
        jobs,
        { caption: "Jobs, newest first" },
      ),
    );
  };

  function drawInputs() {
    fill(
      inputs,
      el("h2", { text: "Inputs" }),
      el("p", { class: "small", text: "Geometry, sinks, fluids, scenarios and campaigns (TOML), load cycles and rheometer tables (CSV)." }),
      app.state.inputs.length > 0 &&
        table(
          [
            { title: "input", class: "name", cell: (input) => opening(inputFile(input.name), input.name) },
            { title: "size", number: true, cell: (input) => bytes(input.bytes) },
            { title: "", cell: (input) => removal(app, deleteInput, input.name) },
          ],
          app.state.inputs,
          { caption: "Inputs in the folder" },
        ),
      inputPicker(app, "Bring an input", ".toml,.csv", drawInputs),
    );
  }
  /** Return the form of a job without a page. */
  function jobPanel(kind, title, what) {
    const form = jobForm(app, kind);
    forms.push(form);
    const start = button(what, () => app.attempt(async () => startJob(kind, form.read())), { id: `start-${kind}` });
    return el("details", { id: `job-${kind}` }, el("summary", { text: title }), form.panel(title, start));
  }

  /** Show the trash, whose entries can be restored. */
  async function drawTrash() {
    const { trash } = (await app.attempt(getTrash)) ?? { trash: [] };
    fill(
      thrown,
      trash.length > 0 && [
        el("h2", { text: "Trash" }),
        table(
          [
            { title: "removed", class: "name", cell: (one) => one.names.join(", ") },
            { title: "", class: "whole", cell: (one) => button("Put back", () => app.attempt(() => restore(one.id)).then(drawTrash), { class: "quiet", "aria-label": `Put back ${one.names[0]}` }) },
          ],
          trash,
          { caption: "Newest first, in .trash of the folder" },
        ),
        el("div", { class: "actions" }, button("Empty the trash", () => window.confirm("Delete all items in the trash permanently?") && app.attempt(emptyTrash).then(drawTrash), { class: "danger" })),
      ],
    );
  }

  draw();
  drawInputs();
  drawTrash();
  fill(more, el("h2", { text: "More jobs" }), Object.entries(MORE_JOBS).map(([kind, [title, what]]) => jobPanel(kind, title, what)));
  return {
    changed(what) {
      if (what.includes("jobs")) draw();
      if (what.includes("inputs")) drawInputs();
      drawTrash();
      forms.forEach((form) => form.draw());
    },
  };
}

/** Return the subject of a job: a card, a record, an input. */
function subjectOf({ options, card }) {
  const { first, second, record, campaign, curve, name, tables } = options;
  return options.card ?? card ?? record ?? (first ? `${first}, ${second}` : [campaign ?? curve ?? tables ?? name ?? []].flat().join(", "));
}

const when = (text) => (text ? new Date(text).toLocaleString([], { dateStyle: "medium", timeStyle: "short" }) : "–");

function took(job) {
  if (!job.started_at) return "–";
  const end = job.ended_at ? new Date(job.ended_at) : new Date();
  const seconds = (end - new Date(job.started_at)) / 1000;
  return seconds < 120 ? `${Math.round(seconds)} s` : duration(seconds);
}

function files(job) {
  const all = job.files ?? [];
  const list = el("ul", { class: "plain" }, all.map((file) =>
    el("li", {}, el("a", { href: jobFile(job.id, file.path, !file.path.endsWith(".html")), target: file.path.endsWith(".html") ? "_blank" : null, rel: "noopener", text: file.path }), " ", el("span", { class: "small", text: bytes(file.bytes) }))));
  return all.length > 4 ? el("details", {}, el("summary", { text: `${all.length} files` }), list) : list;
}
