"""Plausibility of force, current and stroke of a campaign, compared with published dampers.

A unit that is wrong in all runs has no other symptom, because the fitted coefficients scale with the unit
factor. The finding requests a comparison of the unit with the data sheet. No data are changed.

Sources of the ranges: a damper for off-road vehicles of 1.1 to 7.4 kN and a stroke of 180 mm (J. Intell.
Mater. Syst. Struct. 2023, 10.1177/1045389X221151075), a damper for buildings of 15 t (Sternberg, Zemp, de la
Llera, Engineering Structures 69, 2014, 194-205), and the public runs of the tests. The limits are rounded
outwards.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mrdamper.data.diagnosis.settings import SETTINGS
from mrdamper.data.finding import Finding
from mrdamper.data.records import Recording

_HINTS = {
    "force": "kgf, lbf or kN read as N, N read as kN",
    "displacement": "inches read as mm, mm read as cm",
    "current": "per cent or mA read as A, a driver's volts",
}


def find_implausible_damper(runs: Sequence[Recording]) -> Iterator[Finding]:
    """Generate findings on quantities of a campaign that are outside the range of published dampers."""
    if not runs:
        return
    amperes = [float(np.abs(run.command).max()) for run in runs if run.command_unit == "A"]
    current = max(amperes, default=0.0)
    peak = max(float(np.ptp(run.force)) / 2.0 for run in runs)
    stroke = max(float(np.ptp(run.displacement)) for run in runs)
    peak_min = SETTINGS.peak_force_min_at_1A_N if current >= 1.0 else SETTINGS.peak_force_range_N[0]
    for channel, value, low, high, unit in (
        ("force", peak, peak_min, SETTINGS.peak_force_range_N[1], "N"),
        ("displacement", stroke, *SETTINGS.stroke_range_m, "m"),
        *((("current", current, *SETTINGS.peak_current_range_A, "A"),) if current else ()),
    ):
        if low <= value <= high:
            continue
        yield Finding(
            kind="implausible_damper",
            channel=channel,
            run=runs[0].name,
            size=value,
            unit=unit,
            found=f"the largest {channel} of all runs is {value:.3g} {unit}; published magnetorheological "
            f"dampers have {low:.3g} to {high:.3g} {unit}"
            + (", those of buildings up to 150 kN" if channel == "force" else ""),
            effect="A wrong unit makes all coefficients wrong by its factor, but the fit looks as good",
            remedy=f"Compare the unit with the data sheet ({_HINTS[channel]}?); nothing was changed",
        )
