"""The job ``sweep``: run many fits, controller tests or heat-sink searches on processes or a Dask cluster.

Every result is stored on disk as soon as it is available. A resumed sweep writes the same files as a sweep
that was not interrupted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.errors import UsageError
from mrdamper.jobs.options import SweepOptions
from mrdamper.jobs.sweep.plan import Plan, Task, make_plan
from mrdamper.jobs.sweep.store import Store
from mrdamper.jobs.sweep.tasks import Result, run_on_cluster, run_on_processes
from mrdamper.models.card import ModelCard
from mrdamper.results import JobResult
from mrdamper.runtime.pool import usable_cores
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.schema import Json
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import DEFAULT_DUTY, Duty, read_duty

_USUAL = SweepOptions()


@dataclass(frozen=True, slots=True)
class SweptTask:
    """Result of one task: values by name, and the card if the task is a fit; or the error message."""

    name: str
    figures: Mapping[str, float | None]
    error: str
    card: Json | None


@dataclass(frozen=True, slots=True)
class FigureSummary:
    """Statistics of one value over all tasks with this value."""

    count: int
    least: float
    p5: float
    median: float
    p95: float
    most: float


@dataclass(frozen=True, slots=True, repr=False)
class SweepResult(JobResult):
    """The results of the finished tasks of a sweep, in the order of the plan."""

    _job = "sweep"
    plan: Plan
    tasks: tuple[SweptTask, ...]
    resumed: int  # number of results from an earlier, interrupted run of the same sweep

    @property
    def cancelled(self) -> bool:
        """Return True if the sweep was interrupted before all tasks were finished."""
        return len(self.tasks) < len(self.plan.tasks)

    @property
    def tasks_with_values(self) -> list[SweptTask]:
        """Return the tasks that succeeded."""
        return [task for task in self.tasks if not task.error]

    @property
    def failed(self) -> list[SweptTask]:
        """Return the tasks that ended with an error."""
        return [task for task in self.tasks if task.error]

    @property
    def names(self) -> list[str]:
        """Return the names of all values in the results, in order of first appearance."""
        return list(dict.fromkeys(name for task in self.tasks_with_values for name in task.figures))

    @property
    def statistics(self) -> dict[str, FigureSummary]:
        """Return count, minimum, maximum, median, 5th and 95th percentile of every value, by name."""
        found = {}
        for name in self.names:
            values = [v for task in self.tasks_with_values if (v := task.figures.get(name)) is not None]
            if values:
                shares = np.quantile(np.array(values), (0.0, 0.05, 0.5, 0.95, 1.0)).tolist()
                found[name] = FigureSummary(len(values), *shares)
        return found


def sweep(
    campaigns: Sequence[str | Path] | None = None,
    card: ModelCard | None = None,
    dampers: Sequence[DamperDrawing] | None = None,
    duty: Duty | None = None,
    law: str | None = None,
    options: SweepOptions = _USUAL,
    *,
    checkpoint: Store | None = None,
    on_progress: Progress = silent,
) -> SweepResult:
    """Fit campaigns, test controllers on random dampers, or search for heat sinks of several dampers.

    Parameters
    ----------
    campaigns : files, folders or patterns of runs; each match is one campaign with its own fit
    card : model card for the controllers, or for the dissipated power
    dampers : geometry of each damper that gets a heat sink
    duty : load cycle for the heat sinks
    law : hysteresis model of the fits; None: chosen by cross-validation
    checkpoint : store with the results of finished tasks; each new result is added to it

    Raises
    ------
    UsageError
        If not exactly one kind of sweep is given, the card is missing, or workers and a scheduler are both
        given.
    InputError
        If workers die repeatedly, no scheduler answers at the address, or the store contains results of a
        different sweep.
    """
    if options.workers is not None and options.scheduler is not None:
        raise UsageError("workers are of this machine, a scheduler has its own", expected="one of the two")
    plan = make_plan(campaigns, card, dampers, duty or read_duty(DEFAULT_DUTY), law, options)
    if checkpoint is not None:
        checkpoint.begin(plan.head)
    done: dict[str, Any] = {} if checkpoint is None else dict(checkpoint.done)
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
        tuple(_task_result(task.name, done[task.name]) for task in plan.tasks if task.name in done),
        before,
    )


def _task_result(name: str, result: Result) -> SweptTask:
    return SweptTask(name, result.get("figures", {}), result.get("error", ""), result.get("card"))


def _results(left: list[Task], options: SweepOptions) -> Iterator[tuple[Task, Result]]:
    if options.scheduler is not None:
        return run_on_cluster(left, options.scheduler)
    return run_on_processes(left, options.workers or usable_cores())
