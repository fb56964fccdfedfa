"""Bootstrap over runs: spread of the parameters between fits to runs drawn with replacement.

Unlike standard errors from the residuals, it includes differences between the runs. The runs are prepared
once because a draw changes only their weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.confidence.settings import DEFAULT_SETTINGS
from mrdamper.identify.problem import FitProblem, SearchResult
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.windows import FitWindow
from mrdamper.runtime.pool import ONE_CORE, Pool
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent


@dataclass(frozen=True, slots=True, eq=False)
class Bootstrap:
    """The parameters of fits to runs drawn with replacement. The spread is NaN with fewer than two fits."""

    names: tuple[str, ...]
    values: FloatArray  # shape (successful draws, parameters)
    asked: int
    failed: int  # Draws without an admissible fit.
    cancelled: bool

    @property
    def draws(self) -> int:
        """Number of successful draws."""
        return len(self.values)

    @property
    def standard_deviation(self) -> dict[str, float]:
        """The standard deviation of each parameter."""
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

    @property
    def sentence(self) -> str:
        """The number of draws, the largest and the median relative spread, in plain words."""
        failed = f", {self.failed} failed" if self.failed else ""
        stopped = ", interrupted" if self.cancelled else ""
        count = f"Bootstrap: {self.draws} of {self.asked} fits{failed}{stopped}"
        if self.draws < 2:
            return f"{count}. At least two are needed for a spread."
        middle = np.abs(np.median(self.values, axis=0))
        spread = np.array(list(self.standard_deviation.values()))
        unknown = np.full(len(middle), np.inf)
        percent = 100.0 * np.divide(spread, middle, out=unknown, where=middle > 0.0)
        worst = int(np.argmax(percent))
        return (
            f"{count}. {self.names[worst]} has the largest standard deviation "
            f"({_two_digits(float(percent[worst]))} %), the median of all parameters is "
            f"{_two_digits(float(np.median(percent)))} %."
        )

    def _unknown(self) -> FloatArray:
        return np.full(len(self.names), np.nan)


def bootstrap(
    problem: FitProblem,
    result: SearchResult,
    *,
    draws: int = 50,
    seed: int = 0,
    stratified: bool = False,
    on_progress: Progress = silent,
    pool: Pool = ONE_CORE,
) -> Bootstrap:
    """Fit runs drawn with replacement, each time from the parameters of the fit.

    A draw has as many runs as the problem. A run that is drawn twice has twice the weight. The admissible
    range of the model is computed from all runs.

    Parameters
    ----------
    stratified : keep at least one run at each current and each temperature. If a draw has none, it replaces a
        run that is not the only one at its level. A level with a single run is then in every draw, and the
        spread does not contain the effect of its absence.
    on_progress : called after every draw; an interrupt (Ctrl-C) keeps the draws so far
    pool : computes the draws; the result does not depend on it

    Raises
    ------
    InputError
        If there is only one run, or with ``stratified`` only one run at each level.
    """
    prepared = problem.windows()
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
    drawn = [_draw(rng, len(prepared), levels) for _ in range(draws)]
    kept: list[list[float]] = []
    failed = 0
    cancelled = False

    def fitted(counts: NDArray[np.int64]) -> list[float] | None:
        return _fitted(problem, result, prepared, counts)

    try:
        with closing(pool.map(fitted, drawn)) as found:
            for parameters in found:
                if parameters is None:
                    failed += 1
                else:
                    kept.append(parameters)
                on_progress(ProgressUpdate(done=len(kept) + failed, total=draws, text="bootstrap"))
    except KeyboardInterrupt:
        cancelled = True
    values = np.array(kept).reshape(len(kept), len(names))
    return Bootstrap(names, values, draws, failed, cancelled)


def _fitted(
    problem: FitProblem,
    result: SearchResult,
    prepared: Sequence[FitWindow],
    counts: NDArray[np.int64],
) -> list[float] | None:
    """Fit runs with the given counts. Return the parameters, or None if there is no admissible fit."""
    chosen = [replace(run, weight=run.weight * n) for run, n in zip(prepared, counts, strict=True) if n]
    try:
        fit = fit_variable_projection(problem, dampers=[result.damper], windows=chosen, with_errors=False)
    except (ConvergenceError, InputError):
        return None
    if fit.cancelled:  # The search handles an interrupt itself, but it has to end the bootstrap.
        raise KeyboardInterrupt
    return [each.value for each in fit.estimates]


def _levels(runs: Sequence[PreparedRun]) -> list[NDArray[np.intp]]:
    """Return the indices of the runs at each current and at each temperature.

    All runs with a varying current are one level.
    """
    commands = [run.run.constant_command for run in runs]
    stepping = [i for i, command in enumerate(commands) if command is None]
    levels = [np.array(stepping, dtype=np.intp)] if stepping else []
    held = sorted((command, i) for i, command in enumerate(commands) if command is not None)
    if held:
        # Measured currents of one level differ slightly.
        at = np.array([command for command, _ in held])
        cuts = np.flatnonzero(np.diff(at) > DEFAULT_SETTINGS.same_level_command_ratio * np.abs(at).max()) + 1
        levels += np.split(np.array([i for _, i in held], dtype=np.intp), cuts)
    kelvin = [run.trajectory.temperature for run in runs]
    known = sorted((float(np.mean(t)), i) for i, t in enumerate(kelvin) if t is not None)
    at = np.array([kelvin for kelvin, _ in known])
    order = np.array([i for _, i in known], dtype=np.intp)
    if len(order):
        levels += np.split(order, np.flatnonzero(np.diff(at) > DEFAULT_SETTINGS.same_level_K) + 1)
    return sorted(levels, key=lambda members: members.tolist())


def _draw(rng: np.random.Generator, runs: int, levels: Sequence[NDArray[np.intp]]) -> NDArray[np.int64]:
    """Return the count of each run in a draw; every level has at least one run."""
    counts = rng.multinomial(runs, np.full(runs, 1.0 / runs))
    for members in levels:
        if counts[members].sum():
            continue
        counts[rng.choice(members)] += 1
        # The draw now has one run too many. Remove one that is not the only run of its level.
        needed = {int(m[counts[m] > 0][0]) for m in levels if counts[m].sum() == 1}
        spare = [i for i in range(runs) if counts[i] > 1 or (counts[i] == 1 and i not in needed)]
        counts[rng.choice(spare)] -= 1
    return counts


def _two_digits(value: float) -> str:
    return f"{value:.2g}" if not 100.0 <= value < 1e6 else f"{value:.0f}"
