"""Actuation: what lies between the command and the current (or voltage) that the hysteresis law feels.

Driver and coil build the current up, eddy currents hold the field back, the fluid needs a moment: to the
force this looks like a delay and two first-order lags in a row, the first of them with its own time up and
down. The iron remembers: half the field follows the lagged command through a dead band (play), so that a
command which falls is felt as more than one which rises. Identified on runs whose command steps
(``identify.actuation``); controllers look ahead by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from mrdamper import core
from mrdamper.errors import InputError
from mrdamper.quantities import FloatArray

__all__ = ["PLAY_SHARE", "Actuation"]

PLAY_SHARE = 0.5
"""Share of the field that has the play; steps of the command tell its product with the half width only."""


@dataclass(frozen=True, slots=True)
class Actuation:
    """Delay, first lag (rise and fall), second lag; the coil's resistance and the largest command, if known.

    The first lag is ``rise_s`` while the size of the command is above the size of what it feeds. ``play`` is
    the half width [A or V] of the dead band behind the lags: a command that falls is felt as up to this much
    more (twice the half width, in half the field) than one that rises from zero, which is felt as it is.
    """

    rise_s: float
    fall_s: float
    second_s: float = 0.0
    delay_s: float = 0.0
    resistance_20_ohm: float | None = None  # of the coil at 20 degC
    largest_command: float | None = None  # [A or V], that the driver gives
    play: float = 0.0  # half width of the dead band [A or V]

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None and field.default is None:
                continue
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < math.inf:
                raise InputError(f"actuation: {field.name} is {value!r}; expected a finite number, 0 or more")
            object.__setattr__(self, field.name, float(value))

    def applied(self, command: FloatArray, step: float) -> FloatArray:
        """Return what the law feels of a command [A or V] on a uniform step [s], shape (n,).

        It starts settled; the command is taken as linear between its samples.
        """
        at = np.ascontiguousarray(command, dtype=np.float64)
        if self.delay_s > 0.0:
            time = step * np.arange(len(at))
            at = np.interp(time - self.delay_s, time, at)
        lagged = core.lagged(at, step, self.rise_s, self.fall_s)[0]
        if self.second_s > 0.0:
            lagged = core.lagged(lagged, step, self.second_s)[0]
        return self._after_play(lagged) if self.play > 0.0 else lagged

    def _after_play(self, lagged: FloatArray) -> FloatArray:
        """Return what is felt of a lagged command: by its size, as a field is, first reached from zero."""
        behind, half = [], self.play
        at = abs(float(lagged[0])) - half
        for size in np.abs(lagged).tolist():
            at = min(max(at, size - half), size + half)
            behind.append(at)
        size = np.abs(lagged)
        return np.asarray(np.copysign(size + PLAY_SHARE * (np.array(behind) + half - size), lagged))

    def response_time(self, share: float, start: float = 0.0, end: float = 1.0) -> float:
        """Return the time [s] from a step of the command to ``share`` of it at the law, the play left out."""
        if not 0.0 < share < 1.0:
            raise InputError(f"response time: share is {share}; expected above 0 and below 1")
        if start == end:
            raise InputError(f"response time: the step goes from {start} to {end}; expected two values")
        span = self.delay_s + 10.0 * (max(self.rise_s, self.fall_s) + self.second_s) + 1e-6
        step = span / 20_000
        command = np.full(20_001, float(end))
        command[0] = start
        risen = (replace(self, play=0.0).applied(command, step) - start) / (end - start)
        return float(np.interp(share, np.maximum.accumulate(risen), step * np.arange(len(command))))
