"""Whether force, current and stroke of a campaign are those of its damper: data sheet, drawing, or a table.

What all runs have wrong by one factor shows nowhere else: a fit scales with it. A finding asks for a
confirmation, which ``[damper]`` in ``plan.toml`` gives, and changes nothing: there are dampers beyond every
table.

Sources of the table: a damper for off-road vehicles of 1.1 to 7.4 kN and a stroke of 180 mm (J. Intell.
Mater. Syst. Struct. 2023, 10.1177/1045389X221151075), one for buildings of 15 t (Sternberg, Zemp and de la
Llera, Engineering Structures 69, 2014, 194-205), the public runs that the tests read; the ends are rounded
outwards by judgement. Fluids have yield stresses of 50 to 100 kPa at most (Lord Corporation on its fluids).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.data.diagnosis.plan import DeclaredDamper, plans_beside
from mrdamper.data.finding import Finding
from mrdamper.data.records import Recording

_PEAK_N = (150.0, 20e3)
_PEAK_WITH_1A_N = 300.0
_LARGEST_A = (0.3, 15.0)
_LEAST_STROKE_m = 2e-3
_MOST_STROKE_m = 0.5
_OF_SHEET = (0.4, 1.6)  # of the peak: speeds and temperatures differ from those of the data sheet
_DRIVEN = 0.8  # of the largest current: a test that comes to it shows the peak
_OVER_CURRENT = 1.3  # of the largest current
_YIELD_Pa = (3e3, 100e3)  # of a fluid in its field; the most that is known
_FACTOR = (2.0, 3.1)  # of the gap's pressure, tau L / g: at high and at low speed
_BESIDE_YIELD = 1.5  # of the force at most: viscosity and friction

_TABLE = "the magnetorheological dampers that were published have {0:.3g} to {1:.3g} {2}"
_FORCE = "kgf, lbf or kN read as N, N read as kN"
_STROKE = "inches read as mm, mm read as cm"
_CURRENT = "per cent or mA read as A, a driver's volts"


@dataclass(frozen=True, slots=True)
class _Seen:
    """What all runs together have."""

    peak: float  # [N], half of the largest range
    stroke: float  # [m]
    current: float | None  # the largest [A]; None: a voltage


@dataclass(frozen=True, slots=True)
class _Limits:
    """Where one of them has to lie, and who says so."""

    channel: str
    value: float
    low: float
    high: float
    unit: str
    source: str
    hint: str


def find_implausible_damper(runs: Sequence[Recording]) -> Iterator[Finding]:
    """Give a campaign whose force, current or stroke its damper cannot have.

    Raises
    ------
    InputError
        The plan beside the runs is no plan.
    """
    sound = [run for run in runs if len(run) > 1 and _finite(run)]
    if not sound:
        return
    amperes = [float(np.abs(run.command).max()) for run in sound if run.command_unit == "A"]
    seen = _Seen(
        peak=max(float(np.ptp(run.force)) / 2.0 for run in sound),
        stroke=max(float(np.ptp(run.displacement)) for run in sound),
        current=max(amperes, default=0.0) or None,
    )
    plans = plans_beside(run.source for run in sound if run.source)
    declared = next((plan.damper for plan in plans.values()), DeclaredDamper())
    for each in (*_force(seen, declared), *_stroke(seen, declared), *_current(seen, declared)):
        if each.low <= each.value <= each.high:
            continue
        yield Finding(
            kind="implausible_damper",
            severity="warning",
            channel=each.channel,
            run=sound[0].name,
            size=each.value,
            unit=each.unit,
            found=f"the largest {each.channel} of all runs is {each.value:.3g} {each.unit}; "
            + each.source.format(each.low, each.high, each.unit),
            effect="With a wrong unit every coefficient is wrong by its factor, and the fit looks as good",
            remedy=f"Please confirm the unit against the data sheet ({each.hint}?), "
            "by [damper] in plan.toml; nothing was changed",
        )


def _force(seen: _Seen, damper: DeclaredDamper) -> Iterator[_Limits]:
    driven = seen.current is None or seen.current >= _DRIVEN * (damper.largest_current_A or 0.0)
    if damper.peak_force_N is not None:
        low = _OF_SHEET[0] * damper.peak_force_N if driven else 0.0
        source = "plan.toml gives the damper {peak:.4g} N, which leaves {{0:.3g}} to {{1:.3g}} {{2}}"
        yield _Limits(
            "force", seen.peak, low, _OF_SHEET[1] * damper.peak_force_N, "N",
            source.format(peak=damper.peak_force_N), _FORCE,
        )  # fmt: skip
    valve = damper.valve_m
    if valve is not None:
        area, length, gap = valve
        low, high = (
            factor * tau * area * length / gap for factor, tau in zip(_FACTOR, _YIELD_Pa, strict=True)
        )
        source = "the valve that plan.toml draws has {0:.3g} to {1:.3g} {2}, with a fluid of 3 to 100 kPa"
        low = low if driven and (seen.current is None or seen.current >= _LARGEST_A[0]) else 0.0
        yield _Limits("force", seen.peak, low, _BESIDE_YIELD * high, "N", source, _FORCE)
    if damper.peak_force_N is None and valve is None:
        low = _PEAK_WITH_1A_N if (seen.current or 0.0) >= 1.0 else _PEAK_N[0]
        more = ", those of buildings up to 150 kN"
        yield _Limits("force", seen.peak, low, _PEAK_N[1], "N", _TABLE + more, _FORCE)


def _stroke(seen: _Seen, damper: DeclaredDamper) -> Iterator[_Limits]:
    if damper.stroke_mm is None:
        source, most = _TABLE, _MOST_STROKE_m
    else:
        source, most = "plan.toml gives the damper {1:.4g} {2}", 1e-3 * damper.stroke_mm
    yield _Limits("displacement", seen.stroke, _LEAST_STROKE_m, most, "m", source, _STROKE)


def _current(seen: _Seen, damper: DeclaredDamper) -> Iterator[_Limits]:
    if seen.current is None:
        return
    if damper.largest_current_A is None:
        yield _Limits("current", seen.current, *_LARGEST_A, "A", _TABLE, _CURRENT)
        return
    most = _OVER_CURRENT * damper.largest_current_A
    source = f"plan.toml gives the damper {damper.largest_current_A:.4g} A at most"
    yield _Limits("current", seen.current, min(_LARGEST_A[0], 0.1 * most), most, "A", source, _CURRENT)


def _finite(run: Recording) -> bool:
    return all(bool(np.isfinite(each).all()) for each in (run.force, run.displacement, run.command))
