"""Early prediction: how good it is on a fleet that it does not know, and that its answers are Bayes'."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mrdamper.errors import ConvergenceError, InputError
from mrdamper.thermal.estimation.measured_curve import HeatingCurve
from mrdamper.thermal.estimation.prediction import (
    EarlyPrediction,
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


def test_without_falls_and_growth_it_is_the_closed_form():
    """All capacity at the fluid, constant power, constant film: the exponential, to the method's error."""
    time = np.linspace(0.0, 3600.0, 50)
    one = parameters_of(
        viscous=0.0, slope=0.0, exponent=0.0, share=1.0 - 1e-9, heating=0.08, loss=1.0 / 900.0
    )
    found = simulate_two_node(one, np.array([300.0]), AMBIENT, time)[:, 0]
    exact = constant_heating(time, 0.08, 1.0 / 900.0, 1.0, ambient=AMBIENT, start=300.0)
    assert found == pytest.approx(exact, abs=5e-3)


def test_it_ends_where_power_and_loss_balance():
    at = parameters_of(exponent=0.25, viscous=0.3)
    end = float(simulate_two_node(at, np.array([AMBIENT]), AMBIENT, np.array([0.0, 1e5]))[-1, 0])
    excess = end - AMBIENT
    viscous = 0.3 * math.exp(1400.0 * (1.0 / end - 1.0 / AMBIENT))
    power = at["heating"][0] * (viscous + 0.7 * (1.0 - at["slope"][0] * excess))
    film = at["loss"][0] * ((excess**2 + 25.0) / 1625.0) ** 0.125
    assert power == pytest.approx(film * excess, rel=1e-6)


def test_nothing_happens_to_a_damper_at_ambient_without_power():
    rest = parameters_of(heating=0.0)
    assert simulate_two_node(
        rest, np.array([AMBIENT]), AMBIENT, np.array([0.0, 600.0, 1e4])
    ) == pytest.approx(AMBIENT)


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


@pytest.mark.system
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


@pytest.mark.system
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
