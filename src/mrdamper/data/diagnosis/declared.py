"""Findings on runs that disagree with their names, with runs of the same motion, or with published dampers.

A name such as ``sine_10mm2Hz_1.00A_60C`` declares amplitude or stroke, frequency, command and temperature.
The values in the name are compared with the signals.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import PurePath
from typing import NamedTuple

import numpy as np

from mrdamper.arrays import DEVIATION_PER_MAD
from mrdamper.data.diagnosis.settings import SETTINGS
from mrdamper.data.finding import Finding, percent
from mrdamper.data.records import Recording
from mrdamper.quantities import to_degC

_NUMBER = r"(?<![\d.])(\d+(?:[.p,]\d+)?)\s*"


class _Declared(NamedTuple):
    unit: str
    form: str  # pattern of the unit in names of runs
    relative_tolerance: float
    tolerance: float  # [unit]
    channel: str
    hint: str  # typical error


_AMPERES = "per cent, milliamperes or a driver's input read as amperes"
_DECLARED: Mapping[str, _Declared] = {
    "frequency": _Declared("Hz", "Hz", 0.03, 0.002, "time", "a sampling rate, or a counter taken for time"),
    "stroke": _Declared("mm", "mm", 0.12, 0.3, "displacement", "inches or centimetres read as millimetres"),
    "current": _Declared("A", "A(?![a-z])", 0.06, 0.06, "current", _AMPERES),
    "voltage": _Declared("V", "V(?![a-z])", 0.06, 0.06, "current", _AMPERES),
    "temperature": _Declared("degC", "(?:degC|°C|C(?![a-z]))", 0.0, 6.0, "temperature", "degF read as degC"),
}


class _Sibling(NamedTuple):
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
            if declared is None:
                continue
            allowed = max(known.relative_tolerance * declared, known.tolerance)
            factors = (1.0, 2.0) if quantity == "stroke" else (1.0,)  # The name may state an amplitude.
            if any(abs(found - factor * declared) <= factor * allowed for factor in factors):
                continue
            kind = "command" if quantity in {"current", "voltage"} else quantity
            words = f"the name declares {declared:g} {known.unit}, the signals have {found:.4g} {known.unit}"
            effect = "The card would hold for another operating point than the test's, or in another unit"
            remedy = f"Check unit and scale of the channel ({known.hint}), or the name"
            size = found / declared if declared else found
            different = Finding(f"declared_{kind}", words, effect, remedy, channel=known.channel, size=size)
            yield replace(different, run=run.name)


def find_odd_siblings(runs: Sequence[Recording]) -> Iterator[Finding]:
    """Generate findings on runs that differ slightly in frequency or stroke from runs of the same motion.

    Runs whose names declare different frequencies or strokes are not of the same motion.
    """
    sines = []
    for run in runs:
        if "frequency" in (values := _values_of(run)):
            declared = [_number_in_names(run, name) for name in _SIBLINGS]
            sines.append((run, declared, np.array([values[name] for name in _SIBLINGS])))
    limits = np.array([known.ratio_max for known in _SIBLINGS.values()])
    for run, declared, motion in sines:
        siblings = [each for other, names, each in sines if other is not run and names == declared]
        others = np.array([each for each in siblings if (np.abs(each / motion - 1.0) < limits).all()])
        if len(others) < SETTINGS.sibling_run_count_min:
            continue
        for (quantity, known), mine, theirs in zip(_SIBLINGS.items(), motion, others.T, strict=True):
            middle = float(np.median(theirs))
            ratio, apart = float(mine) / middle, np.abs(theirs / middle - 1.0)
            scatter = DEVIATION_PER_MAD * float(np.median(apart))
            deviation_min = max(known.deviation_min, 5.0 * scatter, 2.5 * float(np.max(apart)))
            if abs(ratio - 1.0) < deviation_min or scatter > known.scatter_max:
                continue
            size = 1.0 / ratio if quantity == "frequency" else ratio
            unit, channel = _DECLARED[quantity].unit, _DECLARED[quantity].channel
            found = f"its {quantity} is {mine:.4g} {unit}, and that of {len(others)} other runs of this "
            found += f"motion {middle:.4g} {unit}: {channel} times {size:.3f}"
            effect = f"Velocities of this run are off by {percent(abs(ratio - 1.0))}, viscosity with them"
            remedy = f"Check the {known.suspect} of this file, or leave the run out"
            odd = Finding(known.kind, found, effect, remedy, channel=channel, size=size, run=run.name)
            yield odd.add_interval(max(scatter, 1e-3))


def find_implausible_damper(runs: Sequence[Recording]) -> Iterator[Finding]:
    """Generate findings on quantities of a campaign that are outside the range of published dampers.

    A unit that is wrong in all runs has no other symptom, because the fitted coefficients scale with the unit
    factor. Sources of the ranges, rounded outwards: a damper for off-road vehicles of 1.1 to 7.4 kN and a
    stroke of 180 mm (J. Intell. Mater. Syst. Struct. 2023, 10.1177/1045389X221151075), a damper for buildings
    of 15 t (Sternberg, Zemp, de la Llera, Engineering Structures 69, 2014, 194-205), and the public runs of
    the tests.
    """
    if not runs:
        return
    current = max((float(np.abs(run.command).max()) for run in runs if run.command_unit == "A"), default=0.0)
    peak = max(float(np.ptp(run.force)) / 2.0 for run in runs)
    stroke = max(float(np.ptp(run.displacement)) for run in runs)
    peak_min, peak_max = SETTINGS.peak_force_range_N
    peak_min = SETTINGS.peak_force_min_at_1A_N if current >= 1.0 else peak_min
    buildings = ", those of buildings up to 150 kN"
    for channel, value, low, high, unit, note, hint in (
        ("force", peak, peak_min, peak_max, "N", buildings, "kgf, lbf or kN read as N, N read as kN"),
        ("displacement", stroke, *SETTINGS.stroke_range_m, "m", "", _DECLARED["stroke"].hint),
        ("current", current, *SETTINGS.peak_current_range_A, "A", "", _AMPERES),
    ):
        if low <= value <= high or value == 0.0:  # Without a coil current, the command is a voltage or zero.
            continue
        found = f"the largest {channel} of all runs is {value:.3g} {unit}; published magnetorheological "
        found += f"dampers have {low:.3g} to {high:.3g} {unit}{note}"
        effect = "A wrong unit makes all coefficients wrong by its factor, but the fit looks as good"
        remedy = f"Compare the unit with the data sheet ({hint}?); nothing was changed"
        unusual = Finding("implausible_damper", found, effect, remedy, channel=channel, size=value, unit=unit)
        yield replace(unusual, run=runs[0].name)


def _number_in_names(run: Recording, quantity: str) -> float | None:
    """Return the number that the name of the run, the file or the folder states for a quantity.

    The first of these names that states a number for the quantity is used. The result is None if no name
    states a number, or if the used name states several numbers.
    """
    source, form = PurePath(run.source), _NUMBER + _DECLARED[quantity].form
    stated = (re.findall(form, text) for text in (run.name, source.stem, source.parent.name))
    numbers = {float(re.sub("[p,]", ".", each)) for each in next(filter(None, stated), ())}
    return numbers.pop() if len(numbers) == 1 else None


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
    known = np.flatnonzero(np.abs(x) > 0.25 * (high - low))
    turned = np.flatnonzero((x[known[1:]] > 0.0) & (x[known[:-1]] <= 0.0))
    ups = []
    for a, b in zip(known[turned].tolist(), known[turned + 1].tolist(), strict=True):
        k = a + int(np.argmax(x[a : b + 1] >= 0.0))
        ups.append(float(np.interp(0.0, x[k - 1 : k + 1], run.time[k - 1 : k + 1])))
    periods = np.diff(ups[1:]) if len(ups) > 3 else np.diff(ups)
    if len(periods) < 1 or float(np.ptp(periods)) > SETTINGS.period_ratio_max * float(np.median(periods)):
        return None
    return 1.0 / float(np.mean(periods))
