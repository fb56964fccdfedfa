"""Motions against calculus: each velocity is the slope of its displacement, and known extremes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.excitation import Chirp, Harmonics, Sine, Trajectory, Triangle, drive

amplitudes = st.floats(1e-4, 0.1)
frequencies = st.floats(0.05, 20.0)
motions = st.one_of(
    st.builds(Sine, amplitudes, frequencies),
    st.builds(Chirp, amplitudes, frequencies, frequencies, st.floats(1.0, 60.0)),
    st.builds(
        lambda a, b, f, g, p: Harmonics((a, b), (f, g), (0.0, p)),
        amplitudes,
        amplitudes,
        frequencies,
        frequencies,
        st.floats(0.0, 6.3),
    ),
)


@given(motion=motions, t=st.floats(0.0, 10.0))
def test_velocity_and_acceleration_are_the_slopes(motion, t):
    """Central differences over a hundredth of the fastest period, to their second-order error."""
    fastest = 2 * np.pi * 80.0  # a chirp runs on beyond its end
    h = 0.01 / fastest
    slope = (motion.displacement(t + h) - motion.displacement(t - h)) / (2 * h)
    bend = (motion.velocity(t + h) - motion.velocity(t - h)) / (2 * h)
    size = 0.2
    assert motion.velocity(t) == pytest.approx(slope, abs=size * fastest**3 * h**2)
    assert motion.acceleration(t) == pytest.approx(bend, abs=size * fastest**4 * h**2)


@given(amplitude=amplitudes, frequency=frequencies, t=st.floats(0.0, 10.0))
def test_a_sine_is_a_harmonic_oscillator(amplitude, frequency, t):
    sine = Sine(amplitude, frequency)
    omega = 2 * np.pi * frequency
    energy = sine.velocity(t) ** 2 + (omega * sine.displacement(t)) ** 2
    assert energy == pytest.approx((omega * amplitude) ** 2, rel=1e-9)
    assert sine.acceleration(t) == pytest.approx(-(omega**2) * sine.displacement(t), abs=1e-12)


def test_a_chirp_passes_through_its_frequencies():
    """The phase advances by the mean of both frequencies times the duration: here 80.25 turns."""
    chirp = Chirp(0.002, 1.0, 15.05, 10.0)
    t = np.linspace(0.0, 10.0, 200_001)
    x = chirp.displacement(t)
    upward = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    assert len(upward) == 80
    last_period = t[upward[-1]] - t[upward[-2]]
    assert 1.0 / last_period == pytest.approx(15.0, rel=0.01)


def test_one_harmonic_is_a_sine():
    t = np.linspace(0.0, 3.0, 50)
    sine, sum_of_one = Sine(0.01, 2.0), Harmonics((0.01,), (2.0,), (0.0,))
    for part in ("displacement", "velocity", "acceleration"):
        assert getattr(sum_of_one, part)(t) == pytest.approx(getattr(sine, part)(t))


@given(amplitude=st.floats(1e-3, 0.1), speed=st.floats(1e-3, 1.0), t=st.floats(0.0, 50.0))
def test_a_triangle_keeps_its_speed_and_its_bounds(amplitude, speed, t):
    triangle = Triangle(amplitude, speed)
    assert abs(triangle.velocity(t)) == speed
    assert abs(triangle.displacement(t)) <= amplitude * (1 + 1e-12)
    period = 4 * amplitude / speed
    assert triangle.displacement(t + period) == pytest.approx(
        triangle.displacement(t), abs=1e-9 * amplitude * 1e3
    )
    assert triangle.displacement(0.0) == 0.0
    assert triangle.displacement(period / 4) == pytest.approx(amplitude)
    assert triangle.displacement(3 * period / 4) == pytest.approx(-amplitude)


def test_driving_includes_both_ends():
    path = drive(Sine(0.01, 1.0), duration=2.0, rate_Hz=100.0, command=0.5, temperature=300.0)
    assert len(path) == 201
    assert path.time[-1] == pytest.approx(2.0)
    assert path.rate_Hz == pytest.approx(100.0)
    assert set(path.command) == {0.5}
    assert path.temperature is not None
    assert set(path.temperature) == {300.0}


def test_a_command_may_vary_sample_by_sample():
    given_command = np.linspace(0.0, 1.0, 101)
    path = drive(Sine(0.01, 1.0), duration=1.0, rate_Hz=100.0, command=given_command)
    assert np.array_equal(path.command, given_command)
    with pytest.raises(InputError, match="command has shape \\(5,\\); expected one number or 101"):
        drive(Sine(0.01, 1.0), duration=1.0, rate_Hz=100.0, command=np.zeros(5))


def _trajectory(**changed):
    arrays = {name: np.zeros(8) for name in ("displacement", "velocity", "acceleration", "command")}
    return Trajectory(**{"step": 0.001, **arrays, **changed})


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"step": 0.0}, "step is 0.0 s; expected a positive"),
        ({"step": float("nan")}, "step is nan s"),
        ({"dead_band": -1e-6}, "dead band is -1e-06 m"),
        ({"velocity": np.zeros(7)}, r"velocity has shape \(7,\) and displacement \(8,\)"),
        ({"command": np.array([0.0] * 7 + [np.nan])}, "command is nan at sample 7"),
        ({"temperature": np.zeros((8, 1))}, r"temperature has shape \(8, 1\)"),
    ],
)
def test_a_trajectory_that_cannot_be_driven_is_refused(changed, message):
    with pytest.raises(InputError, match=message):
        _trajectory(**changed)


def test_a_trajectory_never_changes():
    moved = np.arange(8.0)
    path = _trajectory(displacement=moved)
    moved[0] = 99.0
    assert path.displacement[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        path.displacement[0] = 1.0


@pytest.mark.parametrize(
    "build",
    [
        lambda: Sine(0.0, 1.0),
        lambda: Sine(0.01, float("nan")),
        lambda: Chirp(0.01, 1.0, -2.0, 10.0),
        lambda: Triangle(0.01, float("inf")),
        lambda: Harmonics((0.01,), (1.0, 2.0), (0.0,)),
        lambda: Harmonics((), (), ()),
        lambda: drive(Sine(0.01, 1.0), duration=-1.0, rate_Hz=100.0, command=0.0),
    ],
)
def test_motions_without_sense_are_refused(build):
    with pytest.raises(InputError):
        build()
