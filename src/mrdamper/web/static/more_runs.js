// Parts of the page Runs: public data, and a check of all runs without a fit.

import { getData } from "./api.js";
import { button, el, fill, note, table } from "./dom.js";
import { askOnce, filesOf, findingTable, JobPanel, notes } from "./parts.js";
import { firstScreen } from "./shown.js";

/** Return the list of public data sets with buttons that fetch them: `{node, close()}`. */
export function publicData(app) {
  const list = el("div");
  const made = el("div");
  const panel = new JobPanel(app, "fetch", {
    done: ({ answer }) => fill(made, note("good", `${answer.title}: ${answer.runs.join(", ")} lie with the runs, with their channels. Licence ${answer.licence}${answer.doi ? `, doi ${answer.doi}` : ""}.`), notes(answer.notes)),
    begun: () => fill(made),
    busy: (on) => list.querySelectorAll("button").forEach((one) => (one.disabled = on)),
  });
  const node = el(
    "details",
    { id: "public-data" },
    el("summary", { text: "Public data of real dampers" }),
    el("p", { class: "small", text: "Fetched by the server from github.com when you press Fetch, at one commit each; nothing else here needs a connection." }),
    list,
    panel.node,
    made,
  );
  askOnce(node, list, "Reading the list …", async () => {
    const { sets } = await getData();
    return table(
      [
        { title: "set", class: "name", cell: (set) => el("span", {}, el("b", { text: set.title }), el("br"), el("span", { class: "small", text: set.notes })) },
        { title: "files", number: true, cell: (set) => String(set.files.length) },
        { title: "licence", class: "whole", cell: (set) => set.licence },
        { title: "from", class: "name", cell: (set) => el("span", { class: "small", text: `${set.repository} at ${set.commit.slice(0, 10)}${set.doi ? `, doi ${set.doi}` : ""}` }) },
        { title: "", class: "whole", cell: (set) => button("Fetch", () => panel.start({ name: set.name }), { "aria-label": `Fetch ${set.title}`, "data-set": set.name }) },
      ],
      sets,
      { caption: "Public data sets" },
    );
  });
  return { node, close: () => panel.close() };
}

/** Return the check of all runs as a job with a report: `{node, attach(id), close()}`. */
export function checkAll(app) {
  const found = el("div");
  const start = button("Check all runs", () => panel.start({}), { id: "check-runs" });
  const panel = new JobPanel(app, "check", {
    done: (job) => {
      const { answer } = job;
      const told = answer.findings ?? [];
      fill(
        found,
        firstScreen(job),
        told.length > 0 && el("details", {}, el("summary", { text: "Findings of the check" }), findingTable(told)),
        filesOf(job, "check.html", "Open the report of the check"),
      );
    },
    begun: () => fill(found),
    busy: (on) => (start.disabled = on),
  });
  const node = el("section", { id: "check" }, el("h2", { text: "Check" }), el("p", { class: "small", text: "Checks each run and compares the runs, without a fit. The result is a report." }), el("div", { class: "actions" }, start), panel.node, found);
  return { node, panel, close: () => panel.close() };
}
