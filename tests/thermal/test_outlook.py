"""How sure a heating curve is: intervals that hold on dampers off their drawing, before and after a curve."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from mrdamper.arrays import FloatArray
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.estimation.calibration import CalibratedDrawing, HeatingParameters, calibrate_drawing
from mrdamper.thermal.estimation.measured_curve import HeatingCurve, Place
from mrdamper.thermal.estimation.prediction_interval import predict_interval
from mrdamper.thermal.estimation.uncertainty import ModelUncertainty, PredictionInterval, WatchedPoint
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import Heating, simulate_network
from tests.thermal.astray import perturbed

DRAWING = read_drawing(Path(__file__).parents[2] / "examples" / "paper_damper.toml")
BARE = DRAWING.with_sink(None)
DUTY = read_duty("sine:15mm:1Hz:2A:1800s")
OHM = BARE.coil.resistance


def power(kelvin: FloatArray) -> FloatArray:
    return np.asarray(75.0 - 0.15 * (np.asarray(kelvin) - 293.15))


KELVIN = np.linspace(273.15, 423.15, 11)
WORK = LoopWork(KELVIN, power(KELVIN), np.full(len(KELVIN), 1000.0))


def truth_of(base: DamperDrawing, rng: np.random.Generator) -> Heating:
    drawing, more = perturbed(base, rng)
    load = Load(1800.0, lambda kelvin: more * power(kelvin), 4.0 * OHM)
    return simulate_network(zone_network(drawing), [load], longest_step=10.0)


def measured(
    truth: Heating, rng: np.random.Generator, minutes: float, place: Place = "fluid"
) -> HeatingCurve:
    time = np.arange(0.0, 60.0 * minutes + 0.5, 2.0)
    values = {"fluid": truth.fluid, "wall": truth.wall, "coil": truth.coil}[place]
    seen = PchipInterpolator(truth.time, values)(time) + 0.3 * rng.standard_normal(len(time))
    return HeatingCurve(time, seen, place)


def foretold(base: DamperDrawing, curve: HeatingCurve) -> PredictionInterval:
    calibrated = calibrate_drawing(curve, base, [WORK], DUTY, model_uncertainty=ModelUncertainty())
    return predict_interval([WORK], calibrated.drawing, DUTY, calibrated=calibrated)


@dataclass(frozen=True)
class Score:
    """How good the foretold temperatures after 30 min were."""

    rmse: float  # [K]
    inside: float  # share of the 90 % intervals that hold
    width: float  # of the intervals on the average [K]


def score(base: DamperDrawing, count: int, minutes: float, seed: int, place: Place = "fluid") -> Score:
    rng = np.random.default_rng(seed)
    errors, inside, widths = [], [], []
    for _ in range(count):
        truth = truth_of(base, rng)
        prediction_interval, true = (
            foretold(base, measured(truth, rng, minutes, place)),
            float(truth.fluid[-1]),
        )
        errors.append(prediction_interval.median[-1] - true)
        inside.append(prediction_interval.low[-1] <= true <= prediction_interval.high[-1])
        widths.append(prediction_interval.high[-1] - prediction_interval.low[-1])
    return Score(float(np.sqrt(np.mean(np.square(errors)))), float(np.mean(inside)), float(np.mean(widths)))


@pytest.mark.nightly
def test_before_anything_was_measured_the_interval_holds_on_dampers_off_their_drawing():
    """Of 60 dampers 85 % less two deviations of that count, or more; no wider than twice what is needed."""
    rng = np.random.default_rng(1)
    prediction_interval = predict_interval([WORK], BARE, DUTY)
    ends = np.array([truth_of(BARE, rng).fluid[-1] for _ in range(60)])
    inside = (prediction_interval.low[-1] <= ends) & (ends <= prediction_interval.high[-1])
    assert inside.mean() >= 0.85 - 2.0 * np.sqrt(0.85 * 0.15 / 60.0)
    assert prediction_interval.high[-1] - prediction_interval.low[-1] < 2.0 * (2.0 * 1.645 * ends.std())


def test_the_interval_lies_about_the_curve_and_its_times_about_the_curve_s_time():
    from mrdamper.thermal.temperature_rise import simulate_rise

    hour = read_duty("sine:15mm:1Hz:2A:3600s")
    rise, prediction_interval = (
        simulate_rise([WORK], BARE, hour, model="network", stop_at_limit=False),
        predict_interval([WORK], BARE, hour),
    )
    fluid = np.interp(prediction_interval.time, rise.time, rise.fluid)
    assert (prediction_interval.low <= fluid + 1e-6).all()
    assert (fluid <= prediction_interval.high + 1e-6).all()
    assert prediction_interval.median == pytest.approx(fluid, abs=2.0)
    assert rise.time_to_limit_s is not None
    assert prediction_interval.to_limit.low_s < rise.time_to_limit_s < prediction_interval.to_limit.high_s
    # the times are where the band's edges cross
    crossing = [
        float(np.interp(rise.limit_K, edge, prediction_interval.time))
        for edge in (prediction_interval.high, prediction_interval.low)
    ]
    assert crossing == pytest.approx(
        [prediction_interval.to_limit.low_s, prediction_interval.to_limit.high_s], rel=0.03
    )


@pytest.mark.nightly
def test_more_of_the_curve_narrows_the_interval():
    rng = np.random.default_rng(2)
    truth = truth_of(DRAWING, rng)
    whole = measured(truth, rng, 30.0)
    before = predict_interval([WORK], DRAWING, DUTY)
    widths = [float(before.high[-1] - before.low[-1])]
    for minutes in (3.0, 30.0):
        prediction_interval = foretold(DRAWING, whole.until(60.0 * minutes))
        widths.append(float(prediction_interval.high[-1] - prediction_interval.low[-1]))
    assert widths == sorted(widths, reverse=True)
    assert widths[-1] < 0.5


@pytest.mark.nightly
@pytest.mark.parametrize("base", [BARE, DRAWING], ids=["bare", "fins"])
def test_a_drawn_damper_is_foretold_from_ten_minutes(base):
    """Six dampers off their drawing in every way: 2 K at 30 min, and the intervals hold for most."""
    found = score(base, 6, 10.0, seed=3)
    assert found.rmse < 2.0
    assert found.inside >= 0.5  # 85 % less two and a half deviations of that count


@pytest.mark.release
@pytest.mark.parametrize("base", [BARE, DRAWING], ids=["bare", "fins"])
@pytest.mark.parametrize(("minutes", "most"), [(5.0, 5.0), (10.0, 2.0)])
@pytest.mark.parametrize("place", ["fluid", "wall", "coil"])
def test_a_hundred_drawn_dampers_are_foretold(base, minutes, most, place):
    found = score(base, 100, minutes, seed=4, place=place)
    print(f"{place}, {minutes:.0f} min: {found}")
    assert found.rmse < most
    assert found.inside >= 0.78


@pytest.mark.nightly
def test_a_body_thermometer_tells_less_of_the_fluid_than_one_in_it():
    """After 5 min, of a fluid that gets 20 K warmer than the body by a conductance believed at 30 %."""
    stagnant = replace(BARE, calibration=replace(BARE.calibration, fluid_wall=0.03))
    course = simulate_network(zone_network(stagnant), [Load(1800.0, power, 4.0 * OHM)], longest_step=10.0)
    assert course.fluid[-1] - course.wall[-1] > 20.0
    rng = np.random.default_rng(5)
    places: tuple[Place, ...] = ("wall", "fluid")
    width = {}
    for place in places:
        prediction_interval = foretold(stagnant, measured(course, rng, 5.0, place))
        width[place] = float(
            np.interp(300.0, prediction_interval.time, prediction_interval.high - prediction_interval.low)
        )
    assert width["wall"] > 3.0 * width["fluid"]


def test_a_stated_start_is_sure():
    prediction_interval = predict_interval([WORK], BARE, DUTY, start_K=350.0)
    assert prediction_interval.low[0] == prediction_interval.high[0] == pytest.approx(350.0)


def told(place: Place = "fluid", **spreads: float) -> CalibratedDrawing:
    """Return the bare drawing, calibrated with these deviations: start [K], then logarithms."""
    names = ("start", "capacity", "loss", "fluid_body", "coil")
    deviations = np.array([spreads.get(name, 0.0) for name in names])
    time = np.linspace(0.0, 60.0, 8)
    return CalibratedDrawing(
        BARE,
        HeatingParameters(0.05, 1e-3, 0.0, 0.0, 0.0, 300.0, 310.0, 0.1, 0.1, ()),
        0.0, 0.0, np.diag(deviations**2), HeatingCurve(time, 310.0 + 0.05 * time, place), np.full(8, 310.0),
    )  # fmt: skip


def width(found: PredictionInterval, at: float) -> float:
    return float(np.interp(at, found.time, found.high - found.low))


@pytest.mark.parametrize(("place", "share"), [("fluid", 0.002), ("wall", 0.004), ("coil", 0.004)])
def test_what_no_multiplier_mends_is_a_share_of_the_rise(place: Place, share: float):
    """From the fitted start on; two sides of 1.645 deviations."""
    found = predict_interval([WORK], BARE, DUTY, calibrated=told(place))
    assert found.median[0] == pytest.approx(310.0)
    rise = found.median - 310.0
    assert found.high - found.low == pytest.approx(2.0 * 1.645 * share * rise, rel=0.05, abs=1e-9)


def test_a_fitted_start_is_that_of_all_nodes_and_a_stated_one_leaves_the_rest():
    found = predict_interval([WORK], BARE, DUTY, calibrated=told(start=2.0, capacity=0.05))
    assert width(found, 0.0) == pytest.approx(2.0 * 1.645 * 2.0, rel=0.05)
    stated = predict_interval([WORK], BARE, DUTY, calibrated=told(start=2.0, capacity=0.05), start_K=330.0)
    assert (stated.low[0], stated.high[0]) == pytest.approx((330.0, 330.0))
    # capacity by 5 %: of the first minutes' rise as much
    early = predict_interval([WORK], BARE, DUTY, calibrated=told(capacity=0.05))
    gained = float(np.interp(120.0, early.time, early.median)) - 310.0
    assert width(early, 120.0) == pytest.approx(2.0 * 1.645 * gained * np.hypot(0.05, 0.002), rel=0.15)


@pytest.mark.parametrize(("name", "late"), [("loss", True), ("capacity", False), ("fluid_body", False)])
def test_each_deviation_of_a_fit_is_that_of_its_own_factor(name, late):
    """Losses grow with time, the capacity matters first, the way to the wall from the start on."""
    found = predict_interval([WORK], BARE, DUTY, calibrated=told("fluid", **{name: 0.2}))
    own = [
        width(found, seconds) / (np.interp(seconds, found.time, found.median) - 310.0)
        for seconds in (60.0, 1800.0)
    ]
    assert (own[1] > own[0]) == late
    assert max(own) > 0.02


def test_a_watched_point_is_as_far_above_its_nodes_as_it_was():
    """Between the times given along straight lines, beyond them as at the ends."""
    point = WatchedPoint(np.array([0.25, 0.75]), 400.0, np.array([10.0, 20.0]), np.array([2.0, 6.0]))
    nodes = np.array([[[300.0, 304.0]], [[301.0, 305.0]], [[310.0, 310.0]]])
    found = point.temperature(np.array([0.0, 15.0, 99.0]), nodes)
    assert found[:, 0] == pytest.approx([305.0, 308.0, 316.0])
