"""Findings on runs that disagree with their file names or with other runs of the same motion.

A name such as ``sine_10mm2Hz_1.00A_60C`` declares amplitude or stroke, frequency, command and temperature.
The values in the name are compared with the signals.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from types import MappingProxyType
from typing import Literal

import numpy as np

from mrdamper.arrays import DEVIATION_PER_MAD
from mrdamper.data.diagnosis.settings import SETTINGS
from mrdamper.data.finding import Finding, percent
from mrdamper.data.records import Recording
from mrdamper.quantities import ZERO_CELSIUS_K

Quantity = Literal["frequency", "stroke", "command", "temperature"]

_NUMBER = r"(?<![\d.])(\d+(?:[.p,]\d+)?)\s*"
_NAMED: Mapping[str, str] = MappingProxyType(
    {
        "frequency": r"Hz",
        "stroke": r"mm",
        "command": r"A(?![a-z])",
        "voltage": r"V(?![a-z])",
        "temperature": r"(?:degC|°C|C(?![a-z]))",
    }
)
_UNITS = {"frequency": "Hz", "stroke": "mm", "command": "A", "temperature": "degC"}
_WITHIN = {"frequency": 0.03, "stroke": 0.12, "command": 0.06, "temperature": 0.0}  # Relative tolerances.
_CHANNEL = {
    "frequency": "time", "stroke": "displacement", "command": "current", "temperature": "temperature"
}  # fmt: skip
_AT_LEAST = {"frequency": 0.002, "stroke": 0.3, "command": 0.06, "temperature": 6.0}  # Absolute tolerances.
_RATIO = {"frequency": 0.12, "stroke": 0.25}  # Runs of one motion differ by less than these fractions.
_DEVIATION_MIN = {"frequency": 0.015, "stroke": 0.04}  # A run that differs by a larger fraction is reported.
_SCATTER_MAX = {"frequency": 0.003, "stroke": 0.012}  # Limit of the scatter among the remaining runs.


@dataclass(frozen=True, slots=True)
class _Values:
    """Values computed from the signals of a run, in the units of ``_UNITS``; None if not available."""

    frequency: float | None
    stroke: float | None
    command: float | None
    temperature: float | None


def find_against_names(runs: Sequence[Recording]) -> Iterator[Finding]:
    """Generate findings on runs whose signals differ from the values in the names of run, file or folder."""
    for run in runs:
        seen = _values_of(run)
        for quantity, usual_unit in _UNITS.items():
            unit = run.command_unit if quantity == "command" else usual_unit
            declared = _declared(run, quantity)
            found = getattr(seen, quantity)
            if declared is None or found is None or _agrees(quantity, declared, found):
                continue
            yield Finding(
                kind=f"declared_{quantity}",
                channel=_CHANNEL[quantity],
                run=run.name,
                size=found / declared if declared else found,
                found=f"the name declares {declared:g} {unit}, and the signals have {found:.4g} {unit}",
                effect="The card would hold for another operating point than the test's, or in another unit",
                remedy=f"Check unit and scale of the channel ({_HINT[quantity]}), or the name",
            )


def find_odd_siblings(runs: Sequence[Recording]) -> Iterator[Finding]:
    """Generate findings on runs that differ slightly in frequency or stroke from runs of the same motion."""
    seen = [(run, _values_of(run)) for run in runs]
    sines = [(run, each) for run, each in seen if each.frequency is not None]
    for run, mine in sines:
        others = [each for other, each in sines if other is not run and all(
            abs(getattr(each, name) / getattr(mine, name) - 1.0) < ratio for name, ratio in _RATIO.items()
        )]  # fmt: skip
        if len(others) < SETTINGS.sibling_run_count_min:
            continue
        for quantity, cause, channel in (
            ("frequency", "time_scale", "time"), ("stroke", "displacement_scale", "displacement")
        ):  # fmt: skip
            values = np.array([getattr(each, quantity) for each in others])
            middle = float(np.median(values))
            ratio = getattr(mine, quantity) / middle
            scatter = DEVIATION_PER_MAD * float(np.median(np.abs(values / middle - 1.0)))
            if abs(ratio - 1.0) < _DEVIATION_MIN[quantity] or scatter > _SCATTER_MAX[quantity]:
                continue
            if abs(ratio - 1.0) < 5.0 * max(scatter, float(np.max(np.abs(values / middle - 1.0))) / 2.0):
                continue
            size = 1.0 / ratio if quantity == "frequency" else ratio
            yield Finding(
                kind=cause,
                channel=channel,
                run=run.name,
                size=size,
                low=size - 2.0 * max(scatter, 1e-3),
                high=size + 2.0 * max(scatter, 1e-3),
                found=f"its {quantity} is {getattr(mine, quantity):.4g} {_UNITS[quantity]}, and that of "
                f"{len(others)} other runs of this motion {middle:.4g} {_UNITS[quantity]}: {channel} "
                f"times {size:.3f}",
                effect=f"Velocities of this run are off by {percent(abs(ratio - 1.0))}, viscosity with them",
                remedy=f"Check the {_SUSPECT[channel]} of this file against the others; until it is known "
                "leave the run out",
            )


_SUSPECT = {"time": "sampling rate", "displacement": "scale of the displacement"}
_HINT = {
    "frequency": "a sampling rate, or a counter taken for time",
    "stroke": "inches or centimetres read as millimetres",
    "command": "per cent, milliamperes or a driver's input read as amperes",
    "temperature": "degF read as degC",
}


def _declared(run: Recording, quantity: str) -> float | None:
    """Return the number that the name of the run, the file or the folder states for a quantity.

    The first name with a number counts. The result is None if no name has a number, or if the first name with
    numbers has several.
    """
    source = PurePath(run.source) if run.source else PurePath()
    named = "voltage" if quantity == "command" and run.command_unit == "V" else quantity
    for text in (run.name, source.stem, source.parent.name):
        found = {float(re.sub("[p,]", ".", each)) for each in re.findall(_NUMBER + _NAMED[named], text)}
        if len(found) == 1:
            return found.pop()
        if found:
            return None
    return None


def _agrees(quantity: str, declared: float, found: float) -> bool:
    allowed = max(_WITHIN[quantity] * declared, _AT_LEAST[quantity])
    meant = (1.0, 2.0) if quantity == "stroke" else (1.0,)  # A name may state an amplitude or a stroke.
    return any(abs(found - times * declared) <= times * allowed for times in meant)


def _values_of(run: Recording) -> _Values:
    frequency = _frequency(run)
    low, high = np.quantile(run.displacement, (0.002, 0.998))
    mean = abs(float(np.mean(run.command)))
    steady = float(np.std(run.command)) < 0.02 + 0.05 * mean
    kelvin = run.temperature
    return _Values(
        frequency,
        1e3 * float(high - low) if frequency is not None else None,
        mean if steady else None,
        None if kelvin is None else float(np.median(kelvin)) - ZERO_CELSIUS_K,
    )


def _frequency(run: Recording) -> float | None:
    """Return the frequency of a motion [Hz] from its zero crossings, None if it is not a steady sine."""
    low, high = np.quantile(run.displacement, (0.02, 0.98))
    x = run.displacement - 0.5 * (low + high)
    swing = 0.25 * float(high - low)
    known = np.flatnonzero(np.abs(x) > swing)
    up = x[known] > 0.0
    turned = np.flatnonzero(up[1:] & ~up[:-1])
    ups = []
    for a, b in zip(known[turned].tolist(), known[turned + 1].tolist(), strict=True):
        k = a + int(np.argmax(x[a : b + 1] >= 0.0))
        share = float(-x[k - 1] / (x[k] - x[k - 1]))
        ups.append(float(run.time[k - 1] + share * (run.time[k] - run.time[k - 1])))
    periods = np.diff(ups[1:]) if len(ups) > 3 else np.diff(ups)
    if len(periods) < 1 or float(np.ptp(periods)) > SETTINGS.period_ratio_max * float(np.median(periods)):
        return None
    return 1.0 / float(np.mean(periods))
