"""Proposed tests: the sines that reduce the uncertainty of the force most (I-optimal design).

The candidates are sines at currents and temperatures inside the range of the runs, because the rig can run
these. The covariance of the parameters causes a variance of the force in every candidate. The best test
reduces the mean of this variance most. It follows from the tangents of the model without a measurement. The
tests are selected one after the other. More tests do not reduce the error of the model equations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray, inverse_sizes
from mrdamper.excitation import Sine, drive
from mrdamper.identify.evaluate import whole_envelope
from mrdamper.identify.motions import motion_groups
from mrdamper.identify.problem import FitProblem, SearchResult
from mrdamper.identify.search.objective import Objective
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import open_drive
from mrdamper.models.tangents import Tangents
from mrdamper.quantities import to_degC

AMPLITUDE_RATIOS = (1.0, 0.5, 0.2)  # [half stroke]
FREQUENCY_COUNT = 3
COMMAND_COUNT = 3
PERIOD_COUNT = 2
SAMPLES_PER_PERIOD = 200
VELOCITY_MIN_RATIO = 0.03  # Noise dominates in slower runs [maximum velocity].
PRIOR_INFORMATION_RATIO = 1e-7  # Keeps the information matrix regular [information of the runs].


@dataclass(frozen=True, slots=True)
class ProposedTest:
    """A sine at a current and a temperature, and the reduction of the force's uncertainty.

    ``reduction_percent`` includes the tests that were proposed before. It is the reduction of the standard
    deviation that the parameters cause.
    """

    amplitude_mm: float
    frequency_Hz: float
    command: float
    command_unit: str
    temperature_degC: float | None
    reduction_percent: float

    @property
    def sentence(self) -> str:
        """The test and its benefit in plain words."""
        at = "" if self.temperature_degC is None else f" and {self.temperature_degC:.0f} degC"
        return (
            f"run a sine of {self.amplitude_mm:.2g} mm at {self.frequency_Hz:.2g} Hz, {self.command:.3g} "
            f"{self.command_unit}{at}: it reduces the uncertainty of the force due to the "
            f"parameters by {self.reduction_percent:.0f} %"
        )


def propose_tests(problem: FitProblem, result: SearchResult, *, count: int = 3) -> tuple[ProposedTest, ...]:
    """Return the tests to run next, the best first. Return none if all parameters are on a bound."""
    names = [estimate.name for estimate in result.estimates if not estimate.at_bound]
    if not names:
        return ()
    objective = Objective(problem, problem.windows())
    size, runs = len(names), len(problem.runs)
    known = runs * objective.gram(result.damper, names)[:size, :size]
    scale = inverse_sizes(known)
    known = known * np.outer(scale, scale) + PRIOR_INFORMATION_RATIO * np.eye(size)
    candidates = _candidates(problem, result.damper)
    information = _information(result.damper, names, candidates) * np.outer(scale, scale)
    target = information.mean(axis=0)
    # The residuals of runs of one motion are correlated. Therefore they count as one run.
    weight = runs / len(motion_groups(problem.runs))
    tests: list[ProposedTest] = []
    before = float(np.trace(np.linalg.solve(known, target)))
    for _ in range(min(count, len(candidates))):
        after = [float(np.trace(np.linalg.solve(known + weight * gain, target))) for gain in information]
        best = int(np.argmin(after))
        known = known + weight * information[best]
        reduction = 100.0 * (1.0 - math.sqrt(max(after[best], 0.0) / before)) if before > 0.0 else 0.0
        tests.append(_proposed(candidates[best], problem.template.command_unit, reduction))
    return tuple(tests)


_Candidate = tuple[
    float, float, float, float | None
]  # amplitude [m], frequency [Hz], command, temperature [K]


def _candidates(problem: FitProblem, damper: Damper) -> list[_Candidate]:
    """Return sines inside the envelope of the runs, including velocity and acceleration."""
    envelope = whole_envelope(problem.runs)
    assert envelope.frequency is not None
    assert envelope.acceleration is not None
    half = 0.5 * (envelope.displacement[1] - envelope.displacement[0])
    speed, acceleration = (max(map(abs, ends)) for ends in (envelope.velocity, envelope.acceleration))
    limits = envelope.temperature if damper.temperature_dependent else None
    kelvin: tuple[float | None, ...] = (None,) if limits is None else tuple(dict.fromkeys(limits))
    low, high = envelope.frequency
    motions = [
        (ratio * half, float(frequency))
        for ratio, frequency in product(AMPLITUDE_RATIOS, np.geomspace(low, high, FREQUENCY_COUNT))
        if VELOCITY_MIN_RATIO * speed <= 2.0 * np.pi * frequency * ratio * half <= 1.02 * speed
        and (2.0 * np.pi * frequency) ** 2 * ratio * half <= 1.1 * acceleration
    ]
    commands = dict.fromkeys(np.linspace(*envelope.command, COMMAND_COUNT).tolist())
    return [(*motion, command, degrees) for motion, command, degrees in product(motions, commands, kelvin)]


def _information(damper: Damper, names: Sequence[str], candidates: Sequence[_Candidate]) -> FloatArray:
    """Return the information matrix of each candidate in the unit of the cost, shape (k, n, n)."""
    drives = [
        open_drive(
            drive(
                Sine(amplitude, frequency),
                duration=PERIOD_COUNT / frequency,
                rate_Hz=SAMPLES_PER_PERIOD * frequency,
                command=command,
                temperature=kelvin,
            )
        )
        for amplitude, frequency, command, kelvin in candidates
    ]
    tangents, information = Tangents(damper, names, drives), []
    for k in range(len(drives)):
        along = tangents.along(k)
        start = len(along.force) // PERIOD_COUNT
        scored = along.force[start:]
        squares = along.combine @ core.gram(along.columns, start) @ along.combine.T
        information.append(1e4 * squares / (max(float(np.var(scored)), 1e-300) * len(scored)))
    return np.array(information).reshape(len(information), len(names), len(names))


def _proposed(candidate: _Candidate, unit: str, reduction: float) -> ProposedTest:
    """Return the test with the digits to which a rig is set."""
    amplitude, frequency, command, kelvin = candidate
    degrees = None if kelvin is None else round(to_degC(kelvin), 1)
    amplitude_mm, frequency_Hz, level = (
        float(f"{value:.3g}") for value in (1e3 * amplitude, frequency, command)
    )
    return ProposedTest(amplitude_mm, frequency_Hz, level, unit, degrees, round(reduction, 1))
