"""Draw posterior samples of the parameters from a normal approximation around the fit.

The mean is the fitted parameter set in search coordinates, which are logarithms for parameters on a log
scale. The covariance contains the reported standard errors. The standard error of a poorly determined
parameter may be larger than its search range. Therefore a normal prior with the variance of the uniform
distribution between the bounds is included. The prior has no effect on a parameter with a small standard
error. Posterior samples outside the bounds or outside the valid range of the model are rejected and drawn
again. Parameters on a bound stay on the bound.
"""

from __future__ import annotations

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.identify.confidence.settings import SETTINGS
from mrdamper.identify.problem import FitProblem, SearchResult
from mrdamper.identify.search.objective import Box
from mrdamper.models.card_draws import CardDraws


def sample_posterior(
    problem: FitProblem, result: SearchResult, *, draws: int = 1000, seed: int = 0
) -> CardDraws:
    """Return ``draws`` equally likely parameter sets (at least 2). The same seed gives the same samples.

    Raises
    ------
    InputError
        If no parameter has a standard error, or the bounds and conditions reject almost all samples.
    """
    if draws < 2:
        raise InputError(f"{draws} posterior draws", expected="2 or more")
    moving = [k for k, estimate in enumerate(result.estimates) if estimate.standard_error > 0.0]
    if not moving:
        raise InputError(place="posterior", found="no parameter of the fit has a standard error")
    free = problem.free
    box = Box.from_parameters(free)
    low, high, log = box.low, box.high, box.log
    values = np.array([result.damper.parameters_and_lag[f.name] for f in free])
    mean = np.log(values, where=log, out=values.copy())
    covariance = result.covariance
    if covariance is None:
        errors = np.array([estimate.standard_error for estimate in result.estimates])
        covariance = result.correlation * np.outer(errors, errors)
    # The coordinates are divided by the prior standard deviation (``spread``), so that the prior variance is
    # 1. A variance c of the fit along an eigenvector then becomes 1 / (1 / c + 1) in the posterior.
    spread = ((high - low) / np.sqrt(12.0))[moving]
    unit = np.where(log, values, 1.0)[moving] * spread
    variances, directions = np.linalg.eigh(covariance[np.ix_(moving, moving)] / np.outer(unit, unit))
    variances = np.maximum(variances, 0.0)
    factor = spread[:, None] * directions * np.sqrt(variances / (variances + 1.0))
    rows, floor = problem.conditions
    linear = [k for k, f in enumerate(free) if f.linear]
    searched = [k for k in moving if not free[k].linear]
    rng = np.random.default_rng(seed)
    accepted: list[FloatArray] = []
    batches, size = SETTINGS.batch_count_max, SETTINGS.batch_sample_count
    for _ in range(batches):
        points = np.tile(mean, (size, 1))
        points[:, moving] += rng.standard_normal((size, len(moving))) @ factor.T
        inside = ((points > low) & (points < high))[:, searched].all(axis=1)
        points[:, log] = np.exp(points[:, log])
        inside &= (points[:, linear] @ rows[:, : len(linear)].T >= floor).all(axis=1)
        accepted.append(points[inside])
        if sum(map(len, accepted)) >= draws:
            return CardDraws(tuple(f.name for f in free), np.concatenate(accepted)[:draws])
    raise InputError(
        f"{sum(map(len, accepted))} of {batches * size} samples are inside the bounds",
        place="posterior",
        expected=f"{draws} or more",
        remedy="Fix parameters that are not identifiable, or add runs",
    )
