"""Simulations reject invalid inputs, and their fast paths give the same results as the general path."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import LAG, Damper
from mrdamper.models.dependence import (
    Bipolynomial,
    Constant,
    Exponential,
    Hill,
    ParameterLaw,
    Polynomial,
    TemperatureDependent,
)
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import open_drive, simulate, simulate_each
from mrdamper.models.tangents import Tangents, sensitivities
from mrdamper.models.temperature import Arrhenius, Linear, PolynomialFactor, Reynolds, TemperatureFactor, Vft
from tests.identify.reference_dampers import REFERENCE_DAMPERS
from tests.oracles.reference import simulate_reference

MOTION = Sine(0.010, 2.0)
BOUC_WEN: dict[str, ParameterLaw] = {
    "yield_force": Polynomial((100.0, 500.0)),
    "rho": Constant(1500.0),
    "kappa": Constant(-0.4),
}
DAMPER = Damper(LAWS["bouc-wen"], {**BOUC_WEN, "n": Constant(1.6)})
SERIES = Damper(
    LAWS["series-valve"],
    {
        name: Constant(value)
        for name, value in {
            "stiffness": 700.0,
            "offset": 50.0,
            "thinning": 3.0,
            "thinning_exponent": 0.4,
            "yield_velocity": 2.5e-3,
            "position_gain": -2.0,
            "gap_stiffness": 1e7,
            "gap": 1.7e-4,
            "gap_corner": 5e-5,
            "leak_damping": 3e4,
        }.items()
    }
    | {"yield_force": Polynomial((100.0, 500.0))},
)


def path(command: ArrayLike = 0.5, rate: float = 500.0):
    return drive(MOTION, duration=1.0, rate_Hz=rate, command=command)


@pytest.mark.parametrize(
    ("coefficient", "value", "message"),
    [
        ("n", 0.1, r"bouc-wen: n is 0\.1 -; the law is well posed for 0\.2 to 20"),
        ("kappa", 1.5, r"kappa is 1\.5 -; the law is well posed for -1 to 1"),
        ("rho", -3.0, r"rho is -3 1/m; the law is well posed for 0\.01 to 1e\+08"),
        ("yield_force", -1.0, r"yield_force is -1 N; the law is well posed for 0 to inf"),
        ("viscosity", -1.0, r"viscosity is -1 N s/m"),
    ],
)
@pytest.mark.parametrize("form", ["record", "causal"])
def test_simulation_rejects_coefficient_outside_range(coefficient, value, message, form):
    ill = replace(DAMPER, coefficients={**DAMPER.coefficients, coefficient: Constant(value)})
    with pytest.raises(InputError, match=message):
        simulate(ill, path(), form=form)


@pytest.mark.parametrize("command", [0.5, np.linspace(0.0, 1.0, 501)], ids=["constant", "varying"])
def test_simulation_rejects_negative_valve_gain(command):
    """For x > 1 / -position_gain, the equation of the valve has no bounded solution."""
    ill = replace(SERIES, coefficients={**SERIES.coefficients, "position_gain": Constant(-200.0)})
    with pytest.raises(InputError, match=r"1 \+ position_gain x is -0\.999\d* at x = 0\.0099\d* m"):
        simulate(ill, path(command))


def test_batched_derivatives_match_single_runs():
    drives = [open_drive(path(command)) for command in (0.0, 0.5, np.linspace(0.0, 1.0, 501), 0.5)]
    parameters = ["yield_force.c1", "rho.value"]
    together = Tangents(DAMPER, parameters, drives)
    for index, each in enumerate(drives):
        alone, of_many = sensitivities(DAMPER, each, parameters), together.evaluate_run(index)
        np.testing.assert_array_equal(of_many.force, alone.force)
        np.testing.assert_array_equal(of_many.combine @ of_many.columns, alone.combine @ alone.columns)


def test_step_response_follows_first_order_lag():
    """The command jumps within one sample. All later samples equal the closed form."""
    step, lag = 1e-3, 0.02
    command = np.concatenate([np.zeros(10), np.ones(200)])
    applied, _ = core.first_order_lag(command, step, lag)
    # A ramp of the command in one sample interval h gives 1 - (lag/h)(1 - exp(-h/lag)).
    reached = 1.0 - lag / step * -np.expm1(-step / lag)
    expected = 1.0 - (1.0 - reached) * np.exp(-step / lag * np.arange(200))
    np.testing.assert_allclose(applied[10:], expected, atol=1e-14)
    assert not applied[:10].any()


@given(lag=st.floats(2e-3, 1.0))
def test_lag_derivative_equals_central_difference(lag):
    command = np.sin(3.0 * path().time)
    by_difference = (
        core.first_order_lag(command, 2e-3, lag * 1.0001)[0]
        - core.first_order_lag(command, 2e-3, lag * 0.9999)[0]
    ) / (2e-4 * lag)
    np.testing.assert_allclose(
        core.first_order_lag(command, 2e-3, lag)[1], by_difference, rtol=1e-5, atol=1e-6
    )


# ---------------------------------------------------------------------------------- dependence on temperature

FRICTION = {
    **{"mass": 3.0, "coulomb_friction": 20.0, "breakaway_friction": 10.0},
    **{"stribeck_velocity": 5e-3, "transition_velocity": 2e-3, "viscous_exponent": 0.8},
}
CHAIN_TERMS = {
    **{"thinning_force": 80.0, "orifice": 900.0, "bristle_share": 0.5, "bristle_stiffness": 3e6},
    **{"bristle_spread": 0.8, "friction_force": 40.0, "friction_stiffness": 5e5, "static_excess": 0.4},
    **{"fade_velocity": 0.01, "memory_force": 60.0, "gas_force": -150.0, "play": 3e-5, "follow_share": 0.6},
    **{"position_gain": -2.0, "position_curvature": 60.0, "gas_length": 0.08, "memory_stiffness": 1.5e4},
    **{"creep": 5e-6, "knee": 0.4, "cavity_length": 0.03, "cavity_force": 500.0, "bubble_length": 2e-5},
    **{"bypass": 2e-4},
}
FACTOR_OF: dict[str, TemperatureFactor] = {
    "viscosity": Arrhenius(1435.5),
    "thinning": Reynolds(0.012),
    "leak_damping": Vft(600.0, 150.0),
    "series_damping": Arrhenius(1200.0),
    "inner_viscosity": Reynolds(0.01),
    "bristle_damping": Arrhenius(1000.0),
    "yield_force": Linear(1.2e-3),
    "rate_force": PolynomialFactor((-1e-3, 1e-6)),
    "coulomb_friction": Linear(2e-3),
    "rho": Linear(1e-3),
}


def warm_damper(name: str, **changed) -> Damper:
    """Return a damper with temperature-dependent coefficients that are not at their bounds."""
    forms = dict(REFERENCE_DAMPERS[name].coefficients)
    forms |= {key: Constant(value) for key, value in FRICTION.items()}
    if name == "chain":
        forms |= {key: Constant(value) for key, value in CHAIN_TERMS.items()}
    for key, value in {"viscosity": 300.0, "stiffness": 600.0, "offset": 40.0}.items():
        if forms[key] == Constant(0.0):
            forms[key] = Constant(value)
    for key, form in forms.items():
        if key in FACTOR_OF:
            assert isinstance(form, Constant | Polynomial | Hill | Exponential)
            forms[key] = TemperatureDependent(form, FACTOR_OF[key])
    forms["offset"] = Bipolynomial((40.0, -0.1, 5.0, 0.02), 1)
    if "n" in forms:
        forms["n"] = Constant(1.47)  # The kernel's table jumps by 1e-7 at n = 1.5.
    return Damper(LAWS[name], {**forms, **changed})


def warming(
    command: ArrayLike = 0.5,
    *,
    start: float = 300.0,
    rise: float = 50.0,
    rate: float = 500.0,
    duration: float = 1.0,
):
    """Return the motion while the temperature rises smoothly by ``rise`` [K] over the run."""
    path = drive(MOTION, duration=duration, rate_Hz=rate, command=0.0)
    at = np.broadcast_to(np.asarray(command, dtype=np.float64), len(path)).copy()
    share = path.time / path.time[-1]
    return replace(path, command=at, temperature=start + rise * share * (2.0 - share))


def swinging(path) -> FloatArray:
    return np.asarray(0.5 + 0.4 * np.sin(2.0 * math.pi * 0.8 * path.time), dtype=np.float64)


def relative(found, expected) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


every_law = pytest.mark.parametrize("name", list(REFERENCE_DAMPERS))
# The chain takes minutes with heating, so ``tests/core/test_laws.py`` tests it without heating.
every_other_law = pytest.mark.parametrize("name", [name for name in REFERENCE_DAMPERS if name != "chain"])


@pytest.mark.parametrize("form", ["record", "causal"])
def test_temperature_dependent_damper_requires_temperature(form):
    damper = warm_damper("bouc-wen")
    said = (
        r"no temperature channel; expected a column such as temperature_degC\. Map the channel, or state it"
    )
    with pytest.raises(InputError, match=said):
        simulate(damper, path(), form=form)
    with pytest.raises(InputError, match=said):
        sensitivities(damper, open_drive(path()), ["rho.value"])
    with pytest.raises(InputError, match=said):
        Tangents(damper, ["rho.value"], [open_drive(warming()), open_drive(path())])


@every_law
def test_batched_simulation_matches_single_runs(name):
    """The runs differ in length, sample rate, command and temperature. One run has a rising temperature."""
    damper = warm_damper(name)
    paths = [
        warming(0.5, start=300.0, rise=0.0, duration=0.4),
        warming(0.0, start=320.0, rise=0.0, duration=0.7, rate=200.0),
        warming(),
        warming(0.5, start=320.0, rise=0.0, duration=0.2),
        warming(0.9, start=300.0, rise=0.0, duration=0.3, rate=1000.0),
    ]
    for force, each in zip(simulate_each(damper, paths), paths, strict=True):
        alone = simulate(damper, each)
        np.testing.assert_allclose(force, alone, rtol=0.0, atol=1e-9 * float(np.abs(alone).max()))


@every_law
@pytest.mark.parametrize("form", ["record", "causal"])
def test_shortcut_for_constant_temperature_keeps_force(name, form):
    """Coefficients that are computed once give the same force as coefficients at every sample."""
    damper, one = warm_damper(name), open_drive(warming(start=341.0, rise=0.0))
    assert one.temperature == 341.0
    assert not one.temperature_varies
    each = replace(one, constant=None)
    short = simulate(damper, one, form=form)
    np.testing.assert_allclose(simulate(damper, each, form=form), short, rtol=0.0, atol=1e-12 * np.ptp(short))


@every_law
def test_temperature_beyond_damper_range_is_clipped(name):
    held = replace(warm_damper(name), temperature_range=(288.15, 378.15))
    hot, edge = (simulate(held, warming(start=kelvin, rise=0.0)) for kelvin in (473.15, 378.15))
    np.testing.assert_array_equal(hot, edge)
    run = warming(start=330.0, rise=120.0)
    capped = replace(run, temperature=np.minimum(run.temperature, 378.15))
    np.testing.assert_array_equal(simulate(held, run), simulate(held, capped))
    free = replace(held, temperature_range=None)
    assert relative(simulate(free, run), simulate(held, run)) > 1e-3


def test_warming_dashpot_matches_formula():
    """F = c exp[B (1/T - 1/293.15)] v holds at every sample. At 40 degC, the force is 27 % lower."""
    run = warming(start=293.15, rise=20.0)
    assert run.temperature is not None
    zero = {"yield_force": Constant(0.0), "yield_velocity": Constant(0.01)}
    damper = Damper(
        LAWS["bingham"], {"viscosity": TemperatureDependent(Constant(2000.0), Arrhenius(1435.5)), **zero}
    )
    factor = np.exp(1435.5 * (1.0 / run.temperature - 1.0 / 293.15))
    np.testing.assert_allclose(simulate(damper, run), 2000.0 * factor * run.velocity, rtol=1e-13, atol=1e-12)
    assert factor[-1] == pytest.approx(0.731, abs=1e-3)


# Limits of the force error at rising temperature, divided by the peak force. The measured errors at 1 kHz
# are 3e-5, 8e-5 and 5e-4. The error of the valve is proportional to the sample interval because the valve
# uses the coefficients at the end of the interval.
WARMING_ERRORS = {"lugre": 1e-4, "spencer": 2e-4, "series-valve": 8e-4}
ACTUATED_ERRORS = {**WARMING_ERRORS, "spencer": 3e-4, "series-valve": 6e-4}


@pytest.mark.nightly
@every_other_law
@pytest.mark.parametrize("varying", [False, True], ids=["command held", "command swinging"])
def test_warming_run_matches_integrator(name, varying):
    """The run warms by 50 K in 0.4 s at 1 kHz. The kernel uses the mean of rho over a sample (order two)."""
    run = warming(duration=0.4, rate=1000.0)
    if varying:
        run = replace(run, command=swinging(run))
    damper = warm_damper(name)
    found = relative(simulate(damper, run), simulate_reference(damper, run, tolerance=1e-8))
    assert found < WARMING_ERRORS.get(name, 2e-5)


def differences(force_at, value: float) -> Iterator[FloatArray]:
    """Yield central differences with three step sizes. The best size depends on the curvature."""
    for share in (1e-4, 1e-5, 1e-6):
        h = share * (abs(value) or 1.0)
        first = force_at(value + h) - force_at(value - h)
        yield (8.0 * first - (force_at(value + 2.0 * h) - force_at(value - 2.0 * h))) / (12.0 * h)


def is_tangent(column: FloatArray, force_at, value: float, tolerance: float) -> bool:
    most = tolerance * max(float(np.abs(column).max()), 1e-6)
    return any(float(np.abs(column - found).max()) < most for found in differences(force_at, value))


RUNS = {
    "one point": lambda: warming(start=341.0, rise=0.0),
    "one point beyond the range": lambda: warming(start=390.0, rise=0.0),
    "warming": warming,
    "command swinging": lambda: replace(warming(start=341.0, rise=0.0), command=swinging(path())),
    "both": lambda: replace(warming(), command=swinging(path())),
}
DAILY = {"both"}


@pytest.mark.system
@every_law
@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=() if kind in DAILY else pytest.mark.nightly) for kind in RUNS]
)
def test_force_derivatives_with_heating_match_differences(name, kind):
    """The parameters include the command lag. Temperatures above the range of the damper are clipped."""
    run = open_drive(RUNS[kind]())
    damper = replace(warm_damper(name), command_lag_s=0.03, temperature_range=(280.0, 345.0))
    parameters = [*damper.parameters, LAG]
    found = sensitivities(damper, run, parameters)
    np.testing.assert_allclose(found.force, simulate(damper, run), rtol=0.0, atol=1e-9)
    columns = found.combine @ found.columns
    for row, number in enumerate(parameters):

        def force_at(value, number=number):
            moved = (
                replace(damper, command_lag_s=value)
                if number == LAG
                else damper.with_parameters({number: value})
            )
            return simulate(moved, run)

        value = damper.command_lag_s if number == LAG else damper.parameters[number]
        # The kernel solves implicit laws to a residual of 1e-7, which limits the difference quotients.
        assert is_tangent(columns[row], force_at, value, 2e-6), number


# ------------------------------------------------------------------------------------------- actuated current

ACTUATION = Actuation(rise_s=0.02, fall_s=0.035, second_s=0.006, delay_s=0.004)


def stepping(rate: float = 500.0):
    run = path(rate=rate)
    return replace(run, command=np.where((run.time > 0.2) & (run.time < 0.6), 0.9, 0.1))


def test_force_with_actuation_matches_formula():
    """The Bingham force is Fy a(t) tanh(v/vr). a(t) is the response of two equal lags after the delay."""
    tau, late, run = 0.03, 0.01, path(rate=2000.0)
    run = replace(run, command=np.where(run.time > 0.2, 1.0, 0.0))
    damper = Damper(
        LAWS["bingham"],
        {"yield_force": Polynomial((0.0, 1000.0)), "yield_velocity": Constant(0.01)},
        actuation=Actuation(tau, tau, tau, late),
    )
    # A command that rises within one sample interval acts like a step in the middle of this interval.
    since = np.maximum(run.time - 0.20025 - late, 0.0) / tau
    expected = 1000.0 * (1.0 - (1.0 + since) * np.exp(-since)) * np.tanh(run.velocity / 0.01)
    np.testing.assert_allclose(simulate(damper, run), expected, atol=0.1)


@pytest.mark.nightly
@every_other_law
def test_force_with_actuation_matches_integrator(name):
    """Kernel and integrator apply the actuation at the samples and interpolate linearly."""
    run = replace(stepping(1000.0), temperature=np.linspace(300.0, 340.0, 1001))
    damper = replace(warm_damper(name), actuation=ACTUATION)
    found = relative(simulate(damper, run), simulate_reference(damper, run, tolerance=1e-8))
    assert found < ACTUATED_ERRORS.get(name, 5e-5)


def test_derivatives_with_actuation_match_central_differences():
    run = open_drive(stepping())
    damper = replace(DAMPER, actuation=ACTUATION)
    parameters = ["yield_force.c0", "yield_force.c1", "rho.value", "n.value"]
    found = sensitivities(damper, run, parameters)
    np.testing.assert_allclose(found.force, simulate(damper, run), rtol=0.0, atol=1e-9)
    for column, number in zip(found.combine @ found.columns, parameters, strict=True):

        def force_at(value, number=number):
            return simulate(damper.with_parameters({number: value}), run)

        assert is_tangent(column, force_at, damper.parameters[number], 1e-6), number
