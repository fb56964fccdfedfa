"""Simulation: what it refuses, and that its short cuts change nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from mrdamper import core
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Exponential, ParameterLaw, Polynomial
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import LAG, Tangents, open_drive, sensitivities, simulate

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
def test_a_coefficient_out_of_its_range_is_refused_with_the_range(coefficient, value, message, form):
    ill = replace(DAMPER, coefficients={**DAMPER.coefficients, coefficient: Constant(value)})
    with pytest.raises(InputError, match=message):
        simulate(ill, path(), form=form)


def test_a_coefficient_that_leaves_its_range_along_the_run_is_refused():
    falling = replace(
        DAMPER, coefficients={**DAMPER.coefficients, "yield_force": Polynomial((100.0, -150.0))}
    )
    simulate(falling, path(0.5))
    with pytest.raises(InputError, match="yield_force is -"):
        simulate(falling, path(np.linspace(0.0, 1.0, 501)))


@pytest.mark.parametrize("command", [0.5, np.linspace(0.0, 1.0, 501)], ids=["constant", "varying"])
def test_a_valve_that_would_push_at_the_end_of_the_stroke_is_refused(command):
    """Beyond x = 1 / -position_gain the equation of the valve has no bounded solution."""
    ill = replace(SERIES, coefficients={**SERIES.coefficients, "position_gain": Constant(-200.0)})
    with pytest.raises(InputError, match=r"1 \+ position_gain x is -0\.999\d* at x = 0\.0099\d* m"):
        simulate(ill, path(command))


@pytest.mark.parametrize("damper", [DAMPER, SERIES], ids=lambda damper: damper.law.name)
@pytest.mark.parametrize("form", ["record", "causal"])
def test_a_constant_command_takes_a_short_cut_to_the_same_force(damper, form):
    """One row of coefficients, or one per sample: the same bits up to the order of the additions."""
    constant = open_drive(path())
    varying = replace(constant, constant=None)
    short = simulate(damper, constant, form=form)
    np.testing.assert_allclose(simulate(damper, varying, form=form), short, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("damper", [DAMPER, SERIES], ids=lambda damper: damper.law.name)
def test_a_constant_command_takes_a_short_cut_to_the_same_tangents(damper):
    constant = open_drive(path())
    numbers = list(damper.numbers)
    short, long = (sensitivities(damper, d, numbers) for d in (constant, replace(constant, constant=None)))
    one, two = short.combine @ short.columns, long.combine @ long.columns
    size = np.maximum(np.abs(one).max(axis=1, keepdims=True), 1e-9)
    np.testing.assert_allclose(two / size, one / size, atol=1e-9)


def test_tangents_of_many_runs_are_those_of_each():
    drives = [open_drive(path(command)) for command in (0.0, 0.5, np.linspace(0.0, 1.0, 501), 0.5)]
    numbers = ["yield_force.c1", "rho.value"]
    together = Tangents(DAMPER, numbers, drives)
    for index, each in enumerate(drives):
        alone, of_many = sensitivities(DAMPER, each, numbers), together.along(index)
        np.testing.assert_array_equal(of_many.force, alone.force)
        np.testing.assert_array_equal(of_many.combine @ of_many.columns, alone.combine @ alone.columns)


def test_a_step_of_the_command_arrives_as_one_minus_exp():
    """The command jumps within one sample; from there the closed form, sample by sample."""
    step, lag = 1e-3, 0.02
    command = np.concatenate([np.zeros(10), np.ones(200)])
    applied, _ = core.lagged(command, step, lag)
    # Over the sample in which the command ramps from 0 to 1: 1 - (lag/h)(1 - exp(-h/lag)).
    reached = 1.0 - lag / step * -np.expm1(-step / lag)
    expected = 1.0 - (1.0 - reached) * np.exp(-step / lag * np.arange(200))
    np.testing.assert_allclose(applied[10:], expected, atol=1e-14)
    assert not applied[:10].any()


@given(lag=st.floats(1e-5, 10.0), step=st.floats(1e-4, 0.1), slope=st.floats(-10.0, 10.0))
def test_a_ramp_is_followed_by_the_closed_form_at_any_step(lag, step, slope):
    time = step * np.arange(50)
    applied, _ = core.lagged(slope * time, step, lag)
    np.testing.assert_allclose(applied, slope * (time + lag * np.expm1(-time / lag)), rtol=1e-9, atol=1e-12)


@given(lag=st.floats(2e-3, 1.0))
def test_the_lag_s_derivative_is_its_central_difference(lag):
    command = np.sin(3.0 * path().time)
    by_difference = (
        core.lagged(command, 2e-3, lag * 1.0001)[0] - core.lagged(command, 2e-3, lag * 0.9999)[0]
    ) / (2e-4 * lag)
    np.testing.assert_allclose(core.lagged(command, 2e-3, lag)[1], by_difference, rtol=1e-5, atol=1e-6)


def test_without_lag_the_command_is_applied_at_once():
    command = np.random.default_rng(0).normal(size=40)
    np.testing.assert_array_equal(core.lagged(command, 1e-3, 0.0)[0], command)


def test_a_constant_command_knows_no_lag():
    slow = replace(DAMPER, command_lag_s=0.3)
    np.testing.assert_array_equal(simulate(slow, path()), simulate(DAMPER, path()))
    found = sensitivities(slow, open_drive(path()), [LAG, "yield_force.c1"])
    assert not (found.combine @ found.columns)[0].any()


def test_a_slow_lag_holds_the_force_at_that_of_the_first_command():
    command = np.concatenate([np.zeros(100), np.ones(401)])
    held = simulate(replace(DAMPER, command_lag_s=1e6), path(command))
    np.testing.assert_allclose(held, simulate(DAMPER, path(0.0)), atol=1e-3)


def test_a_command_that_drifts_slowly_gives_nearly_the_constant_one():
    """Continuity: nothing jumps when the fast path is left."""
    moving = replace(DAMPER, coefficients={**DAMPER.coefficients, "rho": Exponential(3000.0, -1.3)})
    drifting = simulate(moving, path(0.5 + 1e-9 * np.arange(501)))
    np.testing.assert_allclose(drifting, simulate(moving, path(0.5)), atol=1e-3)
