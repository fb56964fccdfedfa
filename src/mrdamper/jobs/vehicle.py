"""A car, its top mount and its sensors, from the options of the jobs that have them."""

from __future__ import annotations

from mrdamper.control.vehicle.car import QuarterCar
from mrdamper.control.vehicle.mount import TopMount
from mrdamper.control.vehicle.observer import VehicleSensors
from mrdamper.jobs.options import CarOptions


def car_of(options: CarOptions) -> QuarterCar:
    """Return body, wheel, spring and tyre."""
    return QuarterCar(
        body_kg=options.body_kg,
        wheel_kg=options.wheel_kg,
        spring_N_m=options.spring_N_m,
        tyre_N_m=options.tyre_N_m,
    )


def mount_of(options: CarOptions) -> TopMount | None:
    """Return the top mount; None: the rod is bolted to the body."""
    if options.mount_N_m is None:
        return None
    return TopMount(stiffness_N_m=options.mount_N_m, damping_N_s_m=options.mount_damping_N_s_m)


def sensors_of(options: CarOptions) -> VehicleSensors:
    """Return what tells the car's states."""
    return VehicleSensors(
        body_noise_m_s2=options.body_noise_m_s2,
        body_bias_m_s2=options.body_bias_m_s2,
        wheel_accelerometer=options.wheel_accelerometer,
        wheel_noise_m_s2=options.wheel_noise_m_s2,
        wheel_bias_m_s2=options.wheel_bias_m_s2,
        stroke_noise_m=options.stroke_noise_m,
        stroke_bias_m=options.stroke_bias_m,
    )
