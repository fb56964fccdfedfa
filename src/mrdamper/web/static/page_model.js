// Model: choice of the law and of held-out runs, the result of a fit, and the table of fits.

import { cardFile, deleteCard, getJob, putCard } from "./api.js";
import { fillForm, formOf, literal } from "./forms.js";
import {
  firstScreen,
  formPanel,
  groundsOf,
  jobOf,
  jobStatus,
  removal,
  resultOf,
  startButton,
  tabsOf,
} from "./jobs.js";
import {
  commonest,
  copiesOf,
  filtersOf,
  idOf,
  matching,
  motionOf,
  runList,
  foreignRunsOf,
} from "./runs.js";
import { address, app, attempt, choose, chosen, go, toast } from "./state.js";
import {
  button,
  check,
  empty,
  field,
  filePicker,
  fixed,
  number,
  opening,
  several,
  table,
  tag,
  tags,
  toggled,
} from "./ui.js";
import { linkedView } from "./view.js";

const { a, b, details, div, h1, h2, input, p, section, span, summary } = tags;
const RUNS_MAX = 3; // Runs that the loops of a fit show.
const NAME = /[/\\:*?"<>|\p{C}]+/gu;

/** Return a card name that is valid as the name of a folder. */
const cardName = (text) => text.replace(NAME, "-");

function freeName() {
  const taken = app.state.cards.map(({ name }) => name);
  let k = 2;
  while (taken.includes(`damper-${k}`)) k += 1;
  return taken.includes("damper") ? `damper-${k}` : "damper";
}

// -------------------------------------------------------------------------------------------- choice of runs

/** Return the runs to be fitted: those that match the filters, of one command unit, without the excluded ones. */
function fittedRuns(runs, without) {
  const usual = commonest(runs.map((run) => run.command_unit).filter(Boolean));
  const unit = chosen("choose.unit") ? () => true : (run) => !usual || run.command_unit === usual;
  return matching(runs, "choose").filter((run) => unit(run) && !without.includes(idOf(run, runs)));
}

function runChoice(runs, fitted, without) {
  const [copies, foreign] = [copiesOf(runs), foreignRunsOf(runs)];
  const found = matching(runs, "choose");
  const told = (marked, one, many) => {
    const count = found.filter((run) => marked.has(run)).length;
    return count ? `; ${count} ${count === 1 ? `is ${one}` : `are ${many}`}` : "";
  };
  const marks = (run) =>
    [
      copies.has(run) && `a copy of ${copies.get(run).name}`,
      foreign.get(run),
      run.worst === "fault" && "with a fault",
    ].filter(Boolean);
  const ids = fitted.map((run) => idOf(run, runs));
  const change = (next) => {
    const [one] = [...ids, ...next].filter((id) => ids.includes(id) !== next.includes(id));
    choose({ "choose.without": toggled(without, one) });
  };
  const words = `${ids.length} of ${several(runs.length, "run")}${told(copies, "a copy", "copies")}${told(foreign, "probably of another damper", "probably of another damper")}`;
  const isOpen = chosen("choose.open", false);
  return div(
    filtersOf(runs, "choose"),
    details(
      {
        id: "chosen-runs",
        open: isOpen,
        ontoggle: (event) =>
          event.target.open !== isOpen && choose({ "choose.open": event.target.open || null }),
      },
      summary(words),
      isOpen && runList(found, runs, ids, change, { words: "Fitted runs", marks }),
    ),
  );
}

/** Return files and names of the runs as options of a job; if all runs are chosen, both are empty. */
function runOptions(runs, fitted) {
  if (fitted.length === runs.length) return { files: null, only: [] };
  const files = [...new Set(fitted.map((run) => run.file))];
  const isWhole = runs.every((run) => fitted.includes(run) || !files.includes(run.file));
  return { files, only: isWhole ? [] : fitted.map((run) => literal(run.name)) };
}

/** Show the options of an earlier fit in the form. */
async function again(card, job, runs) {
  const { options } = await getJob(job.id); // The single record contains the file names.
  const isWanted = ({ file, name }) =>
    (!options.files || options.files.includes(file)) &&
    (!options.only?.length || options.only.includes(literal(name)));
  const without = runs.filter((run) => !isWanted(run)).map((run) => idOf(run, runs));
  const filters = Object.fromEntries(
    Object.keys(app.choice)
      .filter((key) => key.startsWith("choose."))
      .map((key) => [key, null]),
  );
  fillForm(
    "fit",
    { ...options, card: null, replace: false },
    { ...filters, "choose.without": without },
  );
  window.scrollTo(0, 0);
  toast("info", `The form shows the options of ${card.name}.`);
}

// --------------------------------------------------------------------------------------------------- result

/** Return the result of a fit: verdict, loops of the worst held-out runs, and the rest in tabs. */
function resultView(job, runs) {
  const { answer, options } = job;
  const { card } = options;
  const isHeld = ({ split }) => split === "held_out";
  const worst = [...answer.runs].sort(
    (x, y) => isHeld(y) - isHeld(x) || y.nrmse_percent - x.nrmse_percent,
  );
  const found = worst.map(({ name }) => runs.find((run) => run.name === name)).filter(Boolean);
  const picked = found.filter((run) => motionOf(run) === motionOf(found[0])).slice(0, RUNS_MAX);
  const link = (name) => address("data", { "view.runs": [name], "view.cards": [card] });
  const loops = () => linkedView({ runs, picked, cards: [card], prefix: "loops", panes: "dvfr" });
  const { tables } = answer.shown ?? { tables: [] };
  const sentence = answer.identifiability?.sentence;
  return [
    h2(`${card}: ${answer.law}`),
    firstScreen(job),
    groundsOf(job),
    div(
      { class: "actions" },
      button("How hot does it get?", () => go("thermal", { card }), { class: "main" }),
      button("Control it", () => go("controller", { card })),
      opening(cardFile(card, "report.html"), "Open the report", { class: "button" }),
      a(
        {
          class: "button",
          href: address("data", {
            "view.runs": picked.map((run) => idOf(run, runs)),
            "view.cards": [card],
          }),
        },
        "All plots",
      ),
      span({ class: "small" }, `${number(answer.cpu_s)} s of CPU`),
    ),
    tabsOf(
      "loops.tab",
      { ...job, answer: { ...answer, shown: { ...answer.shown, tables } } },
      { first: [["Loops", loops]], link },
    ),
    sentence && p({ class: "small" }, sentence),
  ];
}

// --------------------------------------------------------------------------------------------- table of fits

const range = (pair, unit) =>
  pair ? `${number(pair[0])} to ${number(pair[1])} ${unit ?? ""}` : "";
const stateOf = (card) =>
  card.cancelled
    ? "cancelled"
    : card.converged === false
      ? "not converged"
      : card.converged
        ? "yes"
        : "";
const COLUMNS = [
  { key: "name", title: "fit", class: "name", value: (card) => card.name },
  { key: "law", title: "law", value: (card) => card.law ?? "" },
  { key: "runs", title: "runs", number: true, value: (card) => card.runs },
  {
    key: "cost",
    title: "cost",
    unit: "%",
    number: true,
    value: (card) => card.cost_percent,
    decimals: 2,
  },
  { key: "converged", title: "converged", value: stateOf },
  {
    key: "held",
    title: "held out",
    unit: "%, median",
    number: true,
    value: (card) => card.held_out_percent,
    decimals: 2,
  },
  {
    key: "command",
    title: "command",
    value: (card) => range(card.envelope?.command, card.command_unit),
  },
  {
    key: "temperature",
    title: "temperature",
    value: (card) => range(card.envelope?.temperature_degC, "°C"),
  },
  {
    key: "modified",
    title: "date",
    value: (card) => String(card.modified).slice(0, 16).replace("T", " "),
  },
];

/** Return the fits that match the filter, in order. */
function sortedFits(sort) {
  const isDown = sort.startsWith("-");
  const column = COLUMNS.find(({ key }) => key === sort.replace("-", "")) ?? COLUMNS[0];
  const compare = (one, other) => {
    const [x, y] = [column.value(one) ?? null, column.value(other) ?? null];
    if (x === null || y === null) return (x === null) - (y === null);
    return (
      (isDown ? -1 : 1) *
      (column.number ? x - y : String(x).localeCompare(String(y), "en", { numeric: true }))
    );
  };
  const find = chosen("fits.find", "").toLowerCase();
  return app.state.cards
    .filter(({ name, law }) => `${name} ${law ?? ""}`.toLowerCase().includes(find))
    .sort(compare);
}

function fitTable(runs) {
  const all = app.state.cards;
  const names = all.map(({ name }) => name);
  const ticked = chosen("fits.ticked", []).filter((name) => names.includes(name));
  const sort = chosen("fits.sort", "-modified");
  const bring = ([file]) =>
    attempt(() => putCard(file, cardName(file.name.replace(/\.json$/i, ""))));
  const bringCard = filePicker("Bring a card", ".json", bring, { class: "" });
  const frame = (...body) => section({ id: "fits", "aria-label": "Fits" }, h2("Fits"), body);
  if (!all.length)
    return frame(
      p({ class: "small" }, "No card yet: identify one, or bring a card.json."),
      bringCard,
    );
  const jobOfCard = ({ name }) =>
    app.state.jobs.find((job) => job.kind === "fit" && job.options.card === name);
  const sorter = ({ key, title }) => {
    const [isUp, isDown] = [sort === key, sort === `-${key}`];
    const next = isUp ? `-${key}` : key;
    return button(
      `${title}${isUp ? " ↑" : isDown ? " ↓" : ""}`,
      () => choose({ "fits.sort": next }),
      { class: "quiet sort", "aria-label": `Sort by ${title}` },
    );
  };
  const cellOf = (column) => (card) => {
    const value = column.value(card);
    if (["cancelled", "not converged"].includes(value)) return tag("warning", value);
    return column.decimals ? fixed(value, column.decimals) : value;
  };
  const link = (card) => {
    const job = jobOfCard(card);
    const href = job
      ? address("model", { "fit.job": job.id, card: card.name })
      : address("data", { "view.cards": [card.name] });
    return a({ href, title: job ? "Its result" : "Its loops" }, b(card.name));
  };
  const tick = (card) =>
    check(
      "",
      ticked.includes(card.name),
      () => choose({ "fits.ticked": toggled(ticked, card.name) }),
      { "aria-label": `Overlay ${card.name}`, disabled: Boolean(card.error) },
    );
  const actions = (card) => {
    const job = jobOfCard(card);
    return span(
      { class: "row" },
      card.report &&
        opening(cardFile(card.name, "report.html"), "report", {
          "aria-label": `Report of ${card.name}`,
        }),
      job &&
        button("Again", () => attempt(() => again(card, job, runs)), {
          class: "quiet",
          "aria-label": `Again with the options of ${card.name}`,
        }),
      removal(deleteCard, card.name),
    );
  };
  const [first, ...others] = COLUMNS;
  const columns = [
    { title: "", cell: tick },
    {
      ...first,
      title: sorter(first),
      cell: (card) => [link(card), card.error && span({ class: "small" }, ` ${card.error}`)],
    },
    ...others.map((column) => ({
      class: "whole",
      ...column,
      title: sorter(column),
      cell: cellOf(column),
    })),
    { title: "", class: "whole", cell: actions },
  ];
  const shown = sortedFits(sort);
  const overlay = (more) =>
    go("data", { "view.cards": ticked, "view.colour": "card", "view.tab": null, ...more });
  const compare = {
    "show.kind": "compare",
    "compare.first": ticked[0],
    "compare.second": ticked[1],
  };
  const find = (event) => choose({ "fits.find": event.target.value || null });
  return frame(
    div(
      { class: "row end" },
      field(
        "Find",
        input({
          type: "search",
          id: "find-fit",
          value: chosen("fits.find", ""),
          placeholder: "name or law",
          oninput: find,
        }),
      ),
      button("Overlay", () => overlay({}), { disabled: !ticked.length }),
      button("Difference", () => overlay({ "view.against": ticked[0] }), {
        disabled: ticked.length !== 2,
      }),
      button("Report of the difference", () => go("jobs", compare), {
        disabled: ticked.length !== 2,
      }),
      bringCard,
    ),
    table(columns, shown, {
      label: "Fits",
      note: `${shown.length} of ${several(all.length, "fit")}`,
      tall: shown.length > 8,
    }),
  );
}

// ----------------------------------------------------------------------------------------------------- page

export function ModelPage() {
  const runs = app.runs.filter((run) => !run.error);
  const copies = [...copiesOf(runs).keys()].map((run) => idOf(run, runs));
  const without = chosen("choose.without", copies);
  const fitted = fittedRuns(runs, without);
  const form = formOf("fit", {
    given: { files: null, only: [] },
    offered: { runs: fitted.map(({ name }) => name) },
    preset: { card: freeName() },
  });
  const read = () => {
    const options = form.read();
    return { ...options, card: cardName(options.card ?? freeName()), ...runOptions(runs, fitted) };
  };
  const started = ({ card }) => choose({ card, "fit.card": null });
  const start = startButton("fit", "Identify", read, { started, disabled: !fitted.length });
  const job = jobOf("fit");
  const result = resultOf(job);
  const hint = runs.length
    ? empty(
        "No fit yet",
        `${several(runs.length, "run")} can be fitted. Keep the default law, hold out one or two runs, and press Identify. The fit takes seconds to a minute. You can leave this page during the fit.`,
      )
    : empty(
        "No runs to fit",
        "A model is identified from runs. Add files first, and map their channels if they are not understood.",
        button("Go to Data", () => go("data"), { class: "main" }),
      );
  return [
    h1("Model"),
    p(
      { class: "sub" },
      "One law for all currents and temperatures. The result is a card, which all later steps use.",
    ),
    div(
      { class: "split" },
      formPanel("What to fit", form, start, runChoice(runs, fitted, without)),
      div(jobStatus("fit", job), result ? resultView(result, runs) : !job && hint),
    ),
    fitTable(runs),
  ];
}
