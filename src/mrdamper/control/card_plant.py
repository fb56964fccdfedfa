"""The damper of a card as the plant of a closed loop, for control with a perfect model.

The actuation of the damper (delay and lags, or one lag) delays the command. The kernel then steps the law
sample by sample. A controller that is made from the same card has no model error on this plant. The tracking
error is therefore caused only by lag and noise. It does not validate a card.

The plant starts with zero force and zero command. Extension is positive.
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

COMMAND_COUNT = 401  # number of commands at which the law's coefficients are tabulated
_SHAPE = ("kappa", "n")  # Coefficients of the universal curve, which the kernel tabulates once.


class CardPlant:
    """A damper simulated from a model card, with its state, for a closed loop (``protocol.Plant``).

    Parameters
    ----------
    damper : damper of a card
    highest : highest command [A or V]; the applied command is limited to the range from 0 to this value
    step_s : time step [s]

    Raises
    ------
    InputError
        If the law is user-defined in Python, or its universal curve depends on the command.
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
        self._applied.on(np.zeros(2))  # The actuation settles at zero command.
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
        """Advance by one step for each sample; return the force [N] at the end of each step, shape (n,)."""
        x, v = (np.array(given, dtype=np.float64) for given in (displacement, velocity))
        command = self._applied.on(np.broadcast_to(np.asarray(current, dtype=np.float64), x.shape))
        applied = np.clip(command, 0.0, self._highest)
        a = np.diff(v, prepend=v[0] if self._before is None else self._before[1]) / self.step_s
        if self._before is not None:
            x, v, a, applied = map(np.concatenate, zip(self._before, (x, v, a, applied), strict=True))
        self._before = x[-1:].copy(), v[-1:].copy(), a[-1:].copy(), applied[-1:].copy()
        # Each block is treated as the last one, because later samples must not change forces already
        # returned.
        batch = core.open_batch(self.step_s, (x, v, a), self._motion, patience=1, last=True)
        coefficients = self._coefficients(applied, temperature_degC)
        return core.carry(self._kernel, batch, coefficients, self._law, self._workspace)[batch.behind :]

    def _coefficients(self, applied: FloatArray, temperature_degC: float) -> FloatArray:
        """Interpolate the law's coefficients at n applied commands and a temperature, shape (m, n)."""
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
