"""A drive for long, on which the damper warms by what it dissipates.

The damper is two bodies, fluid and housing (``TwoBodies``); of the road a segment in every so many seconds is
driven (``drive``), and its power warms the damper all the while.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control.vehicle.car import check_positive
from mrdamper.control.vehicle.drive import Ride, RoadSegment, Vehicle, drive_car
from mrdamper.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoBodies:
    """A damper as fluid and housing, with constant conductances.

    .. math:: C_f T_f' = P - G (T_f - T_h),  C_h T_h' = G (T_f - T_h) - G_a (T_h - T_a)
    """

    fluid_J_K: float = 150.0
    housing_J_K: float = 950.0
    between_W_K: float = 6.0
    ambient_W_K: float = 2.0

    def __post_init__(self) -> None:
        check_positive(self, "two bodies", zero=("ambient_W_K",))

    def warm(
        self, temperatures: tuple[float, float], power_W: float, time_s: float, ambient_degC: float = 20.0
    ) -> tuple[float, float]:
        """Return the temperatures of fluid and housing [degC] after a time at constant power, exactly."""
        from scipy.linalg import expm

        between, out = self.between_W_K, self.ambient_W_K
        system = np.zeros((3, 3))
        system[0] = [-between / self.fluid_J_K, between / self.fluid_J_K, power_W / self.fluid_J_K]
        system[1, :2] = [between / self.housing_J_K, -(between + out) / self.housing_J_K]
        above = np.array([temperatures[0] - ambient_degC, temperatures[1] - ambient_degC, 1.0])
        fluid, housing, _ = (expm(time_s * system) @ above).tolist()
        return float(fluid) + ambient_degC, float(housing) + ambient_degC


Thermometer = Callable[[float, float, float], float]
"""What a controller gets [degC], from the temperatures of fluid and housing [degC] and the power [W]."""


def _fluid_itself(fluid: float, _housing: float, _power: float) -> float:
    return fluid


@dataclass(frozen=True, slots=True, kw_only=True)
class LongDrive:
    """A drive of which one segment in every ``every_s`` is driven; its power warms the damper all the while.

    The current is cut off while the thermometer shows more than ``cut_off_degC``, until it shows less than
    ``back_degC``. The damper never gets hotter than ``hottest_degC``: a drive that reaches that says so by
    staying there.
    """

    duration_s: float = 1800.0
    every_s: float = 60.0
    segment_s: float = 6.0
    bodies: TwoBodies = field(default_factory=TwoBodies)
    ambient_degC: float = 20.0
    hottest_degC: float = 150.0
    cut_off_degC: float | None = None
    back_degC: float = 110.0
    coil_ohm: float = 5.0  # at 20 degC
    copper_per_K: float = 0.00393
    thermometer: Thermometer = _fluid_itself

    def __post_init__(self) -> None:
        if not 0.0 < self.segment_s <= self.every_s <= self.duration_s < math.inf:
            raise InputError(
                place="long drive",
                found=f"segments of {self.segment_s:g} s every {self.every_s:g} s over {self.duration_s:g} s",
                expected="in this order",
            )
        if self.cut_off_degC is not None and not self.back_degC < self.cut_off_degC:
            raise InputError(
                place="long drive",
                found=(
                    f"the current is cut off at {self.cut_off_degC:g} degC and comes back at "
                    f"{self.back_degC:g} degC"
                ),
                expected="back below it",
            )


@dataclass(frozen=True, slots=True, eq=False)
class Journey:
    """A long drive, a row per segment, shape (m,); temperatures are those at its beginning."""

    time: FloatArray  # [s]
    fluid_degC: FloatArray
    housing_degC: FloatArray
    thermometer_degC: FloatArray  # what the controller gets
    heat_W: FloatArray  # mechanical
    coil_W: FloatArray
    is_cut_off: FloatArray  # 1 where the current was cut off
    body_acceleration_m_s2: FloatArray
    tyre_load_N: FloatArray
    force_error_N: FloatArray  # NaN without a controller


def drive_long(vehicle: Vehicle, plan: LongDrive, segment: RoadSegment | None = None) -> Journey:
    """Drive for long; the temperatures and the length of ``segment`` are the plan's to set."""
    base = RoadSegment() if segment is None else segment
    skip = min(1.0, 0.2 * plan.segment_s)
    at, power, is_cut = (plan.ambient_degC, plan.ambient_degC), 0.0, False
    ride: Ride | None = None
    rows: list[tuple[float, ...]] = []
    for k in range(round(plan.duration_s / plan.every_s)):
        shown = plan.thermometer(*at, power)
        if plan.cut_off_degC is not None:
            is_cut = shown > (plan.back_degC if is_cut else plan.cut_off_degC)
        now = replace(
            base, duration_s=plan.segment_s, unscored_s=skip, temperature_degC=at[0], thermometer_degC=shown
        )
        commanded = replace(vehicle, highest_A=0.0) if is_cut else vehicle
        ride = drive_car(commanded, now, after=ride)
        resistance = plan.coil_ohm * (1.0 + plan.copper_per_K * (at[0] - 20.0))
        coil = ride.current_rms_A**2 * resistance
        power = ride.heat_W + coil
        error = math.nan if ride.force_error_N is None else ride.force_error_N
        figures = (ride.body_acceleration_m_s2, ride.tyre_load_N, error)
        rows.append((k * plan.every_s, *at, shown, ride.heat_W, coil, float(is_cut), *figures))
        fluid, housing = plan.bodies.warm(at, power, plan.every_s, plan.ambient_degC)
        at = min(fluid, plan.hottest_degC), min(housing, plan.hottest_degC)
    return Journey(*np.ascontiguousarray(np.array(rows).T))
