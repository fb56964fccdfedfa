"""The default campaign on a damper of the virtual rig and what it gives: made once for each worker."""

from __future__ import annotations

from functools import cache

import mrdamper
from mrdamper.data.records import Dataset
from mrdamper.jobs.fit import FitResult
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.lumped import LUMPED
from mrdamper.virtual_rig.measurement import measure

USUAL = "usual"  # the law that is chosen for such runs unless one is named


@cache
def runs_of(preset: str) -> Dataset:
    """Return the default campaign on a damper, simulated once."""
    return Dataset(tuple(run for run, _ in measure(LUMPED[preset], Campaign())))


@cache
def identified(preset: str, law: str = USUAL) -> FitResult:
    """Return what the trained runs of the campaign give."""
    asked = None if law == USUAL else law
    fitted: FitResult = mrdamper.fit(runs_of(preset), asked, hold_out=Campaign().hold_out)
    return fitted
