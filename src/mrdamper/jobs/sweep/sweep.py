"""The job ``sweep``: many jobs of one kind, on this machine's processes or on a Dask cluster.

Every result is on the disk before the next one is asked for; a sweep that is taken up where it ended, however
it ended, comes to the same files as one that was never stopped.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from mrdamper.errors import InputError
from mrdamper.jobs.options import SweepOptions
from mrdamper.jobs.sweep.executors import run_on_cluster, run_on_processes
from mrdamper.jobs.sweep.plan import Plan, Task, What
from mrdamper.jobs.sweep.results import Store
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.schema import Json

_USUAL = SweepOptions()


@dataclass(frozen=True, slots=True)
class SweptTask:
    """What came of one task: figures by name, the card where one was identified; or why there is nothing."""

    name: str
    figures: Mapping[str, float | None]
    error: str
    card: Json | None


@dataclass(frozen=True, slots=True)
class FigureSummary:
    """A figure over all tasks that have it."""

    count: int
    least: float
    p5: float
    median: float
    p95: float
    most: float


@dataclass(frozen=True, slots=True)
class SweepResult:
    """The results of a sweep's tasks, in the plan's order; of those that are done, where it was cut short."""

    plan: Plan
    tasks: tuple[SweptTask, ...]
    taken_up: int  # results that were there before

    @property
    def cancelled(self) -> bool:
        """Whether an interrupt has cut the sweep short."""
        return len(self.tasks) < len(self.plan.tasks)

    @property
    def whole(self) -> list[SweptTask]:
        """The tasks that have figures."""
        return [task for task in self.tasks if not task.error]

    @property
    def failed(self) -> list[SweptTask]:
        """The tasks that have none."""
        return [task for task in self.tasks if task.error]

    @property
    def names(self) -> list[str]:
        """Names of all figures."""
        return list(dict.fromkeys(name for task in self.whole for name in task.figures))

    @property
    def summary(self) -> dict[str, FigureSummary]:
        """Median, 5th and 95th percentile and extremes of every figure."""
        found = {}
        for name in self.names:
            values = [v for task in self.whole if (v := task.figures.get(name)) is not None]
            if values:
                shares = np.quantile(np.array(values), (0.0, 0.05, 0.5, 0.95, 1.0)).tolist()
                found[name] = FigureSummary(len(values), *shares)
        return found


def sweep(
    plan: Plan,
    options: SweepOptions = _USUAL,
    *,
    checkpoint: Store | None = None,
    on_progress: Progress = silent,
) -> SweepResult:
    """Run the tasks of a plan; a ``checkpoint`` holds what is done, and keeps each result as it comes.

    Raises
    ------
    InputError
        Workers die again and again; no scheduler at the address.
    """
    if options.workers is not None and options.scheduler is not None:
        raise InputError("workers are of this machine, a scheduler has its own", expected="one of the two")
    done: dict[str, What] = {} if checkpoint is None else dict(checkpoint.done)
    left = [task for task in plan.tasks if task.name not in done]
    before = len(plan.tasks) - len(left)
    try:
        for task, result in _results(left, options):
            if checkpoint is not None:
                checkpoint.add(task.name, result)
            done[task.name] = result
            on_progress(ProgressUpdate(done=len(done), total=len(plan.tasks), text=task.name))
    except KeyboardInterrupt:
        if checkpoint is None:
            raise
    return SweepResult(
        plan,
        tuple(_swept(task.name, done[task.name]) for task in plan.tasks if task.name in done),
        before,
    )


def decisive(plan: Plan, options: SweepOptions) -> Json:
    """Return all that decides the results; those of another plan are not taken for this one's."""
    return {"plan": plan.fingerprint, "kind": plan.kind, "seed": plan.seed, "tasks": len(plan.tasks)}


def _swept(name: str, result: What) -> SweptTask:
    return SweptTask(name, result.get("figures", {}), result.get("error", ""), result.get("card"))


def _results(left: list[Task], options: SweepOptions) -> Iterator[tuple[Task, What]]:
    if options.scheduler is not None:
        return run_on_cluster(left, options.scheduler)
    return run_on_processes(left, options.workers or os.cpu_count() or 1)
