"""A virtual damper made from a model card, for tests without model error.

The command is first delayed by the dead time and the lags in the card. The kernel then steps the hysteresis
law sample by sample. A controller that is made from this card has no model error on this damper. Its tracking
error is caused only by lags and sensor noise. The test therefore does not show whether the card describes the
real damper.

The damper starts with zero force and zero command. Extension is positive.
"""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import ArrayLike

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation, Applied
from mrdamper.models.damper import Damper
from mrdamper.quantities import ZERO_CELSIUS_K

COMMAND_COUNT = 401  # number of commands at which the coefficients of the hysteresis law are tabulated
_SHAPE = ("kappa", "n")  # parameters of the hysteresis curve; the kernel tabulates this curve once


class CardPlant:
    """Simulated damper with a state, made from a model card, for closed loops (``protocol.Plant``).

    Parameters
    ----------
    damper : damper of a model card
    highest : highest command [A or V]; the applied command is limited to the range from 0 to this value
    step_s : time step [s]

    Raises
    ------
    InputError
        If the hysteresis law is user-defined in Python, or the shape of its hysteresis curve depends on the
        command.
    """

    def __init__(self, damper: Damper, *, highest: float = 2.0, step_s: float = 1e-4) -> None:
        if damper.law.kernel is None:
            raise InputError(
                f"a card of the law {damper.law.name!r}, which is in Python, is not available as a plant",
                place="plant",
                expected="a law of the kernel",
                remedy="Name a preset of the virtual rig, or a card of such a law",
            )
        if not 0.0 < step_s <= 1e-3:
            raise InputError(f"step is {step_s} s", place="plant", expected="above 0, at most 1e-3")
        self.step_s = step_s
        self._damper, self._kernel, self._highest = damper, damper.law.kernel, highest
        self._check_curve()
        self._table: tuple[float, FloatArray] | None = None
        lag = damper.command_lag_s
        self._applied = Applied(damper.actuation or Actuation(lag, lag), step_s)
        self._applied.on(np.zeros(2))  # Start in equilibrium with zero command.
        # Displacement, velocity, acceleration and applied command of the last sample.
        self._before: tuple[FloatArray, ...] | None = None
        self._motion, self._law = np.zeros(core.MOTION_NUMBERS), np.zeros(core.STATE_NUMBERS)
        self._workspace = core.Workspace()

    def copy(self) -> CardPlant:
        other = copy.copy(self)
        for name, kept in (("_motion", self._motion), ("_law", self._law), ("_applied", self._applied)):
            setattr(other, name, copy.deepcopy(kept))
        return other

    def advance_many(
        self,
        displacement: ArrayLike,
        velocity: ArrayLike,
        current: ArrayLike,
        temperature_degC: float,
    ) -> FloatArray:
        """Advance one time step per array element; return the forces [N], shape (n,)."""
        x, v = (np.array(given, dtype=np.float64) for given in (displacement, velocity))
        command = self._applied.on(np.broadcast_to(np.asarray(current, dtype=np.float64), x.shape))
        applied = np.clip(command, 0.0, self._highest)
        a = np.diff(v, prepend=v[0] if self._before is None else self._before[1]) / self.step_s
        if self._before is not None:
            x, v, a, applied = map(np.concatenate, zip(self._before, (x, v, a, applied), strict=True))
        self._before = x[-1:].copy(), v[-1:].copy(), a[-1:].copy(), applied[-1:].copy()
        # Every call closes its batch of samples, because later samples must not change forces that are
        # already returned.
        batch = core.open_batch(self.step_s, (x, v, a), self._motion, patience=1, last=True)
        coefficients = self._coefficients(applied, temperature_degC)
        return core.carry(self._kernel, batch, coefficients, self._law, self._workspace)[batch.behind :]

    def _coefficients(self, applied: FloatArray, temperature_degC: float) -> FloatArray:
        if self._table is None or self._table[0] != temperature_degC:
            levels = np.linspace(0.0, self._highest, COMMAND_COUNT)
            warm = temperature_degC + ZERO_CELSIUS_K if self._damper.temperature_dependent else None
            self._table = (temperature_degC, self._damper.coefficients_at(levels, warm))
        place = applied * ((COMMAND_COUNT - 1) / self._highest)
        below = np.minimum(place.astype(np.intp), COMMAND_COUNT - 2)
        low, high = self._table[1][:, below], self._table[1][:, below + 1]
        return np.ascontiguousarray(low + (place - below) * (high - low))

    def _check_curve(self) -> None:
        values = self._damper.coefficients_at(np.linspace(0.0, self._highest, 9))
        for name, row in zip(self._damper.law.names, values, strict=True):
            if name in _SHAPE and np.ptp(row) > 0.0:
                raise InputError(f"{name} depends on the command", place="plant", expected="a constant value")
