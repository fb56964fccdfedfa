"""A quarter car on an ISO 8608 road, whose damper follows the target force of a skyhook controller.

python examples/quarter_car.py [CARD]

Without CARD, the example identifies the vehicle damper of the virtual rig (half a minute). The damper of the
car is the real-time model of the card, and the controller is made from the same card. The states, relative to
the car at rest, are z = (x_b - x_w, x_b', x_w - x_r, x_w'): rattle space, body speed, tyre deflection and
wheel speed. The damper force F resists extension:

    m_b x_b'' = -k_s (x_b - x_w) - F
    m_w x_w'' =  k_s (x_b - x_w) + F - k_t (x_w - x_r)

The target force is the skyhook force F* = c x_b' while the damper can dissipate (F* v > 0, v = x_b' - x_w'),
otherwise zero.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.linalg import expm

import mrdamper
from mrdamper.control.controllers import ForceController, controllers_for
from mrdamper.control.protocol import Measurement, Reference
from mrdamper.control.realtime import realtime_model
from mrdamper.excitation import Road
from mrdamper.models.card import ModelCard
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import PRESETS

STEP_S = 0.25e-3  # time step of car and damper
CONTROL_PERIOD_S = 1e-3
SPEED_MAX_M_S = 4.0  # max speed of the tables; the damper of a car is fast
UNSCORED_S = 2.0  # The transient from rest is not scored.
SKYHOOK_N_S_M = 2500.0

States = np.ndarray  # shape (4,)
Damper = Callable[[int, States], float]  # arguments: step number and states; result: force in this step [N]


@dataclass(frozen=True)
class QuarterCar:
    """Body, wheel, spring and tyre of a quarter of a car without its damper."""

    body_kg: float = 320.0
    wheel_kg: float = 40.0
    spring_N_m: float = 20e3
    tyre_N_m: float = 200e3

    def transition(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return A, b, c of the step z <- A z + b F + c x_r', exact for constant F, x_r'."""
        system = np.zeros((6, 6))
        system[0, 1], system[0, 3], system[2, 3], system[2, 5] = 1.0, -1.0, 1.0, -1.0
        system[1, 0], system[1, 4] = -self.spring_N_m / self.body_kg, -1.0 / self.body_kg
        system[3, 0], system[3, 4] = self.spring_N_m / self.wheel_kg, 1.0 / self.wheel_kg
        system[3, 2] = -self.tyre_N_m / self.wheel_kg
        exact = expm(STEP_S * system)
        return exact[:4, :4], exact[:4, 4], exact[:4, 5]


@dataclass(frozen=True)
class Ride:
    """Results of a ride; the RMS values ignore the first seconds."""

    body_acceleration_m_s2: float
    tyre_load_N: float
    rattle_m: float
    states: np.ndarray  # shape (steps, 4)
    force: np.ndarray  # damper force [N], shape (steps,)


def drive(car: QuarterCar, damper: Damper, road: Road, duration_s: float = 20.0) -> Ride:
    """Drive a road from rest; the damper force is constant during each time step."""
    count = round(duration_s / STEP_S)
    heights = road.displacement(STEP_S * np.arange(count + 1))
    road_speed = np.diff(heights) / STEP_S
    a, b, c = car.transition()
    states, force = np.zeros((count, 4)), np.zeros(count)
    z = np.zeros(4)
    for k in range(count):
        states[k], force[k] = z, damper(k, z)
        z = a @ z + b * force[k] + c * road_speed[k]
    scored = slice(min(round(UNSCORED_S / STEP_S), count // 2), None)
    body = -(car.spring_N_m * states[:, 0] + force) / car.body_kg

    def rms(values: np.ndarray) -> float:
        return float(np.sqrt(np.mean(values[scored] ** 2)))

    return Ride(rms(body), car.tyre_N_m * rms(states[:, 2]), rms(states[:, 0]), states, force)


def skyhook(z: States) -> float:
    """Return the skyhook force [N], or zero if this force would not dissipate energy in the damper."""
    wanted = SKYHOOK_N_S_M * z[1]
    return float(wanted) if wanted * (z[1] - z[3]) > 0.0 else 0.0


def ideal_damper(_step: int, z: States) -> float:
    """Return the target force itself, like an actuator without lag and error."""
    return skyhook(z)


def card_damper(
    card: ModelCard, car: QuarterCar, controller: ForceController | None, temperature_degC: float
) -> Damper:
    """Return the damper of a card with a controller. If the controller is None, the current is zero.

    The controller needs the target force a short time ahead (preview). The road ahead is unknown. Therefore
    this force is predicted by the motion of the car without damper force and road excitation.
    """
    kelvin = temperature_degC + ZERO_CELSIUS_K
    model = realtime_model(card, period_s=STEP_S, speed_m_s=SPEED_MAX_M_S)
    state, current = model.start(), 0.0
    control_state = None if controller is None else controller.start()
    steps_per_sample = round(CONTROL_PERIOD_S / STEP_S)
    preview_steps = 0 if controller is None else round(controller.preview_s / STEP_S)
    free_motion = np.linalg.matrix_power(car.transition()[0], preview_steps)

    def damper(step: int, z: States) -> float:
        nonlocal state, control_state, current
        if controller is not None and step % steps_per_sample == 0:
            wanted = Reference(skyhook(z), skyhook(free_motion @ z))
            measured = Measurement(float(z[0]), kelvin)
            control_state, current = controller.step(control_state, wanted, measured)
        state, force = model.step(state, float(z[0]), float(z[1] - z[3]), current, kelvin)
        return force

    return damper


def vehicle_card() -> ModelCard:
    """Return the card of the vehicle damper of the virtual rig."""
    campaign = Campaign.from_toml(Path(__file__).with_name("vehicle_campaign.toml"))
    campaign = replace(
        campaign, temperatures_degC=(20.0, 110.0), currents_A=(0.0, 1.0, 2.0), held_out_temperatures_degC=()
    )
    runs = [run for run, _ in measure(PRESETS["vehicle"], campaign)]
    return mrdamper.fit(runs, "double-bouc-wen").card()


def main() -> None:
    """Print comfort, tyre load and rattle space of three cars on the same road."""
    card = mrdamper.read_card(sys.argv[1]) if len(sys.argv) > 1 else vehicle_card()
    controllers = controllers_for(card, period_s=CONTROL_PERIOD_S, speed_m_s=SPEED_MAX_M_S)
    car = QuarterCar()
    dampers = {
        "no current": card_damper(card, car, None, 100.0),
        "controlled": card_damper(card, car, controllers["recommended"], 100.0),
        "ideal": ideal_damper,
    }
    for name, damper in dampers.items():
        ride = drive(car, damper, Road("C", speed=20.0))
        print(
            f"{name:10} body {ride.body_acceleration_m_s2:.3f} m/s2, tyre {ride.tyre_load_N:.0f} N, "
            f"rattle space {1e3 * ride.rattle_m:.1f} mm"
        )


if __name__ == "__main__":
    main()
