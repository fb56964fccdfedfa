"""Propose further tests: the sines that reduce the uncertainty of the force most (I-optimal design).

The candidates are sines inside the envelope of the runs. The uncertainty of the parameters causes a variance
of the force in every candidate. The best test minimises the mean of these variances. The effect of a test is
computed from the derivatives of the model, so that no measurement is needed. The tests are selected one after
the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray, inverse_sizes
from mrdamper.excitation import Sine, Trajectory, drive
from mrdamper.identify.confidence.settings import SETTINGS
from mrdamper.identify.evaluate import operating_envelope
from mrdamper.identify.motions import motion_groups
from mrdamper.identify.problem import FitProblem, SearchResult
from mrdamper.identify.search.objective import Objective
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import open_drive
from mrdamper.models.tangents import Tangents
from mrdamper.quantities import to_degC


def propose_tests(problem: FitProblem, result: SearchResult, *, count: int = 3) -> tuple[str, ...]:
    """Return one sentence for each proposed test, best test first; empty if all parameters are on a bound.

    The uncertainty of the parameters causes a standard deviation of the force. Each sentence states by how
    many percent the proposed test, together with the tests listed before, reduces this standard deviation.
    """
    names = [estimate.name for estimate in result.estimates if not estimate.at_bound]
    if not names:
        return ()
    objective = Objective(problem, problem.windows())
    size, runs = len(names), len(problem.runs)
    known = runs * objective.gram(result.damper, names)[:size, :size]
    scale = inverse_sizes(known)
    known = known * np.outer(scale, scale) + SETTINGS.prior_information_ratio * np.eye(size)
    candidates = _candidates(problem, result.damper)
    information = _information(result.damper, names, [path for _, path in candidates])
    information *= np.outer(scale, scale)
    target = information.mean(axis=0)
    # The residuals of runs with the same motion are correlated. Therefore all runs of a motion count as one.
    weight = runs / len(motion_groups(problem.runs))
    tests: list[str] = []
    before = float(np.trace(np.linalg.solve(known, target)))
    for _ in range(min(count, len(candidates))):
        after = [float(np.trace(np.linalg.solve(known + weight * gain, target))) for gain in information]
        best = int(np.argmin(after))
        known = known + weight * information[best]
        reduction = 100.0 * (1.0 - math.sqrt(max(after[best], 0.0) / before)) if before > 0.0 else 0.0
        tests.append(_sentence(*candidates[best], problem.template.command_unit, reduction))
    return tuple(tests)


def _candidates(problem: FitProblem, damper: Damper) -> list[tuple[Sine, Trajectory]]:
    """Return sines whose displacement, velocity and acceleration are inside the envelope of the runs."""
    envelope = operating_envelope(problem.runs)
    assert envelope.frequency is not None
    assert envelope.acceleration is not None
    half = 0.5 * (envelope.displacement[1] - envelope.displacement[0])
    speed, acceleration = (max(map(abs, ends)) for ends in (envelope.velocity, envelope.acceleration))
    limits = envelope.temperature if damper.temperature_dependent else None
    frequencies = np.geomspace(*envelope.frequency, SETTINGS.proposal_frequency_count).tolist()
    candidates = []
    for ratio, frequency in product(SETTINGS.proposal_amplitude_ratios, frequencies):
        amplitude, rate = ratio * half, 2.0 * np.pi * frequency
        if not SETTINGS.proposal_velocity_ratio_min * speed <= rate * amplitude <= 1.02 * speed:
            continue
        if rate**2 * amplitude > 1.1 * acceleration:
            continue
        sine, duration = Sine(amplitude, frequency), SETTINGS.proposal_period_count / frequency
        rate_Hz = SETTINGS.proposal_samples_per_period * frequency
        commands = np.unique(np.linspace(*envelope.command, SETTINGS.proposal_command_count)).tolist()
        for command, kelvin in product(commands, dict.fromkeys(limits or (None,))):
            path = drive(sine, duration=duration, rate_Hz=rate_Hz, command=command, temperature=kelvin)
            candidates.append((sine, path))
    return candidates


def _information(damper: Damper, names: Sequence[str], paths: Sequence[Trajectory]) -> FloatArray:
    """Return the information matrix of each path, shape (paths, parameters, parameters) [%^2]."""
    tangents, information = Tangents(damper, names, [open_drive(path) for path in paths]), []
    for k in range(len(paths)):
        along = tangents.evaluate_run(k)
        start = len(along.force) // SETTINGS.proposal_period_count
        scored = along.force[start:]
        squares = along.combine @ core.gram(along.columns, start) @ along.combine.T
        information.append(1e4 * squares / (max(float(np.var(scored)), 1e-300) * len(scored)))
    return np.array(information).reshape(len(information), len(names), len(names))


def _sentence(sine: Sine, path: Trajectory, unit: str, reduction_percent: float) -> str:
    at = f"{float(path.command[0]):.3g} {unit}"
    if path.temperature is not None:
        at += f" and {to_degC(float(path.temperature[0])):.0f} degC"
    return (
        f"run a sine of {1e3 * sine.amplitude:.2g} mm at {sine.frequency:.2g} Hz, {at}: it reduces the "
        f"uncertainty of the force due to the parameters by {reduction_percent:.0f} %"
    )
