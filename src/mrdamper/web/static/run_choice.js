// Choice of the fitted runs by unit, motion, command and temperature, and by name. Copies are marked and not chosen.

import { check, el, fill } from "./dom.js";
import { literal } from "./forms.js";
import { copiesOf, runFilters, strangersOf } from "./run_marks.js";

/** Return the number of marked runs in words; empty if no run is marked. */
function told(runs, marked, one, several) {
  const count = runs.filter((run) => marked.has(run)).length;
  return count ? `; ${count} ${count === 1 ? `is ${one}` : `are ${several}`}` : "";
}

/**
 * Return the choice of runs: `{node, runs(), read()}`.
 *
 * @param {object[]} runs runs that can be fitted
 * @param {(byHand?: boolean) => void} changed called after a change of the choice; byHand: by the user
 */
export function runChoice(runs, changed) {
  const copies = copiesOf(runs);
  const aside = new Set(copies.keys());
  const strangers = strangersOf(runs);
  const filters = runFilters(runs, "choose", { oneUnit: true, changed: () => (draw(), changed(true)) });
  const said = el("summary");
  const picks = el("div", { class: "picks" });
  const each = el("details", { id: "chosen-runs" }, said, picks);

  const chosen = () => filters.matching().filter((run) => !aside.has(run));

  function say() {
    const found = filters.matching();
    said.textContent = `${chosen().length} of ${runs.length} runs${told(found, copies, "a copy", "copies")}${told(found, strangers, "a stranger", "strangers")}`;
  }

  function draw() {
    say();
    if (!each.open) return;
    fill(picks, filters.matching().map((run) => {
      const marks = [copies.has(run) && `a copy of ${copies.get(run).name}`, strangers.get(run), run.worst === "fault" && "with a fault"];
      const { box, node } = check([run.name, ...marks.filter(Boolean)].join(", "), !aside.has(run));
      box.addEventListener("change", () => {
        if (box.checked) aside.delete(run);
        else aside.add(run);
        say();
        changed(true);
      });
      return node;
    }));
  }
  each.addEventListener("toggle", draw);
  draw();
  return {
    node: el("div", { class: "wide" }, el("div", { class: "fields" }, filters.nodes), each),
    runs: chosen,
    /** Choose the runs of a job. */
    take({ files, only }) {
      const wanted = runs.filter((run) => (!files || files.includes(run.file)) && (!only?.length || only.includes(literal(run.name))));
      for (const { of, list, single } of filters.lists) list.value = single && wanted.length ? of(wanted[0]) : "";
      aside.clear();
      for (const run of runs) if (!wanted.includes(run)) aside.add(run);
      draw();
      changed();
    },
    /** Return the chosen files and names as options of a job; if all runs are chosen, both are empty. */
    read() {
      const wanted = new Set(chosen());
      if (wanted.size === runs.length) return { files: null, only: [] };
      const files = [...new Set([...wanted].map((run) => run.file))];
      const whole = runs.every((run) => wanted.has(run) || !files.includes(run.file));
      return { files, only: whole ? [] : [...wanted].map((run) => literal(run.name)) };
    },
  };
}
