"""An elastic top mount between a damper's rod and the body.

The rod has no mass: mount and damper carry one force F, and of the rattle space x_b - x_w = d + m the mount
takes m, the damper's own stroke is d:

    c_m m' = F - k_m m

A force held from the step before diverges where the mount is damped little, since the damper is stiff before
it yields. The force of a step is therefore the one that damper and mount agree upon at its end, and with
it held the mount moves exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mrdamper.control.vehicle.car import CarDamper, check_positive

_TOLERANCE_N = 1e-6  # by which damper and mount may disagree
_MOST_TRIALS = 80  # bisection alone would take 50 from 1e9 N
_SECANTS = 6  # from then on every other trial halves the bracket


@dataclass(frozen=True, slots=True, kw_only=True)
class TopMount:
    """A spring and a viscous damper side by side."""

    stiffness_N_m: float
    damping_N_s_m: float = 0.0

    def __post_init__(self) -> None:
        check_positive(self, "top mount", zero=("damping_N_s_m",))

    def advance(self, step_s: float) -> tuple[float, float]:
        """Return what the exact step keeps of a deflection, and what it adds to it by a held force [m/N]."""
        if self.damping_N_s_m == 0.0:
            return 0.0, 1.0 / self.stiffness_N_m
        gone = -math.expm1(-step_s * self.stiffness_N_m / self.damping_N_s_m)
        return 1.0 - gone, gone / self.stiffness_N_m


class MountedDamper:
    """A damper and its mount as one ``CarDamper``: moved by the rattle space, it knows its own stroke."""

    def __init__(self, damper: CarDamper, mount: TopMount) -> None:
        self.damper, self.mount = damper, mount
        self.deflection = 0.0  # of the mount [m]
        self._keep, self._by_force = mount.advance(damper.step_s)
        self._force, self._stiffer = 0.0, 0.0  # of the last step [N]; -dF/dF of the damper there [-]

    @property
    def step_s(self) -> float:
        """Time between two steps [s]."""
        return self.damper.step_s

    def copy(self) -> MountedDamper:
        """Return both in the same state, which go their own way from here."""
        other = MountedDamper(self.damper.copy(), self.mount)
        other.deflection, other._force, other._stiffer = self.deflection, self._force, self._stiffer
        return other

    def advance(
        self, displacement: float, velocity: float, current: float, temperature_degC: float, /
    ) -> float:
        """Move on by one step of the rattle space; return the force [N] of damper and mount at its end.

        The more the mount gives, the less the damper is moved: its force falls with the one that is tried, so
        that there is one answer, between a trial and what the damper makes of it.
        """
        before, rate = self.deflection, 1.0 / self.step_s
        tried = self._force
        last = tried, 0.0
        low, high = -math.inf, math.inf
        for trial in range(_MOST_TRIALS):
            after = self._keep * before + self._by_force * tried
            damper = self.damper.copy()
            velocity_of_damper = velocity - rate * (after - before)
            off = damper.advance(displacement - after, velocity_of_damper, current, temperature_degC) - tried
            low, high = (max(low, tried), high) if off > 0.0 else (low, min(high, tried))
            if trial == 0:  # the damper's force falls: the answer is not beyond what it gave
                low, high = (low, tried + off) if off > 0.0 else (tried + off, high)
                following = tried + off / (1.0 + self._stiffer)
            else:
                following = self._next(tried, off, *last)
            if abs(off) <= _TOLERANCE_N or high - low <= _TOLERANCE_N:
                break
            halved = trial > _SECANTS and trial % 2 == 0
            last = tried, off
            tried = 0.5 * (low + high) if halved or not low < following < high else following
        self.damper, self.deflection, self._force = damper, after, tried
        return tried

    def _next(self, tried: float, off: float, tried_before: float, off_before: float) -> float:
        """Return where a straight line through two trials has no difference; keep its slope."""
        if tried == tried_before or off == off_before:
            return math.nan
        slope = (off_before - off) / (tried - tried_before)  # 1 and what the damper falls
        self._stiffer = max(slope - 1.0, 0.0)
        return tried + off / slope
