"""The force map equals the force of the hysteresis law at mid-stroke, for rising and falling velocity."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.codegen.table import force_map
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate
from tests.export.exports import ENVELOPE, card_of
from tests.support.cards import DAMPERS, DOUBLE

AMPLITUDE, FASTEST = 0.012, 0.08


@pytest.fixture(scope="module")
def made():
    return force_map(card_of(DAMPERS["bouc-wen"]))


def rows_of(text):
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return list(csv.DictReader(io.StringIO("\n".join(lines))))


def sine(damper, speed, command, kelvin, *, samples=20_000, periods=4):
    """Return velocity and force in the last period of a sine motion at constant command."""
    omega = speed / AMPLITUDE
    t = np.arange(samples * periods + 1) * (2.0 * math.pi / omega / samples)
    flat = np.ones_like(t)
    path = Trajectory(
        float(t[1]),
        AMPLITUDE * np.sin(omega * t),
        speed * np.cos(omega * t),
        -speed * omega * np.sin(omega * t),
        command * flat,
        temperature=kelvin * flat,
    )
    force = simulate(damper, path)
    return path.velocity[-samples - 1 :], force[-samples - 1 :]


@pytest.mark.system
@pytest.mark.parametrize(("i", "j", "k"), [(0, 0, -1), (2, 4, 3), (5, 8, 15), (3, 1, 20)])
def test_force_map_equals_force_at_mid_stroke(made, i, j, k):
    speed = float(made.velocity[k])
    v, force = sine(DAMPERS["bouc-wen"], abs(speed), float(made.command[j]), float(made.temperature[i]))
    assert made.pick[i, j, k] == pytest.approx(force[int(np.argmax(v * math.copysign(1.0, speed)))], abs=0.05)


@pytest.mark.parametrize(("i", "j"), [(0, 0), (5, 8)])
def test_branches_of_force_map_equal_loop_of_sine(made, i, j):
    v, force = sine(DAMPERS["bouc-wen"], FASTEST, float(made.command[j]), float(made.temperature[i]))
    half = len(v) // 2
    downwards, upwards = slice(0, half + 1), slice(half, None)
    peak = np.abs(force).max()
    for part, branch in ((upwards, made.rising), (downwards, made.falling)):
        order = np.argsort(v[part])
        expected = np.interp(made.velocity, v[part][order], force[part][order])
        assert np.abs(branch[i, j] - expected).max() < 2e-3 * peak


def test_branches_of_force_map_meet_at_largest_velocity(made):
    assert np.allclose(made.rising[..., -1], made.falling[..., -1], rtol=1e-6)
    assert np.allclose(made.rising[..., 0], made.falling[..., 0], rtol=1e-6)
    inside = slice(6, -6)
    assert (made.falling[..., inside] - made.rising[..., inside]).max() > 100.0


def test_force_map_without_hysteresis_has_equal_branches():
    """The force of Bingham's law without stiffness, mass and friction depends only on velocity."""
    forms: dict[str, ParameterLaw] = {
        "viscosity": Constant(1500.0),
        "yield_force": Polynomial((50.0, 300.0)),
        "yield_velocity": Constant(2e-3),
    }
    made = force_map(card_of(Damper(LAWS["bingham"], forms)))
    exact = 1500.0 * made.velocity + (50.0 + 300.0 * made.command[:, None]) * np.tanh(made.velocity / 2e-3)
    assert np.allclose(made.pick[0], exact, atol=1e-6)
    # Values between the samples of the loop are interpolated.
    assert np.allclose(made.rising[0], exact, atol=0.5)
    assert np.allclose(made.falling[0], made.rising[0], atol=1e-6)
    assert made.temperature.tolist() == [293.15]


def test_force_in_map_varies_with_current_and_temperature(made):
    fast = made.pick[..., -1]
    assert (np.diff(fast, axis=1) > 0.0).all()
    assert (np.diff(fast, axis=0) < 0.0).all()


def test_force_map_file_contains_every_point(made):
    text = made.as_csv()
    said = [line for line in text.splitlines() if line.startswith("#")]
    assert text.startswith("# Force map of a magnetorheological damper")
    assert any("fingerprint sha256:" in line for line in said)
    assert any("peak velocity 0.08 m/s" in line for line in said)
    rows = rows_of(text)
    assert list(rows[0]) == [
        "temperature_degC", "current_A", "velocity_m_s", "force_N", "force_rising_N", "force_falling_N",
    ]  # fmt: skip
    shape = made.pick.shape
    assert len(rows) == math.prod(shape)
    force = np.array([float(row["force_N"]) for row in rows]).reshape(shape)
    assert np.allclose(force, made.pick, rtol=1e-8)
    assert sorted({float(row["temperature_degC"]) for row in rows}) == [20.0, 40.0, 60.0, 80.0, 100.0, 120.0]
    speeds = [float(row["velocity_m_s"]) for row in rows[: shape[2]]]
    assert speeds == sorted(speeds)
    assert speeds == [-speed for speed in reversed(speeds)]
    assert text == made.as_csv()


@pytest.mark.system
def test_force_map_command_may_be_voltage():
    card = card_of(replace(DOUBLE, command_unit="V"))
    assert "voltage_V" in force_map(card).as_csv()


def test_law_without_realtime_model_has_force_map():
    forms: dict[str, ParameterLaw] = {
        "yield_force": Polynomial((50.0, 300.0)),
        "slope": Constant(300.0),
        "shift": Constant(0.0),
    }
    made = force_map(card_of(Damper(LAWS["tanh"], forms)))
    assert made.pick[0, -1, -1] == pytest.approx(650.0, rel=1e-6)


def test_force_map_rejects_card_without_motion():
    still = OperatingEnvelope(ENVELOPE.command, (0.0, 0.0), (0.0, 0.0), ENVELOPE.temperature)
    with pytest.raises(InputError, match=r"the card's data cover 0 m and 0 m/s; expected a motion"):
        force_map(replace(card_of(DOUBLE), envelope=still))
