"""Calibration by a measured curve: what it tells, what it does not, and that it copes with dirty curves."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import LAWS
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import Calibration, DamperDrawing
from mrdamper.thermal.drawing_file import calibrated_text, drawing_of, read_drawing
from mrdamper.thermal.duty import Duty, read_duty
from mrdamper.thermal.estimation.calibration import _spread, calibrate_drawing, fit_heating
from mrdamper.thermal.estimation.curve_fit import (
    NUISANCE,
    CurveFit,
    inverse_of,
    variance_of,
    with_multipliers,
)
from mrdamper.thermal.estimation.measured_curve import (
    MOST_BAD_SHARE,
    HeatingCurve,
    Place,
    clean_curve,
    lag_signal,
    read_curve,
)
from mrdamper.thermal.estimation.uncertainty import ModelUncertainty
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.temperature_rise import Rise, loads_of, predict_rise, simulate_rise, works_of
from tests.oracles.closed_form import constant_heating
from tests.support.examples import examples

DRAWING = read_drawing(Path(__file__).parents[2] / "examples" / "paper_damper.toml")
BARE = DRAWING.with_sink(None)
AMBIENT = 293.15
DUTY = read_duty("sine:15mm:1Hz:2A:1800s")
KELVIN = np.linspace(273.15, 423.15, 6)


def work(scale: float = 1.0) -> LoopWork:
    return LoopWork(KELVIN, scale * (75.0 - 0.15 * (KELVIN - AMBIENT)), np.full(6, 1000.0))


def heated(drawing: DamperDrawing, *, scale: float = 1.0, start: float = AMBIENT, duty: Duty = DUTY) -> Rise:
    works = [work(scale) for _ in duty.segments]
    return simulate_rise(
        works, drawing, duty, model="network", start_K=start, stop_at_limit=False, longest_step=10.0
    )


def measured(
    rise: Rise, rng: np.random.Generator, *, noise: float = 0.0, place: Place = "fluid", until: float = 1800.0
) -> HeatingCurve:
    time = np.sort(rng.uniform(0.0, until, 300))
    values: FloatArray = {"fluid": rise.fluid, "wall": rise.wall, "coil": rise.coil}[place]
    seen = PchipInterpolator(rise.time, values)(time) + noise * rng.standard_normal(len(time))
    return HeatingCurve(time, seen, place)


def one_node_curve(rng: np.random.Generator, noise: float, *, a: float = 0.08, b: float = 1.0 / 1500.0):
    time = np.sort(rng.uniform(0.0, 1800.0, 200))
    seen = constant_heating(time - time[0], a, b, 1.0, ambient=AMBIENT, start=300.0)
    return HeatingCurve(time, seen + noise * rng.standard_normal(len(time)))


# ------------------------------------------------------------------------------------- the two combinations


@examples(30)
@given(
    a=st.floats(0.005, 0.3),
    minutes=st.floats(5.0, 120.0),
    start=st.floats(273.0, 340.0),
    seed=st.integers(0, 1000),
    lag=st.sampled_from([0.0, 8.0]),
)
def test_without_noise_both_are_exact_wherever_the_curve_starts(a, minutes, start, seed, lag):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(1.0, 20.0, 150))
    b = 1.0 / (60.0 * minutes)
    course = constant_heating(time - time[0], a, b, 1.0, ambient=AMBIENT, start=start)
    if course.max() > 450.0:
        return
    found = fit_heating(HeatingCurve(time, lag_signal(time, course, lag), lag_s=lag), AMBIENT)
    assert found.power_over_capacity == pytest.approx(a, rel=1e-6)
    assert found.conductance_over_capacity == pytest.approx(b, rel=1e-6)
    assert found.start_K == pytest.approx(start, abs=1e-6)


def test_a_cooling_curve_tells_the_time_constant():
    time = np.arange(0.0, 1200.0, 5.0)
    course = constant_heating(time, 0.0, 1.0 / 900.0, 1.0, ambient=AMBIENT, start=390.0)
    found = fit_heating(HeatingCurve(time, course), AMBIENT)
    assert found.conductance_over_capacity == pytest.approx(1.0 / 900.0, rel=1e-6)
    assert found.power_over_capacity == pytest.approx(0.0, abs=1e-9)


@pytest.mark.system
def test_standard_errors_and_correlation_are_those_of_repeated_measurements():
    """200 repeats: errors over standard errors have spread 1, and the two errors go together as stated."""
    rng = np.random.default_rng(11)
    true = np.array([0.08, 1.0 / 1500.0])
    told = [fit_heating(one_node_curve(rng, 0.4), AMBIENT) for _ in range(200)]
    found = np.array([[each.power_over_capacity, each.conductance_over_capacity] for each in told])
    errors = np.array([[each.power_error, each.conductance_error] for each in told])
    scores = (found - true) / errors
    assert np.abs(scores).max() < 4.5
    assert (np.abs(scores) < 3.0).mean() > 0.98
    # the spread of 200 normal numbers is known to 5 %: three of that
    assert scores.std(axis=0) == pytest.approx(1.0, abs=0.15)
    assert np.corrcoef(found.T)[0, 1] == pytest.approx(np.mean([each.correlation for each in told]), abs=0.02)


def test_a_short_curve_says_that_it_does_not_tell_the_losses():
    rng = np.random.default_rng(2)
    short = one_node_curve(rng, 0.5).until(200.0)
    found = fit_heating(short, AMBIENT)
    assert any("too short or too noisy for UA/C" in each for each in found.notes)
    assert not any("noisy for P/C" in each for each in found.notes)


def test_never_more_than_two_numbers_are_claimed_and_the_words_say_so():
    words = " ".join(fit_heating(one_node_curve(np.random.default_rng(0), 0.1), AMBIENT).notes)
    assert "P/C and UA/C" in words
    assert "it does not tell" in words


def test_a_curve_that_the_model_cannot_follow_says_so_and_has_larger_errors():
    """Residuals that follow each other count for less than independent ones."""
    time = np.arange(0.0, 1800.0, 3.0)
    course = constant_heating(time, 0.08, 1.0 / 1500.0, 1.0, ambient=AMBIENT, start=300.0)
    rng = np.random.default_rng(0)
    noisy = fit_heating(HeatingCurve(time, course + 0.5 * rng.standard_normal(len(time))), AMBIENT)
    wavy = fit_heating(HeatingCurve(time, course + 0.5 * np.sqrt(2.0) * np.sin(time / 60.0)), AMBIENT)
    assert wavy.residual_K == pytest.approx(noisy.residual_K, rel=0.1)
    assert wavy.power_error > 3.0 * noisy.power_error
    assert any("does not follow" in each for each in wavy.notes)
    assert not any("does not follow" in each for each in noisy.notes)


# ------------------------------------------------------------------------------------------------ drawings


@pytest.mark.system
@pytest.mark.parametrize("place", ["fluid", "wall", "coil"])
def test_the_drawing_comes_back_with_the_multipliers_of_the_truth(place):
    truth = replace(BARE, calibration=Calibration(heat_capacity=1.15, film=1.05))
    curve = measured(heated(truth, start=297.0), np.random.default_rng(1), noise=0.3, place=place)
    found = calibrate_drawing(curve, BARE, [work()], DUTY)
    assert found.heat_capacity == pytest.approx(1.15, rel=3.0 * found.heat_capacity_error)
    assert found.film == pytest.approx(1.05, rel=3.0 * found.film_error)
    assert found.parameters.start_K == pytest.approx(297.0, abs=0.3)
    assert found.heat_capacity_error < 0.01


def test_without_noise_the_multipliers_are_exact():
    truth = replace(BARE, calibration=Calibration(heat_capacity=1.15, film=1.05))
    found = calibrate_drawing(measured(heated(truth), np.random.default_rng(1)), BARE, [work()], DUTY)
    assert found.heat_capacity == pytest.approx(1.15, rel=2e-4)
    assert found.film == pytest.approx(1.05, rel=5e-4)


def test_the_calibrated_drawing_foretells_another_duty():
    """Calibrated on 15 minutes of heating, it says what half the power will do in an hour, within 1 K."""
    assert DRAWING.sink is not None
    finned = replace(DRAWING.sink, film_multiplier=1.3)
    truth = replace(DRAWING, calibration=Calibration(heat_capacity=1.2, film=0.7), sink=finned)
    curve = measured(heated(truth), np.random.default_rng(3), noise=0.2, until=900.0)
    found = calibrate_drawing(curve, DRAWING, [work()], DUTY)
    hour = read_duty("sine:15mm:1Hz:1A:3600s")
    off = (
        heated(found.drawing, scale=0.5, duty=hour).fluid[-1] - heated(truth, scale=0.5, duty=hour).fluid[-1]
    )
    before = heated(DRAWING, scale=0.5, duty=hour).fluid[-1] - heated(truth, scale=0.5, duty=hour).fluid[-1]
    assert abs(off) < 1.0
    assert abs(before) > 3.0


@pytest.mark.system
def test_scaling_power_capacity_and_losses_together_changes_nothing():
    """A card that says twice the power gets twice the capacity and film; P/C and UA/C stay."""
    no_more = replace(BARE.surroundings, emissivity=0.0, mount=0.0)
    alone = replace(BARE, surroundings=no_more, coil=replace(BARE.coil, resistance=0.0))
    curve = measured(heated(alone, scale=0.6), np.random.default_rng(4), noise=0.2)
    once = calibrate_drawing(curve, alone, [work(0.6)], DUTY, model="lumped")
    twice = calibrate_drawing(curve, alone, [work(1.2)], DUTY, model="lumped")
    assert twice.heat_capacity == pytest.approx(2.0 * once.heat_capacity, rel=1e-6)
    assert twice.film == pytest.approx(2.0 * once.film, rel=1e-6)
    for name in ("power_over_capacity", "conductance_over_capacity", "power_error", "conductance_error"):
        assert getattr(twice.parameters, name) == pytest.approx(getattr(once.parameters, name), rel=1e-5)


@pytest.mark.nightly
def test_film_emissivity_and_mountings_cannot_be_told_apart():
    """Three ways of losing heat, films that differ by four: one curve, UA/C within 6 %, one forecast."""
    curve = measured(heated(BARE), np.random.default_rng(5), noise=0.3)
    ways = [
        replace(BARE, surroundings=replace(BARE.surroundings, emissivity=emissivity, mount=mount))
        for emissivity, mount in ((0.31, 0.10), (0.05, 0.10), (0.31, 0.25))
    ]
    found = [calibrate_drawing(curve, way, [work()], DUTY) for way in ways]
    films = [each.film for each in found]
    assert max(films) > 4.0 * min(films)
    ends = [heated(each.drawing).fluid[-1] for each in found]
    assert np.ptp(ends) < 0.2
    for each in found[1:]:
        assert each.parameters.residual_K == pytest.approx(found[0].parameters.residual_K, rel=0.02)
        told = each.parameters.conductance_over_capacity
        assert told == pytest.approx(found[0].parameters.conductance_over_capacity, rel=0.06)


def test_a_card_s_own_loop_gives_the_power_that_is_calibrated_by():
    """The card's own loop gives the power; a card in volts does not fit a duty in amperes."""
    numbers = {"yield_force": Constant(1100.0), "yield_velocity": Constant(1e-6), "viscosity": Constant(1e3)}
    damper = Damper(LAWS["bingham"], numbers)
    truth = replace(BARE, calibration=Calibration(heat_capacity=1.15, film=1.05))
    rise = predict_rise(damper, truth, DUTY, model="network", stop_at_limit=False, longest_step=10.0)
    curve = measured(rise, np.random.default_rng(10), noise=0.2)
    found = calibrate_drawing(curve, BARE, works_of(damper, DUTY), DUTY)
    assert found.heat_capacity == pytest.approx(1.15, rel=3.0 * found.heat_capacity_error)
    with pytest.raises(InputError, match="its command is in V, the card's in A"):
        works_of(damper, read_duty("sine:15mm:1Hz:2V:1800s"))


@pytest.mark.system
def test_the_entries_read_back_as_the_same_drawing():
    """A file of its own: the drawing's text with the entries in place of those that were there."""
    path = Path(__file__).parents[2] / "examples" / "paper_damper.toml"
    curve = measured(heated(DRAWING, scale=1.1), np.random.default_rng(6), noise=0.2, until=600.0)
    found = calibrate_drawing(curve, DRAWING, [work()], DUTY, model_uncertainty=ModelUncertainty())
    text = calibrated_text(path.read_text(encoding="utf-8"), found.entries, "the paper's, calibrated")
    read = drawing_of(text, DRAWING.name)
    assert found.heat_capacity != DRAWING.calibration.heat_capacity
    for name, value in asdict(found.drawing.calibration).items():
        assert getattr(read.calibration, name) == pytest.approx(value, rel=1e-5)
    assert read.sink is not None
    assert found.drawing.sink is not None
    assert read.sink.film_multiplier == pytest.approx(found.drawing.sink.film_multiplier, rel=1e-5)
    same = replace(found.drawing, calibration=read.calibration, sink=read.sink)
    assert read == same


def test_a_sink_of_another_file_goes_into_the_calibrated_text():
    assert DRAWING.sink is not None
    other = replace(DRAWING.sink, fins=3)
    found = calibrated_text(DRAWING.text, {"sink": {"film_multiplier": 1.5}}, "t", sink=other)
    assert drawing_of(found).sink == replace(other, film_multiplier=1.5)


# ----------------------------------------------------------------------------------- with a doubt beforehand


@pytest.mark.nightly
def test_a_curve_of_half_an_hour_outweighs_what_was_believed():
    """Believed at a tenth and a quarter, told at a per cent: the same numbers within their errors."""
    truth = replace(BARE, calibration=Calibration(heat_capacity=1.15, film=1.05))
    curve = measured(heated(truth), np.random.default_rng(1), noise=0.3)
    alone = calibrate_drawing(curve, BARE, [work()], DUTY)
    held = calibrate_drawing(curve, BARE, [work()], DUTY, model_uncertainty=ModelUncertainty())
    for found in (alone, held):
        assert found.heat_capacity == pytest.approx(1.15, rel=3.0 * found.heat_capacity_error)
        assert found.film == pytest.approx(1.05, rel=3.0 * found.film_error)
    # what is carried along takes some certainty
    assert alone.heat_capacity_error < held.heat_capacity_error < 0.05
    assert not any("hardly tells" in each for each in held.parameters.notes)
    assert any("nothing is claimed of them" in each for each in held.parameters.notes)


@pytest.mark.system
def test_a_minute_of_curve_leaves_the_losses_to_the_drawing():
    """Losses that are believed at no more than 5 % stay so; P/C is told better already."""
    curve = measured(heated(BARE, scale=1.2), np.random.default_rng(2), noise=0.3, until=60.0)
    for losses in (0.25, 0.05):
        model_uncertainty = ModelUncertainty(power=0.10, capacity=1e-3, loss=losses)
        numbers = calibrate_drawing(
            curve, BARE, [work()], DUTY, model_uncertainty=model_uncertainty
        ).parameters
        assert any("hardly tells UA/C yet" in each for each in numbers.notes)
        assert numbers.power_error / numbers.power_over_capacity < 0.09
        # at the start's low excess the film has a smaller share of the losses than at 40 K
        assert 0.7 * losses < numbers.conductance_error / numbers.conductance_over_capacity < 1.05 * losses


def test_without_any_doubt_the_drawing_stays_as_it_is():
    """Only the start is fitted then."""
    nothing = ModelUncertainty(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    curve = measured(heated(BARE, start=296.0), np.random.default_rng(2), noise=0.3, until=600.0)
    found = calibrate_drawing(curve, BARE, [work()], DUTY, model_uncertainty=nothing)
    assert found.heat_capacity == pytest.approx(BARE.calibration.heat_capacity, rel=1e-4)
    assert found.film == pytest.approx(BARE.calibration.film, rel=1e-4)
    assert found.parameters.start_K == pytest.approx(296.0, abs=0.15)


def test_what_is_believed_before_a_curve_is_the_doubt_of_capacity_and_losses_and_of_the_network():
    """Residuals of variance 1: a power that is off by a tenth shows in both of the first two alike."""
    doubt = ModelUncertainty(power=0.11, capacity=0.07, loss=0.21, fluid_body=0.3, coil=0.4)
    loads = loads_of([work()], BARE, DUTY)
    fit = CurveFit(measured(heated(BARE), np.random.default_rng(0)), BARE, loads, "network", doubt)

    def residuals(at):
        return fit._prior_residuals(at, fit._network(at))

    moves = 1e-4 * np.eye(7)
    slope = np.transpose([(residuals(m) - residuals(-m)) / 2e-4 for m in moves])[:, 1:]
    networks = [zone_network(with_multipliers(BARE, 1.0, film)) for film in (0.9999, 1.0, 1.0001)]
    lost = [np.interp(AMBIENT + 40.0, each.grid, each.watts.sum(axis=0)) for each in networks]
    by_film = (lost[2] - lost[0]) / 2e-4 / lost[1]  # of the logarithms
    told = np.diag([1.0, by_film, 1.0, 1.0, 1.0, 1.0])
    expected = np.diag([0.07**2, 0.21**2, 0.09, 0.09, 0.09, 0.16])
    expected[:2, :2] += 0.11**2
    found = told @ np.linalg.inv(slope.T @ slope) @ told
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-5)
    assert residuals(np.zeros(7)) == pytest.approx(np.zeros(6), abs=1e-12)


def test_neighbours_that_go_together_tell_as_much_less_as_an_autoregression_says():
    """Of a variance 1 and r = 0.6 the mean of many is as uncertain as of (1 - r) / (1 + r) as many."""
    rng, r = np.random.default_rng(5), 0.6
    kicks, series = np.sqrt(1.0 - r**2) * rng.standard_normal(40_000), np.zeros(40_000)
    for k in range(1, len(series)):
        series[k] = r * series[k - 1] + kicks[k]
    assert variance_of(series, 3) == pytest.approx((1.0 + r) / (1.0 - r), rel=0.05)
    assert variance_of(rng.standard_normal(40_000), 3) == pytest.approx(1.0, rel=0.05)
    # two are left of four, and neighbours that are opposite count as if they were apart
    assert variance_of(np.array([1.0, -1.0, 1.0, -1.0]), 2) == pytest.approx(2.0)


def test_a_covariance_of_very_different_sizes_is_the_inverse():
    scale = np.array([1e-6, 1.0, 1e5])
    precision = np.array([[2.0, 0.3, 0.1], [0.3, 1.0, 0.2], [0.1, 0.2, 3.0]]) * np.outer(scale, scale)
    found = inverse_of(precision) * np.outer(scale, scale)
    assert found == pytest.approx(np.linalg.inv(precision / np.outer(scale, scale)), rel=1e-9)
    assert inverse_of(np.zeros((2, 2))) == pytest.approx(np.zeros((2, 2)))


def test_the_spread_is_that_of_capacity_and_losses():
    """Without a doubt: two multipliers, of which the film's moves the convective part of UA alone."""
    curve = measured(heated(BARE), np.random.default_rng(1), noise=0.3)
    found = calibrate_drawing(curve, BARE, [work()], DUTY)
    start, capacity, losses, *carried = np.sqrt(np.diag(found.spread))
    assert capacity == pytest.approx(found.heat_capacity_error, rel=1e-6)  # no fins: all of it is multiplied
    assert losses < 0.8 * found.film_error
    assert 0.01 < start < 0.3
    assert carried == [0.0, 0.0]


@pytest.mark.system
@pytest.mark.parametrize(
    ("course", "said"),
    [
        (lambda t: 20.0 + 30.0 * (np.arange(len(t)) % 2), "K off it at best"),  # a loose contact
        pytest.param(lambda t: 20.0 + 1.2 * t, "no multipliers from", marks=pytest.mark.nightly),  # a furnace
        (lambda t: np.where(t < 40.0, 20.0, 90.0), "K off it at best"),  # a step
        (lambda t: 20.0 - 0.05 * t, r"the curve cools by 4\.\d* K under load; .* expected a curve of this"),
    ],
)
def test_a_curve_of_no_damper_is_refused_with_a_doubt_as_well(course, said):
    time = np.arange(0.0, 120.0, 1.5)
    with pytest.raises(ConvergenceError, match=said):
        calibrate_drawing(
            HeatingCurve(time, course(time) + 273.15),
            BARE,
            [work()],
            DUTY,
            model_uncertainty=ModelUncertainty(),
        )


@pytest.mark.nightly
def test_a_curve_of_a_damper_of_twice_the_size_is_refused_with_a_doubt():
    """A clean curve, a fifth of the drawing's rate: no drawing is that far off."""
    curve = measured(heated(BARE, scale=0.2), np.random.default_rng(3), noise=0.05, until=900.0)
    with pytest.raises(ConvergenceError, match=r"it takes a heat capacity .* times the drawing's"):
        calibrate_drawing(curve, BARE, [work()], DUTY, model_uncertainty=ModelUncertainty())


@pytest.mark.system
def test_a_curve_of_something_else_is_refused():
    time = np.linspace(0.0, 1800.0, 100)
    cold = HeatingCurve(time, AMBIENT + 0.1 * np.sin(time))
    with pytest.raises(ConvergenceError, match=r"no multipliers from 0\.05 to 20 follow it"):
        calibrate_drawing(cold, BARE, [work()], DUTY)


def test_a_curve_longer_than_the_duty_is_refused():
    time = np.linspace(0.0, 3600.0, 100)
    with pytest.raises(InputError, match="expected a curve within the duty"):
        calibrate_drawing(HeatingCurve(time, np.full(100, 300.0)), BARE, [work()], DUTY)


# ------------------------------------------------------------------------------------------- dirty curves


def test_gaps_spikes_and_repeated_stamps_go_and_are_counted():
    rng = np.random.default_rng(7)
    clean = one_node_curve(rng, 0.2)
    time, seen = clean.time.copy(), clean.temperature.copy()
    seen[[20, 90]] = np.nan
    seen[[40, 150]] += 35.0
    time[101] = time[100]
    order = rng.permutation(len(time))
    found = clean_curve(time[order], seen[order])
    assert len(found) == len(time) - 5
    assert sorted(found.notes) == [
        "1 of 200 samples left out: a time that is there already",
        "2 of 200 samples left out: a spike",
        "2 of 200 samples left out: no plausible temperature",
    ]
    told = fit_heating(found, AMBIENT)
    assert told.power_over_capacity == pytest.approx(0.08, abs=3.0 * told.power_error)
    assert told.notes[-3:] == found.notes


def test_a_clean_curve_is_left_alone_even_where_it_is_steep():
    time = np.arange(0.0, 600.0, 5.0)
    steep = 300.0 + 90.0 * (1.0 - np.exp(-time / 30.0))
    peak = np.minimum(steep, steep[30] - 0.3 * (time - time[30]))
    for course in (steep, -steep + 700.0, peak):
        assert len(clean_curve(time, course)) == len(time)


def test_noise_is_what_a_straight_line_between_neighbours_misses():
    """Nothing of a line at any times; of readings that jump up and down by d, d (2 / sqrt 1.5) 1.4826."""
    time = np.cumsum(np.random.default_rng(3).uniform(0.2, 5.0, 60))
    assert HeatingCurve(time, 300.0 + 0.1 * time).noise_K == pytest.approx(0.0, abs=1e-12)
    jumps = HeatingCurve(np.arange(60.0), 300.0 + 0.1 * np.cos(np.pi * np.arange(60.0)))
    assert jumps.noise_K == pytest.approx(0.1 * 2.0 / np.sqrt(1.5) * 1.4826)
    apart = np.zeros(60)
    apart[1::2] = 0.1  # in the way: one third from the left, two thirds, so that weights are not alike
    uneven = np.cumsum(np.where(np.arange(60) % 2 == 1, 1.0, 2.0))
    told = HeatingCurve(uneven, 300.0 + apart).noise_K
    assert told == pytest.approx(0.1 / np.sqrt(1.0 + 5.0 / 9.0) * 1.4826)


def test_noise_is_told_apart_from_the_course():
    rng = np.random.default_rng(8)
    assert one_node_curve(rng, 0.5).noise_K == pytest.approx(0.5, rel=0.2)
    assert one_node_curve(rng, 0.0).noise_K < 2e-3


def test_the_lag_of_a_sensor_is_that_of_a_first_order():
    """A ramp comes out late by the lag; a step by 1 - exp(-t/lag); whatever the sampling."""
    rng = np.random.default_rng(9)
    time = np.cumsum(rng.uniform(0.1, 3.0, 200))
    shown = lag_signal(time, 0.5 * time, 7.0)
    since = time - time[0]
    assert shown == pytest.approx(0.5 * (time - 7.0 * (1.0 - np.exp(-since / 7.0))), rel=1e-12)


def test_a_curve_is_read_from_a_table(tmp_path):
    path = tmp_path / "warm.csv"
    rows = "\n".join(f"{k},{20.0 + 0.1 * k},{19.0 + 0.1 * k}" for k in range(20))
    path.write_text(f"time_s,fluid_degC,wall_degC\n{rows}\n")
    curve = read_curve(path, column="wall_degC")
    assert (curve.place, curve.temperature[0]) == ("wall", pytest.approx(292.15))
    with pytest.raises(InputError, match=r"warm\.csv: has columns time_s, fluid_degC, wall_degC"):
        read_curve(path)


@pytest.mark.parametrize(
    ("time", "kelvin", "said"),
    [
        (np.arange(10.0), np.full(10, 25.0), "temperature is 25 K at 0 s"),
        (np.zeros(10), np.full(10, 300.0), "time does not rise"),
        (np.arange(5.0), np.full(5, 300.0), "at least 8"),
        (np.arange(10.0), np.full(9, 300.0), "expected one temperature per time"),
        (np.arange(10.0)[:, None], np.full((10, 1), 300.0), "expected one temperature per time"),
    ],
)
def test_a_curve_that_is_none_is_refused(time, kelvin, said):
    with pytest.raises(InputError, match=said):
        HeatingCurve(time, kelvin)
    if "one temperature" in said:
        with pytest.raises(InputError, match=said):
            clean_curve(time, kelvin)


def test_a_broken_sensor_is_refused():
    with pytest.raises(InputError, match="Check the sensor"):
        clean_curve(np.arange(20.0), np.where(np.arange(20) % 2, np.nan, 300.0))


def rising(count=60):
    """Return a curve without noise that rises by 0.01 K a sample."""
    return np.arange(float(count)), 300.0 + 0.01 * np.arange(count)


@pytest.mark.parametrize(("off", "gone"), [(0.45, 0), (0.55, 1), (-0.55, 1)])
def test_without_noise_a_spike_is_half_a_kelvin(off: float, gone: int):
    time, kelvin = rising()
    kelvin[30] += off
    assert len(time) - len(clean_curve(time, kelvin)) == gone
    for end in (0, -1):  # with neighbours on one side only nobody can say
        time, kelvin = rising()
        kelvin[end] += 10.0 * off
        assert len(clean_curve(time, kelvin)) == len(time)


@pytest.mark.parametrize(("times", "gone"), [(7.0, 0), (9.5, 1)])
def test_a_spike_is_eight_deviations_of_the_noise(times: float, gone: int):
    """Readings that alternate by d: second differences of 4 d over the root of 6, 1.4826 of which count."""
    time, kelvin = np.arange(60.0), 300.0 + 0.2 * (-1.0) ** np.arange(60)
    deviation = 1.4826 * 4.0 * 0.2 / np.sqrt(6.0)
    kelvin[30] = 299.8 + times * deviation  # its neighbours' medians are those of odd samples
    assert len(time) - len(clean_curve(time, kelvin)) == gone


@pytest.mark.parametrize(("off", "gone"), [(3.8, 0), (4.3, 1)])
def test_a_spike_is_four_times_as_far_off_as_its_three_neighbours_lie_apart(off: float, gone: int):
    time = np.arange(60.0)
    kelvin = np.full(60, 300.0)
    kelvin[33:] += 1.0  # a step that stays, the last of three neighbours
    kelvin[30] += off
    assert len(time) - len(clean_curve(time, kelvin)) == gone


@pytest.mark.parametrize("bad", [12, 13])
def test_a_fifth_of_bad_readings_is_borne_and_no_more(bad: int):
    time, kelvin = rising()
    kelvin[:bad] = np.nan
    if bad > MOST_BAD_SHARE * 60:
        with pytest.raises(InputError, match="13 of 60 samples are no plausible temperature; expected less"):
            clean_curve(time, kelvin)
    else:
        assert len(clean_curve(time, kelvin)) == 48
    assert MOST_BAD_SHARE == 0.2


def test_eight_readings_are_a_curve_and_seven_are_none():
    time, kelvin = rising(8)
    assert len(HeatingCurve(time, kelvin, lag_s=0.0)) == 8
    assert len(HeatingCurve(time, kelvin).until(7.0)) == 8
    with pytest.raises(InputError, match="it has 7 readings; expected at least 8"):
        HeatingCurve(time, kelvin).until(6.9)
    for lag in (-1.0, np.inf, np.nan):
        with pytest.raises(InputError, match=r"lag_s is .*; expected seconds, zero or more"):
            HeatingCurve(time, kelvin, lag_s=lag)
    with pytest.raises(InputError, match="use one of: fluid, wall, coil"):
        HeatingCurve(time, kelvin, "oil")  # type: ignore[arg-type]
    short = clean_curve(*rising(8))  # too short to look for spikes with three neighbours on either side
    assert len(short) == 8


@pytest.mark.parametrize(
    ("column", "place"),
    [("coil_degC", "coil"), ("body_near_degC", "wall"), ("wall_degC", "wall"), ("fluid_K", "fluid")],
)
def test_a_column_s_name_says_where_the_thermometer_sits(tmp_path, column, place):
    path = tmp_path / "warm.csv"
    base = 290.0 if column.endswith("_K") else 16.85
    rows = "\n".join(f"{k},{base + 0.1 * k}" for k in range(20))
    path.write_text(f"time_s,{column}\n{rows}\n")
    curve = read_curve(path)
    assert (curve.place, curve.name) == (place, "warm.csv")
    assert curve.temperature[0] == pytest.approx(290.0)


def test_a_sensor_without_lag_among_others_shows_what_is():
    time = np.array([0.0, 1.0, 3.0])
    shown = lag_signal(time, np.array([[1.0, 1.0], [2.0, 2.0], [5.0, 5.0]]), np.array([0.0, 2.0]))
    assert shown[:, 0] == pytest.approx([1.0, 2.0, 5.0])
    assert shown[0, 1] == 1.0
    assert shown[1, 1] == pytest.approx(2.0 - 2.0 * (1.0 - np.exp(-0.5)))


# ------------------------------------------------------------------------- how far off a drawing may be


def alone(**multipliers: float) -> DamperDrawing:
    """Return a bare damper that convection alone cools, so that the film is all of its losses."""
    own = replace(BARE.surroundings, emissivity=0.0, mount=0.0)
    coil = replace(BARE.coil, resistance=0.0)
    return replace(BARE, surroundings=own, coil=coil, calibration=Calibration(**multipliers))


@pytest.mark.parametrize(
    "given", [{"heat_capacity": 9.0, "film": 0.12}, {"heat_capacity": 0.12, "film": 9.0}]
)
def test_a_multiplier_of_nine_or_an_eighth_is_found(given: dict[str, float]):
    """Twenty and a twentieth are the ends of the search."""
    power = min(given["heat_capacity"], 1.0)
    short = read_duty("sine:15mm:1Hz:2A:600s")
    truth = simulate_rise([work(power)], alone(**given), short, model="lumped", longest_step=20.0)
    curve = measured(truth, np.random.default_rng(1), until=600.0)
    found = calibrate_drawing(curve, alone(), [work(power)], short, model="lumped")
    for name, value in given.items():
        assert getattr(found, name) == pytest.approx(value, rel=2e-3)


def checker(monkeypatch: pytest.MonkeyPatch, rise: float, off: float) -> CurveFit:
    """Return a fit to a curve that rises so far, its priors off by so many deviations."""
    fit, time = CurveFit.__new__(CurveFit), np.linspace(0.0, 1800.0, 400)
    fit._curve = HeatingCurve(time, 300.0 + rise * time / 1800.0)
    monkeypatch.setattr(fit, "_network", lambda at: None)
    monkeypatch.setattr(fit, "_prior_residuals", lambda at, network: np.array([0.0, off]))
    return fit


@pytest.mark.parametrize(("rise", "most"), [(100.0, 3.0), (10.0, 1.0)])
def test_a_drawing_may_be_three_percent_of_the_range_off_or_a_kelvin(monkeypatch, rise, most):
    fit = checker(monkeypatch, rise, 0.0)
    fit._check(np.zeros(3), np.full(400, 0.98 * most))
    with pytest.raises(ConvergenceError, match=rf"K off it at best; expected {most:.2g} K or less"):
        fit._check(np.zeros(3), np.full(400, 1.02 * most))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_was_believed_may_be_five_deviations_off(monkeypatch, sign):
    checker(monkeypatch, 100.0, 4.99 * sign)._check(np.zeros(3), np.zeros(400))
    with pytest.raises(ConvergenceError, match="it takes a heat capacity 1 times and a film 1 times"):
        checker(monkeypatch, 100.0, 5.01 * sign)._check(np.zeros(3), np.zeros(400))


def test_p_and_ua_over_c_are_those_of_the_drawing_at_the_weighted_middle():
    """The power of the heaviest load with the coil's heat, and the losses over the excess, by the network."""
    duty = read_duty("sine:15mm:1Hz:2A:1800s")
    curve = measured(heated(BARE), np.random.default_rng(1), noise=0.1)
    found = calibrate_drawing(curve, BARE, [work()], duty)
    excess = np.abs(curve.temperature - AMBIENT)
    at = float((excess * curve.temperature).sum() / excess.sum())
    network = zone_network(found.drawing)
    lost = np.interp(at, network.grid, network.watts.sum(axis=0))
    watts = 75.0 - 0.15 * (at - AMBIENT) + 16.8 * (1.0 + 0.00393 * (at - 293.15))
    told = found.parameters
    assert told.at_K == pytest.approx(at)
    assert told.at_degC == pytest.approx(at - 273.15)
    assert told.power_over_capacity == pytest.approx(watts / network.total_capacity, rel=1e-4)
    assert told.conductance_over_capacity == pytest.approx(lost / (at - AMBIENT) / network.total_capacity)
    assert found.fitted_K - curve.temperature == pytest.approx(0.0, abs=0.6)
    assert told.residual_K == pytest.approx(float(np.std(found.fitted_K - curve.temperature)), rel=0.05)
    assert found.entries["calibration"] == pytest.approx(
        {"heat_capacity": found.heat_capacity, "film": found.film}
    )


def test_a_damper_at_ambient_tells_p_and_ua_a_kelvin_above_it():
    """A curve that stays where the air is has no excess: losses are taken at one kelvin."""
    time = np.linspace(0.0, 600.0, 50)
    found = fit_heating(HeatingCurve(time, np.full(50, AMBIENT)), AMBIENT)
    assert found.at_K == pytest.approx(AMBIENT)
    assert found.power_over_capacity == pytest.approx(0.0, abs=1e-9)


def test_a_drawing_s_multipliers_multiply_what_it_has():
    """Capacity, convection of body and fins, and those that mend the network, each its own."""
    own = replace(DRAWING, calibration=Calibration(heat_capacity=1.1, film=1.2, fluid_wall=1.3, coil=1.4))
    assert own.sink is not None
    found = with_multipliers(own, 2.0, 3.0, {"fluid_wall": 5.0, "coil": 7.0})
    assert asdict(found.calibration) == pytest.approx(
        {**asdict(own.calibration), "heat_capacity": 2.2, "film": 3.6, "fluid_wall": 6.5, "coil": 9.8}
    )
    assert found.sink == replace(own.sink, film_multiplier=3.0 * own.sink.film_multiplier)
    assert with_multipliers(BARE, 1.0, 1.0) == BARE


def test_what_a_fit_leaves_open_is_told_of_start_capacity_losses_and_two_ways_of_heat():
    """P/C falls as the capacity rises, UA/C besides rises with the losses; the ways are the fit's own."""
    root = np.random.default_rng(4).standard_normal((7, 7))
    covariance, slope = root @ root.T, np.array([[-1.0, 0.0], [-0.9, 0.6]])
    draws = np.linalg.cholesky(covariance) @ np.eye(7)
    told = slope @ draws[1:3]
    capacity = -told[0]
    losses = told[1] + capacity
    names = list(NUISANCE)
    ways = [draws[3 + names.index(name)] for name in ("fluid_wall", "coil")]
    rows = np.array([draws[0], capacity, losses, *ways])
    assert _spread(covariance, slope) == pytest.approx(rows @ rows.T)
    few = _spread(covariance[:3, :3], slope)  # without what mends the network
    assert few[:3, :3] == pytest.approx((rows @ rows.T)[:3, :3])
    assert not few[3:].any()


def test_a_number_that_is_not_told_is_so_by_its_own_standard_error():
    """From half of the number on, in per cent of it; P/C as UA/C."""
    short = one_node_curve(np.random.default_rng(2), 0.5).until(200.0)
    found = fit_heating(short, AMBIENT)
    percent = 100.0 * found.conductance_error / abs(found.conductance_over_capacity)
    assert percent >= 50.0
    assert any(f"noisy for UA/C: its standard error is {percent:.0f} % of it" in each for each in found.notes)
    still = HeatingCurve(short.time, AMBIENT + 0.5 * np.random.default_rng(3).standard_normal(len(short)))
    told = fit_heating(still, AMBIENT)
    unknown = 100.0 * told.power_error / abs(told.power_over_capacity)
    assert (unknown >= 50.0) == any("noisy for P/C" in each for each in told.notes)
