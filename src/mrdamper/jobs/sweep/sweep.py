"""The job behind ``mrdamper sweep``: many jobs of one kind, on this machine's processes or on a Dask cluster.

Every result is on the disk before the next one is asked for; ``resume`` goes on where a sweep ended,
however it ended, and comes to the same files as one that was never stopped. Nothing is printed here.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from pathlib import Path

import numpy as np

from mrdamper.errors import InputError
from mrdamper.jobs.sweep.executors import run_on_cluster, run_on_processes
from mrdamper.jobs.sweep.plan import Plan, Task, What, read_plan
from mrdamper.jobs.sweep.results import CHECKPOINT, Store
from mrdamper.runtime.outputs import atomic_output, write_json, write_table

__all__ = ["Report", "sweep"]

Report = Callable[[int, int, str], None]
"""Told how many of how many tasks are done, and which one was the last."""


def sweep(
    file: Path,
    out: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    report: Report | None = None,
) -> What:
    """Run the sweep that a TOML file asks for; write sweep.json, sweep.csv, sweep.html, cards to ``out``.

    Parameters
    ----------
    workers : processes of this machine; None: as many as it has cores
    scheduler : address of a Dask scheduler instead, ``tcp://host:port``
    resume : go on with the results that are in ``out``

    Raises
    ------
    InputError
        A plan that cannot be; a folder with other results; workers that die again and again.
    """
    if workers is not None and workers < 1:
        raise InputError(f"workers is {workers}; expected 1 or more")
    if workers is not None and scheduler is not None:
        raise InputError("workers are of this machine, a scheduler has its own; expected one of the two")
    plan = read_plan(file)
    with closing(Store(out, plan, resume=resume)) as store:
        left = [task for task in plan.tasks if task.name not in store.done]
        before = len(plan.tasks) - len(left)
        try:
            for task, result in _results(left, workers, scheduler):
                store.add(task.name, result)
                if report is not None:
                    report(len(store.done), len(plan.tasks), task.name)
        except KeyboardInterrupt:
            return {
                "kind": plan.kind,
                "cancelled": True,
                "done": len(store.done),
                "tasks": len(plan.tasks),
                "notes": [f"{len(store.done)} of {len(plan.tasks)} results are in {out}; ⟦--resume⟧ goes on"],
            }
        return _written(plan, store.done, out, file, taken_up=before)


def _results(left: list[Task], workers: int | None, scheduler: str | None) -> Iterator[tuple[Task, What]]:
    if scheduler is not None:
        return run_on_cluster(left, scheduler)
    return run_on_processes(left, workers or os.cpu_count() or 1)


def _written(plan: Plan, done: Mapping[str, What], out: Path, file: Path, *, taken_up: int) -> What:
    """Write the files of a sweep that is complete; they do not tell in what order or where it ran."""
    from mrdamper.report.sweep import render_sweep

    rows: list[What] = [{"name": task.name, **done[task.name]} for task in plan.tasks]
    failed = [{"name": row["name"], "error": row["error"]} for row in rows if "error" in row]
    whole = [row for row in rows if "error" not in row]
    answer: What = {
        "kind": plan.kind,
        "plan": file.name,
        "seed": plan.seed,
        "tasks": len(rows),
        "failed": failed,
        "summary": _summary(whole),
        "rows": [{"name": row["name"], **row["figures"]} for row in whole],
    }
    with atomic_output(out) as beside:
        write_json(beside / "sweep.json", answer)
        names = list(dict.fromkeys(name for row in whole for name in row["figures"]))
        write_table(
            beside / "sweep.csv",
            [
                {
                    "name": r["name"],
                    **{n: r.get("figures", {}).get(n) for n in names},
                    "error": r.get("error"),
                }
                for r in rows
            ],
        )
        (beside / "sweep.html").write_text(render_sweep(answer), encoding="utf-8")
        for row in whole:
            if "card" in row:
                (beside / "cards").mkdir(exist_ok=True)
                write_json(beside / "cards" / f"{row['name']}.json", row["card"])
    files = [str(out / name) for name in ("sweep.html", "sweep.json", "sweep.csv", CHECKPOINT)]
    return {
        **answer,
        "files": files,
        "cancelled": False,
        "taken_up": taken_up,
        "report": str(out / "sweep.html"),
    }


def _summary(rows: list[What]) -> dict[str, What]:
    """Return median, 5th and 95th percentile and extremes of every figure."""
    found: dict[str, What] = {}
    for name in dict.fromkeys(name for row in rows for name in row["figures"]):
        values = np.array([v for row in rows if (v := row["figures"].get(name)) is not None])
        if len(values):
            low, p5, median, p95, high = np.quantile(values, (0.0, 0.05, 0.5, 0.95, 1.0)).tolist()
            found[name] = {
                "count": len(values),
                "least": low,
                "p5": p5,
                "median": median,
                "p95": p95,
                "most": high,
            }
    return found
