"""Searches for a damper's numbers on one campaign: variable projection, and what one would take instead.

Twelve runs of 1000 samples (3 currents, 4 temperatures) of a damper of the fitted form, with 2 % noise. Cost
and kernel are the same for all (``identify.search.population.Ensemble``), and so are the bounds; only the
search differs. The floor is the cost of the true numbers: a search that ends within 1 % of it has found the
damper.

Variable projection is run with ten seeds, each other search with the first of them; ``full`` runs ten seeds
of all, and those that take longest. Part of ``python -m bench identification``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from statistics import median, quantiles
from typing import Any

import numpy as np

from bench import integrators
from bench.measure import Asked, Row, absent, timed
from bench.problem import Problem
from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import Sine, drive
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.search.population import Ensemble, fit_cma, fit_genetic
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import open_drive, simulate

__all__ = ["Campaign", "campaign", "rows"]

GROUP = "a campaign of 12 runs, 2 % noise: searches on one kernel"
CURRENTS_A, TEMPERATURES_degC = (0.0, 1.0, 2.0), (20.0, 40.0, 60.0, 80.0)
SAMPLES, RATE_Hz = 1000, 200.0
NOISE = 0.02
SEEDS = 10
POPULATION, GENERATIONS = 200, 300
FOUND = 1.01  # over the floor
LONG = {"genetic algorithm, pymoo's defaults"}  # only with --full
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
    truth = template("bouc-wen", made, groups=())[0].with_parameters(TRUTH)
    runs = _runs(truth, np.random.default_rng(seed))
    damper, free = template("bouc-wen", runs, groups=())
    problem = FitProblem(damper, free, tuple(runs), rate_Hz=RATE_Hz)
    squares = [run.weight * _squared(truth, run) for run in problem.prepare()]
    return Campaign(problem, float(np.sqrt(sum(squares))))


def _squared(damper: Damper, run: object) -> float:
    error = (simulate(damper, run.drive) - run.force)[run.start :]  # type: ignore[attr-defined]
    return float(error @ error)


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
    return fit_variable_projection(problem, starts=5, seed=seed).cost_percent


def _cma(problem: FitProblem, seed: int) -> float:
    return fit_cma(problem, seed=seed).cost_percent


def _pymoo(problem: FitProblem, seed: int) -> float:
    return fit_genetic(problem, population=POPULATION, generations=GENERATIONS, seed=seed).cost_percent


def _pymoo_defaults(problem: FitProblem, seed: int) -> float:
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.core.problem import Problem as PymooProblem
    from pymoo.optimize import minimize

    ensemble = Ensemble(problem)

    class Fit(PymooProblem):  # type: ignore[misc]  # pymoo is not typed
        def _evaluate(self, x: FloatArray, out: dict[str, FloatArray], *_: object, **__: object) -> None:
            out["F"] = ensemble.costs(x)[:, None]

    size = len(problem.free)
    found = minimize(Fit(n_var=size, n_obj=1, xl=np.zeros(size), xu=np.ones(size)), GA(), seed=seed)
    return float(np.sqrt(found.F[0]))


def _pygad(problem: FitProblem, seed: int) -> float:
    import pygad

    ensemble = Ensemble(problem)

    def fitness(_: object, solutions: FloatArray, __: object) -> list[float]:
        return list(-ensemble.costs(np.atleast_2d(solutions)))

    search = pygad.GA(
        num_generations=GENERATIONS,
        sol_per_pop=POPULATION,
        num_parents_mating=POPULATION // 2,
        num_genes=len(problem.free),
        gene_space={"low": 0.0, "high": 1.0},
        fitness_func=fitness,
        fitness_batch_size=POPULATION,
        random_seed=seed,
        suppress_warnings=True,
    )
    search.run()
    return float(np.sqrt(-max(search.best_solutions_fitness)))


def _scipy_evolution(problem: FitProblem, seed: int) -> float:
    from scipy.optimize import differential_evolution

    ensemble = Ensemble(problem)

    def costs(x: FloatArray) -> FloatArray:
        return ensemble.costs(x.T)

    search: Any = differential_evolution  # its stubs do not know what a vectorised cost takes
    bounds = [(0.0, 1.0)] * len(problem.free)
    found = search(costs, bounds, rng=seed, vectorized=True, updating="deferred", polish=False)
    return float(np.sqrt(found.fun))


def _lmfit(problem: FitProblem, seed: int, method: str = "leastsq", most: int | None = None) -> float:
    import lmfit

    ensemble = Ensemble(problem)
    parameters = lmfit.Parameters()
    for index, value in enumerate(np.random.default_rng(seed).uniform(0.05, 0.95, len(problem.free))):
        parameters.add(f"p{index}", value=value, min=0.0, max=1.0)

    def residual(given: lmfit.Parameters) -> FloatArray:
        unit = np.array([each.value for each in given.values()])
        if method != "leastsq":
            return np.sqrt(ensemble.costs(unit[None, :]))
        damper = ensemble.damper(unit)
        return np.concatenate([np.sqrt(run.weight) * (simulate(damper, run.drive) - run.force)[run.start :]
                               for run in ensemble.runs])  # fmt: skip

    found = lmfit.minimize(residual, parameters, method=method, max_nfev=most)
    return float(np.sqrt(np.sum(np.square(residual(found.params)))))


SEARCHES: dict[str, Search] = {
    "variable projection, 5 starts": _variable_projection,
    "CMA-ES (cma), from the middle": _cma,
    "scipy differential_evolution, vectorised": _scipy_evolution,
    f"genetic algorithm, pymoo, {POPULATION} x {GENERATIONS}": _pymoo,
    "genetic algorithm, pymoo's defaults": _pymoo_defaults,
    f"genetic algorithm, PyGAD, {POPULATION} x {GENERATIONS}": _pygad,
    "lmfit leastsq, one start": _lmfit,
    "lmfit differential_evolution, stopped at 5,000 evaluations": partial(
        _lmfit, method="differential_evolution", most=5_000
    ),
}


def rows(*, full: bool = False) -> list[Row]:
    """Return CPU time and cost over the floor of every search."""
    spent: dict[str, list[float]] = {name: [] for name in SEARCHES}
    over: dict[str, list[float]] = {name: [] for name in SEARCHES}
    gaps: dict[str, Row] = {}
    for seed in range(SEEDS):
        given = campaign(seed)
        for index, (name, search) in enumerate(SEARCHES.items()):
            if name in gaps or (index and seed and not full):
                continue
            if name in LONG and not full:
                gaps[name] = Row(name, accuracy="not run: only with --full", group=GROUP, state="absent")
                continue
            begin = time.process_time()
            try:
                cost = search(given.problem, seed)
            except ImportError as fault:
                gaps[name] = absent(name, fault, GROUP)
                continue
            except ValueError as fault:  # a start outside the law's range: a fit that failed, and is counted
                cost = float("inf")
                print(f"{name}, seed {seed}: {fault}")
            spent[name].append(time.process_time() - begin)
            over[name].append(cost / given.floor_percent)
    ours = median(spent[next(iter(SEARCHES))])
    made = [gaps.get(name) or _row(name, spent[name], over[name], ours) for name in SEARCHES]
    return [*made, _by_odeint(ours)]


def _row(name: str, spent: list[float], over: list[float], ours: float) -> Row:
    near, worst = sum(each <= FOUND for each in over), max(over)
    seeds = f"{len(over)} seed{'s' if len(over) > 1 else ''}"
    said = f"{near} of {seeds} within 1 % of the floor; cost {median(over):.4g} x the floor"
    said += f", worst {worst:.4g} x" if len(over) > 1 else ""
    cpu = median(spent)
    asked: tuple[Asked, ...] = ()
    if name.startswith("variable"):
        figure = f"variable projection: seeds within 1 % of the floor, of {SEEDS}"
        asked = (Asked(figure, SEEDS, near, "-", at_least=True),)
    row = Row(name, cpu, ratio=cpu / ours, accuracy=said, asked=asked, group=GROUP)
    if len(spent) < 3:
        return row
    low, _, high = quantiles(spent, n=4, method="inclusive")
    return replace(row, spread=(low / cpu, high / cpu))


def _by_odeint(ours: float) -> Row:
    """Return what a genetic algorithm takes on the integrator that people use: a product, not a run."""
    job = integrators.odeint(Problem(candidates=1, samples=SAMPLES, rate_Hz=RATE_Hz))
    runs, evaluations = len(CURRENTS_A) * len(TEMPERATURES_degC), POPULATION * GENERATIONS
    cpu = timed({"one run": job}, 3)["one run"].cpu_s * runs * evaluations
    name = f"genetic algorithm {POPULATION} x {GENERATIONS} on scipy odeint"
    said = f"not run: {evaluations:,} evaluations of {runs} runs, each as long as one that was measured"
    return Row(name, cpu, ratio=cpu / ours, accuracy=said, group=GROUP)
