"""Assess a fit: error of each run, dissipated energy, passivity, and remarks for the user."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.excitation import Sine, drive
from mrdamper.identify.confidence.settings import SETTINGS
from mrdamper.identify.problem import FittedDamper, SearchResult, envelope_of
from mrdamper.identify.scores import RunError, score_each
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate_each


@dataclass(frozen=True, slots=True)
class Assessment:
    """Errors of a fit on each run, passivity of the damper, and remarks for the user."""

    runs: tuple[RunError, ...]  # errors of training runs and held-out runs
    passivity_min: float  # result of ``passivity``; the model can generate energy if this value is negative
    words: tuple[str, ...]  # remarks for the user; each has one or two sentences


def assess(fitted: FittedDamper) -> Assessment:
    """Return the assessment of a fit: errors of the runs, passivity and remarks."""
    runs = (
        *score_each(fitted.damper, fitted.training, "training"),
        *score_each(fitted.damper, fitted.held_out, "held_out"),
    )
    work_min = passivity(fitted.damper, fitted.training)
    return Assessment(runs, work_min, tuple(_remarks(fitted.result, runs, work_min)))


def passivity(damper: Damper, runs: Sequence[PreparedRun]) -> float:
    """Return the minimum dissipated work of a closed cycle, divided by 4 x amplitude x peak force [-].

    The minimum is taken over sines inside the envelope of the runs: amplitudes of 1, 10 and 100 % of the
    stroke, 20 and 100 % of the maximum velocity, five currents, the lowest and the highest temperature. Two
    cycles are simulated, and the second cycle is evaluated.
    """
    envelope = envelope_of(runs)
    stroke = max(abs(end) for end in envelope.displacement)
    speed = max(abs(end) for end in envelope.velocity)
    temperatures = dict.fromkeys(envelope.temperature or (None,))
    commands = np.linspace(*envelope.command, 5).tolist()
    amplitudes, paths = [], []
    for ratio, speed_ratio, at, kelvin in product((0.01, 0.1, 1.0), (0.2, 1.0), commands, temperatures):
        amplitudes.append(ratio * stroke)
        frequency = speed_ratio * speed / (2.0 * np.pi * amplitudes[-1])
        timing = {"duration": 2.0 / frequency, "rate_Hz": 500.0 * frequency}
        paths.append(drive(Sine(amplitudes[-1], frequency), **timing, command=at, temperature=kelvin))
    work_min = np.inf
    for amplitude, path, force in zip(amplitudes, paths, simulate_each(damper, paths), strict=True):
        # The first and the last point of a closed cycle are the same point, so only one of them is counted.
        second = slice(len(path) // 2 + 1, None)
        work = float(force[second] @ path.velocity[second]) * path.step
        peak = 4.0 * amplitude * float(np.abs(force[second]).max())
        work_min = min(work_min, work / peak if peak > 0.0 else 0.0)
    return float(work_min)


def _correlation_remarks(result: SearchResult) -> list[str]:
    """Return remarks on correlated parameters of different coefficients, strongest correlation first."""
    names = [estimate.name for estimate in result.estimates]
    strength = np.abs(np.triu(np.nan_to_num(result.correlation), 1))
    owners = np.array([name.partition(".")[0] for name in names])
    strength[owners[:, None] == owners] = 0.0  # The terms of one polynomial are always correlated.
    count = np.count_nonzero(strength > SETTINGS.correlation_min)
    pairs = [divmod(int(k), len(names)) for k in np.argsort(-strength, axis=None)[:count]]
    remarks = [
        f"{names[i]} and {names[j]} are strongly correlated ({result.correlation[i, j]:.2f}): the runs "
        "determine them together, not separately."
        for i, j in pairs[: SETTINGS.correlations_max_count]
    ]
    if (more := len(pairs) - SETTINGS.correlations_max_count) > 0:
        remarks.append(f"{more} more pairs of parameters are strongly correlated: see the matrix.")
    return remarks


def _remarks(result: SearchResult, runs: Sequence[RunError], work_min: float) -> list[str]:
    remarks = []
    for estimate in result.estimates:
        if estimate.at_bound:
            bound = estimate.lower if estimate.at_bound == "lower" else estimate.upper
            unit = "" if estimate.unit == "-" else f" {estimate.unit}"
            remarks.append(
                f"{estimate.name} is on its {estimate.at_bound} bound ({bound:g}{unit}): the best "
                "value is beyond the bound or the model's range. The other parameters were fitted with this "
                "value."
            )
        elif not estimate.identifiable:
            percent = estimate.design_error_percent
            limit = f"{percent:.0f} %" if percent < 1000.0 else "over 1000 %"
            remarks.append(
                f"{estimate.name} is not identifiable from these runs (standard error {limit} by design): "
                "its value has no physical meaning."
            )
    remarks += _correlation_remarks(result)
    if work_min < 0.0:
        remarks.append(
            "The model is not passive inside the envelope: at least one closed cycle returns work "
            f"({100 * work_min:.1f} % of 4 x amplitude x peak force)."
        )
    for error in runs:
        if not error.energy_measured_J > 0.0:
            continue
        difference = error.energy_model_J / error.energy_measured_J - 1.0
        if abs(difference) > SETTINGS.energy_error_max:
            remarks.append(f"{error.name}: the energy per cycle differs by {100.0 * difference:+.0f} %.")
    return remarks
