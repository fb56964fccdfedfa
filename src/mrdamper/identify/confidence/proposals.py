"""The tests to run next: those after which the parameters leave least doubt about the force.

Candidates are sines at commands and temperatures inside what the runs covered, so that the rig can run them.
Each is judged before it is run, by the law's tangents (an I-optimal design, one run after the other): what it
would take off the mean variance of the force that the parameters' covariance makes over all candidates.
What the law itself cannot do stays; the band holds both.
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
from mrdamper.identify.motions import motion_groups
from mrdamper.identify.predict import whole_envelope
from mrdamper.identify.problem import FitProblem, FitResult
from mrdamper.identify.search.objective import Objective
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import open_drive
from mrdamper.models.tangents import Tangents
from mrdamper.quantities import to_degC

_AMPLITUDES = (1.0, 0.5, 0.2)  # of half the stroke
_FREQUENCIES = 3
_COMMANDS = 3
_PERIODS = 2
_SAMPLES = 200  # in a period
_SLOWEST = 0.03  # of the top speed: below it a run tells of noise
_RIDGE = 1e-7  # of what the runs say of a parameter: that much is known before


@dataclass(frozen=True, slots=True)
class ProposedTest:
    """A sine at a command and a temperature, and by how much it shrinks the parameters' part of the band."""

    amplitude_mm: float
    frequency_Hz: float
    command: float
    command_unit: str
    temperature_degC: float | None
    reduction_percent: float  # with the tests proposed before it

    @property
    def sentence(self) -> str:
        """The test and what it is good for, in words."""
        at = "" if self.temperature_degC is None else f" and {self.temperature_degC:.0f} degC"
        return (
            f"run a sine of {self.amplitude_mm:.2g} mm at {self.frequency_Hz:.2g} Hz, {self.command:.3g} "
            f"{self.command_unit}{at}: what the parameters add to the force band shrinks by "
            f"{self.reduction_percent:.0f} %"
        )


def propose_tests(problem: FitProblem, result: FitResult, *, count: int = 3) -> tuple[ProposedTest, ...]:
    """Return the tests to run next, the best first; none where no parameter is free of its bounds."""
    names = [each.name for each in result.estimates if not each.at_bound]
    if not names:
        return ()
    objective = Objective(problem, problem.prepare())
    size, runs = len(names), len(problem.runs)
    known = runs * objective.gram(result.damper, names, result.offsets_N)[:size, :size]
    scale = inverse_sizes(known)
    known = known * np.outer(scale, scale) + _RIDGE * np.eye(size)
    candidates = _candidates(problem, result.damper)
    told = _information(result.damper, names, candidates) * np.outer(scale, scale)
    target = told.mean(axis=0)
    weight = runs / len(motion_groups(problem.runs))  # runs of one motion hang together
    found: list[ProposedTest] = []
    before = float(np.trace(np.linalg.solve(known, target)))
    for _ in range(min(count, len(candidates))):
        after = [float(np.trace(np.linalg.solve(known + weight * each, target))) for each in told]
        best = int(np.argmin(after))
        known = known + weight * told[best]
        shrinks = 100.0 * (1.0 - math.sqrt(max(after[best], 0.0) / before)) if before > 0.0 else 0.0
        found.append(_proposed(candidates[best], problem.template.command_unit, shrinks))
    return tuple(found)


_Candidate = tuple[
    float, float, float, float | None
]  # amplitude [m], frequency [Hz], command, temperature [K]


def _candidates(problem: FitProblem, damper: Damper) -> list[_Candidate]:
    """Return sines inside the envelope of the runs, speed and acceleration included."""
    seen = whole_envelope(problem.runs)
    assert seen.frequency is not None
    assert seen.acceleration is not None
    half = 0.5 * (seen.displacement[1] - seen.displacement[0])
    speed, acceleration = (max(map(abs, ends)) for ends in (seen.velocity, seen.acceleration))
    warm = seen.temperature if damper.temperature_dependent else None
    kelvin: tuple[float | None, ...] = (None,) if warm is None else tuple(dict.fromkeys(warm))
    low, high = seen.frequency
    motions = [
        (share * half, float(frequency))
        for share, frequency in product(_AMPLITUDES, np.geomspace(low, high, _FREQUENCIES))
        if _SLOWEST * speed <= 2.0 * np.pi * frequency * share * half <= 1.02 * speed
        and (2.0 * np.pi * frequency) ** 2 * share * half <= 1.1 * acceleration
    ]
    commands = dict.fromkeys(np.linspace(*seen.command, _COMMANDS).tolist())
    return [(*motion, command, degrees) for motion, command, degrees in product(motions, commands, kelvin)]


def _information(damper: Damper, names: Sequence[str], candidates: Sequence[_Candidate]) -> FloatArray:
    """Return what each candidate would tell of the parameters, in the cost's unit, shape (k, n, n)."""
    drives = [
        open_drive(
            drive(
                Sine(amplitude, frequency),
                duration=_PERIODS / frequency,
                rate_Hz=_SAMPLES * frequency,
                command=command,
                temperature=kelvin,
            )
        )
        for amplitude, frequency, command, kelvin in candidates
    ]
    tangents, found = Tangents(damper, names, drives), []
    for k in range(len(drives)):
        along = tangents.along(k)
        start = len(along.force) // _PERIODS
        scored = along.force[start:]
        squares = along.combine @ core.gram(along.columns, start) @ along.combine.T
        found.append(1e4 * squares / (max(float(np.var(scored)), 1e-300) * len(scored)))
    return np.array(found).reshape(len(found), len(names), len(names))


def _proposed(candidate: _Candidate, unit: str, shrinks: float) -> ProposedTest:
    amplitude, frequency, command, kelvin = candidate
    degrees = None if kelvin is None else round(to_degC(kelvin), 1)
    size, often, level = (float(f"{value:.3g}") for value in (1e3 * amplitude, frequency, command))
    return ProposedTest(size, often, level, unit, degrees, round(shrinks, 1))
