"""A card's damper as a plant: what a controller meets when the card itself is taken for the truth.

The command goes through the damper's actuation (or its lag) and is held over each step; the law's state is
carried from step to step by the exact flow of the Bouc-Wen family, implicitly (``series_plant``), or by the
kernel (chain, Spencer, LuGre).
Judged on this plant a controller made from the same card has no model error left: use it to see what lag and
noise alone cost, never as proof.

Starts without force and command. Extension positive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.control.series_plant import carry_chain
from mrdamper.errors import InputError
from mrdamper.models.actuation import PLAY_SHARE
from mrdamper.models.damper import Damper
from mrdamper.models.laws import VISCOUS_SPEED
from mrdamper.quantities import ZERO_CELSIUS_K

__all__ = ["LAWS_AS_PLANT", "CardPlant"]

_ELEMENTS = {  # yield force and inverse yield displacement of the hysteretic elements in parallel
    "bouc-wen": (("yield_force", "rho"),),
    "dahl": (("yield_force", "rho"),),
    "bouc-wen-saturating": (("yield_force", "rho"),),
    "double-bouc-wen": (("yield_force", "rho"), ("second_force", "second_rho")),
    "bingham": (),
    "tanh": (),
    "series-valve": (),
    "chain": (),
    "spencer": (),
    "lugre": (),
}

_IN_KERNEL = ("chain", "spencer", "lugre")
"""Laws whose state the kernel itself carries, as ``simulate_batch`` does."""

LAWS_AS_PLANT = tuple(_ELEMENTS)
"""The laws whose state can be carried from step to step here."""

_CHAIN = (
    "offset", "stiffness", "yield_force", "thinning", "thinning_exponent", "yield_velocity", "position_gain",
    "gap_stiffness", "gap", "gap_corner", "leak_damping", "leak_exponent",
)  # fmt: skip
_LEVELS = 401  # commands of the coefficients' table


@dataclass(frozen=True, slots=True, eq=False)
class _Curve:
    """The universal curve w = Y(tau) as a table, both ways."""

    travel: FloatArray
    state: FloatArray

    @classmethod
    def of(cls, kappa: float, n: float) -> _Curve:
        travel = np.sinh(np.linspace(-4.5, 4.5, 40_001))  # fine around zero, to +-45
        state = core.curve(kappa, n, travel)[0]
        rising = np.concatenate([[True], np.diff(np.maximum.accumulate(state)) > 0.0])
        return cls(travel[rising], state[rising])

    def move(self, state: float, scaled: FloatArray) -> FloatArray:
        """Return the states after scaled travels from a state, all in one direction or none."""
        side = -1.0 if scaled.sum() < 0.0 else 1.0
        start = float(np.interp(side * state, self.state, self.travel))
        moved = np.interp(start + np.cumsum(np.abs(scaled)), self.travel, self.state)
        return np.asarray(side * moved, dtype=np.float64)


class CardPlant:
    """A damper of a card that remembers, as ``protocol.Plant`` has it.

    Parameters
    ----------
    damper : what the card holds
    highest : highest command [A or V]; what is applied is held between zero and this
    step_s : time step [s]

    Raises
    ------
    InputError
        A law whose state cannot be carried from step to step here, or whose curve depends on the command.
    """

    __slots__ = (
        "_applied",
        "_carried",
        "_curve",
        "_damper",
        "_highest",
        "_line",
        "_play",
        "_state",
        "_table",
        "_where",
        "step_s",
    )

    def __init__(self, damper: Damper, *, highest: float = 2.0, step_s: float = 1e-4) -> None:
        law = damper.law.name
        if law not in _ELEMENTS:
            raise InputError(
                found=f"plant: a card of the law {law!r} cannot be the plant",
                expected=f"one of: {', '.join(LAWS_AS_PLANT)}",
                remedy="Name a preset of the virtual rig, or such a card",
            )
        if not 0.0 < step_s <= 1e-3:
            raise InputError(found=f"plant: step is {step_s} s", expected="above 0, at most 1e-3")
        self.step_s = step_s
        self._damper, self._highest = damper, highest
        self._curve = self._make_curve() if _ELEMENTS[law] else None
        self._table: tuple[float, dict[str, FloatArray | float]] | None = None
        self._play = 0.0 if damper.actuation is None else damper.actuation.play
        self._applied = (0.0, 0.0, -self._play)  # after the first lag, after the second, behind the play
        delay = 0.0 if damper.actuation is None else damper.actuation.delay_s
        self._line = np.zeros(round(delay / step_s))
        self._state = (0.0, 0.0) if law == "series-valve" else (0.0,) * len(_ELEMENTS[law])
        self._carried: tuple[FloatArray, ...] = ()  # motion, law, and the last sample; none: not moved yet
        self._where: tuple[float, float] | None = None  # displacement and velocity; None: not moved yet

    def copy(self) -> CardPlant:
        other = CardPlant.__new__(CardPlant)
        for name in self.__slots__:
            setattr(other, name, getattr(self, name))  # all of them are replaced, never changed
        return other

    def advance_many(
        self,
        displacement: ArrayLike,
        velocity: ArrayLike,
        current: ArrayLike,
        temperature_degC: float,
    ) -> FloatArray:
        """Move on by a step per sample; return the force [N] at the end of each, shape (n,)."""
        x, v = (np.asarray(given, dtype=np.float64) for given in (displacement, velocity))
        applied = self._apply(np.broadcast_to(np.asarray(current, dtype=np.float64), x.shape))
        c = self._coefficients(applied, temperature_degC)
        x0, v0 = (float(x[0]), float(v[0])) if self._where is None else self._where
        if self._damper.law.name in _IN_KERNEL:
            return self._carry(x, v, c)
        travel = np.diff(x, prepend=x0)
        self._where = (float(x[-1]), float(v[-1]))
        force = c["mass"] * np.diff(v, prepend=v0) / self.step_s
        if self._damper.law.name != "series-valve":
            force += c["offset"] + c["stiffness"] * x
        force += (
            c["viscosity"] * np.sign(v) * VISCOUS_SPEED * (np.abs(v) / VISCOUS_SPEED) ** c["viscous_exponent"]
        )
        stribeck = c["breakaway_friction"] * np.exp(-((v / c["stribeck_velocity"]) ** 2))
        force += (c["coulomb_friction"] + stribeck) * np.tanh(v / c["transition_velocity"])
        return np.asarray(force + self._hysteretic(x, v, travel, c), dtype=np.float64)

    def _carry(self, x: FloatArray, v: FloatArray, c: dict[str, FloatArray | float]) -> FloatArray:
        """Return the whole force [N] of a law whose state the kernel carries."""
        rows = np.stack([np.broadcast_to(row, x.shape) for row in c.values()])
        motion, law = np.zeros(core.MOTION_NUMBERS), np.zeros(core.STATE_NUMBERS)
        speed = float(v[0])
        if self._carried:
            motion, law, last, row = (part.copy() for part in self._carried)
            x, v = np.append(last[0], x), np.append(last[1], v)
            rows, speed = np.concatenate([row, rows], axis=1), float(last[1])
        a = np.diff(v, prepend=speed) / self.step_s
        record = core.open_batch(
            self.step_s, (np.ascontiguousarray(x), np.ascontiguousarray(v), a), motion, patience=1, last=True
        )
        law_number = self._damper.law.kernel or 0
        force = core.carry(law_number, record, np.ascontiguousarray(rows), law, core.Workspace())
        self._carried = (motion, law, np.array([x[-1], v[-1]]), rows[:, -1:].copy())
        return force[record.behind :]

    def _hysteretic(
        self, x: FloatArray, v: FloatArray, travel: FloatArray, c: dict[str, FloatArray | float]
    ) -> FloatArray | float:
        """Return the law's own part of the force [N]; its state moves on."""
        law = self._damper.law.name
        if law == "series-valve":
            spring, valve = self._state
            chain = {name: c[name] for name in _CHAIN}
            self._state, force = carry_chain((spring, valve), x, v, travel, self.step_s, chain)
            return force
        if self._curve is None:
            if law == "bingham":
                return np.asarray(c["yield_force"] * np.tanh(v / c["yield_velocity"]))
            return np.asarray(c["yield_force"] * np.tanh(c["slope"] * v + c["shift"] * np.sign(x)))
        total: FloatArray = np.zeros(len(x))
        states = []
        # pieces of one direction; a standstill goes with what is before it
        turns = np.flatnonzero(travel[:-1] * travel[1:] < 0.0) + 1
        for (amplitude, rho), state in zip(_ELEMENTS[law], self._state, strict=True):
            scaled, w = c[rho] * travel, np.empty(len(x))
            for begin, end in zip([0, *turns], [*turns, len(x)], strict=True):
                w[begin:end] = self._curve.move(state, scaled[begin:end])
                state = float(w[end - 1])  # noqa: PLW2901 - carried along the pieces
            level = c[amplitude]
            if law == "bouc-wen-saturating":
                speed = np.abs(v)
                level = level + c["rate_force"] * speed / (speed + c["saturation_velocity"])
            total += level * w
            states.append(state)
        self._state = tuple(states)
        return total

    def _apply(self, command: FloatArray) -> FloatArray:
        """Return what the law feels of a command that is held over each step, at the steps' ends."""
        if self._line.size:
            queue = np.concatenate([self._line, command])
            command, self._line = queue[: len(command)], queue[len(command) :]
        lag = self._damper.actuation
        if lag is None:
            one = self._damper.command_lag_s
            rise, fall, behind = one, one, 0.0
        else:
            rise, fall, behind = lag.rise_s, lag.fall_s, lag.second_s
        keep_rise, keep_fall, keep = (
            math.exp(-self.step_s / tau) if tau > 0.0 else 0.0 for tau in (rise, fall, behind)
        )
        first, second, behind_play = self._applied
        out, play = [], self._play
        for level in command.tolist():
            keep_first = keep_rise if abs(level) > abs(first) else keep_fall
            before, first = first, level + (first - level) * keep_first
            # the first lag's output is taken as its mean over the step
            second = first if behind == 0.0 else second * keep + 0.5 * (before + first) * (1.0 - keep)
            behind_play = min(max(behind_play, second - play), second + play)
            out.append(second + PLAY_SHARE * (behind_play + play - second))
        self._applied = (first, second, behind_play)
        return np.asarray(np.clip(out, 0.0, self._highest), dtype=np.float64)

    def _coefficients(self, applied: FloatArray, temperature_degC: float) -> dict[str, FloatArray | float]:
        """Return the coefficients at the applied commands, from a table for the temperature."""
        if self._table is None or self._table[0] != temperature_degC:
            levels = np.linspace(0.0, self._highest, _LEVELS)
            warm = temperature_degC + ZERO_CELSIUS_K if self._damper.temperature_dependent else None
            rows = self._damper.coefficients_at(levels, warm)
            self._table = (
                temperature_degC,
                {
                    name: row if np.ptp(row) > 0.0 else float(row[0])
                    for name, row in zip(self._damper.law.names, rows, strict=True)
                },
            )
        place = applied * ((_LEVELS - 1) / self._highest)
        below = np.minimum(place.astype(np.intp), _LEVELS - 2)
        share = place - below
        return {
            name: row if isinstance(row, float) else row[below] + share * (row[below + 1] - row[below])
            for name, row in self._table[1].items()
        }

    def _make_curve(self) -> _Curve:
        values = self._damper.coefficients_at(np.linspace(0.0, self._highest, 9))
        names = self._damper.law.names
        shape = []
        for name, fixed in (("kappa", -1.0), ("n", 1.0)):  # Dahl's law has them fixed
            row = values[names.index(name)] if name in names else np.array([fixed])
            if np.ptp(row) > 0.0:
                raise InputError(found=f"plant: {name} depends on the command", expected="one that does not")
            shape.append(float(row[0]))
        return _Curve.of(shape[0], shape[1])
