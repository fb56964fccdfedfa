"""Findings on runs that disagree with their file names or with other runs of the same motion.

A name such as ``sine_10mm2Hz_1.00A_60C`` declares amplitude or stroke, frequency, command and temperature.
The values in the name are compared with the signals.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np

from mrdamper.arrays import DEVIATION_PER_MAD
from mrdamper.data.diagnosis.settings import SETTINGS
from mrdamper.data.finding import Finding, percent
from mrdamper.data.records import Recording
from mrdamper.quantities import to_degC

_NUMBER = r"(?<![\d.])(\d+(?:[.p,]\d+)?)\s*"


@dataclass(frozen=True, slots=True)
class _Declared:
    """Quantity in names of runs: pattern ``form`` of its unit, typical error ``hint``."""

    unit: str
    form: str
    relative_tolerance: float
    tolerance: float  # [unit]
    channel: str
    hint: str


_AMPERES = "per cent, milliamperes or a driver's input read as amperes"
_DECLARED: Mapping[str, _Declared] = {
    "frequency": _Declared("Hz", "Hz", 0.03, 0.002, "time", "a sampling rate, or a counter taken for time"),
    "stroke": _Declared("mm", "mm", 0.12, 0.3, "displacement", "inches or centimetres read as millimetres"),
    "current": _Declared("A", "A(?![a-z])", 0.06, 0.06, "current", _AMPERES),
    "voltage": _Declared("V", "V(?![a-z])", 0.06, 0.06, "current", _AMPERES),
    "temperature": _Declared("degC", "(?:degC|°C|C(?![a-z]))", 0.0, 6.0, "temperature", "degF read as degC"),
}


@dataclass(frozen=True, slots=True)
class _Sibling:
    """Quantity that is equal in runs of the same motion, and limits for a finding."""

    kind: str
    suspect: str
    ratio_max: float  # max relative difference of runs with the same motion
    deviation_min: float  # min relative difference of a reported run from the other runs
    scatter_max: float  # max relative difference among the other runs; else no finding


_SIBLINGS: Mapping[str, _Sibling] = {
    "frequency": _Sibling("time_scale", "sampling rate", 0.12, 0.015, 0.003),
    "stroke": _Sibling("displacement_scale", "scale of the displacement", 0.25, 0.04, 0.012),
}


def find_against_names(runs: Sequence[Recording]) -> Iterator[Finding]:
    """Generate findings on runs whose signals differ from the values in the names of run, file or folder."""
    for run in runs:
        for quantity, found in _values_of(run).items():
            declared, known = _number_in_names(run, quantity), _DECLARED[quantity]
            if declared is None or _agrees(quantity, declared, found):
                continue
            kind = "command" if quantity in {"current", "voltage"} else quantity
            yield Finding(
                kind=f"declared_{kind}",
                channel=known.channel,
                run=run.name,
                size=found / declared if declared else found,
                found=f"the name declares {declared:g} {known.unit}, and the signals have {found:.4g} "
                f"{known.unit}",
                effect="The card would hold for another operating point than the test's, or in another unit",
                remedy=f"Check unit and scale of the channel ({known.hint}), or the name",
            )


def find_odd_siblings(runs: Sequence[Recording]) -> Iterator[Finding]:
    """Generate findings on runs that differ slightly in frequency or stroke from runs of the same motion.

    Runs whose names declare different frequencies or strokes are not of the same motion.
    """
    seen = [(run, _values_of(run)) for run in runs]
    sines = [
        (values, [_number_in_names(run, name) for name in _SIBLINGS], run)
        for run, values in seen
        if "frequency" in values
    ]
    for mine, declared, run in sines:
        others = [
            values
            for values, other_declared, other in sines
            if other is not run
            and other_declared == declared
            and all(
                abs(values[name] / mine[name] - 1.0) < known.ratio_max for name, known in _SIBLINGS.items()
            )
        ]
        if len(others) < SETTINGS.sibling_run_count_min:
            continue
        for quantity, known in _SIBLINGS.items():
            values = np.array([each[quantity] for each in others])
            middle = float(np.median(values))
            ratio, apart = mine[quantity] / middle, np.abs(values / middle - 1.0)
            scatter = DEVIATION_PER_MAD * float(np.median(apart))
            if abs(ratio - 1.0) < known.deviation_min or scatter > known.scatter_max:
                continue
            if abs(ratio - 1.0) < 5.0 * max(scatter, float(np.max(apart)) / 2.0):
                continue
            size, error = 1.0 / ratio if quantity == "frequency" else ratio, max(scatter, 1e-3)
            unit, channel = _DECLARED[quantity].unit, _DECLARED[quantity].channel
            yield Finding(
                kind=known.kind,
                channel=channel,
                run=run.name,
                size=size,
                found=f"its {quantity} is {mine[quantity]:.4g} {unit}, and that of {len(others)} other runs "
                f"of this motion {middle:.4g} {unit}: {channel} times {size:.3f}",
                effect=f"Velocities of this run are off by {percent(abs(ratio - 1.0))}, viscosity with them",
                remedy=f"Check the {known.suspect} of this file against the others; until it is known leave "
                "the run out",
            ).add_interval(error)


def _number_in_names(run: Recording, quantity: str) -> float | None:
    """Return the number that the name of the run, the file or the folder states for a quantity.

    The first of these names that states a number for the quantity is used. The result is None if no name
    states a number, or if the used name states several numbers.
    """
    source = PurePath(run.source) if run.source else PurePath()
    for text in (run.name, source.stem, source.parent.name):
        found = {
            float(re.sub("[p,]", ".", each)) for each in re.findall(_NUMBER + _DECLARED[quantity].form, text)
        }
        if len(found) == 1:
            return found.pop()
        if found:
            return None
    return None


def _agrees(quantity: str, declared: float, found: float) -> bool:
    allowed = max(_DECLARED[quantity].relative_tolerance * declared, _DECLARED[quantity].tolerance)
    meant = (1.0, 2.0) if quantity == "stroke" else (1.0,)  # The name may state an amplitude.
    return any(abs(found - times * declared) <= times * allowed for times in meant)


def _values_of(run: Recording) -> dict[str, float]:
    """Return frequency, stroke, command and temperature of a run's signals, in the units of ``_DECLARED``."""
    values: dict[str, float] = {}
    frequency = _frequency(run)
    if frequency is not None:
        low, high = np.quantile(run.displacement, (0.002, 0.998))
        values |= {"frequency": frequency, "stroke": 1e3 * float(high - low)}
    mean = abs(float(np.mean(run.command)))
    if float(np.std(run.command)) < 0.02 + 0.05 * mean:  # The command is steady.
        values["current" if run.command_unit == "A" else "voltage"] = mean
    if run.temperature is not None:
        values["temperature"] = to_degC(float(np.median(run.temperature)))
    return values


def _frequency(run: Recording) -> float | None:
    """Return the frequency [Hz] by zero crossings, None if the periods are not equal."""
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
