"""The job ``derate``: compute the allowed load at several ambient temperatures."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray, read_only
from mrdamper.errors import EnvelopeWarning
from mrdamper.jobs.options import DerateOptions
from mrdamper.models.card import ModelCard
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.results import JobResult
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.thermal.derating import Conditions, Quantity, derate_damper
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty
from mrdamper.thermal.limits import Limit
from mrdamper.thermal.temperature_rise import notes_of

_USUAL = DerateOptions()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DerateResult(JobResult):
    """The largest current, stroke or duty ratio that keeps all temperatures within their limits.

    The first four attributes below have the shape (durations, air speeds, ambient temperatures).

    Attributes
    ----------
    largest : largest allowed current, stroke or duty ratio [unit]; NaN if no value is allowed
    low, high : bounds of the interval that contains the true value of ``largest`` with ``probability``
    limited_by : index in ``limits`` of the limit that is reached first; -1 if the unchanged load cycle is
        allowed
    duration_min : durations of the load cycle [min], shape (n,); infinity: thermal equilibrium
    """

    _job = "derate"
    name: str
    duty: str
    quantity: Quantity
    unit: str
    whole: float  # current, stroke or duty ratio in the unchanged load cycle [unit]
    ambient_degC: FloatArray
    air_m_s: FloatArray
    duration_min: FloatArray
    largest: FloatArray
    low: FloatArray
    high: FloatArray
    limited_by: FloatArray
    limits: tuple[Limit, ...]
    probability: float = 0.9
    notes: tuple[str, ...] = ()  # statements about a load cycle outside the card's envelope


def derate(
    card: ModelCard,
    drawing: DamperDrawing,
    duty: Duty,
    options: DerateOptions = _USUAL,
    *,
    on_progress: Progress = silent,
) -> DerateResult:
    """Return maps of the allowed current, stroke or duty ratio of a load cycle; see ``thermal.derating``.

    Raises
    ------
    InputError
        If the load cycle and the card have different units, an axis does not increase, or an ambient
        temperature is above a limit.
    """
    on_progress(ProgressUpdate(total=1, text="derating map"))
    conditions = Conditions(
        np.array(options.ambient_degC) + ZERO_CELSIUS_K,
        np.array(options.air_m_s),
        np.append(60.0 * np.array(options.duration_min), np.inf),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", EnvelopeWarning)  # ``notes_of`` reports extrapolation.
        found = derate_damper(card.damper, drawing, duty, conditions, options.quantity)
    whole, unit = _unchanged_value(duty, options.quantity)
    return DerateResult(
        drawing.name,
        duty.text,
        options.quantity,
        unit,
        whole,
        ambient_degC=np.array(options.ambient_degC),
        air_m_s=conditions.air,
        duration_min=conditions.duration / 60.0,
        largest=read_only(whole * found.share),
        low=read_only(whole * found.low),
        high=read_only(whole * found.high),
        limited_by=read_only(found.part),
        limits=found.limits,
        notes=notes_of(card, duty),
    )


def _unchanged_value(duty: Duty, quantity: Quantity) -> tuple[float, str]:
    """Return current, stroke or duty ratio (``quantity``) of the unchanged load cycle, and its unit."""
    if quantity == "current":
        return max(each.command for each in duty.segments), duty.command_unit
    if quantity == "duty":
        return 100.0, "%"
    paths = [each.path.displacement for each in duty.segments if each.path is not None]
    return max((1e3 * float(np.abs(path).max()) for path in paths), default=0.0), "mm"
