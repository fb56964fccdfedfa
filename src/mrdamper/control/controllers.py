"""Force-tracking controllers made from a model card.

All controllers and exports share one step function in C (``core/kernel/controller.c``). Only
the configuration (``config``) differs:

- ``recommended``: model-predictive control with the damper model of the card. The command minimises the
  expected force error in the prediction horizon. After a reversal, the controller assumes that the hysteresis
  force builds up faster than in the model (``settings``: ``settled_ratio``). ``recommended-causal`` does not
  need the future target, but extrapolates it. ``recommended-observer`` also corrects the model with a
  measured force (disturbance observer).
- ``predictive``: like ``recommended``, but with the hysteresis exactly as in the model. For the hysteresis
  laws ``chain`` and ``series-valve``, ``predictive`` and ``recommended`` are equal.
- ``paper``: controller of the reference paper. Models at five constant currents compute the present force.
  Interpolation between these forces gives the command. ``paper-unaware`` always assumes 20 degC.
- ``pi`` and ``clipped-on-off``: baselines with a force sensor.

The module ``tuning`` computes every controller parameter that the card does not contain.
"""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.control import config, tuning
from mrdamper.control.config import Config, FeedbackKind, InverseMethod
from mrdamper.control.protocol import Measurement, Reference
from mrdamper.control.settings import SETTINGS
from mrdamper.control.stepper import Stepper
from mrdamper.control.tables.card_tables import STEPPED, DamperTables, tabulate
from mrdamper.control.tables.heating import Heating
from mrdamper.core import Tracker
from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation
from mrdamper.models.card import ModelCard
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.quantities import REFERENCE_K
from mrdamper.schema import NotNegative, Positive, check_ranges

NAMES = (
    "recommended", "recommended-causal", "recommended-observer", "predictive", "paper", "paper-unaware", "pi",
    "clipped-on-off",
)  # fmt: skip
"""Names of all controllers."""


_WITH_FORCE_SENSOR = ("recommended-observer", "pi", "clipped-on-off")
_BANKS = ("paper", "paper-unaware")
NEED_LAG = ("recommended", "recommended-causal", "recommended-observer", "predictive", "pi")
"""Controllers that require a card with a delay or lag between current and force."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Safety:
    """Limits beyond which a reading is a fault, and the reaction to a fault. Units are SI and kelvin."""

    stroke_times: Positive = 10.0  # fault limits of displacement and velocity, divided by the data's maxima
    frozen_s: Positive = 0.02  # Equal displacement readings for this time are a fault.
    coast_s: Positive = 0.12  # time for which a missing displacement is replaced by an extrapolated motion
    fall_back: NotNegative = 0.0  # command if the displacement is missing for longer than coast_s [A or V]
    back_s: Positive = 0.03  # duration of valid displacement readings that ends the fall-back command
    cold_K: Positive = 233.15
    hot_K: Positive = 423.15
    slew_K_s: Positive = 20.0  # max rate of change of the temperature estimate; no damper warms faster
    jump_K: Positive = 10.0  # max difference between temperature reading and estimate
    smooth_s: Positive = 0.2  # time constant of the filter for the temperature readings
    # Time without a valid reading for which the temperature estimate is used; None: ``thermometer`` computes
    # the time.
    hold_s: Positive | None = None
    nominal_K: float | None = None  # temperature after hold_s; None: middle of the model's range
    # Temperature readings after a jump are rejected until they are nearly constant for this time. They must
    # also be nearly constant for longer than the time in which the readings before the jump were valid.
    recover_s: Positive = 2.0

    def __post_init__(self) -> None:
        check_ranges(self, "safety")
        if not self.cold_K < self.hot_K:
            raise InputError(
                f"the limits are {self.cold_K} to {self.hot_K} K", place="safety", expected="limits in order"
            )

    def faults(
        self, axes: config.Axes, envelope: OperatingEnvelope | None, *, frozen_speed_min: float
    ) -> config.Faults:
        """Return the fault limits of displacement and velocity for the C code.

        ``frozen_speed_min`` is the minimum speed [m/s] at which equal readings are a fault.
        """
        displacement_limit, speed_limit = 1.0, 100.0
        if envelope is not None:
            displacement_limit = self.stroke_times * max(map(abs, envelope.displacement))
            speed_limit = self.stroke_times * max(map(abs, envelope.velocity))
        return config.Faults(
            displacement_limit=max(displacement_limit, 1e-3),
            speed_limit=speed_limit,
            frozen_samples=max(2, round(self.frozen_s / axes.period)),
            frozen_speed_min=frozen_speed_min,
            coast_samples=max(1, round(self.coast_s / axes.period)),
            recovery_samples=max(1, round(self.back_s / axes.period)),
            fall_back=min(self.fall_back, axes.largest),
        )

    def thermometer(self, axes: config.Axes, heating: config.HeatBalance) -> config.Thermometer:
        """Return the fault limits of the temperature for the C code.

        Without a valid reading, the temperature estimate is extrapolated from the supplied energy. This lasts
        for one thermal time constant (heat capacity divided by loss conductance), at most half an hour. If
        extrapolation is disabled, the last estimate is used unchanged for 10 s.
        """
        kept = heating.extrapolate and heating.heat_capacity > 0.0
        lasts = SETTINGS.temperature_held_s
        if kept:
            time_constant_s = heating.heat_capacity / max(heating.loss_conductance, 1e-9)
            lasts = min(time_constant_s, SETTINGS.temperature_extrapolated_s)
        middle = 0.5 * (axes.coldest + axes.warmest)
        return config.Thermometer(
            cold_limit=self.cold_K,
            hot_limit=self.hot_K,
            jump=self.jump_K,
            change_max=self.slew_K_s * axes.period,
            filter_decay=math.exp(-axes.period / self.smooth_s),
            hold_samples=round((self.hold_s or lasts) / axes.period),
            recover_samples=max(1, round(self.recover_s / axes.period)),
            nominal=middle if self.nominal_K is None else self.nominal_K,
            fixed=0.0,
        )


@dataclass(frozen=True, slots=True, eq=False)
class ForceController(Stepper):
    """A controller: ``step(state, reference, measurement)`` returns the next state (bytes) and the command.

    For all inputs, the command is between 0 and ``largest`` [A or V].
    """

    name: str = field(kw_only=True)
    needs_force: bool = field(default=False, kw_only=True)
    known_ahead: bool = field(default=True, kw_only=True)  # False: the target is extrapolated

    @property
    def preview_s(self) -> float:
        """Return the preview time of the target [s] that the controller needs.

        The value is 0 if the controller needs only the present target, or extrapolates the target.
        """
        return self.config.inverse.preview if self.known_ahead else 0.0

    def step(self, state: bytes, reference: Reference, measurement: Measurement) -> tuple[bytes, float]:
        """Return the next state and the command [A or V]. Equal arguments give equal results."""
        ahead = reference.ahead if self.known_ahead else None
        return self._native.step(
            state,
            reference.now,
            ahead,
            measurement.displacement,
            measurement.temperature,
            measurement.force,
        )

    def run(self, state: bytes, inputs: FloatArray) -> tuple[bytes, FloatArray, NDArray[np.int64]]:
        """Compute n steps; return the last state, n commands and the flags of n steps.

        ``inputs`` has shape (n, 5). Its columns are wanted force now [N], wanted force after ``preview_s``
        [N], displacement [m], temperature [K] and measured force [N]. Unknown values are NaN.
        """
        rows = np.ascontiguousarray(inputs, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != 5:
            raise InputError(place="controller", found=f"inputs have shape {rows.shape}", expected="(n, 5)")
        if not self.known_ahead:
            rows = rows.copy()
            rows[:, 1] = np.nan
        return self._native.run(state, rows)

    @property
    def compiled(self) -> Tracker | None:
        """The object with which C code computes the closed loop.

        The value is None in single precision, or if a subclass defines its own step in Python.
        """
        return self._native if type(self).step is ForceController.step and not self.single else None

    def scaled(
        self, yield_gain: float = 1.0, viscous_gain: float = 1.0, friction_gain: float = 1.0
    ) -> ForceController:
        """Return the controller for a damper whose force parts differ by these gains."""
        gains = (yield_gain, viscous_gain, friction_gain)
        if not all(0.1 <= gain <= 10.0 for gain in gains):
            raise InputError(place="controller", found=f"gains are {gains}", expected="0.1 to 10")
        named = config.Gains(yield_force=yield_gain, viscous_force=viscous_gain, friction_force=friction_gain)
        return replace(self, config=replace(self.config, gains=named))


def names_for(law: str, *, has_lag: bool = True) -> tuple[str, ...]:
    """Return the names of the controllers that can be made from a model card.

    Parameters
    ----------
    law : name of the hysteresis law; ``paper`` controllers do not exist for the laws ``series-valve`` and
        ``chain``
    has_lag : True if the force follows the current with a delay or lag
    """
    excluded = (_BANKS if law in STEPPED else ()) + (() if has_lag else NEED_LAG)
    return tuple(name for name in NAMES if name not in excluded)


def check_name(name: str, law: str) -> None:
    """Raise ``InputError`` if a controller is not available for a hysteresis law."""
    if name in NAMES and name not in names_for(law):
        raise InputError(
            place="controller",
            found=f"{name!r} is a bank of Bouc-Wen models, and the law of this card is {law!r}",
            expected=f"one of {', '.join(names_for(law))}",
        )


def controllers_for(  # noqa: PLR0913 - values that a caller can know better than the rules
    source: ModelCard | Damper,
    *,
    period_s: float = 1e-3,
    largest: float | None = None,
    displacement_noise_m: float = 10e-6,
    displacement_period_s: float | None = None,
    jerk_density: float = SETTINGS.jerk_density,
    extra_delay_s: float = 0.0,
    safety: Safety | None = None,
    heating: Heating | None = None,
    speed_m_s: float = 1.0,
) -> dict[str, ForceController]:
    """Return every controller of a card or damper, by name.

    The controller ``paper-unaware`` always assumes 20 degC. All others use the temperature dependence of the
    model card. To get these without temperature dependence, pass a card without a temperature model. Fit this
    card to runs at one temperature, or to all runs with the temperature model disabled.

    Parameters
    ----------
    period_s : sampling period [s]
    largest : largest command [A or V]; None: the largest command of the driver in the card; if unknown, the
        largest command in the runs
    displacement_noise_m : noise of the displacement sensor, RMS [m]
    displacement_period_s : time between new displacement readings [s], if a slow bus repeats each reading for
        several controller periods; equal readings are then a fault only after 2.5 reading periods
    jerk_density : jerk density of the expected motion [m/s^3 per root Hz], for the design of the motion
        filter
    extra_delay_s : dead time of sensing, computing and driver in addition to the dead time of the card [s]
    safety : limits of valid readings; None: the default
    heating : heat balance that detects a stuck thermometer; None: heat balance of the damper in the reference
        paper; ``NO_HEATING``: no detection
    speed_m_s : maximum speed of the tables [m/s]

    Raises
    ------
    InputError
        If no tables exist for the hysteresis law, the force does not depend on the command, or the sampling
        is too slow for the lag.
    """
    damper = source.damper if isinstance(source, ModelCard) else source
    if not (math.isfinite(extra_delay_s) and extra_delay_s >= 0.0):
        raise InputError(
            place="controller", found=f"the extra delay is {extra_delay_s} s", expected="0 or more"
        )
    actuation = tuning.actuation_of(damper)
    actuation = replace(actuation, delay_s=actuation.delay_s + extra_delay_s)
    check_period("controller", period_s)
    tuning.check_sampling(actuation, period_s)
    held_s = max(displacement_period_s or 0.0, period_s)
    motion, swinging = (
        tuning.motion_of(period_s, held_s, displacement_noise_m, jerk_density, is_harmonic=is_harmonic)
        for is_harmonic in (False, True)
    )
    safety = safety or Safety()
    safety = replace(safety, frozen_s=max(safety.frozen_s, 2.5 * held_s if held_s > period_s else 0.0))
    tables = tables_of(source, actuation, period_s=period_s, largest=largest, speed_m_s=speed_m_s)
    base = base_configuration(
        tables,
        period_s,
        safety,
        envelope_of(source),
        motion=motion,
        actuation=tuning.sampled_actuation(actuation, period_s),
        heating=(heating or Heating.paper()).config(damper.command_unit, extrapolate=True),
    )
    _check_yield_force(tables, damper)
    per_command = _force_per_command(tables)
    claimed = _claimed_error(source) if isinstance(source, ModelCard) else 0.0
    horizon = tuning.prediction_of(
        actuation,
        period_s,
        swinging,
        per_command,
        claimed / base.axes.largest,
        spread=tables.series is not None,
    )
    variants = _variants(base, swinging, horizon, actuation, per_command)
    return {
        name: ForceController(
            variants[name],
            tables,
            name=name,
            needs_force=name in _WITH_FORCE_SENSOR,
            known_ahead=not name.endswith("-causal"),
        )
        for name in names_for(damper.law.name)
    }


def tables_of(
    source: ModelCard | Damper,
    actuation: Actuation,
    *,
    period_s: float,
    largest: float | None,
    speed_m_s: float,
) -> DamperTables:
    """Return the tables of a damper for the real-time model and the controllers.

    Parameters
    ----------
    actuation : delay and lags between command and force; the delay includes the dead time of the control loop
    largest : largest command [A or V]

    Raises
    ------
    InputError
        If no tables exist for the hysteresis law, the largest command is unknown, or the dead time has too
        many periods.
    """
    damper, envelope = source.damper if isinstance(source, ModelCard) else source, envelope_of(source)
    tuning.check_delay(actuation, period_s)
    highest = largest or actuation.largest_command or (None if envelope is None else envelope.command[1])
    if highest is None:
        raise InputError(
            place="real-time model",
            found="the largest command is unknown, because the damper has no actuation that contains it",
            remedy="Pass it (largest=...), or pass the card, whose envelope contains it",
        )
    return tabulate(damper, highest or SETTINGS.unpowered_command_max, speed=speed_m_s)


def envelope_of(source: ModelCard | Damper) -> OperatingEnvelope | None:
    """Return the operating envelope of a model card; None for a damper without a card."""
    return source.envelope if isinstance(source, ModelCard) else None


def check_period(place: str, period_s: float) -> None:
    """Raise ``InputError`` if a sampling period is not a positive number."""
    if not (math.isfinite(period_s) and period_s > 0.0):
        raise InputError(place=place, found=f"the period is {period_s} s", expected="a positive number")


def _check_yield_force(tables: DamperTables, damper: Damper) -> None:
    """Raise ``InputError`` unless the yield force rises with the command, so that the command is unique."""
    yields = tables.yield_force_table
    if float(np.ptp(yields, axis=1).min()) <= 1e-9 * float(yields.max()):
        raise InputError(
            place="controller",
            found=(
                f"the yield force of this card does not depend on the command (it is {yields[0, 0]:.4g} N at "
                "every command), so no command can track a force"
            ),
            remedy=(
                "Fit runs at two or more commands, or export the model alone: mrdamper export --content model"
            ),
        )
    falls = (np.diff(yields, axis=1) < 0.0).any(axis=0)
    if tables.series is not None and falls.any():
        turn = float(tables.currents[-1]) * float(np.argmax(falls)) / (yields.shape[1] - 1)
        raise InputError(
            place="controller",
            found=(
                f"the yield force of this {damper.law.name} card falls with the command above {turn:g} "
                f"{damper.command_unit}"
            ),
            expected="a yield force that rises",
            remedy="Lower the largest command, or fit runs up to this command",
        )


def _variants(
    base: Config,
    harmonic: config.MotionFilter,
    prediction: config.Prediction,
    actuation: Actuation,
    force_per_command: float,
) -> dict[str, Config]:
    """Return the configuration of every controller, by name.

    Parameters
    ----------
    base : configuration that all controllers share; it does not select how the command is computed
    harmonic : motion filter of the predictive controllers, which assumes a harmonic motion
    force_per_command : increase of the force with the command in a fast motion [N/A]
    """
    period = base.axes.period
    method = config.Inverse(method=InverseMethod.PREDICTIVE, preview=tuning.horizon_end(prediction))
    recommended = replace(base, motion=harmonic, inverse=method, prediction=prediction)
    # The controller of the reference paper assumes that current follows the command without lag or
    # hysteresis.
    paper = replace(
        base,
        actuation=tuning.sampled_actuation(Actuation(0.0, 0.0), period),
        inverse=config.Inverse(method=InverseMethod.BANK, preview=0.0),
    )
    gain, rate = tuning.feedback_gains(actuation, period, force_per_command)
    observe = 1.0 - math.exp(-period / SETTINGS.observer_s)
    return {
        "recommended": recommended,
        "recommended-causal": recommended,
        "recommended-observer": replace(recommended, feedback=replace(base.feedback, observe=observe)),
        "predictive": replace(recommended, prediction=replace(prediction, settled=0.0)),
        "paper": paper,
        "paper-unaware": replace(paper, thermometer=replace(base.thermometer, fixed=REFERENCE_K)),
        "pi": replace(base, feedback=replace(base.feedback, kind=FeedbackKind.PI, gain=gain, rate=rate)),
        "clipped-on-off": replace(base, feedback=replace(base.feedback, kind=FeedbackKind.ON_OFF)),
    }


_NO_PREDICTION = config.Prediction(
    steps=0, samples=1, together=1, step=0.0, stretch=1, dead=0.0, fade=0.0, settled=0.0, calm=0.0,
    lags=config.Lags(
        rise=0.0, fall=0.0, second=0.0, rise_couple=0.0, fall_couple=0.0, second_ramp=0.0,
        freewheel_ratio=0.0,
    ),
)  # fmt: skip


def base_configuration(
    tables: DamperTables,
    period: float,
    safety: Safety,
    envelope: OperatingEnvelope | None,
    *,
    motion: config.MotionFilter,
    actuation: config.Actuation,
    heating: config.HeatBalance,
) -> Config:
    """Return the configuration that the real-time model and all controllers share.

    ``period`` is the sampling period [s].
    """
    axes = tables.axes(period)
    speed_noise = math.sqrt(motion.velocity_noise_variance)
    return Config(
        axes=axes,
        law=tables.law(substeps=max(1, math.ceil(period / SETTINGS.series_step_s - 1e-9))),
        motion=motion,
        # The filter that extrapolates the wanted force has the same gains as the motion filter.
        reference=config.ReferenceFilter(
            gain_f=motion.gain_x, gain_rate=motion.gain_v, gain_second_derivative=motion.gain_a
        ),
        actuation=actuation,
        inverse=config.Inverse(method=InverseMethod.NONE, preview=0.0),
        prediction=_NO_PREDICTION,
        feedback=config.Feedback(
            kind=FeedbackKind.NONE, gain=0.0, rate=0.0, full_speed=4.0 * speed_noise, observe=0.0
        ),
        envelope=_envelope(envelope),
        faults=safety.faults(axes, envelope, frozen_speed_min=8.0 * speed_noise),
        thermometer=safety.thermometer(axes, heating),
        heating=heating,
    )


def _envelope(of: OperatingEnvelope | None) -> config.Envelope:
    if of is None:
        return config.Envelope(displacement_min=-1e9, displacement_max=1e9, speed_max=1e9)
    low, high = of.displacement
    return config.Envelope(displacement_min=low, displacement_max=high, speed_max=max(map(abs, of.velocity)))


def _force_per_command(tables: DamperTables) -> float:
    """Return the mean increase of the yield force per command [N/A] at the middle temperature."""
    if tables.series is not None:
        table = tables.yield_force_table  # The table has one row if the force ignores temperature.
        yields = table[len(table) // 2]
    else:
        rows = tables.evaluate(0.5 * float(tables.temperatures[0] + tables.temperatures[-1]))
        yields = rows[6] + rows[7]
    return float((yields[-1] - yields[0]) / tables.currents[-1])


def _claimed_error(card: ModelCard) -> float:
    runs = card.evidence.runs
    return float(statistics.median(run["rmse_N"] for run in runs)) if runs else 0.0
