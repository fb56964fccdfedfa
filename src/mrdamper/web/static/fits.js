// Table of fits with sorting and filter. Fits can be overlaid, compared, and repeated.

import { cardFile, deleteCard, putCard } from "./api.js";
import { addressed, button, check, el, field, filePicker, fill, fixed, number, opening, table } from "./dom.js";
import { removal } from "./parts.js";

const NAME = /[/\\:*?"<>|\p{C}]+/gu;

/** Return a card name that is valid as the name of a folder. */
export const cardName = (text) => text.replace(NAME, "-");

const COLUMNS = [
  { key: "name", title: "fit", value: (card) => card.name },
  { key: "law", title: "law", value: (card) => card.law ?? "" },
  { key: "runs", title: "runs", number: true, value: (card) => card.runs },
  { key: "cost", title: "cost", unit: "%", number: true, value: (card) => card.cost_percent, decimals: 2 },
  { key: "converged", title: "converged", value: (card) => (card.cancelled ? "cancelled" : card.converged == null ? "" : card.converged ? "yes" : "no") },
  { key: "held", title: "held out", unit: "%, median", number: true, value: (card) => card.held_out_percent, decimals: 2 },
  { key: "command", title: "command", value: (card) => range(card.envelope?.command, card.command_unit) },
  { key: "temperature", title: "temperature", value: (card) => range(card.envelope?.temperature_degC, "°C") },
  { key: "modified", title: "of", value: (card) => String(card.modified).slice(0, 16).replace("T", " ") },
];

/**
 * Return the table of fits: `{node, draw()}`.
 *
 * @param {object} app
 * @param {{again: (card: object, job: object | null) => void, compare: (first: string, second: string) => void}} heard
 */
export function fitTable(app, heard) {
  const asked = addressed();
  const state = { sort: asked.get("sort") ?? "-modified", find: asked.get("find") ?? "" };
  const ticked = new Set(asked.getAll("fit"));
  const rows = el("div");
  const find = el("input", { type: "search", id: "find-fit", value: state.find, placeholder: "name or law" });
  const load = filePicker(".json", ([file]) =>
    app.attempt(async () => {
      await putCard(cardName(file.name.replace(/\.json$/i, "")), file);
      await app.refresh();
      draw();
    }));
  const overlay = button("Overlay", () => look({}), { class: "main", title: "The forces of the ticked fits on the same runs, with their residuals" });
  const difference = button("Difference", () => look({ against: [...ticked][0] }), { title: "The force of the second less that of the first" });
  const report = button("Report of the difference", () => heard.compare(...ticked), { title: "A report of both, as the command compare writes it" });
  find.addEventListener("input", () => {
    state.find = find.value;
    keep();
    draw();
  });

  function keep() {
    const next = addressed();
    for (const name of ["sort", "find", "fit"]) next.delete(name);
    if (state.sort !== "-modified") next.set("sort", state.sort);
    if (state.find) next.set("find", state.find);
    for (const name of ticked) next.append("fit", name);
    app.keep(next);
  }

  function look(more) {
    const wanted = new URLSearchParams({ colour: "card", ...more });
    for (const name of ticked) wanted.append("card", name);
    window.location.hash = `#/loops?${wanted}`;
  }

  /** Return the matching fits in order. */
  function found() {
    const down = state.sort.startsWith("-");
    const column = COLUMNS.find(({ key }) => key === state.sort.replace("-", "")) ?? COLUMNS[0];
    const compare = (a, b) => {
      const [x, y] = [column.value(a), column.value(b)];
      if ((x ?? null) === null || (y ?? null) === null) return ((x ?? null) === null) - ((y ?? null) === null);
      return (down ? -1 : 1) * (column.number ? x - y : String(x).localeCompare(String(y), "en", { numeric: true }));
    };
    return app.state.cards
      .filter((card) => `${card.name} ${card.law ?? ""}`.toLowerCase().includes(state.find.toLowerCase()))
      .sort(compare);
  }

  const sorter = ({ key, title }) => {
    const down = state.sort === `-${key}`;
    const sorted = down || state.sort === key;
    return button(`${title}${sorted ? (down ? " ↓" : " ↑") : ""}`, () => {
      state.sort = sorted && !down ? `-${key}` : key;
      keep();
      draw();
    }, { class: "quiet sort", "aria-label": `Sort by ${title}` });
  };
  const jobOf = (card) => app.state.jobs.find((job) => job.kind === "fit" && job.options.card === card.name) ?? null;
  const cellOf = (column) => (card) => {
    const value = column.value(card);
    if (column.key === "converged" && ["cancelled", "no"].includes(value)) return el("span", { class: "tag warning", text: value === "no" ? "not converged" : value });
    return column.number && column.decimals ? fixed(value, column.decimals) : value;
  };

  function tick(card) {
    const { box, node } = check("", ticked.has(card.name), { "aria-label": `Overlay ${card.name}`, disabled: Boolean(card.error) });
    box.addEventListener("change", () => {
      if (!ticked.delete(card.name)) ticked.add(card.name);
      keep();
      ready();
    });
    return node;
  }

  function ready() {
    overlay.disabled = !ticked.size;
    difference.disabled = report.disabled = ticked.size !== 2;
  }

  function draw() {
    const known = new Set(app.state.cards.map((card) => card.name));
    for (const name of ticked) if (!known.has(name)) ticked.delete(name);
    ready();
    const shown = found();
    const link = (card) => {
      const job = jobOf(card);
      return el("a", { href: job ? `#/fit?job=${encodeURIComponent(job.id)}` : `#/loops?card=${encodeURIComponent(card.name)}`, title: job ? "Its result" : "Its loops" }, el("b", { text: card.name }));
    };
    const [name, ...others] = COLUMNS;
    fill(
      rows,
      table(
        [
          { title: "", cell: tick },
          { title: sorter(name), class: "name", cell: link },
          ...others.map((column) => ({ ...column, title: sorter(column), class: "whole", cell: cellOf(column) })),
          { title: "", class: "name", cell: (card) => (card.error ? el("span", { class: "small", text: card.error }) : "") },
          {
            title: "",
            class: "whole",
            cell: (card) =>
              el(
                "span",
                {},
                card.report && opening(cardFile(card.name, "report.html"), "report", { "aria-label": `Report of ${card.name}` }),
                " ",
                jobOf(card) && button("Again", () => heard.again(card, jobOf(card)), { class: "quiet", "aria-label": `Again with the options of ${card.name}`, title: "Fill the form with what was asked for" }),
                removal(app, deleteCard, card.name),
              ),
          },
        ],
        shown,
        { caption: `${shown.length} of ${app.state.cards.length} fits`, tall: shown.length > 8 },
      ),
    );
  }

  const bring = button("Bring a card", load.pick);
  const bar = el("div", { class: "row end" }, field("Find", find), overlay, difference, report, bring, load.picker);
  const node = el("section", { id: "fits", "aria-label": "Fits" }, el("h2", { text: "Fits" }), bar, rows);
  return {
    node,
    draw() {
      for (const one of [find.parentNode, overlay, difference, report]) one.hidden = !app.state.cards.length;
      if (app.state.cards.length) draw();
      else fill(rows, el("p", { class: "small", text: "No card yet: identify one, or bring a card.json." }));
    },
  };
}

const range = (pair, unit) => (pair ? `${number(pair[0])} to ${number(pair[1])} ${unit ?? ""}` : "");
