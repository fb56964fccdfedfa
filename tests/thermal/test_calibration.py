"""Calibration with a measured heating curve recovers known factors and rejects unsuitable curves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from mrdamper.errors import ConvergenceError, InputError
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import Calibration, DamperDrawing
from mrdamper.thermal.drawing_file import calibrated_text, drawing_of, read_drawing
from mrdamper.thermal.duty import Duty, read_duty
from mrdamper.thermal.estimation.calibration import calibrate_drawing, residual_variance
from mrdamper.thermal.estimation.measured_curve import HeatingCurve, Place, clean_curve, read_curve
from mrdamper.thermal.temperature_rise import Model, Rise, simulate_rise
from tests.support.tiers import one_by_day

DRAWING = read_drawing("paper")
BARE = DRAWING.with_sink(None)
AMBIENT = 293.15
DUTY = read_duty("sine:15mm:1Hz:2A:1800s")
KELVIN = np.linspace(273.15, 423.15, 6)


def work(scale: float = 1.0) -> LoopWork:
    return LoopWork(KELVIN, scale * (75.0 - 0.15 * (KELVIN - AMBIENT)), np.full(6, 1000.0))


def heated(
    drawing: DamperDrawing,
    *,
    scale: float = 1.0,
    start: float = AMBIENT,
    duty: Duty = DUTY,
    model: Model = "network",
) -> Rise:
    return simulate_rise(
        [work(scale)], drawing, duty, model=model, start_K=start, stop_at_limit=False, longest_step=10.0
    )


def measured(
    rise: Rise, seed: int, *, noise: float = 0.0, place: Place = "fluid", until: float = 1800.0
) -> HeatingCurve:
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0.0, until, 300))
    seen = PchipInterpolator(rise.time, getattr(rise, place))(time) + noise * rng.standard_normal(300)
    return HeatingCurve(time, seen, place)


@pytest.mark.parametrize("place", one_by_day(["fluid", "wall", "coil"]))
def test_calibration_recovers_factors_within_errors(place: Place):
    truth = replace(BARE, calibration=Calibration(heat_capacity=1.15, film=1.05))
    curve = measured(heated(truth, start=297.0), 1, noise=0.3, place=place)
    found = calibrate_drawing(curve, BARE, [work()], DUTY)
    assert found.heat_capacity == pytest.approx(1.15, abs=3.0 * found.heat_capacity_error)
    assert found.film == pytest.approx(1.05, abs=3.0 * found.film_error)
    assert found.start_K == pytest.approx(297.0, abs=0.3)
    assert found.heat_capacity_error < 0.01
    assert found.residual_K == pytest.approx(0.3, rel=0.2)


def test_calibration_with_exact_curve_is_exact():
    truth = replace(BARE, calibration=Calibration(heat_capacity=1.15, film=1.05))
    found = calibrate_drawing(measured(heated(truth), 1), BARE, [work()], DUTY)
    assert found.heat_capacity == pytest.approx(1.15, rel=5e-4)
    assert found.film == pytest.approx(1.05, rel=2e-3)


@pytest.mark.nightly
def test_calibration_errors_match_repeated_fits():
    """The scatter of 60 fits has a standard error of 9 %. The limit is three times this error."""
    rise = heated(BARE)
    fits = [calibrate_drawing(measured(rise, seed, noise=0.3), BARE, [work()], DUTY) for seed in range(60)]
    found = np.array([[each.heat_capacity, each.film] for each in fits])
    errors = np.array([[each.heat_capacity_error, each.film_error] for each in fits])
    truth = [BARE.calibration.heat_capacity, BARE.calibration.film]
    assert ((found - truth) / errors).std(axis=0) == pytest.approx(1.0, abs=0.3)
    stated = np.mean([each.correlation for each in fits])
    assert np.corrcoef(found.T)[0, 1] == pytest.approx(stated, abs=0.1)


@pytest.mark.nightly
def test_calibration_recovers_factors_of_reduced_model():
    """The curve and the calibration use the reduced finite-element model."""
    own = BARE.calibration
    truth = replace(
        BARE, calibration=replace(own, heat_capacity=1.1 * own.heat_capacity, film=0.9 * own.film)
    )
    curve = measured(heated(truth, model="reduced"), 2)
    found = calibrate_drawing(curve, BARE, [work()], DUTY, model="reduced")
    assert found.heat_capacity == pytest.approx(truth.calibration.heat_capacity, rel=5e-3)
    assert found.film == pytest.approx(truth.calibration.film, rel=2e-2)
    again = heated(found.drawing, start=found.start_K, model="reduced")
    shown = np.interp(curve.time, again.time, again.fluid)
    assert shown == pytest.approx(curve.temperature, abs=0.1)


def test_calibrated_geometry_predicts_other_load_cycle():
    """Calibration with 15 min of heating predicts an hour at half the power within 1 K."""
    assert DRAWING.sink is not None
    finned = replace(DRAWING.sink, film_multiplier=1.3)
    truth = replace(DRAWING, calibration=Calibration(heat_capacity=1.2, film=0.7), sink=finned)
    curve = measured(heated(truth), 3, noise=0.2, until=900.0)
    found = calibrate_drawing(curve, DRAWING, [work()], DUTY)
    hour = read_duty("sine:15mm:1Hz:1A:3600s")
    ends = [heated(each, scale=0.5, duty=hour).fluid[-1] for each in (found.drawing, DRAWING, truth)]
    assert abs(ends[0] - ends[2]) < 1.0
    assert abs(ends[1] - ends[2]) > 3.0


@pytest.mark.system
def test_power_error_scales_capacity_and_losses():
    """If the power of the card is 10 % higher, calibration gives 10 % more heat capacity and losses."""
    around = replace(BARE.surroundings, emissivity=0.0, mount=0.0)
    alone = replace(BARE, surroundings=around, coil=replace(BARE.coil, resistance=0.0))
    curve = measured(heated(alone, scale=0.9), 4, noise=0.1)
    once, more = (calibrate_drawing(curve, alone, [work(s)], DUTY, model="lumped") for s in (0.9, 0.99))
    assert more.heat_capacity == pytest.approx(1.1 * once.heat_capacity, rel=2e-3)
    assert more.film == pytest.approx(1.1 * once.film, rel=5e-3)
    assert more.fitted_K == pytest.approx(once.fitted_K, abs=0.02)


def test_short_heating_curve_keeps_prior_heat_losses():
    """A curve of one minute hardly depends on the heat losses, so calibration keeps their prior value."""
    curve = measured(heated(BARE, scale=1.2), 2, noise=0.3, until=60.0)
    found = calibrate_drawing(curve, BARE, [work()], DUTY)
    assert found.film == pytest.approx(BARE.calibration.film, rel=0.15)


@pytest.mark.system
def test_calibrated_geometry_file_is_read_back():
    path = Path(__file__).parents[2] / "examples" / "paper_damper.toml"
    curve = measured(heated(DRAWING, scale=1.1), 6, noise=0.2, until=600.0)
    found = calibrate_drawing(curve, DRAWING, [work()], DUTY)
    text = calibrated_text(path.read_text(encoding="utf-8"), found.entries, "the paper's, calibrated")
    read = drawing_of(text, DRAWING.name)
    assert read.sink is not None
    assert found.drawing.sink is not None
    assert read.calibration.heat_capacity == pytest.approx(found.heat_capacity, rel=1e-5)
    assert read.calibration.film == pytest.approx(found.film, rel=1e-5)
    assert read.sink.film_multiplier == pytest.approx(found.drawing.sink.film_multiplier, rel=1e-5)


def test_residual_variance_includes_autocorrelation():
    """The mean of a series with neighbour correlation r has (1 + r) / (1 - r) times the variance."""
    rng, r = np.random.default_rng(5), 0.6
    kicks, series = np.sqrt(1.0 - r**2) * rng.standard_normal(40_000), np.zeros(40_000)
    for k in range(1, len(series)):
        series[k] = r * series[k - 1] + kicks[k]
    assert residual_variance(series, 3) == pytest.approx((1.0 + r) / (1.0 - r), rel=0.05)
    assert residual_variance(rng.standard_normal(40_000), 3) == pytest.approx(1.0, rel=0.05)


@pytest.mark.system
@pytest.mark.parametrize(
    "course",
    [
        lambda t: 20.0 + 30.0 * (np.arange(len(t)) % 2),  # Loose contact
        lambda t: np.where(t < 40.0, 20.0, 90.0),  # Temperature step
        lambda t: 20.0 - 0.05 * t,  # Cooling under load
    ],
)
def test_implausible_heating_curve_is_rejected(course):
    time = np.arange(0.0, 120.0, 1.5)
    with pytest.raises(ConvergenceError, match="K off it at best"):
        calibrate_drawing(HeatingCurve(time, course(time) + 273.15), BARE, [work()], DUTY)


# ------------------------------------------------------------------------------------------- invalid readings


def test_invalid_readings_of_heating_curve_are_removed():
    rng = np.random.default_rng(7)
    time = np.sort(rng.uniform(0.0, 1800.0, 200))
    seen = AMBIENT + 100.0 * (1.0 - np.exp(-time / 1500.0)) + 0.2 * rng.standard_normal(200)
    seen[[20, 90]] = np.nan
    seen[[40, 150]] += 35.0
    time[101] = time[100]
    order = rng.permutation(200)
    found = clean_curve(time[order], seen[order])
    assert len(found) == 195
    assert sorted(found.notes) == [
        "1 of 200 samples dropped: a repeated time",
        "2 of 200 samples dropped: a spike",
        "2 of 200 samples dropped: no plausible temperature",
    ]


def test_heating_curve_is_read_from_table(tmp_path):
    path = tmp_path / "warm.csv"
    path.write_text("time_s,body_degC\n" + "\n".join(f"{k},{20.0 + 0.1 * k}" for k in range(20)))
    curve = read_curve(path)
    assert (curve.place, curve.temperature[0]) == ("wall", pytest.approx(293.15))
    path.write_text("time_s,fluid_degC,wall_degC\n" + "\n".join(f"{k},20,20" for k in range(20)))
    with pytest.raises(InputError, match=r"warm\.csv: has columns time_s, fluid_degC, wall_degC"):
        read_curve(path)
