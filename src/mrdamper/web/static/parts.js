// Parts of several pages: headings, choice of a card, progress and files of a job, lists of notes.

import { cancelJob, follow, getJob, jobFile, putInput, restore, resumeJob, startJob } from "./api.js";
import { bytes, button, duration, el, empty, field, fill, has, note, number, opening, select, table } from "./dom.js";
import { cardsOf } from "./forms.js";

/** Return the heading of a page with its subtitle. */
export function heading(title, sub) {
  return [el("h1", { text: title }), el("p", { class: "sub", text: sub })];
}

/** Return a tile with a value and its `band`; `mark` names assumptions and extrapolation. */
export function tile(name, value, mark = "", band = "") {
  return el("div", { class: mark ? "tile marked" : "tile", title: mark }, el("span", { text: name }), el("b", { text: value }), band && el("small", { text: band }), mark && el("i", { text: mark }));
}

const BEYOND = /^(?:the duty's |the )?(\w+) .*; the card was identified/; // A note on a quantity outside the range of the card's runs.

/** Return the quantities in which a result exceeds the range of the card's runs; empty if there are none. */
export function beyondCard(answer) {
  const found = (answer.notes ?? []).map((text) => BEYOND.exec(text)?.[1]).filter(Boolean);
  return found.length ? `extrapolated: ${found.join(", ")}` : "";
}

/** Return a button that moves an item into the trash and offers to restore it. */
export function removal(app, remove, name, removed = () => {}) {
  const discard = async () => {
    const told = await app.attempt(() => remove(name));
    if (!told) return;
    removed();
    app.toast("info", `${name} was moved to the trash.`, button("Put back", () => app.attempt(() => restore(told.trash)), { class: "quiet" }));
  };
  return button("Remove", discard, { class: "quiet danger", "aria-label": `Remove ${name}` });
}

/** Copy a file of a job to the inputs. */
export async function keepInput(app, job, path, name, words) {
  await putInput(new File([await (await fetch(jobFile(job.id, path))).blob()], name));
  await app.refresh(); // The next page offers the new input.
  app.toast("good", `${name} is saved with the inputs; ${words}`);
}

/** Fill the body of a fold with the result of `ask` when it is opened first, and again after an error. */
export function askOnce(fold, body, waiting, ask) {
  let asked = false;
  fold.addEventListener("toggle", async () => {
    if (!fold.open || asked) return;
    asked = true;
    fill(body, el("p", { class: "small", text: waiting }));
    try {
      fill(body, await ask());
    } catch (fault) {
      asked = false;
      fill(body, note("fault", fault.message));
    }
  });
}

/** Return notes as a list; null if there are no notes. */
export function notes(texts) {
  const said = [...new Set(texts ?? [])];
  return said.length ? el("ul", { class: "notes" }, said.map((text) => el("li", { text }))) : null;
}

/** Return the name of the card in use: the requested, the chosen, or the newest card. */
export function cardInUse(app, asked = null) {
  const names = cardsOf(app).map((card) => card.name);
  return [asked, app.chosen("card")].find((name) => name && names.includes(name)) ?? newest(cardsOf(app))?.name ?? null;
}

function newest(cards) {
  return [...cards].sort((a, b) => String(b.modified).localeCompare(String(a.modified)))[0];
}

/** Return the choice of the card, which all pages share. */
export function cardField(app, name, onchange, { label = "Card", none = "", id = null } = {}) {
  const options = cardsOf(app).map((card) => [card.name, `${card.name} (${card.law})`]);
  const list = select(none ? [["", none], ...options] : options, name, { id });
  list.addEventListener("change", () => {
    if (!none) app.choose("card", list.value);
    onchange(list.value);
  });
  return { list, node: field(label, list) };
}

/**
 * Return the card of a page, its state, and the choice of another card.
 * Without cards the page only explains why a card is needed; `without` is its handle.
 */
export function cardPage(place, app, query, page, title, why) {
  if (!cardsOf(app).length) {
    fill(place, title, empty("No card yet", why, button("Go to Fit", () => app.go("fit"), { class: "main" })));
    return { without: { changed: () => cardsOf(app).length && app.again() } };
  }
  const card = cardInUse(app, query.get("card"));
  app.choose("card", card);
  const about = app.state.cards.find((one) => one.name === card);
  return { card, about, cards: cardField(app, card, (name) => app.go(page, { card: name })) };
}

/** Return a hint that names the controllers which a card does not support, with the reason; null if there are none. */
export function missingControllers(app, { name, controllers }) {
  const missing = app.state.choices.controllers.filter((one) => !controllers.includes(one));
  const banks = missing.filter((one) => one.startsWith("paper"));
  const others = missing.filter((one) => !banks.includes(one));
  const reasons = [
    banks.length && `${banks.join(", ")} (a bank of models, which the law of the card does not allow)`,
    others.length && `${others.join(", ")} (no run of the card steps its current, so that the delay of the force is unknown)`,
  ].filter(Boolean);
  return reasons.length ? el("p", { class: "hint", id: "missing-controllers", text: `Not available for ${name}: ${reasons.join("; ")}.` }) : null;
}

const AROUND_S = 0.5; // Time that is shown before and after a finding.
const BUSY = new Set(["queued", "running"]);

/** Panel of a job: progress, Cancel and errors. It finds a running job again after a reload. */
export class JobPanel {
  /**
   * @param {object} app
   * @param {string} kind
   * @param {{form?: object, press?: string, done?: (job: object) => void, progress?: (told: object) => void, begun?: () => void, busy?: (on: boolean) => void}} heard
   */
  constructor(app, kind, heard = {}) {
    Object.assign(this, { app, kind, heard, job: null, stop: null, gone: false });
    this.node = el("div", { class: "job", "data-job": kind });
    this.result = el("div", { id: `${kind}-result` }); // Used by pages with one job.
    this.button = button(heard.press ?? "", () => this.start(heard.form.read), { class: "main", id: `start-${kind}` });
  }

  /**
   * Fill a page with one job: the form and the result. The node `empty` is shown before the first result.
   *
   * @param {{title: any, label: string, first?: any[], above?: any[], empty: Node}} about
   *   first: fields in front of the form; above: nodes above the job and its result
   */
  fillPage(place, { title, label, first = [], above = [], empty: nothing }) {
    fill(this.result, nothing);
    const came = el("div", { class: above.length ? "gap" : "" }, this.node, this.result);
    fill(place, title, el("div", { class: "split" }, this.heard.form.panel(label, this.button, ...first), el("div", {}, above, came)));
  }

  /** Enable or disable the controls during a job. */
  busy(on) {
    this.button.disabled = on;
    this.heard.busy?.(on);
  }

  begun(job) {
    fill(this.result);
    this.heard.begun?.(job);
  }

  /**
   * Start a job; return true if the server accepted it.
   *
   * @param {object | (() => object)} options or the function that reads them from a form; an invalid entry starts no job
   */
  async start(options) {
    fill(this.node);
    try {
      const request = typeof options === "function" ? options() : options;
      this.busy(true);
      this.begun();
      const { id } = await startJob(this.kind, request);
      await this.attach(id);
      if (this.heard.form) this.app.keepJob(this.kind, id);
      this.showItself();
      return true;
    } catch (fault) {
      this.busy(false);
      fill(this.node, note("fault", fault.message));
      this.showItself();
      return false;
    }
  }

  /** Show an existing job: follow a running job, show the end of another one. */
  async attach(id) {
    this.leave();
    const job = await getJob(id);
    if (this.gone) return;
    this.job = job;
    this.node.dataset.id = id;
    this.heard.form?.set(job.options); // The form shows the options of the job.
    if (!BUSY.has(job.state)) {
      this.ended(job);
      return;
    }
    this.busy(true);
    this.begun(job);
    const bar = el("progress", { max: 1, "aria-label": "Progress" });
    const said = el("p", { class: "small", text: job.state === "queued" ? "Waiting for its turn …" : "Starting …" });
    const cancel = button("Cancel", async () => {
      cancel.disabled = true;
      said.textContent = "Stopping …";
      await this.app.attempt(() => cancelJob(id));
    });
    fill(this.node, el("div", { class: "panel progress" }, el("div", { class: "row" }, el("b", { text: id }), el("span", { class: "tag running", text: "at work" }), cancel), bar, said));
    this.stop = follow(id, {
      progress: (told) => {
        if (told.of > 0 && this.kind !== "fit") bar.value = told.done / told.of;
        if (!cancel.disabled) said.textContent = `${told.text ?? ""} · ${duration(told.t_s)}`;
        this.heard.progress?.(told);
      },
      message: (told) => {
        if (!cancel.disabled) said.textContent = told.text;
      },
      end: async () => {
        this.ended(await getJob(id));
        await this.app.refresh().catch(() => {}); // Update the badge.
      },
    });
  }

  /**
   * Show the job that the address names, else the newest that is running, else the newest that is done or can be resumed
   * (only jobs of a card, if a card is named). If the address names no job, shared choices stay in the form.
   */
  async resume(card = null, wanted = null) {
    const mine = this.app.state.jobs.filter((job) => job.kind === this.kind);
    const found =
      mine.find((job) => job.id === wanted) ??
      mine.find((job) => BUSY.has(job.state)) ??
      mine.find((job) => (job.state === "done" || job.resumable) && (!card || job.options.card === card));
    if (found) await this.attach(found.id);
    if (found?.id !== wanted) this.heard.form?.share();
    return found ?? null;
  }

  ended(job) {
    this.job = job;
    this.busy(false);
    fill(this.node, job.state !== "done" && endNote(job), job.resumable && el("p", {}, this.again(job)));
    if (job.answer) this.heard.done?.(job);
    else if (job.state === "failed") this.showItself();
  }

  /** Scroll to the message, because its button may be far below. */
  showItself() {
    if (this.node.isConnected) this.node.scrollIntoView({ block: "nearest" });
  }

  /** Return a button that resumes a job. */
  again(job) {
    return button("Resume", (event) => {
      event.target.disabled = true;
      return this.app.attempt(async () => {
        await resumeJob(job.id);
        await this.attach(job.id);
      });
    }, { "aria-label": `Resume ${job.id}` });
  }

  /** Stop following the job. */
  leave() {
    this.stop?.();
    this.stop = null;
  }

  /** Stop the panel because the page is left. */
  close() {
    this.gone = true;
    this.leave();
  }
}

function endNote(job) {
  if (job.state === "failed") return note("fault", `${job.id} did not finish.\n${job.message ?? ""}`);
  if (job.state === "interrupted") return note("warning", `${job.id} was interrupted: the server stopped during the job. ${job.resumable ? "Resume continues after its finished parts." : "Start it again."}`);
  if (job.resumable) return note("warning", `${job.id} was cancelled. Its finished parts are kept, and Resume continues after them.`);
  const seen = job.answer && job.kind === "fit" ? "the page shows the best result so far, which is not converged." : "";
  return note("warning", seen ? `${job.id} was cancelled; ${seen}` : `${job.id} was cancelled before it had a result.`);
}

/** Return links to the report of a job and to its other files. */
export const filesOf = (job, report, words = "Open the report") =>
  el("div", { class: "actions" }, opening(jobFile(job.id, report), words, { class: "button" }), fileLinks(job, { only: (path) => !path.endsWith(".html") }));

/** Return links to a job's files. */
export function fileLinks(job, { only = null } = {}) {
  const files = (job.files ?? []).filter((file) => !only || only(file.path));
  if (!files.length) return null;
  return el("div", { class: "row files" }, files.map((file) =>
    el("a", { class: "button", href: jobFile(job.id, file.path, true), download: file.path.split("/").pop() }, file.path, el("span", { class: "small", text: bytes(file.bytes) }))));
}

/**
 * Return a table of findings with position, effect and remedy.
 *
 * Each finding links to its position in the linked view.
 */
export function findingTable(findings) {
  const led = (one, text) => (text ? el("a", { href: placeOf(one), text }) : text);
  return table(
    [
      { title: "", cell: (one) => el("span", { class: `tag ${one.severity}`, text: one.severity }) },
      { title: "run", class: "name", cell: (one) => led(one, one.run) },
      { title: "where", class: "whole", cell: (one) => (has(one.from_s) ? led(one, whereOf(one)) : whereOf(one)) },
      { title: "finding", class: "name", cell: (one) => one.found },
      { title: "effect on a fit", class: "name", cell: (one) => one.effect },
      { title: "remedy", class: "name", cell: (one) => one.remedy },
    ],
    findings,
    { caption: "Findings" },
  );
}

/** Return the address of a finding in the linked view. */
function placeOf({ run, file, from_s: from, to_s: to }) {
  const query = new URLSearchParams({ run, ...(file ? { file } : {}) });
  if (has(from)) {
    const end = to ?? from;
    const around = Math.max(AROUND_S, (end - from) / 2);
    query.set("t", `${from - around}_${end + around}`);
  }
  return `#/loops?${query}`;
}

function whereOf(one) {
  const channel = one.channel || "";
  if (!has(one.from_s)) return channel;
  const [from, to] = [one.from_s, one.to_s].map((seconds) => number(seconds, 4));
  return `${channel} at ${from}${to === "–" || to === from ? "" : ` to ${to}`} s`;
}
