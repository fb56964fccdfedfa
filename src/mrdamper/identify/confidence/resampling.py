"""Bootstrap by runs: how far the parameters move when other runs of the same kind had been measured.

Unlike standard errors it feels what differs from run to run, and not only within one. Runs are prepared
once; a draw is their weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.checkpoint import CheckpointStore, NoCheckpoint, kept_pieces
from mrdamper.identify.problem import FitProblem, FitResult, PreparedFit
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.runtime.pool import ONE_CORE, Pool
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent

_SAME_LEVEL_K = 5.0  # runs whose mean temperatures are no further apart are at one level


@dataclass(frozen=True, slots=True, eq=False)
class Bootstrap:
    """The parameters fitted to runs drawn with replacement. What is NaN had fewer than two draws."""

    names: tuple[str, ...]
    values: FloatArray  # shape (draws that succeeded, parameters)
    asked: int
    failed: int  # draws without an admissible fit
    cancelled: bool

    @property
    def draws(self) -> int:
        """Number of draws that the figures rest on."""
        return len(self.values)

    @property
    def standard_deviation(self) -> dict[str, float]:
        spread = np.std(self.values, axis=0, ddof=1) if self.draws > 1 else self._unknown()
        return dict(zip(self.names, spread.tolist(), strict=True))

    @property
    def percentiles(self) -> dict[str, tuple[float, float]]:
        """The 5th and 95th percentile of each parameter."""
        if self.draws > 1:
            low, high = np.percentile(self.values, [5.0, 95.0], axis=0)
        else:
            low = high = self._unknown()
        return {name: (float(a), float(b)) for name, a, b in zip(self.names, low, high, strict=True)}

    def _unknown(self) -> FloatArray:
        return np.full(len(self.names), np.nan)


def bootstrap(
    problem: FitProblem,
    result: FitResult,
    *,
    draws: int = 50,
    seed: int = 0,
    stratified: bool = False,
    on_progress: Progress = silent,
    checkpoint: CheckpointStore | None = None,
    pool: Pool = ONE_CORE,
) -> Bootstrap:
    """Return the parameters fitted to runs drawn with replacement, each draw from the fit's own parameters.

    A draw is as many runs as there are. A run that is drawn twice counts twice; runs are prepared once and
    the law's conditions are those of all runs.

    Parameters
    ----------
    stratified : keep at least one run at each command and each temperature in every draw: where one is
        missing, a run of it takes the place of one that can be spared. A level with a single run then is
        always there, so that the spread does not show what its loss would mean.
    on_progress : is told of every draw; an interrupt (Ctrl-C) keeps the draws so far
    checkpoint : recalls and keeps every draw
    pool : does the draws; the result does not depend on it

    Raises
    ------
    InputError
        There is nothing to draw from: one run, or with ``stratified`` one run at each level.
    """
    prepared = problem.prepare()
    levels = _levels(problem.runs) if stratified else []
    sole = {int(members[0]) for members in levels if len(members) == 1}
    if len(prepared) < 2 or len(sole) == len(prepared):
        why = (
            "each is the only one at its command or temperature" if len(prepared) > 1 else "one is not enough"
        )
        raise InputError(
            place="bootstrap", found=f"nothing to draw from {len(prepared)} runs ({why}); add repeated runs"
        )
    rng = np.random.default_rng(seed)
    names = tuple(free.name for free in problem.free)
    checkpoint = checkpoint or NoCheckpoint()
    drawn = {f"bootstrap draw {k}": _draw(rng, len(prepared), levels) for k in range(draws)}
    kept: list[list[float]] = []
    failed = 0
    cancelled = False

    def fitted(counts: NDArray[np.int64]) -> dict[str, list[float] | None]:
        return {"values": _fitted(problem, result, prepared, counts)}

    try:
        for _, piece in kept_pieces(fitted, drawn, checkpoint, pool):
            if piece["values"] is None:
                failed += 1
            else:
                kept.append(piece["values"])
            on_progress(ProgressUpdate(done=len(kept) + failed, total=draws, text="bootstrap"))
    except KeyboardInterrupt:
        cancelled = True
    values = np.array(kept).reshape(len(kept), len(names))
    return Bootstrap(names, values, draws, failed, cancelled)


def _fitted(
    problem: FitProblem,
    result: FitResult,
    prepared: Sequence[PreparedFit],
    counts: NDArray[np.int64],
) -> list[float] | None:
    """Return the parameters fitted to runs drawn so often, from the fit's own; None: no admissible fit."""
    chosen = [replace(run, weight=run.weight * n) for run, n in zip(prepared, counts, strict=True) if n]
    try:
        fit = fit_variable_projection(
            problem, starts=0, first=result.damper, prepared=chosen, with_errors=False
        )
    except (ConvergenceError, InputError):
        return None
    if fit.cancelled:  # by an interrupt that it took for its own
        raise KeyboardInterrupt
    return [each.value for each in fit.estimates]


def _levels(runs: Sequence[PreparedRun]) -> list[NDArray[np.intp]]:
    """Return the runs at each command and at each temperature; a command that varies is its own level."""
    commands = [run.run.constant_command for run in runs]
    stepping = [i for i, command in enumerate(commands) if command is None]
    levels = [np.array(stepping, dtype=np.intp)] if stepping else []
    held = sorted((command, i) for i, command in enumerate(commands) if command is not None)
    if held:
        # Measured commands of one level differ a little, as in ``templates.command_levels``.
        at = np.array([command for command, _ in held])
        cuts = np.flatnonzero(np.diff(at) > 0.03 * np.abs(at).max()) + 1
        levels += np.split(np.array([i for _, i in held], dtype=np.intp), cuts)
    kelvin = [run.trajectory.temperature for run in runs]
    known = sorted((float(np.mean(t)), i) for i, t in enumerate(kelvin) if t is not None)
    at = np.array([kelvin for kelvin, _ in known])
    order = np.array([i for _, i in known], dtype=np.intp)
    if len(order):
        levels += np.split(order, np.flatnonzero(np.diff(at) > _SAME_LEVEL_K) + 1)
    return sorted(levels, key=lambda members: members.tolist())


def _draw(rng: np.random.Generator, runs: int, levels: Sequence[NDArray[np.intp]]) -> NDArray[np.int64]:
    """Return how often each run is drawn; every level holds at least one."""
    counts = rng.multinomial(runs, np.full(runs, 1.0 / runs))
    for members in levels:
        if counts[members].sum():
            continue
        counts[rng.choice(members)] += 1
        # One more than there are runs: some run is there twice at least, so one can be spared.
        needed = {int(m[counts[m] > 0][0]) for m in levels if counts[m].sum() == 1}
        spare = [i for i in range(runs) if counts[i] > 1 or (counts[i] == 1 and i not in needed)]
        counts[rng.choice(spare)] -= 1
    return counts
