"""Intervals of a heating curve contain the temperatures of perturbed dampers, also after calibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from mrdamper.arrays import FloatArray
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.estimation.calibration import PRIOR, calibrate_drawing
from mrdamper.thermal.estimation.interval import PredictionInterval, predict_interval, rise_factors
from mrdamper.thermal.estimation.measured_curve import HeatingCurve, Place
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import Heating, simulate_network
from mrdamper.thermal.temperature_rise import Rise, simulate_rise
from tests.thermal.astray import perturbed

DRAWING = read_drawing("paper")
BARE = DRAWING.with_sink(None)
DUTY = read_duty("sine:15mm:1Hz:2A:1800s")
OHM = BARE.coil.resistance


def power(kelvin: FloatArray) -> FloatArray:
    return np.asarray(75.0 - 0.15 * (np.asarray(kelvin) - 293.15))


KELVIN = np.linspace(273.15, 423.15, 11)
WORK = LoopWork(KELVIN, power(KELVIN), np.full(len(KELVIN), 1000.0))


def rise_of(drawing: DamperDrawing, start_K: float | None = None, duty: str = DUTY.text) -> Rise:
    return simulate_rise(
        [WORK], drawing, read_duty(duty), model="network", start_K=start_K, stop_at_limit=False
    )


def truth_of(base: DamperDrawing, rng: np.random.Generator) -> Heating:
    network, more = perturbed(base, rng)
    load = Load(1800.0, lambda kelvin: more * power(kelvin), 4.0 * OHM)
    return simulate_network(network, [load], longest_step=10.0)


def predicted(
    base: DamperDrawing, truth: Heating, rng: np.random.Generator, minutes: float, place: Place = "fluid"
) -> PredictionInterval:
    time = np.arange(0.0, 60.0 * minutes + 0.5, 2.0)
    seen = PchipInterpolator(truth.time, getattr(truth, place))(time) + 0.3 * rng.standard_normal(len(time))
    found = calibrate_drawing(HeatingCurve(time, seen, place), base, [WORK], DUTY)
    return predict_interval(
        [WORK], found.drawing, DUTY, rise_of(found.drawing, found.start_K), calibrated=found
    )


@dataclass(frozen=True)
class Score:
    """Error, coverage and width of predicted temperatures after 30 min."""

    rmse: float  # RMS error [K]
    inside: float  # Fraction of the 90 % intervals that contain the temperature
    width: float  # Mean width [K]


def score(base: DamperDrawing, count: int, minutes: float, seed: int, place: Place = "fluid") -> Score:
    rng = np.random.default_rng(seed)
    errors, inside, widths = [], [], []
    for _ in range(count):
        truth = truth_of(base, rng)
        found, true = predicted(base, truth, rng, minutes, place), float(truth.fluid[-1])
        errors.append(found.median[-1] - true)
        inside.append(found.low[-1] <= true <= found.high[-1])
        widths.append(found.high[-1] - found.low[-1])
    return Score(float(np.sqrt(np.mean(np.square(errors)))), float(np.mean(inside)), float(np.mean(widths)))


@pytest.mark.nightly
def test_uncalibrated_temperature_interval_covers_perturbed_dampers():
    """At least 85 % of 60 dampers are inside the interval, minus two standard deviations of this fraction.

    The interval is at most twice as wide as the scatter of the dampers requires.
    """
    rng = np.random.default_rng(1)
    found = predict_interval([WORK], BARE, DUTY, rise_of(BARE))
    ends = np.array([truth_of(BARE, rng).fluid[-1] for _ in range(60)])
    inside = (found.low[-1] <= ends) & (ends <= found.high[-1])
    assert inside.mean() >= 0.85 - 2.0 * np.sqrt(0.85 * 0.15 / 60.0)
    assert found.high[-1] - found.low[-1] < 2.0 * (2.0 * 1.645 * ends.std())


def test_heating_interval_contains_rise_and_limit():
    rise = rise_of(BARE, duty="sine:15mm:1Hz:2A:3600s")
    found = predict_interval([WORK], BARE, read_duty("sine:15mm:1Hz:2A:3600s"), rise)
    fluid = np.interp(found.time, rise.time, rise.fluid)
    assert (found.low <= fluid + 1e-6).all()
    assert (fluid <= found.high + 1e-6).all()
    assert found.median == pytest.approx(fluid, abs=1e-6)
    assert rise.time_to_limit_s is not None
    assert found.to_limit.low_s < rise.time_to_limit_s < found.to_limit.high_s
    assert len(found.to_limits) == len(rise.limits)


def test_heating_interval_continues_after_fluid_limit():
    """The interval of the time to the limit is the same if the curve stops at the fluid limit."""
    hour = read_duty("sine:15mm:1Hz:2A:3600s")
    stopped = simulate_rise([WORK], BARE, hour, model="network")
    whole = predict_interval([WORK], BARE, hour, rise_of(BARE, duty=hour.text))
    found = predict_interval([WORK], BARE, hour, stopped)
    assert stopped.time[-1] < 3600.0
    assert found.to_limit.low_s == pytest.approx(whole.to_limit.low_s, rel=0.02)
    assert found.to_limit.high_s == pytest.approx(whole.to_limit.high_s, rel=0.05)


@pytest.mark.nightly
@pytest.mark.parametrize("base", [BARE, DRAWING], ids=["bare", "fins"])
def test_ten_minutes_predict_temperature_of_perturbed_dampers(base):
    """With 10 min of data, the RMS error after 30 min is below 2 K, and most intervals are correct."""
    found = score(base, 6, 10.0, seed=3)
    assert found.rmse < 2.0
    assert found.inside >= 0.5  # The limit is 85 % minus 2.5 standard deviations of this fraction.


@pytest.mark.release
@pytest.mark.parametrize("base", [BARE, DRAWING], ids=["bare", "fins"])
@pytest.mark.parametrize(("minutes", "most"), [(5.0, 5.0), (10.0, 2.0)])
@pytest.mark.parametrize("place", ["fluid", "wall", "coil"])
def test_temperatures_of_perturbed_dampers_are_predicted(base, minutes, most, place):
    found = score(base, 100, minutes, seed=4, place=place)
    print(f"{place}, {minutes:.0f} min: {found}")
    assert found.rmse < most
    assert found.inside >= 0.78


def test_early_heating_interval_depends_on_power_and_capacity():
    """At first, only the deviations of power and heat capacity matter, and their squares add."""
    found = predict_interval([WORK], BARE, DUTY, rise_of(BARE))
    gained = np.interp(60.0, found.time, found.median) - found.median[0]
    width = np.interp(60.0, found.time, found.high - found.low)
    assert width / gained == pytest.approx(2.0 * 1.645 * np.hypot(PRIOR.power, PRIOR.capacity), rel=0.35)


def test_quick_heating_interval_matches_full_interval():
    """The quick interval is the temperature rise times two factors. Its limits agree within 2 %."""
    load = Load(1800.0, power, 4.0 * OHM)
    ((low, high),) = rise_factors(BARE, load, np.array([1800.0]))
    found = predict_interval([WORK], BARE, DUTY, rise_of(BARE))
    ends = (np.array([found.low[-1], found.high[-1]]) - 293.15) / (found.median[-1] - 293.15)
    assert [low, high] == pytest.approx(ends, rel=0.02)
