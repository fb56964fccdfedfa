"""The observer: consistent with itself, right on dampers off its drawing, honest without a signal."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.stats import chi2

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.estimation.observer import (
    ObserverState,
    TemperatureObserver,
    ThermalMeasurement,
    ThermalRecord,
    Thermometers,
    observe_temperature,
    time_left,
)
from mrdamper.thermal.estimation.uncertainty import FACTORS, ModelUncertainty
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import simulate_network
from tests.support.tiers import one_by_day
from tests.thermal.astray import perturbed

DRAWING = read_drawing(Path(__file__).parents[2] / "examples" / "paper_damper.toml")
BARE = DRAWING.with_sink(None)
AMBIENT = 293.15
OHM = 4.2
COPPER = 0.00393
LIMIT = 403.15  # 130 degC


def power(kelvin):
    return 75.0 - 0.15 * (np.asarray(kelvin) - AMBIENT)


GOES_ON = Load(7200.0, power, 4.0 * OHM)


def observer_of(drawing: DamperDrawing = BARE, **changed) -> TemperatureObserver:
    return TemperatureObserver(zone_network(drawing), OHM, **changed)


@dataclass(frozen=True)
class Truth:
    """Another damper than the drawn one, at 1 s steps."""

    fluid: FloatArray
    coil: FloatArray
    wall: FloatArray
    resistance_20: float


def truth_of(base: DamperDrawing, rng: np.random.Generator, *, off_percent: float = 1.0) -> Truth:
    drawing, more = perturbed(base, rng)
    load = Load(1800.0, lambda kelvin: more * power(kelvin), 4.0 * OHM)
    heating = simulate_network(zone_network(drawing), [load], longest_step=10.0)
    time = np.arange(0.0, 1801.0)
    fluid, coil, wall = (
        PchipInterpolator(heating.time, v)(time) for v in (heating.fluid, heating.coil, heating.wall)
    )
    return Truth(fluid, coil, wall, OHM * (1.0 + 0.01 * off_percent))


def zero(
    observer: TemperatureObserver, truth: Truth, rng: np.random.Generator, noise: float
) -> ObserverState:
    """Return the state after half a minute of probing current on the cold damper."""
    state = observer.start(spread_K=0.3)
    for _ in range(30):
        ohm = truth.resistance_20 * (1.0 + noise * rng.standard_normal())
        state = observer.step(state, ThermalMeasurement(1.0, 0.0, 0.5, ohm))
    return state


def follow(
    observer: TemperatureObserver,
    truth: Truth,
    rng: np.random.Generator,
    *,
    noise: float = 0.01,
    by_coil: bool = True,
    by_body: bool = False,
    until: int = 1800,
) -> tuple[FloatArray, FloatArray, ObserverState]:
    """Return errors of the fluid [K], their stated deviations, and the last state."""
    state = zero(observer, truth, rng, noise) if by_coil else observer.start(spread_K=0.3)
    ohm = truth.resistance_20 * (1.0 + COPPER * (truth.coil - AMBIENT))
    ohm = ohm * (1.0 + noise * rng.standard_normal(len(ohm)))
    body = truth.wall + 0.5 * rng.standard_normal(len(truth.wall))
    errors, stated = [], []
    for k in range(1, until + 1):
        watts = float(power(observer.fluid(state)[0]))
        seen = ThermalMeasurement(1.0, watts, 2.0, ohm[k] if by_coil else None, body[k] if by_body else None)
        state = observer.step(state, seen)
        fluid, spread = observer.fluid(state)
        errors.append(fluid - truth.fluid[k])
        stated.append(spread)
    return np.array(errors), np.array(stated), state


# ---------------------------------------------------------------------------------------------- consistency


def test_its_covariance_is_that_of_its_errors():
    """Normalised squared errors of 20 dampers drawn from its own beliefs: chi-squared, n degrees each."""
    model_uncertainty = ModelUncertainty(0.05, 0.05, 0.1, 0.1, 0.1, 0.01, node_K_per_sqrt_s=0.03)
    observer = observer_of(model_uncertainty=model_uncertainty, thermometers=Thermometers(0.005, 0.001, 0.5))
    size = len(observer.network.names) + len(FACTORS)
    rng, runs, squares = np.random.default_rng(1), 20, []
    for _ in range(runs):
        state = observer.start()
        actual = rng.multivariate_normal(state.mean, state.covariance, method="cholesky")
        for _ in range(40):
            truth_told = ThermalMeasurement(5.0, 70.0, 2.0)
            ahead, _ = observer._advance(actual, np.eye(size), truth_told)
            actual = ahead + np.sqrt(5.0 * observer._walk()) * rng.standard_normal(size)
            coil = float(observer.network.coil @ actual[: size - len(FACTORS)])
            ohm = OHM * math.exp(actual[-1]) * (1.0 + COPPER * (coil - AMBIENT))
            ohm += observer.thermometers.resistance_error(ohm, 2.0) * rng.standard_normal()
            body = float(observer.network.wall @ actual[: size - len(FACTORS)]) + 0.5 * rng.standard_normal()
            state = observer.step(state, replace(truth_told, resistance_ohm=ohm, body_K=body))
        off = actual - state.mean
        squares.append(off @ np.linalg.solve(state.covariance, off))
    low, high = (float(chi2.ppf(share, size * runs)) / runs for share in (0.005, 0.995))
    assert low < np.mean(squares) < high


def test_with_a_perfect_drawing_and_no_doubt_it_is_the_network():
    """Without doubt and readings it runs the network: Euler against ROS2, first order in the step."""
    sure = ModelUncertainty(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    observer = observer_of(model_uncertainty=sure)
    reference = simulate_network(observer.network, [Load(300.0, power, 4.0 * OHM)], longest_step=2.0).fluid[
        -1
    ]
    errors = []
    for step in (2.0, 1.0):
        state = observer.start()
        for _ in range(round(300.0 / step)):
            fluid = observer.fluid(state)[0]
            # the power at the step's end, as the implicit step has everything else
            ahead = observer.step(state, ThermalMeasurement(step, float(power(fluid)), 2.0))
            state = observer.step(
                state, ThermalMeasurement(step, float(power(observer.fluid(ahead)[0])), 2.0)
            )
        errors.append(observer.fluid(state)[0] - reference)
    assert abs(errors[1]) < 0.05
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.2)


def test_a_thousand_milliseconds_are_a_second():
    """The rate of a control loop or of a logger: the same state, temperatures and spread."""
    observer = observer_of()
    slow = observer.step(observer.start(), ThermalMeasurement(1.0, 70.0, 2.0, 4.25))
    fast = observer.start()
    for _ in range(999):
        fast = observer.step(fast, ThermalMeasurement(1e-3, 70.0, 2.0))
    fast = observer.step(fast, ThermalMeasurement(1e-3, 70.0, 2.0, 4.25))
    assert fast.time_s == pytest.approx(1.0)
    assert observer.fluid(fast) == pytest.approx(observer.fluid(slow), abs=0.02)


# ---------------------------------------------------------------------------- on dampers that are not its own


@pytest.mark.nightly
@pytest.mark.parametrize("drawing", one_by_day([DRAWING, BARE]), ids=["fins", "bare"])
def test_coil_resistance_with_one_percent_of_noise_is_a_thermometer(drawing):
    """Four dampers off their drawing, R20 off by 1 %: at most 1.2 K, and the stated interval holds."""
    rng, errors, inside = np.random.default_rng(3), [], []
    for _ in range(4):
        off, stated, _ = follow(observer_of(drawing), truth_of(drawing, rng), rng)
        errors.append(off[60:])
        inside.append(np.abs(off[60:]) < 1.645 * stated[60:])
    assert np.sqrt(np.mean(np.square(errors))) < 1.2
    assert np.mean(inside) > 0.8


def test_a_cold_start_zeroes_the_resistance():
    """Six deviations of drawing and 3 % off: after half a minute at ambient R20 is known to 0.3 %."""
    rng = np.random.default_rng(4)
    truth = truth_of(BARE, rng, off_percent=3.0)
    observer = observer_of(model_uncertainty=ModelUncertainty(resistance=0.03))
    found, spread = observer.factors(zero(observer, truth, rng, 0.005))["resistance"]
    assert spread < 0.003
    assert found == pytest.approx(1.03, abs=3.0 * spread)


# ------------------------------------------------------------------------------------------------ no signal


def test_without_current_there_is_no_signal_and_the_spread_grows():
    observer = observer_of()
    state = observer.start()
    spreads = []
    for _ in range(60):
        # a driver that is off reports any number: it must not count
        state = observer.step(state, ThermalMeasurement(10.0, 60.0, 0.0, 4.2))
        spreads.append(observer.fluid(state)[1])
    assert (np.diff(spreads) > 0.0).all()
    assert spreads[-1] > 5.0 * spreads[0]


def test_the_noise_of_a_resistance_goes_by_the_current():
    noise = Thermometers(0.01, 0.005)
    assert noise.resistance_error(4.2, 0.0) == math.inf
    assert noise.resistance_error(4.2, 1e6) == pytest.approx(0.042)
    assert noise.resistance_error(4.2, 0.01) == pytest.approx(0.5, rel=0.01)


def test_a_reading_that_is_nan_is_no_reading():
    observer = observer_of()
    state = observer.start()
    silent = observer.step(state, ThermalMeasurement(1.0, 50.0, 2.0))
    broken = observer.step(state, ThermalMeasurement(1.0, 50.0, 2.0, math.nan, math.nan))
    assert np.array_equal(silent.mean, broken.mean)
    assert np.array_equal(silent.covariance, broken.covariance)


def test_what_was_learnt_is_kept_over_a_restart():
    rng = np.random.default_rng(7)
    observer = observer_of()
    before = zero(observer, truth_of(BARE, rng), rng, 0.005)
    again = observer.start(330.0, spread_K=20.0, learnt=before)
    assert observer.factors(again) == observer.factors(before)
    assert observer.fluid(again) == pytest.approx((330.0, 20.0), rel=0.05)


# ------------------------------------------------------------------------------------------------ time left


@pytest.mark.nightly
def test_the_time_left_holds_with_the_capacity_off_by_ten_percent():
    """Eight dampers, capacity 10 % off either way: the intervals hold, and the medians are within 3 min."""
    rng, inside, errors = np.random.default_rng(8), [], []
    for k in range(8):
        factor = 1.1 if k % 2 else 1.0 / 1.1
        given = BARE.calibration
        other = replace(BARE, calibration=replace(given, heat_capacity=given.heat_capacity * factor))
        load = Load(3600.0, power, 4.0 * OHM)
        heating = simulate_network(zone_network(other), [load], longest_step=10.0)
        time = np.arange(0.0, 3601.0)
        fluid, coil, wall = (
            PchipInterpolator(heating.time, v)(time) for v in (heating.fluid, heating.coil, heating.wall)
        )
        observer = observer_of()
        _, _, state = follow(observer, Truth(fluid, coil, wall, 1.01 * OHM), rng, until=600)
        found = time_left(observer, state, GOES_ON, LIMIT)
        true = float(time[np.argmax(fluid >= LIMIT)]) - 600.0
        inside.append(found.low_s <= true <= found.high_s)
        errors.append(found.median_s - true)
    assert np.mean(inside) >= 0.75
    assert np.sqrt(np.mean(np.square(errors))) < 180.0


def test_with_nothing_in_doubt_the_time_left_is_the_networks():
    sure = ModelUncertainty(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    observer = observer_of(model_uncertainty=sure)
    state = observer.start(spread_K=1e-6)
    found = time_left(observer, state, GOES_ON, LIMIT, dampers=5)
    heating = simulate_network(
        observer.network, [Load(7200.0, power, 4.0 * OHM)], longest_step=5.0, stop_at=LIMIT
    )
    assert found.median_s == pytest.approx(float(heating.time[-1]), abs=3.0)
    assert found.high_s - found.low_s < 0.1
    assert found.not_reached == 0.0


def test_a_limit_above_the_steady_state_is_not_reached():
    observer = observer_of(DRAWING)
    found = time_left(observer, observer.start(), GOES_ON, 480.0)
    assert (found.median_s, found.low_s, found.not_reached) == (math.inf, math.inf, 1.0)
    assert "not reached" in str(found)


def test_at_the_limit_no_time_is_left():
    observer = observer_of()
    found = time_left(observer, observer.start(410.0, spread_K=0.1), GOES_ON, LIMIT)
    assert (found.median_s, found.high_s) == (0.0, 0.0)


def test_impossible_numbers_are_refused():
    with pytest.raises(InputError, match="resistance_20_ohm is 0"):
        TemperatureObserver(zone_network(BARE), 0.0)
    with pytest.raises(InputError, match=r"model uncertainty: loss is -1"):
        ModelUncertainty(loss=-1.0)
    with pytest.raises(InputError, match="expected positive noise"):
        Thermometers(body_K=0.0)
    with pytest.raises(InputError, match="one weight per node"):
        observer_of(body=np.ones(3))
    observer = observer_of()
    with pytest.raises(InputError, match=r"-1\.0 s passed"):
        observer.step(observer.start(), ThermalMeasurement(-1.0, 0.0, 0.0))


# ------------------------------------------------------------------------------------------------- a record


def test_a_record_is_observed_row_by_row():
    """The same as the observer step by step; the fluid's error is what it says."""
    rng = np.random.default_rng(8)
    truth = truth_of(BARE, rng)
    time = np.arange(0.0, 601.0, 5.0)
    at = time.astype(int)
    ohm = truth.resistance_20 * (1.0 + COPPER * (truth.coil[at] - AMBIENT))
    body = truth.wall[at] + 0.5 * rng.standard_normal(len(at))
    body[10:20] = math.nan
    watts = power(truth.fluid[at])
    found = observe_temperature(
        BARE, ThermalRecord(time, watts, np.full(len(time), 2.0), resistance=ohm, body=body)
    )
    observer = observer_of()
    state = observer.start()
    for k in range(len(time)):
        elapsed = 5.0 if k else 0.0
        state = observer.step(state, ThermalMeasurement(elapsed, watts[k], 2.0, ohm[k], body[k]))
    assert (found.fluid[-1], found.fluid_error[-1]) == observer.fluid(state)
    assert (found.wall[-1], found.wall_error[-1]) == observer.wall(state)
    assert found.factors == observer.factors(state)
    assert np.abs(found.fluid - truth.fluid[at])[60:].max() < 4.0 * found.fluid_error[60:].max()
    assert found.state.time_s == pytest.approx(600.0)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"time": np.zeros(4)}, "time does not rise"),
        ({"power": np.array([1.0, 2.0, math.nan, 3.0])}, "a power or current is not finite"),
        ({"body": np.zeros(3)}, r"body has shape \(3,\), time \(4,\)"),
        ({"body": None}, "expected the coil's resistance, a body temperature, or both"),
    ],
)
def test_a_record_that_says_nothing_is_refused(changed, said):
    plain = {"time": np.arange(4.0), "power": np.ones(4), "current": np.ones(4), "body": np.full(4, 300.0)}
    with pytest.raises(InputError, match=said):
        ThermalRecord(**{**plain, **changed})


@pytest.mark.parametrize("name", ["resistance", "voltage_V", "body_K"])
def test_thermometers_have_noise(name: str):
    """None at all of one of the resistance's two sources will do."""
    with pytest.raises(InputError, match="expected positive noise"):
        Thermometers(**{name: -0.1})
    with pytest.raises(InputError, match="the resistance has no noise at all"):
        Thermometers(resistance=0.0, voltage_V=0.0)
    assert Thermometers(resistance=0.0).resistance_error(5.0, -2.0) == 0.0025
    assert Thermometers(voltage_V=0.0).resistance_error(5.0, 2.0) == 0.05
    assert Thermometers().resistance_error(5.0, 0.0) == math.inf


def test_a_start_is_one_temperature_of_all_and_a_little_of_each():
    """Two nodes are off together but for a fifth of the deviation of each."""
    observer, n = observer_of(), len(zone_network(BARE).names)
    state = observer.start(320.0, spread_K=2.0)
    assert state.mean[:n] == pytest.approx(320.0)
    assert state.mean[n:] == pytest.approx(0.0)
    assert np.diag(state.covariance)[:n] == pytest.approx(4.0)
    assert state.covariance[0, 1] == pytest.approx(4.0 * 0.96)
    assert state.covariance[:n, n:] == pytest.approx(0.0)
    assert state.covariance[n:, n:] == pytest.approx(ModelUncertainty().covariance)
    assert observer.start().mean[0] == AMBIENT
    for start, spread in ((math.nan, 1.0), (300.0, 0.0), (300.0, -1.0), (math.inf, 1.0)):
        with pytest.raises(InputError, match="expected a positive spread"):
            observer.start(start, spread_K=spread)


@pytest.mark.parametrize("ohm", [0.0, -1.0, math.nan, math.inf])
def test_a_coil_has_a_resistance(ohm: float):
    with pytest.raises(InputError, match=r"resistance_20_ohm is .*expected the coil's at 20 degC"):
        TemperatureObserver(zone_network(BARE), ohm)
    n = len(zone_network(BARE).names)
    with pytest.raises(InputError, match="one weight per node, sum 1"):
        observer_of(body=np.full(n, 1.001 / n))


def test_time_that_stands_still_changes_nothing_without_a_reading():
    observer = observer_of()
    state = observer.start()
    same = observer.step(state, ThermalMeasurement(0.0, 70.0, 2.0))
    assert np.array_equal(same.mean, state.mean)
    assert np.array_equal(same.covariance, state.covariance)
    blind = observer.step(state, ThermalMeasurement(0.0, 70.0, 0.0, resistance_ohm=5.0))  # without current
    assert np.array_equal(blind.mean, state.mean)
    with pytest.raises(InputError, match="nan s passed; expected zero or more"):
        observer.step(state, ThermalMeasurement(math.nan, 0.0, 0.0))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"time": np.array([0.0, 1.0, 1.0, 2.0])}, "time does not rise"),
        ({"current": np.array([1.0, 2.0, math.inf, 3.0])}, "a power or current is not finite"),
        ({"current": np.zeros(5)}, r"current has shape \(5,\)"),
        ({"resistance": np.zeros(2)}, r"resistance has shape \(2,\)"),
    ],
)
def test_a_record_whose_columns_do_not_fit_is_refused(changed, said):
    plain = {"time": np.arange(4.0), "power": np.ones(4), "current": np.ones(4), "body": np.full(4, 300.0)}
    assert len(ThermalRecord(np.ones(1), np.ones(1), np.ones(1), body=np.ones(1)).time) == 1
    with pytest.raises(InputError, match=said):
        ThermalRecord(**{**plain, **changed})
