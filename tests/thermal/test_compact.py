"""The compact thermal model with six states agrees with the reduced finite elements and conserves energy.

``python -m tests.thermal.test_compact 20`` prints the errors of the compact model for 20 random dampers.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.quantities import REFERENCE_K
from mrdamper.thermal.compact import (
    UPDATE_S,
    CompactLoad,
    CompactModel,
    compact_model,
    sensor_gains,
    simulate_compact,
)
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.model.finite_element import build_field, cooling_in
from mrdamper.thermal.model.heat_equation import FieldHeating, simulate_field, steady_field
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.section import section_of
from mrdamper.thermal.model.stepping import Load
from tests.thermal.bodies import draw_body, odd_bodies

SEGMENTS = 8
LATE_S = 15.0  # Gap and coil are compared only from this time after a step of the power.


@dataclass(frozen=True)
class CompactScore:
    """Largest errors against the reduced model [K]. Gap and coil are compared from 15 s after a step."""

    fluid: float
    gap: float
    coil: float


def _constant(watts: float, kelvin: FloatArray) -> FloatArray:
    return np.full(np.shape(kelvin), watts)


@dataclass(frozen=True)
class _Course:
    """Temperatures of the reduced model during the whole load. ``add`` appends one segment."""

    time: list[FloatArray]
    fluid: list[FloatArray]
    gap: list[FloatArray]
    coil: list[FloatArray]

    def add(self, since: float, part: FieldHeating) -> None:
        self.time.append(since + part.time[1:])
        self.fluid.append(part.fluid[1:])
        self.gap.append(part.hottest("gap")[1:])
        self.coil.append(part.hottest("coil")[1:])


def score(seed: int) -> CompactScore:
    """Return the errors for a random body after random steps of power, current, ambient and air speed."""
    rng, body = np.random.default_rng(1000 + seed), draw_body(seed)
    drawing = body.drawing
    power = float(body.load.power(np.array([drawing.surroundings.ambient]))[0])
    time = rng.uniform(60.0, 300.0, SEGMENTS).round()
    watts = power * rng.uniform(0.0, 2.0, SEGMENTS) * (rng.random(SEGMENTS) > 0.15)
    coil = body.load.coil_W * rng.uniform(0.0, 2.0, SEGMENTS)
    around = [drawing.surroundings]
    for _ in range(3):
        speed = float(rng.choice([0.0, rng.uniform(0.3, 8.0)]))
        around.append(replace(drawing.surroundings, ambient=rng.uniform(258.0, 318.0), air_speed=speed))
    which = np.sort(rng.integers(0, len(around), SEGMENTS))
    which[0] = 0
    full = build_field(drawing)
    coolings = [cooling_in(full, each) for each in around[1:]]
    reduced = reduce_field(full, order=26, elsewhere=coolings)
    truth = _Course([], [], [], [])
    state: FloatArray | None = None
    for k in range(SEGMENTS):
        cooling = [reduced.equation.cooling, *coolings][which[k]]
        heat = Load(float(time[k]), partial(_constant, watts[k]), float(coil[k]))
        part = simulate_field(
            replace(reduced.equation, cooling=cooling), [heat], start=state, longest_step=5.0
        )
        state = part.state[-1]
        truth.add(float(time[:k].sum()), part)
    of = np.repeat(np.arange(SEGMENTS), (time / UPDATE_S).astype(int))
    load = CompactLoad(
        watts[of],
        coil[of],
        np.array([around[k].ambient for k in which])[of],
        np.array([around[k].air_speed for k in which])[of],
    )
    found = simulate_compact(compact_model(drawing), load, start_K=drawing.surroundings.ambient)
    at = UPDATE_S * np.arange(1, len(of) + 1)
    late = at - (np.cumsum(time) - time)[of] > LATE_S

    def off(given: FloatArray, expected: FloatArray, when: NDArray[np.bool_]) -> float:
        return float(np.abs(given - np.interp(at, np.concatenate(truth.time), expected))[when].max())

    return CompactScore(
        off(found.fluid, np.concatenate(truth.fluid), at > 0.0),
        off(found.hot[:, 0], np.concatenate(truth.gap), late),
        off(found.hot[:, 1], np.concatenate(truth.coil), late),
    )


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [*odd_bodies(3)[1:], 1])
def test_compact_thermal_model_follows_random_steps(seed: int):
    found = score(seed)
    assert found.fluid < 1.0
    assert found.gap < 1.0
    assert found.coil < 2.5


@pytest.fixture(scope="module")
def model() -> CompactModel:
    return compact_model(read_drawing("paper"))


def even(updates: int, power: float, coil_W: float = 0.0, speed: float = 0.0) -> CompactLoad:
    return CompactLoad(*(np.full(updates, each) for each in (power, coil_W, REFERENCE_K, speed)))


def test_compact_model_conserves_energy(model: CompactModel):
    load = even(2000, 120.0, 12.0, 1.5)
    found = simulate_compact(model, load, start_K=300.0)
    stored = model.capacity[0] * (found.state[-1, 0] - (300.0 - model.reference))
    taken = (load.power + found.coil_W - found.lost_W).sum() * UPDATE_S
    assert stored == pytest.approx(taken, rel=1e-8)
    assert model.capacity[0] == pytest.approx(section_of(read_drawing("paper")).heat_capacity, rel=1e-9)
    assert (model.mechanical[0], model.electrical[0]) == pytest.approx((1.0, 1.0), rel=1e-9)


@pytest.mark.parametrize("step", [0.1, 1e2, 1e5])
def test_compact_model_cools_to_air_temperature(model: CompactModel, step: float):
    found = simulate_compact(model, even(60, 0.0, 0.0, 5.0), start_K=390.0, step=step)
    assert (np.diff(found.fluid) < 5e-3).all()
    assert (found.hot > REFERENCE_K - 0.5).all()
    if step > 10.0:
        assert found.fluid[-1] == pytest.approx(REFERENCE_K, abs=0.5)


def test_compact_model_interpolates_heat_transfer_coefficients(model: CompactModel):
    """Heat-transfer coefficients are exact at the points of the table and within 3 % between them."""
    drawing = read_drawing("paper")
    asked = ((288.15, 2.0, 40.0, 1e-9), (270.0, 1.7, 33.0, 0.03), (310.0, 0.0, 70.0, 0.03))
    for ambient, speed, above, rel in asked:
        around = replace(drawing.surroundings, ambient=ambient, air_speed=speed)
        section = section_of(replace(drawing, surroundings=around))
        kelvin = ambient + above
        for kind, surface in enumerate(section.surfaces):
            convection = float(np.interp(kelvin, section.grid, section.films[surface.law]))
            radiation = surface.emissivity * 5.670374419e-8 * (kelvin**4 - ambient**4) / above
            expected = convection + radiation + surface.mount
            assert model.film_of(kind, kelvin, ambient, speed) == pytest.approx(expected, rel=rel)


def test_compact_sensor_gains_equal_kalman_gains(model: CompactModel):
    """The reference is a Kalman filter in steady state. The unknown heat is modelled as a random walk."""
    found, n = sensor_gains(model), model.states
    power, h = model.capacity[0] * 100.0 / 1800.0, UPDATE_S
    air, kinds = (model.reference, model.air_speed), range(len(model.law))
    films = [model.film_of(kind, model.reference + 60.0, *air) for kind in kinds]
    inner = np.diag(model.conductance) + np.einsum("k,kij->ij", films, model.loss)
    step = np.linalg.inv(np.diag(model.capacity) / h + inner)
    into, forward = np.append(step @ model.mechanical, 0.0), np.eye(n + 1)
    forward[:n, :n], forward[:, n] = step * model.capacity / h, into + np.eye(n + 1)[n]
    noise = np.outer(into, into) * (0.15 * power) ** 2 * 60.0 / h
    noise += np.diag([*(1e-9 * model.capacity[0] / model.capacity), (0.15 * power) ** 2 * h / 1800.0])
    for row, error, gain in ((model.fluid, 0.5, found[0]), (model.coil, 3.0, found[1])):
        sees, heard = np.append(row, 0.0), error**2 * 10.0 / h
        spread, settled = 100.0 * noise, np.zeros(n + 1)
        for _ in range(12_000):
            settled = spread @ sees / (sees @ spread @ sees + heard)
            left = spread - np.outer(settled, sees @ spread)
            spread = forward @ left @ forward.T + noise
        assert gain == pytest.approx(settled, rel=1e-3, abs=1e-6 * np.abs(settled).max())
    assert (found[:, -1] > 0.0).all()


def test_compact_steady_state_agrees_with_finite_elements(model: CompactModel):
    """Six states cannot represent the steady gradients in coil and gap, so outputs also depend on power."""
    found = simulate_compact(model, even(60, 70.0, 15.0), start_K=REFERENCE_K, step=1800.0)
    equation = build_field(read_drawing("paper"), size=0.02).equation
    state = steady_field(equation, Load(1.0, partial(_constant, 70.0), 15.0))
    spots = [
        float((rows @ state).max()) for rows in (equation.spots.gap, equation.spots.coil, equation.spots.seal)
    ]
    whole = [float(equation.fluid @ state), *spots]
    assert [found.fluid[-1], *found.hot[-1]] == pytest.approx(np.array(whole) + REFERENCE_K, abs=0.6)
    coil = model.reference + found.state[-1] @ model.coil
    coil += model.coil_feedthrough @ [70.0, found.coil_W[-1]]
    assert coil == pytest.approx(float(equation.coil @ state) + REFERENCE_K, abs=0.6)


if __name__ == "__main__":
    scores = np.array([tuple(vars(score(seed)).values()) for seed in odd_bodies(int(sys.argv[1]))])
    for name, column in zip(("fluid K", "hot gap K", "hot coil K"), scores.T, strict=True):
        print(f"{name}: median {np.median(column):.3g}, worst {column.max():.3g}")
