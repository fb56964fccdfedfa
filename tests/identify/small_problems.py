"""Fit problems with known solutions: linear regression, and dampers fitted to their simulated force."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.problem import FitProblem, FreeParameter, SearchResult
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.settings import FitSettings
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import find_law
from tests.identify.reference_dampers import REFERENCE_DAMPERS, simulate_runs

LINEAR = ("viscosity.value", "stiffness.value", "offset.value")


def fitted(
    truth: Damper, free: Sequence[FreeParameter], *, noise: float = 0.02, seed: int = 0
) -> tuple[FitProblem, SearchResult]:
    """Fit the ``free`` parameters of a damper to its simulated force. All other parameters stay correct."""
    problem = FitProblem(
        truth,
        tuple(free),
        simulate_runs(truth, noise=noise, seed=seed),
        settings=FitSettings(rate_Hz=1e4, samples_per_period=1e9),
    )
    return problem, fit_variable_projection(problem, dampers=[truth])


def fitted_default(law: str, runs: Sequence[PreparedRun]) -> tuple[FitProblem, SearchResult]:
    """Return the fit of the default free parameters of a law, starting from the true values."""
    damper, free = template(law, runs)
    problem = FitProblem(damper, free, tuple(runs))
    return problem, fit_variable_projection(problem, dampers=[REFERENCE_DAMPERS[law]])


def linear_problem(seed: int = 0) -> tuple[FitProblem, SearchResult]:
    """Return a problem that is linear in viscosity, spring stiffness and offset. The yield force is fixed."""
    known = {"yield_force": Constant(300.0), "yield_velocity": Constant(0.006)}
    searched = {"viscosity": Constant(900.0), "stiffness": Constant(1500.0), "offset": Constant(40.0)}
    free = [
        FreeParameter("viscosity.value", 0.0, 1e4, linear=True),
        FreeParameter("stiffness.value", 0.0, 1e5, linear=True),
        FreeParameter("offset.value", -500.0, 700.0, linear=True),
    ]
    return fitted(Damper(find_law("bingham"), {**known, **searched}), free, seed=seed)


def normal_matrix(problem: FitProblem) -> np.ndarray:
    """Return the Hessian matrix of the squared cost from the velocity and displacement of the runs."""
    total = np.zeros((3, 3))
    for run in problem.runs:
        kept = slice(run.scored_from, None)
        path, force = run.trajectory, np.asarray(run.force)[kept]
        columns = np.stack([path.velocity, path.displacement, np.ones(len(path.velocity))])[:, kept]
        total += 1e4 * columns @ columns.T / (np.var(force) * len(force) * len(problem.runs))
    return total
