"""Early prediction: how good it is on a fleet that it does not know, and that its answers are Bayes'."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mrdamper.errors import ConvergenceError, InputError
from mrdamper.thermal.estimation.measured_curve import HeatingCurve, lag_signal
from mrdamper.thermal.estimation.prediction import (
    EarlyPrediction,
    Misfit,
    PredictionOptions,
    _Problem,
    predict_early,
    predict_temperature,
)
from mrdamper.thermal.estimation.two_node import PARAMETERS, PRIOR, simulate_two_node
from tests.oracles.closed_form import constant_heating
from tests.thermal.fleet import Member, draw_fleet

AMBIENT = 293.15
FLEET_SEED = 7  # drawn once the predictor was finished; it was made on fleets of other seeds
END_S = 1800.0


def parameters_of(**changed: float) -> dict[str, np.ndarray]:
    middle = {name: float(PRIOR[name].value(np.zeros(1))[0]) for name in PARAMETERS}
    return {name: np.array([value]) for name, value in {**middle, **changed}.items()}


def scores(fleet: list[Member], minutes: float, *, dampers: int = 400) -> tuple[float, float]:
    """Return root mean square error [K] and coverage of the 90 % interval at 30 min."""
    errors, inside = [], []
    for member in fleet:
        known = predict_early(member.curve.until(60.0 * minutes), member.ambient, dampers=dampers)
        middle, low, high = known.temperature(END_S)
        true = member.truth_at(END_S)
        errors.append(middle - true)
        inside.append(low <= true <= high)
    return float(np.sqrt(np.mean(np.square(errors)))), float(np.mean(inside))


# --------------------------------------------------------------------------------------- the two-node model


def balance(
    kelvin: np.ndarray,
    *,
    heating: float, loss: float, viscous: float, slope: float, exponent: float, share: float, settling: float,
) -> list[float]:  # fmt: skip
    """Return the rates of fluid and core [K/s], as the module's page has them."""
    over, apart = kelvin[0] - AMBIENT, kelvin[0] - kelvin[1]
    thin = viscous * math.exp(1400.0 / kelvin[0] - 1400.0 / AMBIENT)
    power = heating * max(thin + (1.0 - viscous) * (1.0 - slope * over), 0.05)
    lost = loss * over * ((over**2 + 25.0) / (1600.0 + 25.0)) ** (exponent / 2.0)
    passed = share * (1.0 - share) / settling * apart
    return [(power - lost - passed) / share, passed / (1.0 - share)]


def integrated(ours: dict[str, float], start: float, time: np.ndarray) -> np.ndarray:
    def rates(_: float, kelvin: np.ndarray) -> list[float]:
        return balance(kelvin, **ours)

    span = (float(time[0]), float(time[-1]))
    solved = solve_ivp(rates, span, [start, start], t_eval=time, rtol=1e-9, atol=1e-9, method="LSODA")
    return np.asarray(solved.y[0])


def test_two_nodes_are_their_heat_balances_integrated():
    """Drawn dampers, heating and cooling, one power that is held: to the error of the fixed steps."""
    rng, time = np.random.default_rng(4), np.array([5.0, 17.0, 60.0, 61.0, 400.0, 1500.0, 3600.0])
    drawn = {name: PRIOR[name].value(rng.uniform(-1.0, 1.0, 6)) for name in PARAMETERS}
    drawn["slope"][0], drawn["viscous"][0] = 0.02, 0.1
    start = rng.uniform(283.0, 350.0, 6)
    found = simulate_two_node(drawn, start, AMBIENT, time)
    for k in range(6):
        exact = integrated({name: float(drawn[name][k]) for name in PARAMETERS}, float(start[k]), time)
        assert found[:, k] == pytest.approx(exact, abs=0.05)


def test_bins_and_their_errors_are_those_of_the_curve():
    """Means of ten seconds, noise by their count, and a misfit that is a share of the rise and lasts."""
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.5, 1.5, 400))
    curve = HeatingCurve(time, 300.0 + 0.05 * (time - time[0]) + 0.2 * rng.standard_normal(400))
    problem = _Problem(curve, AMBIENT, Misfit(0.004, 0.03, 90.0))
    which = np.minimum(((time[1:] - time[0]) / 10.0).astype(int), int((time[-1] - time[0]) / 10.0))
    bins = [np.flatnonzero(which == k) + 1 for k in np.unique(which)]
    assert problem.time == pytest.approx([time[each].mean() for each in bins])
    assert problem.seen == pytest.approx([curve.temperature[each].mean() for each in bins])
    assert problem.start == pytest.approx(float(np.median(curve.temperature[:8])))

    def off_by(kelvin: float) -> float:
        return math.hypot(0.03, 0.004 * (kelvin - problem.start))

    expected = np.array([
        [
            off_by(one) * off_by(other) * math.exp(-abs(t - u) / 90.0)
            + (curve.noise_K**2 / len(each) if t == u else 0.0)
            for u, other in zip(problem.time, problem.seen, strict=True)
        ]
        for t, one, each in zip(problem.time, problem.seen, bins, strict=True)
    ])  # fmt: skip
    root = np.linalg.inv(problem._whiten)
    assert root @ root.T == pytest.approx(expected, rel=1e-9, abs=1e-12)
    middle = np.zeros((problem.size, 1))
    values, start = problem.parameters(middle)
    shown = lag_signal(
        np.append(time[0], problem.time),
        simulate_two_node(values, start, AMBIENT, np.append(time[0], problem.time)),
        4.0,
    )
    off = root @ problem.residuals(middle)[: len(bins), 0]
    assert off == pytest.approx(shown[1:, 0] - problem.seen, abs=1e-9)
    assert problem.residuals(middle + 1.0)[len(bins) :, 0] == pytest.approx(1.0)
    assert problem.parameters(middle + 1.0)[1] == pytest.approx(problem.start + 2.0)


# ----------------------------------------------------------------------------------------------- prediction


@pytest.mark.nightly
def test_forty_unknown_dampers_are_foretold_from_ten_minutes():
    """Fleet unseen: 3 K at 30 min; of 40 intervals, at least 85 % less two deviations of that count hold."""
    rmse, coverage = scores(draw_fleet(40, FLEET_SEED), 10.0, dampers=100)
    assert rmse < 3.0
    assert coverage >= 0.85 - 2.0 * math.sqrt(0.85 * 0.15 / 40.0)


@pytest.mark.release
def test_two_hundred_unknown_dampers_are_foretold():
    """10 min: at most 3 K, 85 to 95 % of the 90 % intervals hold; more minutes are better."""
    fleet = draw_fleet(200, FLEET_SEED)
    rmse = {}
    for minutes in (5.0, 10.0, 15.0):
        rmse[minutes], coverage = scores(fleet, minutes)
        print(f"{minutes:.0f} min: {rmse[minutes]:.2f} K, {100.0 * coverage:.1f} % inside")
        assert 0.85 <= coverage <= 0.95
    assert rmse[10.0] < 3.0
    assert rmse[15.0] < rmse[10.0] < rmse[5.0]


@pytest.mark.release
def test_two_hundred_thermocouples_on_the_body_are_foretold():
    rmse, coverage = scores(draw_fleet(200, FLEET_SEED, place="wall"), 10.0)
    print(f"body, 10 min: {rmse:.2f} K, {100.0 * coverage:.1f} % inside")
    assert rmse < 3.0
    assert 0.85 <= coverage <= 0.95


@pytest.mark.release
def test_the_interval_is_that_of_a_markov_chain():
    """Two ways agree: randomised maximum likelihood against differential evolution Markov chains."""
    for member in draw_fleet(2, FLEET_SEED + 1):
        curve = member.curve.until(600.0)
        _, low, high = predict_early(curve, member.ambient, dampers=400).temperature(END_S)
        sampled = _chains(_Problem(curve, member.ambient, predict_early(curve, member.ambient).misfit))
        lower, upper = np.quantile(sampled, (0.05, 0.95))
        assert high - low == pytest.approx(upper - lower, rel=0.25)
        assert 0.5 * (low + high) == pytest.approx(0.5 * (lower + upper), abs=0.2 * (upper - lower))


def _chains(problem: _Problem, *, walkers: int = 100, steps: int = 2000) -> np.ndarray:
    """Return temperatures at 30 min drawn by differential evolution Markov chains (ter Braak)."""
    rng = np.random.default_rng(0)
    middle = problem.fit(np.zeros((problem.size, 1)), np.zeros((problem.rows, 1)))
    at = np.repeat(middle, walkers, axis=1) + 0.05 * rng.standard_normal((problem.size, walkers))
    log = -0.5 * (problem.residuals(at) ** 2).sum(axis=0)
    kept, own = [], np.arange(walkers)
    for k in range(steps):
        one, other = ((own + rng.integers(1, walkers, walkers)) % walkers for _ in range(2))
        reach = 0.6 * 2.38 / math.sqrt(2.0 * problem.size)
        trial = at + reach * (at[:, one] - at[:, other]) + 1e-4 * rng.standard_normal(at.shape)
        new = -0.5 * (problem.residuals(trial) ** 2).sum(axis=0)
        moves = np.log(rng.uniform(size=walkers)) < new - log
        at, log = np.where(moves, trial, at), np.where(moves, new, log)
        if k >= steps // 2 and k % 50 == 0:
            parameters, start = problem.parameters(at)
            kept.append(
                simulate_two_node(
                    parameters, start, problem.ambient, np.array([problem.curve.time[0], END_S])
                )[1]
            )
    return np.concatenate(kept)


def member_of_the_model(seed: int, noise: float) -> tuple[HeatingCurve, float]:
    """Return a curve of the lean model itself, its numbers near the beliefs' means, and its end at 30 min."""
    rng = np.random.default_rng(seed)
    numbers = {name: PRIOR[name].value(0.4 * rng.standard_normal(1)) for name in PARAMETERS}
    time = np.arange(0.0, END_S + 1.0, 2.0)
    course = simulate_two_node(numbers, np.array([AMBIENT]), AMBIENT, time)[:, 0]
    return HeatingCurve(time, course + noise * rng.standard_normal(len(time))), float(course[-1])


@pytest.mark.nightly
def test_more_curve_and_less_noise_narrow_the_interval():
    curve, _ = member_of_the_model(1, 0.2)
    quiet, _ = member_of_the_model(1, 0.01)

    def width(seen: HeatingCurve, minutes: float) -> float:
        _, low, high = predict_early(seen.until(60.0 * minutes), AMBIENT).temperature(END_S)
        return high - low

    assert width(curve, 5.0) > width(curve, 10.0) > width(curve, 20.0) > width(curve, 30.0)
    assert width(quiet, 10.0) < width(curve, 10.0)


@pytest.mark.system
def test_what_was_measured_already_is_known():
    """With the whole curve in hand, its end is known to a fraction of a kelvin, and right."""
    curve, end = member_of_the_model(3, 0.1)
    middle, low, high = predict_early(curve, AMBIENT).temperature(END_S)
    assert high - low < 1.5
    assert low <= end <= high
    assert middle == pytest.approx(end, abs=0.5)


@pytest.mark.nightly
def test_the_clock_and_the_seed_do_not_matter_beyond_their_place():
    """A clock that starts elsewhere shifts nothing; the same seed gives the same answer."""
    curve, _ = member_of_the_model(2, 0.2)
    early = curve.until(600.0)
    late = HeatingCurve(early.time + 5000.0, early.temperature)
    assert predict_early(late, AMBIENT).temperature(5000.0 + END_S) == pytest.approx(
        predict_early(early, AMBIENT).temperature(END_S), abs=1e-3
    )
    assert predict_early(early, AMBIENT).temperature(END_S) == predict_early(early, AMBIENT).temperature(
        END_S
    )


def test_the_time_to_a_limit_agrees_with_the_temperature():
    """The limit is passed before t in as many dampers as are above it at t."""
    curve, _ = member_of_the_model(5, 0.2)
    known = predict_early(curve.until(600.0), AMBIENT)
    middle, _, _ = known.temperature(1500.0)
    when = known.time_to(middle)
    assert when.median_s == pytest.approx(1500.0, abs=25.0)
    assert when.low_s < when.median_s < when.high_s


def test_a_limit_that_is_never_reached_says_so():
    curve, _ = member_of_the_model(5, 0.2)
    never = predict_early(curve.until(600.0), AMBIENT).time_to(5000.0)
    assert (never.median_s, never.not_reached) == (math.inf, 1.0)
    assert "not reached" in str(never)


def test_less_than_a_minute_is_no_curve_to_predict_from():
    curve, _ = member_of_the_model(2, 0.2)
    with pytest.raises(InputError, match="expected a minute or more"):
        predict_early(curve.until(40.0), AMBIENT)
    with pytest.raises(InputError, match="ambient is -253"):
        predict_early(curve, 20.0)


@pytest.mark.system
def test_a_curve_of_something_else_is_refused():
    """A duty that stops within the curve is no constant duty."""
    time = np.arange(0.0, 1200.0, 2.0)
    up = constant_heating(time, 0.08, 1.0 / 900.0, 1.0, ambient=AMBIENT, start=AMBIENT)
    down = constant_heating(time - 600.0, 0.0, 1.0 / 900.0, 1.0, ambient=AMBIENT, start=up[300])
    with pytest.raises(ConvergenceError, match="no damper follows it"):
        predict_early(HeatingCurve(time, np.where(time < 600.0, up, down)), AMBIENT)


def test_a_prediction_of_the_past_is_refused():
    curve, _ = member_of_the_model(2, 0.2)
    known: EarlyPrediction = predict_early(curve.until(600.0), AMBIENT, dampers=10)
    with pytest.raises(InputError, match="expected a later time"):
        known.temperature(-5.0)


def test_a_prediction_is_the_early_one_at_every_time_asked():
    member = draw_fleet(1, FLEET_SEED)[0]
    curve = member.curve.until(600.0)
    options = PredictionOptions(until=END_S, limit=member.truth_at(END_S) - 1.0, dampers=100)
    found = predict_temperature(curve, member.ambient, options)
    known = predict_early(curve, member.ambient, dampers=100)
    ends = (found.interval.median[-1], found.interval.low[-1], found.interval.high[-1])
    assert found.interval.time[-1] == END_S
    assert ends == pytest.approx(known.temperature(END_S), abs=1e-9)
    assert found.interval.to_limit == known.time_to(options.limit)
    middle, low, high = found.parameters["heating"]
    assert low < middle < high
    assert found.parameters.keys() == set(PARAMETERS)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"probability": 1.0}, r"prediction\.probability is 1\.0; expected a number, above 0 and below 1"),
        ({"limit": 130.0}, r"prediction\.limit_degC is -143\.15; expected a number in degC"),
        ({"dampers": 3}, r"prediction\.dampers is 3; expected a whole number, at least 20"),
    ],
)
def test_what_cannot_be_asked_is_refused(given, said):
    with pytest.raises(InputError, match=said):
        PredictionOptions(**given)


def test_a_prediction_that_ends_before_the_curve_begins_is_refused():
    curve = HeatingCurve(np.arange(100.0, 300.0), 300.0 + 0.01 * np.arange(200.0))
    with pytest.raises(InputError, match="it should end at 50 s, the curve starts at 100 s"):
        predict_temperature(curve, AMBIENT, PredictionOptions(until=50.0, dampers=20))


def test_priors_are_those_of_the_docs():
    """Middle and one spread to either side, rounded as they are printed."""
    page = (Path(__file__).parents[2] / "docs" / "thermal_estimation.md").read_text(encoding="utf-8")
    middles = {
        "heating": ("P/C at ambient", 1.0), "viscous": ("share of the power", 1.0),
        "slope": ("fall of the rest", 100.0), "exponent": ("growth of the loss", 1.0),
        "share": ("share of the capacity", 1.0), "settling": ("time constant between", 1.0),
    }  # fmt: skip
    for name, (row, scale) in middles.items():
        (said,) = re.findall(rf"^\| {row}.* \| ([\d.]+).* \| ([\d.]+), ([\d.]+) \|$", page, re.MULTILINE)
        for text, at in zip(said, (0.0, -1.0, 1.0), strict=True):
            digits = len(text.partition(".")[2])
            value = scale * float(PRIOR[name].value(np.array(at)))
            assert abs(value - float(text)) <= 0.5001 * 10.0**-digits, name
    minutes = [1.0 / 60.0 / float(PRIOR["loss"].value(np.array(at))) for at in (0.0, -1.0, 1.0)]
    assert minutes == pytest.approx([20.0, 40.0, 10.0])
    lags = [
        [float(PRIOR[name].value(np.array(at))) for at in (0.0, -1.0, 1.0)] for name in ("lag", "body lag")
    ]
    assert lags[0] == pytest.approx([4.0, 2.0, 8.0])
    assert lags[1] == pytest.approx([12.0, 12.0 / 2.2, 26.4])


def test_each_coordinate_moves_one_number_and_the_last_two_are_lag_and_start():
    curve, _ = member_of_the_model(2, 0.2)
    problem = _Problem(curve.until(300.0), AMBIENT, Misfit(0.002))
    at = np.linspace(-1.0, 1.0, problem.size)[:, None] * np.array([[1.0, -0.7]])
    values, start = problem.parameters(at)
    for k, name in enumerate(PARAMETERS):
        assert values[name] == pytest.approx(PRIOR[name].value(at[k]))
    assert start == pytest.approx(problem.start + 2.0 * at[-1])
    slower = at.copy()
    slower[-2] += 1.0
    rows = len(problem.time)
    assert np.abs(problem.residuals(slower)[:rows] - problem.residuals(at)[:rows]).min(axis=0).max() > 0.0
    assert problem.residuals(at)[rows:] == pytest.approx(at)
    assert problem.rows == rows + problem.size == rows + len(PARAMETERS) + 2


@pytest.mark.parametrize("kelvin", [223.15, 373.15])
def test_a_minute_in_any_climate_is_enough(kelvin: float):
    """From -50 to 100 degC; a hundredth beyond is refused."""
    time = np.arange(0.0, 61.0, 2.0)
    curve = HeatingCurve(time, kelvin + 0.04 * time)
    found = predict_early(curve, kelvin, dampers=4)
    assert found.start == pytest.approx(kelvin, abs=3.0)
    with pytest.raises(InputError, match=r"ambient is .* degC; expected -50 to 100"):
        predict_early(curve, kelvin + math.copysign(0.01, kelvin - 300.0))
    with pytest.raises(InputError, match="it lasts 58 s"):
        predict_early(curve.until(59.0), kelvin)


def test_the_misfit_of_a_damper_is_the_same_share_of_its_rise_at_all_times():
    curve, _ = member_of_the_model(2, 0.2)
    known = predict_early(curve.until(300.0), AMBIENT, dampers=6)
    time = np.array([400.0, 900.0, 1800.0])
    plain = simulate_two_node(known.parameters, known.start, AMBIENT, np.append(curve.time[0], time))[1:]
    error = known.off * np.hypot(0.02, 0.0017 * (plain - known.start))
    assert known.temperatures(time) == pytest.approx(plain + error, abs=1e-9)
    middle, low, high = known.temperature(900.0, probability=0.5)
    assert [low, middle, high] == pytest.approx(np.quantile((plain + error)[1], [0.25, 0.5, 0.75]))
    when = known.time_to(float(middle), probability=0.5, look_s=3600.0)
    assert when.looked_s == pytest.approx(300.0 + 3600.0)
    for late in (0.0, -1.0):
        with pytest.raises(InputError, match="expected a later time"):
            known.temperatures(np.array([late, 10.0]))


@pytest.mark.parametrize(
    ("name", "fine", "beyond"),
    [
        ("until", 1e-9, 0.0), ("limit", 223.15, 223.14), ("limit", 673.15, 673.16), ("look", 1e-9, 0.0),
        ("probability", 1e-9, 0.0), ("probability", 1.0 - 1e-9, 1.0), ("dampers", 20, 19), ("seed", 0, -1),
    ],
)  # fmt: skip
def test_options_hold_to_their_ends(name, fine, beyond):
    PredictionOptions(**{name: fine})
    with pytest.raises(InputError, match=rf"prediction\.{name}"):
        PredictionOptions(**{name: beyond})


def test_a_power_that_would_fall_to_nothing_is_held_at_a_twentieth():
    """The rate's own derivative is none of the power's there; a warm damper's loss alone cools it."""
    ours = {name: float(value[0]) for name, value in parameters_of(slope=0.02, viscous=0.0).items()}
    time = np.array([0.0, 300.0, 1800.0])
    found = simulate_two_node(parameters_of(slope=0.02, viscous=0.0), np.array([380.0]), AMBIENT, time)
    assert found[:, 0] == pytest.approx(integrated(ours, 380.0, time), abs=0.05)


def test_a_curve_much_longer_than_twenty_minutes_is_averaged_over_a_hundred_and_twentieth():
    """At most so many bins, and one more for its very end."""
    time = np.arange(0.0, 4801.0, 4.0)
    curve = HeatingCurve(time, 300.0 + 0.01 * time)
    problem = _Problem(curve, AMBIENT, Misfit(0.002))
    assert len(problem.time) == 121
    assert problem.time[:2] == pytest.approx([20.0, 58.0])
