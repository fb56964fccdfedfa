// Jobs on a page: start, progress, end, and the result as the server sends it.

import { cancelJob, getJob, jobFile, putInput, resumeJob, restore, startJob } from "./api.js";
import { address, app, attempt, choose, chosen, isRunning, once, refresh, toast } from "./state.js";
import {
  button,
  bytes,
  duration,
  fold,
  has,
  note,
  notes,
  number,
  opening,
  table,
  tag,
  tags,
  tile,
} from "./ui.js";

const { a, b, div, form, h2, p, progress, span } = tags;

// --------------------------------------------------------------------------------------------------- start

/** Return the job of a kind that a page shows: the one in the address, the running, or the newest one of a card. */
export function jobOf(kind, card = null) {
  const mine = app.state.jobs.filter((job) => job.kind === kind);
  const isResult = (job) =>
    (job.state === "done" || job.resumable) && (!card || job.options.card === card);
  const found =
    mine.find(({ id }) => id === chosen(`${kind}.job`)) ??
    mine.find(isRunning) ??
    mine.find(isResult);
  return found ?? null;
}

/** Return a job with its answer, null until it has ended and has been fetched. */
export function resultOf(job) {
  if (!job || isRunning(job)) return null;
  const found = once(`job ${job.id} ${job.ended_at}`, () => getJob(job.id));
  return found?.answer ? found : null;
}

/** Start a job with the options that `read` returns; an invalid entry starts no job. */
async function start(kind, read, started) {
  app.faults[kind] = app.starting = null;
  try {
    const options = read();
    app.starting = kind;
    app.draw();
    const { id } = await startJob(kind, options);
    choose({ [`${kind}.job`]: id });
    started?.(options);
    await refresh(false);
  } catch (fault) {
    app.faults[kind] = fault.message;
  }
  app.starting = null;
  app.draw();
  document.querySelector(`[data-job=${kind}]`)?.scrollIntoView({ block: "nearest" });
}

/** Return the button that starts a job. */
export function startButton(
  kind,
  words,
  read,
  { started, disabled, id = `start-${kind}`, ...props } = {},
) {
  const isBusy =
    app.starting === kind || app.state.jobs.some((job) => job.kind === kind && isRunning(job));
  return button(words, () => start(kind, read, started), {
    class: "main",
    id,
    disabled: disabled || isBusy,
    ...props,
  });
}

/** Return a panel with a form and its button. */
export const formPanel = (words, fields, start, ...first) =>
  form(
    { class: "panel", "aria-label": words, onsubmit: (event) => event.preventDefault() },
    first,
    fields.nodes(),
    fields.more(),
    div({ class: "actions" }, start),
  );

/** Return progress, Cancel, error or end of a job of a kind. */
export function jobStatus(kind, job) {
  const fault = app.faults[kind];
  return div(
    { class: "job", "data-job": kind, "data-id": job?.id },
    fault && note("fault", fault),
    job && (isRunning(job) ? atWork(job) : endOf(job)),
  );
}

function atWork(job) {
  const { done, of, text } = job.progress ?? {};
  const seconds = job.started_at ? (Date.now() - new Date(job.started_at)) / 1000 : null;
  const words =
    job.state === "queued"
      ? "Waiting for its turn …"
      : `${text ?? "Starting …"} · ${duration(seconds)}`;
  return div(
    { class: "panel progress" },
    div(
      { class: "row" },
      b(job.id),
      tag("running", "at work"),
      button("Cancel", () => attempt(() => cancelJob(job.id))),
    ),
    progress({
      max: 1,
      "aria-label": "Progress",
      value: of > 0 && job.kind !== "fit" ? done / of : undefined,
    }),
    p({ class: "small" }, words),
  );
}

function endOf(job) {
  if (job.state === "done") return null;
  const resume =
    job.resumable &&
    button("Resume", () => attempt(() => resumeJob(job.id)), { "aria-label": `Resume ${job.id}` });
  const kept = job.resumable ? "Resume continues after its finished parts." : "";
  const words = {
    failed: `${job.id} did not finish.\n${job.message ?? ""}`,
    interrupted: `${job.id} was interrupted: the server stopped during the job. ${kept || "Start it again."}`,
    cancelled: `${job.id} was cancelled. ${kept || (job.kind === "fit" ? "The page shows the best result so far, which is not converged." : "")}`,
  }[job.state];
  return note(job.state === "failed" ? "fault" : "warning", words, " ", resume);
}

// -------------------------------------------------------------------------------------------------- result

const BEYOND = /^(?:the duty's |the )?(\w+) .*; the card was identified/; // A note on a quantity outside the card's runs.

/** Return the quantities in which a result exceeds the range of the card's runs; empty if there are none. */
export function beyondCard({ notes: texts }) {
  const found = (texts ?? []).map((text) => BEYOND.exec(text)?.[1]).filter(Boolean);
  return found.length ? `extrapolated: ${found.join(", ")}` : "";
}

/** Return the verdict and three values with their bands. */
export function firstScreen({ kind, answer }) {
  if (!answer.shown) return null;
  const mark = beyondCard(answer);
  return [
    p({ class: "verdict" }, answer.shown.verdict),
    div(
      { class: "tiles three", id: `${kind}-tiles` },
      answer.shown.tiles.map(({ label, value, band }) => tile(label, value, mark, band)),
    ),
  ];
}

/** Return the subject of a result and its warnings. */
export const groundsOf = ({ answer: { shown } }) =>
  shown && [
    p({ class: "small" }, shown.subject),
    shown.flags.map(([lead, text]) => note("warning", b(lead), ` ${text}`)),
  ];

const SHORT = 22; // Cells with at most this number of letters are not wrapped.

/**
 * Return one table of a result; `link(run)` is the address of a run. With a `choice`, `{pick(n), isPicked(n), words(cells)}`,
 * a button in the first column chooses a row.
 */
export function tableOf({ title, caption, folded, columns, rows }, { link, choice } = {}) {
  const cell = (column, k) => (row) => {
    const text = row.cells[k];
    if (column.names_run && link) return a({ href: link(text) }, text);
    if (k || !choice) return text;
    const n = rows.indexOf(row);
    const pressed = String(choice.isPicked(n));
    return button(choice.words(row.cells), () => choice.pick(n), {
      class: "quiet",
      "aria-pressed": pressed,
    });
  };
  const isShort = (k) => rows.every(({ cells }) => (cells[k] ?? "").length <= SHORT);
  const rowClass = (row) =>
    choice?.isPicked(rows.indexOf(row)) ? "chosen" : row.held ? "held" : "";
  const shown = columns.map((column, k) => ({
    ...column,
    class: isShort(k) ? "whole" : "name",
    cell: cell(column, k),
  }));
  const made = table(shown, rows, { label: title, rowClass });
  return [caption && p({ class: "small" }, caption), folded ? fold(folded, made) : made];
}

/** Return a row of tabs and the body of the chosen one; `tabs` are `[title, body()]` pairs, empty ones are omitted. */
export function tabbed(key, tabs, words = "Parts of the result") {
  const shown = tabs.filter(Boolean);
  const [title, body] = shown.find(([one]) => one === chosen(key)) ?? shown[0];
  const one = ([text]) =>
    button(text, () => choose({ [key]: text }), {
      role: "tab",
      "aria-selected": String(text === title),
    });
  return div(
    div({ class: "tabs", role: "tablist", "aria-label": words }, shown.map(one)),
    div({ key: title }, body()),
  );
}

/** Return tables and notes of a result as tabs, after the tabs in `first`. */
export const tabsOf = (key, { answer }, { first = [], link } = {}) =>
  tabbed(key, [
    ...first,
    ...(answer.shown?.tables ?? []).map((one) => [one.title, () => tableOf(one, { link })]),
    [
      "Notes",
      () => notes(answer.shown?.notes ?? answer.notes) ?? p({ class: "small" }, "No notes."),
    ],
  ]);

/** Return links to the report of a job, if it has one, and to its other files. */
export function filesOf(job, { words = "Open the report", only = () => true } = {}) {
  const files = (job.files ?? []).filter(({ path }) => only(path));
  const isReport = ({ path }) => path.endsWith(".html");
  const name = (path) => path.split("/").pop();
  return div(
    { class: "actions" },
    files
      .filter(isReport)
      .map(({ path }) => opening(jobFile(job.id, path), words, { class: "button" })),
    files
      .filter((one) => !isReport(one))
      .map(({ path, bytes: size }) =>
        a(
          { class: "button", href: jobFile(job.id, path, true), download: name(path) },
          path,
          span({ class: "small" }, bytes(size)),
        ),
      ),
  );
}

/** Copy a file of a job to the inputs. */
export async function keepInput(job, path, name) {
  await putInput(new File([await (await fetch(jobFile(job.id, path))).blob()], name));
  toast("good", `${name} is saved with the inputs.`);
}

/** Return a button that moves an item into the trash and offers to restore it. */
export function removal(remove, name, removed = () => {}) {
  const discard = async () => {
    const answer = await attempt(() => remove(name));
    if (!answer) return;
    removed();
    toast(
      "info",
      `${name} was moved to the trash.`,
      button("Put back", () => attempt(() => restore(answer.trash)), { class: "quiet" }),
    );
  };
  return button("Remove", discard, { class: "quiet danger", "aria-label": `Remove ${name}` });
}

// ------------------------------------------------------------------------------------------------ findings

const AROUND_S = 0.5; // Time that is shown before and after a finding.

/** Return findings in groups of one kind; each run links to its position in the plots. */
export function findingList(findings) {
  const groups = new Map();
  for (const one of findings) {
    const key = `${one.severity}: ${one.found.replace(/[-−+]?\d[\d.,]*/g, "#")}`;
    groups.set(key, [...(groups.get(key) ?? []), one]);
  }
  const order = ["fault", "warning", "note"];
  const all = [...groups.values()].sort(
    (x, y) => order.indexOf(x[0].severity) - order.indexOf(y[0].severity),
  );
  return all.map((group) => {
    const [first] = group;
    const title = [
      tag(first.severity),
      ` ${first.found}`,
      group.length > 1 && ` (and ${group.length - 1} similar)`,
    ];
    const place = (one) => [
      a({ href: placeOf(one) }, `${one.run}${whereOf(one)}`),
      group.length > 1 && `: ${one.found}`,
    ];
    return fold(
      title,
      p({ class: "small" }, `${first.effect}. ${first.remedy}.`),
      tags.ul(
        { class: "notes" },
        group.map((one) => tags.li(place(one))),
      ),
    );
  });
}

/** Return the address of a finding in the linked view. */
function placeOf({ run, from_s: from, to_s: to }) {
  if (!has(from)) return address("data", { "view.runs": [run] });
  const around = Math.max(AROUND_S, ((to ?? from) - from) / 2);
  return address("data", { "view.runs": [run], "view.t": [from - around, (to ?? from) + around] });
}

function whereOf({ channel, from_s: from, to_s: to }) {
  if (!has(from)) return channel ? `, ${channel}` : "";
  const end = has(to) && to !== from ? ` to ${number(to, 4)}` : "";
  return `, ${channel || "time"} at ${number(from, 4)}${end} s`;
}

/** Return the title of a section with its body. */
export const section = (title, ...body) => tags.section({ "aria-label": title }, h2(title), body);
