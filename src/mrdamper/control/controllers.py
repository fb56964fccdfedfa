"""Force-tracking controllers made from a card: the recommended one, the paper's, and baselines.

Each is a small frozen value; its arithmetic is one step in C (``core/kernel/controller.c``), the same for all
of them and the same that an export ships. What tells them apart are a few numbers:

- ``recommended``: motion, hysteresis and target at the preview, exact solve, reversal clamp; its causal form
  extrapolates the target, its adaptive form learns gains where a force is measured now and then;
- ``paper``: a bank of models at constant currents, interpolated linearly, at the present instant;
- baselines with and without a force sensor;
- ``series-inverse``: the explicit inverse of the series valve law at the preview; with the reversal clamp and
  the reach it is the ``recommended`` of such a card.

A controller knows one temperature, that of the fluid; where it comes from is the business of ``estimators``.
What a card leaves open is settled by the rules of ``tuning``.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.control import tuning
from mrdamper.control.protocol import Measurement, Reference
from mrdamper.control.stepper import Stepper
from mrdamper.control.tables.card_tables import DamperTables, tabulate
from mrdamper.control.tables.heating import Heating
from mrdamper.errors import InputError
from mrdamper.models.actuation import PLAY_SHARE, Actuation
from mrdamper.models.card import ModelCard
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.quantities import ROOM_K

__all__ = [
    "NAMES",
    "ForceController",
    "Safety",
    "check_name",
    "controllers_for",
    "names_for",
]


_READ_FORCE = ("clipped-on-off", "pi", "feed-forward-pi", "recommended-observer", "recommended-adaptive")


@dataclass(frozen=True, slots=True, kw_only=True)
class Safety:
    """When a reading is not believed, and what is done then. SI and kelvin."""

    stroke_times: float = 10.0  # a displacement so many times the data's is a fault
    frozen_s: float = 0.02  # equal readings for so long ...
    coast_s: float = 0.03  # the motion is carried on for so long without displacement, then
    fall_back: float = 0.0  # this command is given [A or V]
    cold_K: float = 233.15
    hot_K: float = 423.15
    slew_K_s: float = 20.0  # no damper warms faster
    jump_K: float = 10.0  # a reading further from what is believed is a fault
    smooth_s: float = 0.2  # of the temperature
    hold_s: float = 10.0  # the last good temperature is held for so long, then
    nominal_K: float | None = None  # this one is used; None: the middle of the model's range
    recover_s: float = 2.0  # a reading that stays where it jumped to is believed after so long

    def __post_init__(self) -> None:
        for name in (
            "stroke_times",
            "frozen_s",
            "coast_s",
            "slew_K_s",
            "jump_K",
            "smooth_s",
            "hold_s",
            "recover_s",
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"safety: {name} is {value}; expected a positive number")
        if not (0.0 <= self.fall_back < math.inf and 0.0 < self.cold_K < self.hot_K < math.inf):
            raise InputError(
                f"safety: fall_back is {self.fall_back} and the limits {self.cold_K} to {self.hot_K} K; "
                "expected a fall-back of 0 or more, and limits in order"
            )


@dataclass(frozen=True, slots=True, eq=False)
class ForceController(Stepper):
    """A controller: ``step(state, wanted, seen)`` gives the next state, which is bytes, and the command.

    Whatever it is told, the command stays within 0 and ``largest`` [A or V].
    """

    name: str = field(kw_only=True)
    needs_force: bool = field(default=False, kw_only=True)
    known_ahead: bool = field(default=True, kw_only=True)  # whether it is told the target ahead of time

    @property
    def preview_s(self) -> float:
        """How far ahead it looks at the target [s]; 0 where it does not, or extrapolates."""
        return self.numbers["preview"] if self.known_ahead else 0.0

    def step(self, state: bytes, wanted: Reference, seen: Measurement) -> tuple[bytes, float]:
        """Return the next state and the command [A or V]; the same arguments give the same answer."""
        ahead = wanted.ahead if self.known_ahead else None
        return self._native.step(state, wanted.now, ahead, seen.displacement, seen.temperature, seen.force)

    def run(self, state: bytes, told: FloatArray) -> tuple[bytes, FloatArray, NDArray[np.int64]]:
        """Take many steps at once; return the last state, the commands and the flags, shape (n,).

        ``told`` holds wanted force now and ahead [N], displacement [m], temperature [K] and force [N], shape
        (n, 5), NaN for what is not known.
        """
        rows = np.ascontiguousarray(told, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != 5:
            raise InputError(f"controller: told has shape {rows.shape}; expected (n, 5)")
        if not self.known_ahead:
            rows = rows.copy()
            rows[:, 1] = np.nan
        current, flags = np.empty(len(rows)), np.empty(len(rows))
        return self._native.run(state, rows, current, flags), current, flags.astype(np.int64)

    def scaled(
        self, yield_gain: float = 1.0, viscous_gain: float = 1.0, friction_gain: float = 1.0
    ) -> ForceController:
        """Return the controller of a damper whose parts have these gains: aged, or another of its kind."""
        gains = (yield_gain, viscous_gain, friction_gain)
        if not all(0.1 <= gain <= 10.0 for gain in gains):
            raise InputError(f"controller: gains are {gains}; expected 0.1 to 10")
        if self.tables.series is not None:
            return replace(self, tables=replace(self.tables, series=self.tables.series.scaled(*gains)))
        return replace(self, tables=self.tables.scaled(*gains))


@dataclass(frozen=True, slots=True)
class _Source:
    """What all controllers of a card share."""

    damper: Damper
    actuation: Actuation
    tables: DamperTables
    numbers: Mapping[str, float]  # of ``exact`` with preview, clamp and reach switched on
    preview: float
    force_per_command: float  # [N/A] at a steady, fast motion


NAMES = (
    "recommended", "recommended-causal", "recommended-adaptive", "recommended-observer", "paper", "paper-2",
    "paper-3", "paper-9", "paper-unaware", "paper-preview", "static-preview", "exact", "lead",
    "inverse-bouc-wen", "clipped-on-off", "pi", "feed-forward-pi",
)  # fmt: skip
"""The controllers there are; ``names_for`` has those of the series valve."""

_OF_ONE_LAW = {"inverse-bouc-wen": "the Bouc-Wen laws", "series-inverse": "the series-valve law"}


def names_for(law: str) -> tuple[str, ...]:
    """Return the controllers that a law can be given."""
    if law != "series-valve":
        return NAMES
    return (*(name for name in NAMES if name not in _OF_ONE_LAW), "series-inverse")


def check_name(name: str, law: str) -> None:
    """Raise ``InputError`` for a controller that there is, but not for this law."""
    if name in _OF_ONE_LAW and name not in names_for(law):
        raise InputError(
            f"controller: {name!r} is made from cards of {_OF_ONE_LAW[name]}, and this card's law is "
            f"{law!r}; expected one of {', '.join(names_for(law))}"
        )


def controllers_for(  # noqa: PLR0913 - what a caller may know better than the rules
    source: ModelCard | Damper,
    *,
    period_s: float = 1e-3,
    largest: float | None = None,
    displacement_noise_m: float = 10e-6,
    jerk_density: float = tuning.JERK_DENSITY,
    extra_delay_s: float = 0.0,
    preview_s: float | None = None,
    safety: Safety | None = None,
    heating: Heating | None = None,
    speed_m_s: float = 1.0,
) -> dict[str, ForceController]:
    """Return every controller that a card or damper can be given, by name.

    A controller that is unaware of temperature is the same made from a card of one temperature, or pooled;
    only ``paper-unaware`` holds this card at 20 degC.

    Parameters
    ----------
    period_s : sampling period [s]
    largest : largest command [A or V]; None: the actuation's, else the envelope's
    displacement_noise_m : of the displacement sensor, rms [m]
    jerk_density : of the motion that the filter expects [m/s^3 per root Hz]
    extra_delay_s : dead time of sensing, computing and driving beside the card's [s]
    preview_s : instead of the rule's [s]
    safety : when readings are not believed; None: the usual
    heating : what tells a frozen thermometer; None: the paper's damper; ``NO_HEATING``: it is not looked for
    speed_m_s : speed up to which the tables reach [m/s]

    Raises
    ------
    InputError
        A law without tables, a card without dependence on the command, sampling too slow for the lag.
    """
    card = source if isinstance(source, ModelCard) else None
    damper = source.damper if isinstance(source, ModelCard) else source
    envelope = None if card is None else card.envelope
    if not (math.isfinite(period_s) and period_s > 0.0):
        raise InputError(f"controller: the period is {period_s} s; expected a positive number")
    if not (math.isfinite(extra_delay_s) and extra_delay_s >= 0.0):
        raise InputError(f"controller: the extra delay is {extra_delay_s} s; expected 0 or more")
    actuation = tuning.actuation_of(damper)
    actuation = replace(actuation, delay_s=actuation.delay_s + extra_delay_s)
    tuning.check_sampling(actuation, period_s)
    highest = largest or actuation.largest_command or (None if envelope is None else envelope.command[1])
    if highest is None:
        raise InputError(
            "controller: the largest command is not known; the damper has no actuation that tells. Pass it "
            "(largest=...), or pass the card, whose envelope has it"
        )
    tables = tabulate(damper, highest, speed=speed_m_s)
    preview = tuning.preview_of(actuation, period_s) if preview_s is None else preview_s
    if not (math.isfinite(preview) and preview >= 0.0):
        raise InputError(f"controller: the preview is {preview} s; expected 0 or more")
    gain_of_force = _force_per_command(tables)
    numbers = _numbers(
        tables=tables,
        actuation=actuation,
        period=period_s,
        preview=preview,
        noise=displacement_noise_m,
        density=jerk_density,
        safety=safety or Safety(),
        heating=(heating or Heating.paper()).numbers(damper.command_unit),
        envelope=envelope,
        model_error=_model_error(card, tables),
    )
    made = _Source(damper, actuation, tables, numbers, preview, gain_of_force)
    return {name: _controller(name, made) for name in names_for(damper.law.name)}


def _controller(name: str, made: _Source) -> ForceController:
    """Return one controller: what its numbers differ in."""
    numbers = dict(made.numbers)
    present = {"preview": 0.0, "reach": 0.0, "margin": -1.0}
    # as published: the command is known, and neither lags nor play
    literal = present | {"play": 0.0, "unlagged": 1.0}
    bank = {"reach": 0.0, "margin": -1.0, "play": 0.0}
    gain, rate = tuning.feedback_gains(made.actuation, numbers["period"], made.force_per_command)
    feedback = {"gain": gain, "rate": rate}
    lead = dict(tuning.lead_of(made.actuation, numbers["period"]))
    changes: dict[str, dict[str, float]] = {
        "recommended": {},
        "recommended-causal": {},
        "recommended-adaptive": {"forget": math.exp(-numbers["period"] / tuning.FORGETTING_S)},
        "recommended-observer": {"observe": 1.0 - math.exp(-numbers["period"] / tuning.OBSERVER_S)},
        "paper": literal | {"bank": 5.0},
        "paper-2": literal | {"bank": 2.0},
        "paper-3": literal | {"bank": 3.0},
        "paper-9": literal | {"bank": 9.0},
        "paper-unaware": literal | {"bank": 5.0, "held_temperature": ROOM_K},
        "paper-preview": bank | {"bank": 5.0},
        "static-preview": {"reach": 0.0, "margin": -1.0, "is_static": 1.0},
        "exact": present,
        "lead": present | lead,
        "inverse-bouc-wen": literal,
        "clipped-on-off": present | {"feed_forward": 0.0, "on_off": 1.0},
        "pi": present | feedback | {"feed_forward": 0.0},
        "feed-forward-pi": feedback,
        "series-inverse": {"reach": 0.0, "margin": -1.0},
    }
    numbers |= changes[name]
    return ForceController(
        numbers,
        made.tables,
        name=name,
        needs_force=name in _READ_FORCE,
        known_ahead=name != "recommended-causal",
    )


def _numbers(  # noqa: PLR0913 - one place where all numbers of the kernel's table are set
    *,
    tables: DamperTables,
    actuation: Actuation,
    period: float,
    preview: float,
    noise: float,
    density: float,
    safety: Safety,
    heating: Mapping[str, float],
    envelope: OperatingEnvelope | None,
    model_error: float,
) -> dict[str, float]:
    """Return the kernel's numbers of the recommended controller."""
    filter_gains, spread = tuning.motion_filter(period, noise, density)
    speed_noise = math.sqrt(float(spread[1, 1]))
    # The target is followed as the motion is: its filter forgets as fast.
    wanted = filter_gains
    lags = tuning.lags_of(actuation, period)
    largest = float(tables.currents[-1])
    low, high = float(tables.temperatures[0]), float(tables.temperatures[-1])
    x = (-1e9, 1e9) if envelope is None else envelope.displacement
    v = 1e9 if envelope is None else max(map(abs, envelope.velocity))
    far = 1.0 if envelope is None else safety.stroke_times * max(map(abs, x))
    return {
        "period": period,
        "largest": largest,
        "coldest": low,
        "warmest": high,
        "elements": float(tables.elements),
        "saturating": float(tables.saturating),
        "filter_x": float(filter_gains[0]),
        "filter_v": float(filter_gains[1]),
        "filter_a": float(filter_gains[2]),
        "wanted_f": float(wanted[0]),
        "wanted_v": float(wanted[1]),
        "wanted_a": float(wanted[2]),
        "dead_samples": float(lags.dead_samples),
        "dead_part": lags.dead_part,
        "rise": lags.rise,
        "fall": lags.fall,
        "second": lags.second,
        "rise_couple": lags.rise_couple,
        "fall_couple": lags.fall_couple,
        **tuning.lags_ahead(actuation, period, preview),
        "play": actuation.play,
        "play_share": PLAY_SHARE,
        "preview": preview,
        "reach": tuning.REACH,
        "margin": tuning.CLAMP_SHARE * largest,
        "is_static": 0.0,
        "unlagged": 0.0,
        "bank": 0.0,
        "lead": 0.0,
        "lead_keep": 0.0,
        "feed_forward": 1.0,
        "on_off": 0.0,
        "gain": 0.0,
        "rate": 0.0,
        "gain_speed": 4.0 * speed_noise,
        "observe": 0.0,
        "forget": 0.0,
        "error_variance": model_error**2 * max(1.0, tuning.ERROR_LASTS_S / period),
        "gain_variance": tuning.GAIN_SPREAD**2,
        "low_x": x[0],
        "high_x": x[1],
        "high_v": v,
        "far_x": max(far, 1e-3),
        "frozen_samples": float(max(2, round(safety.frozen_s / period))),
        "frozen_speed": 8.0 * speed_noise,
        "coast_samples": float(max(1, round(safety.coast_s / period))),
        "fall_back": min(safety.fall_back, largest),
        "cold_limit": safety.cold_K,
        "hot_limit": safety.hot_K,
        "jump": safety.jump_K,
        "slew": safety.slew_K_s * period,
        "warm_keep": math.exp(-period / safety.smooth_s),
        "hold_samples": float(round(safety.hold_s / period)),
        "recover_samples": float(max(1, round(safety.recover_s / period))),
        "nominal": 0.5 * (low + high) if safety.nominal_K is None else safety.nominal_K,
        "held_temperature": 0.0,
        "far_v": 100.0 if envelope is None else safety.stroke_times * v,
        **heating,
        "reckon": 1.0,
        "substeps": float(max(1, math.ceil(period / tuning.SERIES_STEP_S - 1e-9))),
        "strides": tuning.SERIES_STRIDES,
        "horizon": tuning.SERIES_HORIZON_S,
        "unloaded": tables.unloaded,
        "shared": float(tables.shared),
    }


def _force_per_command(tables: DamperTables) -> float:
    """Return the mean growth of the settled yield force with the command [N/A], at the middle temperature."""
    if tables.series is not None:
        steady = tables.series.yield_force[len(tables.series.yield_force) // 2]
        return float((steady[-1] - steady[0]) / tables.currents[-1])
    rows = tables.at(0.5 * float(tables.temperatures[0] + tables.temperatures[-1]))
    yields = rows[6] + rows[7]
    return float((yields[-1] - yields[0]) / tables.currents[-1])


def _model_error(card: ModelCard | None, tables: DamperTables) -> float:
    """Return the size of the model's force error [N]: the card's, else 5 % of its largest yield force."""
    if card is not None and card.evidence.runs:
        return max(1.0, float(statistics.median(run["rmse_N"] for run in card.evidence.runs)))
    if tables.series is not None:
        return max(1.0, 0.05 * float(tables.series.yield_force.max()))
    return max(1.0, 0.05 * tables.peak_yield)
