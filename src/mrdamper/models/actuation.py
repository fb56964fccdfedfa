"""Actuation: dynamics between the command and the effective current (or voltage) of the hysteresis law.

Driver and coil delay the current, eddy currents delay the magnetic field, and the fluid needs some time. The
effect on the force is modelled as a delay and two first-order lags in series. The first lag has separate rise
and fall times. The iron has magnetic hysteresis: half of the field follows the lagged command through a dead
band, so that a falling command has a larger effect than a rising one. Alternatively, a fraction of 0.25 of
the field follows through a narrow dead band and a fraction of 0.15 through a wide dead band. A small change
of the command then causes a smaller loop. Lags and dead bands act on the magnetic flux, which saturates. The
model is identified from runs with steps of the command (``identify.actuation``). Controllers use the model
for their preview time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.schema import NotNegative, check_ranges

HYSTERESIS_WEIGHT = 0.5
"""Fraction of the field with hysteresis. Runs determine only the product of this fraction and half width."""

TWO_HYSTERESIS_WEIGHTS = (0.25, 0.15)
"""Fractions of the field with the narrow and the wide dead band, if a damper has both (decision 0007)."""


@dataclass(frozen=True, slots=True)
class Actuation:
    """Delay, lags and magnetic hysteresis between command and force, and coil data.

    The first lag has the time constant ``rise_s`` while its input exceeds its output, otherwise ``fall_s``.
    The lagged command passes a dead band of half width ``hysteresis_width_A`` [A or V]. A command that rises
    from zero is unchanged. A falling command has the effect of a command that is larger by up to the half
    width: the dead band is two half widths wide, but acts on only half of the field. A one-quadrant driver
    cannot force the current down. The output of the first lag then falls no faster than with the time
    constant ``freewheel_time_s``. With ``saturation``, lags and dead bands act on the flux, and a large
    free-wheeling current falls faster.
    """

    rise_s: NotNegative
    fall_s: NotNegative
    second_s: NotNegative = 0.0
    delay_s: NotNegative = 0.0
    resistance_20_ohm: NotNegative | None = None  # coil resistance at 20 degC
    largest_command: NotNegative | None = None  # largest command of the driver [A or V]
    hysteresis_width_A: NotNegative = 0.0  # half width of the dead band [A or V]
    freewheel_time_s: NotNegative = 0.0  # free-wheeling time constant; 0: the driver forces the current down
    saturation: NotNegative = 0.0  # command at half of the saturation flux [A or V]; 0: no saturation
    wide_hysteresis_width_A: NotNegative = 0.0  # half width of the wide dead band [A or V]; 0: disabled

    def __post_init__(self) -> None:
        check_ranges(self, "actuation")

    def flux(self, size: FloatArray) -> FloatArray:
        r"""Return the magnetic flux [A or V], which equals a small command, shape (n,).

        .. math:: \varphi = I / (1 + I / I_s)
        """
        return size if self.saturation <= 0.0 else np.asarray(size / (1.0 + size / self.saturation))

    def current(self, flux: FloatArray) -> FloatArray:
        """Return the absolute command [A or V] that has a given flux, shape (n,)."""
        return flux if self.saturation <= 0.0 else np.asarray(flux / (1.0 - flux / self.saturation))

    @property
    def hysteresis_weights(self) -> tuple[float, float]:
        """Return the fractions of the field that pass the narrow and the wide dead band."""
        return TWO_HYSTERESIS_WEIGHTS if self.wide_hysteresis_width_A > 0.0 else (HYSTERESIS_WEIGHT, 0.0)

    def apply(self, command: FloatArray, step: float) -> FloatArray:
        """Return the effective command [A or V], which the hysteresis law uses, shape (n,).

        ``step`` is the time between samples [s]. All dynamics are in equilibrium at the first sample. The
        command is linear between its samples.
        """
        return Applied(self, step).on(command)

    def response_time(self, share: float, start: float = 0.0, end: float = 1.0) -> float:
        """Return the time [s] until a fraction of a command step acts, without hysteresis."""
        if not 0.0 < share < 1.0:
            raise InputError(place="response time", found=f"share is {share}", expected="above 0 and below 1")
        if start == end:
            raise InputError(
                place="response time", found=f"the step is from {start} to {end}", expected="two values"
            )
        span = (
            self.delay_s
            + 10.0 * (max(self.rise_s, self.fall_s, self.freewheel_time_s) + self.second_s)
            + 1e-6
        )
        step = span / 20_000
        command = np.full(20_001, float(end))
        command[0] = start
        risen = (
            replace(self, hysteresis_width_A=0.0, wide_hysteresis_width_A=0.0).apply(command, step) - start
        ) / (end - start)
        return float(np.interp(share, np.maximum.accumulate(risen), step * np.arange(len(command))))


class Applied:
    """Effective command after delay, lags and hysteresis, computed batch by batch."""

    def __init__(self, actuation: Actuation, step: float) -> None:
        self._actuation = actuation
        self._step = step
        self._taken = 0
        self._delayed: FloatArray = np.empty(0)  # commands that have not passed the delay yet
        self._lags = [(actuation.rise_s, actuation.fall_s, actuation.freewheel_time_s)]
        if actuation.second_s > 0.0:
            self._lags.append((actuation.second_s, actuation.second_s, 0.0))
        widths, shares = (
            (actuation.hysteresis_width_A, actuation.wide_hysteresis_width_A),
            actuation.hysteresis_weights,
        )
        self._plays = [(2.0 * w, share) for w, share in zip(widths, shares, strict=True) if w > 0.0]
        # Last input and output of each lag, last output of each dead band; NaN before the first batch
        self._before = np.full((len(self._lags), 2), np.nan)
        self._behind = np.full(len(self._plays), np.nan)

    def on(self, command: FloatArray) -> FloatArray:
        """Return the effective command [A or V] of the next samples, shape (n,)."""
        at = np.ascontiguousarray(command, dtype=np.float64)
        if self._actuation.delay_s > 0.0:
            at = self._after_delay(at)
        bends = self._actuation.saturation > 0.0
        if bends:
            at = np.copysign(self._actuation.flux(np.abs(at)), at)
        for k, (rise, fall, wheel) in enumerate(self._lags):
            at = self._after_lag(k, at, rise, fall, wheel)
        self._taken += len(at)
        if not (bends or self._plays):
            return at
        flux = np.abs(at)
        felt = self._actuation.current(flux)
        for k, (width, share) in enumerate(self._plays):
            felt = felt + share * (self._after_play(k, flux, width) - flux)
        return np.asarray(np.copysign(felt, at))

    def _after_delay(self, command: FloatArray) -> FloatArray:
        known = np.concatenate([self._delayed, command])
        time = self._step * np.arange(self._taken - len(self._delayed), self._taken + len(command))
        reach = int(self._actuation.delay_s / self._step) + 2
        self._delayed = known[-reach:].copy()
        return np.asarray(np.interp(time[-len(command) :] - self._actuation.delay_s, time, known))

    def _after_lag(self, k: int, command: FloatArray, rise: float, fall: float, wheel: float) -> FloatArray:
        given, came = (float(each) for each in self._before[k])
        bend = self._actuation.saturation
        if np.isnan(given):
            applied = core.first_order_lag(command, self._step, rise, fall, wheel=wheel, saturation=bend)[0]
        else:
            longer = np.concatenate([[given], command])
            before = came, 0.0
            applied = core.first_order_lag(
                longer, self._step, rise, fall, wheel=wheel, saturation=bend, before=before
            )[0][1:]
        self._before[k] = command[-1], applied[-1]
        return applied

    def _after_play(self, k: int, flux: FloatArray, width: float) -> FloatArray:
        """Return the output of dead band ``k`` (play operator) for the input ``flux``.

        At each sample, the output is the previous output, clipped to the range from ``flux`` to
        ``flux + width``. Two successive clips are equal to one clip with combined limits. Therefore the
        limits of all samples are combined in log2(n) passes by a parallel prefix scan (Hillis & Steele,
        Commun. ACM 29 (1986) 1170-1183).
        """
        low, high = flux.copy(), flux + width
        shift = 1
        while shift < len(flux):
            before = low[:-shift].copy(), high[:-shift].copy()
            low[shift:], high[shift:] = (np.clip(each, low[shift:], high[shift:]) for each in before)
            shift *= 2
        start = flux[0] if np.isnan(self._behind[k]) else self._behind[k]
        behind = np.clip(start, low, high)
        self._behind[k] = behind[-1]
        return np.asarray(behind)
