"""The velocity of each motion is the derivative of its displacement, and its extremes have known values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.excitation import (
    MOTIONS,
    Chirp,
    CurrentSteps,
    Harmonics,
    RandomCurrent,
    RandomMotion,
    Road,
    Sine,
    Triangle,
    motion_from_text,
)

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
def test_velocity_is_derivative_of_displacement(motion, t):
    """Central differences with steps of 1 % of the shortest period agree within their own error."""
    fastest = 2 * np.pi * 80.0  # The frequency of a chirp also changes after its duration.
    h = 0.01 / fastest
    slope = (motion.displacement(t + h) - motion.displacement(t - h)) / (2 * h)
    bend = (motion.velocity(t + h) - motion.velocity(t - h)) / (2 * h)
    size = 0.2
    assert motion.velocity(t) == pytest.approx(slope, abs=size * fastest**3 * h**2)
    assert motion.acceleration(t) == pytest.approx(bend, abs=size * fastest**4 * h**2)


@given(amplitude=amplitudes, frequency=frequencies, t=st.floats(0.0, 10.0))
def test_sine_conserves_oscillator_energy(amplitude, frequency, t):
    sine = Sine(amplitude, frequency)
    omega = 2 * np.pi * frequency
    energy = sine.velocity(t) ** 2 + (omega * sine.displacement(t)) ** 2
    assert energy == pytest.approx((omega * amplitude) ** 2, rel=1e-9)
    assert sine.acceleration(t) == pytest.approx(-(omega**2) * sine.displacement(t), abs=1e-12)


def test_chirp_reaches_first_and_last_frequency():
    """The mean frequency of 8.025 Hz during 10 s gives 80.25 cycles."""
    chirp = Chirp(0.002, 1.0, 15.05, 10.0)
    t = np.linspace(0.0, 10.0, 200_001)
    x = chirp.displacement(t)
    upward = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    assert len(upward) == 80
    last_period = t[upward[-1]] - t[upward[-2]]
    assert 1.0 / last_period == pytest.approx(15.0, rel=0.01)


@given(amplitude=st.floats(1e-3, 0.1), speed=st.floats(1e-3, 1.0), t=st.floats(0.0, 50.0))
def test_triangle_keeps_speed_and_bounds(amplitude, speed, t):
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


# ------------------------------------------------------------------------------------- named motions


@pytest.mark.parametrize(
    ("name", "amplitude", "speed"),
    [
        ("sine5mm1Hz", 5e-3, 2 * np.pi * 5e-3),
        ("sine3mm2Hz", 3e-3, 2 * np.pi * 6e-3),
        ("sine15mm1Hz", 15e-3, 2 * np.pi * 15e-3),
        ("chirp3mm", 3e-3, 2 * np.pi * 24e-3),
        ("steps", 12e-3, 30e-3),
    ],
)
def test_named_motion_has_known_amplitude_and_speed(name, amplitude, speed):
    t = np.linspace(0.0, 8.0, 80_001)
    assert np.abs(MOTIONS[name].displacement(t)).max() == pytest.approx(amplitude, rel=1e-3)
    assert np.abs(MOTIONS[name].velocity(t)).max() == pytest.approx(speed, rel=2e-3)


def test_nonperiodic_motion_never_repeats():
    """The motion does not repeat after any time from 1 to 60 s because its tones have no common period."""
    t = np.arange(0.0, 120.0, 0.01)
    x = MOTIONS["nonperiodic"].displacement(t)
    echoes = [np.corrcoef(x[:-shift], x[shift:])[0, 1] for shift in range(100, 6000, 5)]
    assert max(echoes) < 0.95


@pytest.mark.parametrize(
    ("text", "motion"),
    [
        ("chirp3mm", Chirp(3e-3, 0.5, 8.0, 8.0)),
        ("sine:5mm:1Hz", Sine(5e-3, 1.0)),
        ("sine:0.2in:1.5Hz", Sine(0.2 * 0.0254, 1.5)),
        ("triangle:12mm:30mm/s", Triangle(12e-3, 30e-3)),
        ("chirp:3mm:0.5-8Hz:8s", Chirp(3e-3, 0.5, 8.0, 8.0)),
        ("chirp:3mm:8Hz-0.5Hz:8s", Chirp(3e-3, 8.0, 0.5, 8.0)),
        ("road:C:20m/s:5", Road("C", 20.0, 5)),
    ],
)
def test_motion_is_parsed_from_text(text, motion):
    read = motion_from_text(text)
    assert type(read) is type(motion)
    t = np.linspace(0.0, 3.0, 50)
    assert read.displacement(t) == pytest.approx(motion.displacement(t), rel=1e-12, abs=1e-15)


# ------------------------------------------------------------------------------------------- current steps


def test_current_stays_constant_between_steps():
    steps = CurrentSteps((0.5, 2.0, 1.0), hold=0.8)
    assert steps.current([-5.0, 0.0, 0.79, 0.8, 1.59, 1.6, 99.0]).tolist() == [0.5, 0.5, 0.5, 2, 2, 1, 1]
    assert steps.duration == pytest.approx(2.4)
    assert steps.switches == pytest.approx([0.8, 1.6])


@given(samples=st.integers(1, 400), rate=st.sampled_from([500.0, 1000.0, 10_000.0]), count=st.integers(1, 30))
def test_sample_at_current_step_has_new_current(samples, rate, count):
    """Currents last for a whole number of samples. Rounding errors of time do not change the current."""
    steps = CurrentSteps(tuple(range(count)), hold=samples / rate)
    expected = np.repeat(np.arange(count), samples)
    assert np.array_equal(steps.current(np.arange(count * samples) / rate), expected)


# ----------------------------------------------------------------------------------- roads and random signals


@pytest.mark.system
def test_road_profile_has_spectrum_of_its_class():
    """At high wavenumbers, the power in each octave agrees with the spectrum Gd(n0) (n / n0)^-2."""
    from scipy.signal import periodogram

    road = Road("C", speed=20.0, seed=5)
    rate = 250.0
    t = np.arange(0.0, 400.0, 1.0 / rate)
    frequency, density = periodogram(road.displacement(t), rate, window="hann")
    wavenumber = frequency / 20.0
    for low in (0.05, 0.1, 0.2, 0.4, 0.8):
        band = (wavenumber >= low) & (wavenumber < 2 * low)
        power = density[band].sum() * frequency[1]
        stated = 256e-6 * 0.1**2 * (1.0 / low - 0.5 / low)
        corner = 1.0 / (1.0 + (0.01 / low) ** 2)
        assert power == pytest.approx(stated * corner, rel=0.06), low


def test_random_motion_has_specified_standard_deviation():
    t = np.arange(0.0, 400.0, 0.02)
    motion = RandomMotion(6e-3, 0.5, 4.0, 3)
    assert np.std(motion.displacement(t)) == pytest.approx(2e-3, rel=0.03)
    velocities = 2 * np.pi * np.multiply(motion.tones.amplitudes, motion.tones.frequencies)
    assert velocities == pytest.approx(velocities[0], rel=1e-12)
    assert motion_from_text("random:6mm:0.5-4Hz:3") == motion
    assert not np.allclose(RandomMotion(6e-3, 0.5, 4.0, 4).displacement(t), motion.displacement(t))


def test_random_current_is_independent_of_duration():
    random = RandomCurrent(highest=5.0, shortest=0.02, longest=0.3, seed=4)
    t = np.arange(-0.5, 400.0, 1e-3)
    current = random.current(t)
    changes = np.flatnonzero(np.diff(current)) * 1e-3
    # Zero or the highest current may occur twice in succession, which hides one change.
    assert np.diff(changes).min() >= 0.02 - 1.5e-3
    assert np.median(np.diff(changes)) == pytest.approx(np.sqrt(0.02 * 0.3), rel=0.1)
    assert np.all(current[t <= 0.0] == current[0])
    assert (current.min(), current.max()) == (0.0, 5.0)
    assert np.mean(current) == pytest.approx(2.5, abs=0.2)
    assert np.array_equal(random.current(t[:3000]), current[:3000])
    assert not np.array_equal(RandomCurrent(5.0, 0.02, 0.3, 5).current(t), current)
