"""What a choice of the force of the car's damper can make of a ride at 123 degC, the road known in advance.

Every 5 ms a share of the way from the force at no current to that at the largest one is chosen, for the whole
ride at once and without lag. The search is local, by gradients of a car with smooth force curves; the figures
are those of rides with the rig's damper itself. They show what is possible; better choices may exist.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import bilinear, lfilter

from mrdamper.arrays import FloatArray
from mrdamper.control.vehicle.comfort import weighting_sections
from mrdamper.control.vehicle.drive import Ride, RoadSegment, Vehicle, drive_car
from mrdamper.excitation import Road
from mrdamper.rig.plant import PRESETS, Plant
from tests.acceptance.test_quarter_car import CAR, controller, demand

pytestmark = pytest.mark.nightly

STEP_S, HELD, HOT_degC, KNEE_M_S = 1e-3, 5, 123.0, 0.05
CURRENTS_A = 0.0, 2.0
DAMPER = Plant(PRESETS["vehicle"])


class ChosenShare:
    """The damper without lag: a share of the way between its forces at no and at the largest current."""

    def __init__(self, share: FloatArray) -> None:
        self.ends, self.share, self.step_s = (DAMPER.copy(), DAMPER.copy()), share.tolist(), DAMPER.step_s
        self.forces_N: list[list[float]] = []

    def copy(self) -> ChosenShare:
        return self

    def advance(self, x: float, v: float, _current: float, degrees: float) -> float:
        share = self.share[int((len(self.forces_N) + 0.5) * self.step_s / STEP_S)]
        low, high = (
            end.advance(x, v, amperes, degrees) for end, amperes in zip(self.ends, CURRENTS_A, strict=True)
        )
        self.forces_N.append([low, high])
        return float(low + share * (high - low))


def smooth_curves() -> FloatArray:
    """Return the shares of tanh(v / knee) [N] and of v [N s/m] in both forces, shape (2, 2)."""
    time = np.arange(0.0, 1.0, DAMPER.step_s)
    x, v = 0.08 * np.sin(4.0 * np.pi * time), 0.32 * np.pi * np.cos(4.0 * np.pi * time)
    forces = []
    for amperes in CURRENTS_A:
        end = DAMPER.copy()
        forces.append(
            [end.advance(*at, amperes, HOT_degC) for at in zip(x.tolist(), v.tolist(), strict=True)]
        )
    terms = np.column_stack([np.tanh(v / KNEE_M_S), v])
    return np.asarray(np.linalg.lstsq(terms, np.array(forces).T, rcond=None)[0].T)


def forces_at(curves: FloatArray, v: FloatArray) -> FloatArray:
    """Return both forces [N] on the smooth curves, shape (2, n)."""
    return np.asarray(curves @ np.array([np.tanh(v / KNEE_M_S), v]))


def simulate(
    curves: FloatArray, rest: FloatArray, road: FloatArray, share: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return states, force, its slope over v, and the way between both forces, at every millisecond.

    ``rest`` is what the forces have beside the smooth curves [N], shape (n, 2).
    """
    (t0, c0), (t1, c1) = curves.tolist()
    exact, by_force, by_road = CAR.advance(STEP_S)
    (a, b, c, d), f, r = exact.tolist(), by_force.tolist(), by_road.tolist()
    z: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    rows = []
    for (r0, r1), rise, u in zip(rest.tolist(), road.tolist(), share.tolist(), strict=True):
        v = z[1] - z[3]
        bend = float(np.tanh(v / KNEE_M_S))
        steep = (1.0 - bend * bend) / KNEE_M_S
        low, high = t0 * bend + c0 * v + r0, t1 * bend + c1 * v + r1
        force = low + u * (high - low)
        slope = (1.0 - u) * (t0 * steep + c0) + u * (t1 * steep + c1)
        rows.append((*z, force, slope, high - low))
        w, x, y, s = z
        z = tuple(
            m[0] * w + m[1] * x + m[2] * y + m[3] * s + p * force + q * rise
            for m, p, q in zip((a, b, c, d), f, r, strict=True)
        )
    found = np.array(rows)
    return found[:, :4], found[:, 4], found[:, 5], found[:, 6]


def cost_and_gradient(
    choices: FloatArray, curves: FloatArray, rest: FloatArray, road: FloatArray, tyre: float, skip: int
) -> tuple[float, FloatArray]:
    """Return the mean square of weighted acceleration + tyre (x_w - x_r)^2, and its gradient (adjoint)."""
    share = np.repeat(choices, HELD)[: len(road)]
    states, force, slope, way = simulate(curves, rest, road, share)
    sections = [bilinear(above, below, fs=1.0 / STEP_S) for above, below in weighting_sections()]
    felt = -(CAR.spring_N_m * states[:, 0] + force) / CAR.body_kg
    for section in sections:
        felt = lfilter(*section, felt)
    felt[:skip] = 0.0
    deflection = np.where(np.arange(len(road)) < skip, 0.0, states[:, 2])
    count = len(road) - skip
    back = 2.0 * felt / count
    for section in sections:
        back = lfilter(*section, back[::-1])[::-1]
    by_states = np.zeros_like(states)
    by_states[:, 0] = -CAR.spring_N_m / CAR.body_kg * back
    by_states[:, 2] = 2.0 * tyre * deflection / count
    by_force = -back / CAR.body_kg
    exact, by, _ = CAR.advance(STEP_S)
    a, (b0, b1, b2, b3) = exact.T.tolist(), by.tolist()
    costate, total = (0.0, 0.0, 0.0, 0.0), np.empty(len(road))
    every = zip(by_states[::-1].tolist(), by_force[::-1].tolist(), slope[::-1].tolist(), strict=True)
    for k, (own, direct, steep) in enumerate(every, start=1):
        w, x, y, s = costate
        all_of_it = direct + b0 * w + b1 * x + b2 * y + b3 * s
        total[-k] = all_of_it
        g = [m[0] * w + m[1] * x + m[2] * y + m[3] * s + o for m, o in zip(a, own, strict=True)]
        costate = (g[0], g[1] + all_of_it * steep, g[2], g[3] - all_of_it * steep)
    gradient = np.zeros(len(choices) * HELD)
    gradient[: len(road)] = total * way
    cost = (felt @ felt + tyre * (deflection @ deflection)) / count
    return float(cost), gradient.reshape(-1, HELD).sum(axis=1)


def optimal_ride(segment: RoadSegment, *, tyre: float = 1e3, rounds: int = 6) -> Ride:
    """Return the best ride found; each round knows where the damper left the smooth curves in the last.

    ``tyre`` weighs the squared tyre deflection [1/s^4] against that of the weighted acceleration.
    """
    curves, skip = smooth_curves(), round(segment.unscored_s / STEP_S)
    count = round(segment.duration_s / STEP_S)
    choices, rest, best, least = np.full(-(-count // HELD), 0.1), np.zeros((count, 2)), None, np.inf
    for _ in range(rounds):
        damper = ChosenShare(np.repeat(choices, HELD))
        ride = drive_car(Vehicle(CAR, demand(), damper), segment)
        cost = ride.weighted_acceleration_m_s2**2 + tyre * (ride.tyre_load_N / CAR.tyre_N_m) ** 2
        if best is None or cost < least:
            best, least = ride, cost
        every = round(STEP_S / ride.step_s)
        v = (ride.states[:, 1] - ride.states[:, 3]).reshape(count, every).mean(axis=1)
        seen = np.array(damper.forces_N).reshape(count, every, 2).mean(axis=1)
        rest = 0.5 * (rest + seen - forces_at(curves, v).T) if rest.any() else seen - forces_at(curves, v).T
        road = ride.road.reshape(count, every).mean(axis=1)
        choices = minimize(
            cost_and_gradient, choices, (curves, rest, road, tyre, skip), jac=True, method="L-BFGS-B",
            bounds=[(0.0, 1.0)] * len(choices), options={"maxiter": 60, "maxcor": 20},
        ).x  # fmt: skip
    assert best is not None
    return best


def test_the_gradient_of_the_search_is_that_of_its_cost():
    rng = np.random.default_rng(0)
    road, rest = 0.3 * rng.standard_normal(600), 20.0 * rng.standard_normal((600, 2))
    choices, way, small = rng.uniform(0.2, 0.8, 120), rng.standard_normal(120), 1e-6
    asked = smooth_curves(), rest, road, 1e4, 100
    ends = [cost_and_gradient(choices + side * small * way, *asked)[0] for side in (-1.0, 1.0)]
    slope = cost_and_gradient(choices, *asked)[1] @ way
    assert (ends[1] - ends[0]) / (2.0 * small) == pytest.approx(slope, rel=1e-4)


@pytest.mark.release
@pytest.mark.parametrize("road", ["B", "C"])
def test_with_the_road_known_the_damper_can_do_more_than_the_regulator_asks_of_it(road):
    segment = RoadSegment(road=Road(road, 20.0, 1), duration_s=8.0, temperature_degC=HOT_degC, seed=1)
    aware, cold = (
        drive_car(Vehicle(CAR, demand(), DAMPER, controller(which)), segment) for which in ("aware", "cold")
    )
    ideal, best = drive_car(Vehicle(CAR, demand()), segment), optimal_ride(segment)
    print(f"{road}, over unaware:", end=" ")
    for name, ride in (("aware", aware), ("ideal", ideal), ("optimum", best)):
        weighted = ride.weighted_acceleration_m_s2 / cold.weighted_acceleration_m_s2
        print(f"{name} {weighted:.2f}, tyre {ride.tyre_load_N / cold.tyre_load_N:.2f};", end=" ")
    print(f"optimum's body over ideal {best.body_acceleration_m_s2 / ideal.body_acceleration_m_s2:.2f}")
    assert best.weighted_acceleration_m_s2 < 0.97 * aware.weighted_acceleration_m_s2
    assert best.tyre_load_N < aware.tyre_load_N
