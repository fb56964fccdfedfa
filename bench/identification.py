"""Searches for a damper's numbers on one campaign: variable projection, and what one would take instead.

Twelve runs of 1000 samples (3 currents, 4 temperatures) of a damper of the fitted form, with 2 % noise. Cost,
kernel, tables and bounds are the same for all: population searches have their candidates evaluated together
(``identify.search.population.Ensemble``), and where a name says so the linear numbers are eliminated as
variable projection does it (``Objective``). Only the search differs. The floor is the cost of the true
numbers: a search that ends within 1 % of it has found the damper.

Variable projection and the genetic algorithm are run with five seeds each, the others with the first of them;
``full`` runs five seeds of all.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution

from bench.measure import Asked, Row, Timing, absent
from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.errors import MissingExtraError
from mrdamper.excitation import Sine, drive
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.search.objective import Box
from mrdamper.identify.search.population import Ensemble, fit_genetic
from mrdamper.identify.search.variable_projection import Objective, fit_variable_projection
from mrdamper.identify.settings import FitSettings
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import open_drive, simulate

__all__ = ["run"]

GROUP = "a campaign of 12 runs, 2 % noise: searches on one kernel"
CURRENTS_A, TEMPERATURES_degC = (0.0, 1.0, 2.0), (20.0, 40.0, 60.0, 80.0)
SAMPLES, RATE_Hz = 1000, 200.0
NOISE = 0.02
SEEDS = 5
POPULATION, GENERATIONS = 200, 300
FOUND = 1.01  # over the floor
TRUTH = {
    "viscosity.c0": 900.0,
    "viscosity.c1": 150.0,
    "stiffness.value": 800.0,
    "offset.c0": 12.0,
    "offset.c1": 4.0,
    "yield_force.base": 60.0,
    "yield_force.gain": 700.0,
    "yield_force.half_command": 1.1,
    "rho.at_zero": 1900.0,
    "rho.rate": -0.15,
    "kappa.value": -0.45,
    "n.value": 1.5,
    "viscosity.activation_K": 1200.0,
    "yield_force.temperature_slope": -0.0015,
}


@dataclass(frozen=True)
class Campaign:
    """A fitting problem and the cost [%] of the numbers that its runs were made with."""

    problem: FitProblem
    floor_percent: float


def campaign(seed: int = 0) -> Campaign:
    """Return the campaign with one draw of noise."""
    made = _runs(None, np.random.default_rng(0))
    truth = template("bouc-wen", made, terms=())[0].with_parameters(TRUTH)
    runs = _runs(truth, np.random.default_rng(seed))
    damper, free = template("bouc-wen", runs, terms=())
    problem = FitProblem(
        damper, free, tuple(runs), settings=FitSettings(rate_Hz=RATE_Hz, samples_per_period=1e9)
    )
    errors = [
        (run.weight, (simulate(truth, run.drive) - run.force)[run.start :]) for run in problem.windows()
    ]
    return Campaign(problem, float(np.sqrt(sum(weight * (error @ error) for weight, error in errors))))


def _runs(truth: Damper | None, rng: np.random.Generator) -> list[PreparedRun]:
    """Return a damper's runs; without one, those of a plain yield force, to learn the fitted form from."""
    runs = []
    for current in CURRENTS_A:
        for degrees in TEMPERATURES_degC:
            warm = np.full(SAMPLES, 273.15 + degrees)
            path = drive(Sine(0.010, 1.5), duration=(SAMPLES - 1) / RATE_Hz, rate_Hz=RATE_Hz, command=current)
            path = type(path)(path.step, path.displacement, path.velocity, path.acceleration, path.command,
                              temperature=warm)  # fmt: skip
            force = 800.0 * path.velocity + (100.0 + 400.0 * current) * np.tanh(path.velocity / 0.01)
            if truth is not None:
                force = simulate(truth, open_drive(path))
                force = force + NOISE * float(np.std(force)) * rng.standard_normal(SAMPLES)
            name, time_s = f"run_{current:g}A_{degrees:g}C", np.arange(SAMPLES, dtype=np.float64) / RATE_Hz
            run = RigRun(name, time_s, path.displacement, force, path.command, "A", path.velocity, warm)
            runs.append(prepare_run(run))
    return runs


# ------------------------------------------------------------------------------------ the searches

Search = Callable[[FitProblem, int], float]
"""Fits with a seed; returns the cost [%]."""


def _variable_projection(problem: FitProblem, seed: int) -> float:
    return fit_variable_projection(problem, starts=5).cost_percent


def _genetic(problem: FitProblem, seed: int) -> float:
    return fit_genetic(problem, population=POPULATION, generations=GENERATIONS, seed=seed).cost_percent


def _evolution(problem: FitProblem, seed: int) -> float:
    size = len(problem.free)
    return _evolved(Ensemble(problem).costs, np.zeros(size), np.ones(size), seed)


def _eliminated_evolution(problem: FitProblem, seed: int) -> float:
    """Search the nonlinear numbers alone, the linear ones eliminated at every candidate."""
    objective, box = Objective(problem, problem.windows()), Box.of(problem)
    guess = objective.points_of([problem.template])[1]

    def costs(points: FloatArray) -> FloatArray:
        linear = np.tile(guess, (len(points), 1))
        cost = objective.eliminate(box.to_physical(points), linear, tangents=False).cost
        return np.where(np.isfinite(cost), cost, 1e12)

    return _evolved(costs, box.low, box.high, seed)


def _evolved(
    costs: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray, seed: int
) -> float:
    """Return the cost [%] that SciPy's differential evolution ends at, its candidates evaluated together."""
    search: Any = differential_evolution  # its stubs do not know what a vectorised cost takes
    found = search(
        lambda x: costs(np.ascontiguousarray(x.T)), list(zip(low, high, strict=True)), rng=seed,
        vectorized=True, updating="deferred", polish=False,
    )  # fmt: skip
    return float(np.sqrt(found.fun))


OURS = "variable projection, 5 starts"
GENETIC = f"genetic algorithm, pymoo, {POPULATION} x {GENERATIONS}"
SEARCHES: dict[str, Search] = {
    OURS: _variable_projection,
    GENETIC: _genetic,
    "differential evolution, linear numbers eliminated": _eliminated_evolution,
    "differential evolution, all numbers": _evolution,
}


def run(*, full: bool = False) -> list[Row]:
    """Return CPU time and cost over the floor of every search, the searches taking turns by seed."""
    spent: dict[str, list[tuple[float, float]]] = {name: [] for name in SEARCHES}
    over: dict[str, list[float]] = {name: [] for name in SEARCHES}
    gaps: dict[str, Row] = {}
    _variable_projection(campaign().problem, 0)  # what is loaded once is not counted
    for seed in range(SEEDS):
        given = campaign(seed)
        for name, search in SEARCHES.items():
            if name in gaps or (seed and not full and name not in (OURS, GENETIC)):
                continue
            start, begin = time.perf_counter(), time.process_time()
            try:
                cost = search(given.problem, seed)
            except MissingExtraError as fault:
                gaps[name] = absent(name, fault, GROUP)
                continue
            spent[name].append((time.process_time() - begin, time.perf_counter() - start))
            over[name].append(cost / given.floor_percent)
    ours = Timing.of(spent[OURS])
    return [gaps.get(name) or _row(name, Timing.of(spent[name]), over[name], ours) for name in SEARCHES]


def _row(name: str, timing: Timing, over: list[float], ours: Timing) -> Row:
    near, count = sum(each <= FOUND for each in over), len(over)
    said = f"{near} of {count} seeds within 1 % of the floor; cost {median(over):.4g} x the floor"
    said += f", {min(over):.4g} to {max(over):.4g} x" if count > 1 else ""
    ratios = timing.over(Timing(ours.cpu[:count], ours.wall[:count]))
    figure = f"variable projection: seeds within 1 % of the floor, of {SEEDS}"
    asked = (Asked(figure, SEEDS, near, "-", at_least=True),) if name == OURS else ()
    return Row(name, timing, ratios=ratios, accuracy=said, asked=asked, group=GROUP)
