"""A damper has parameters and coefficients that depend on the command, and rejects invalid inputs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper, OperatingEnvelope
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
from mrdamper.models.temperature import Arrhenius, Linear, Vft

MILLIAMPERE: Any = "mA"  # A user who runs no type checker can pass this unit.
ONE_END: Any = (0.0,)
ENVELOPE = OperatingEnvelope((0.0, 1.0), (-0.025, 0.025), (-0.2, 0.2))
WARM_ENVELOPE = OperatingEnvelope((0.0, 1.0), (-0.025, 0.025), (-0.2, 0.2), (293.15, 393.15))
RANGE = (288.15, 398.15)


def bouc_wen(**changed):
    given_coefficients: dict[str, ParameterLaw] = {
        "viscosity": Polynomial((600.0, 400.0)),
        "yield_force": Hill(90.0, 629.0, 1.14, 1.466),
        "rho": Exponential(1500.0, -0.3),
        "kappa": Constant(-0.9),
        "n": Constant(1.2),
    }
    return Damper(LAWS["bouc-wen"], {**given_coefficients, **changed})


def warm(*, held=RANGE, actuation=None, **changed):
    forms: dict[str, ParameterLaw] = {
        "viscosity": TemperatureDependent(Polynomial((600.0, 400.0)), Arrhenius(1435.5)),
        "yield_force": TemperatureDependent(Hill(90.0, 629.0, 1.14, 1.466), Linear(1e-3), assumed=True),
        "offset": Bipolynomial((40.0, -0.1), 1),
    }
    cold = bouc_wen(**{**forms, **changed})
    return Damper(cold.law, cold.coefficients, actuation=actuation, temperature_range=held)


def series_valve(**changed):
    values = {
        "yield_force": 400.0,
        "thinning": 3.2,
        "thinning_exponent": 0.43,
        "yield_velocity": 2.5e-3,
        "position_gain": -2.3,
        "gap_stiffness": 1.2e7,
        "gap": 1.7e-4,
        "gap_corner": 4.6e-5,
        "leak_damping": 3e4,
    }
    forms = {name: Constant(value) for name, value in values.items()}
    return Damper(LAWS["series-valve"], {**forms, **changed})


def test_missing_damper_coefficients_have_defaults():
    damper = bouc_wen()
    assert tuple(damper.coefficients) == LAWS["bouc-wen"].names
    assert damper.coefficients["mass"] == Constant(0.0)
    assert damper.coefficients["stribeck_velocity"] == Constant(3e-3)


def test_damper_parameters_have_names_and_units():
    damper = bouc_wen()
    assert list(damper.parameters)[:3] == ["viscosity.c0", "viscosity.c1", "stiffness.value"]
    assert damper.parameters["yield_force.gain"] == 629.0
    assert damper.units["yield_force.half_command"] == "A"
    assert damper.units["viscosity.c1"] == "N s/m/A"
    assert damper.units.keys() == damper.parameters.keys()


@given(st.data())
def test_damper_is_rebuilt_from_its_parameters(data):
    damper = bouc_wen()
    assert damper.with_parameters(damper.parameters) == damper
    name = data.draw(st.sampled_from(sorted(damper.parameters)))
    changed = damper.with_parameters({name: 0.75})
    assert changed.parameters == {**damper.parameters, name: 0.75}
    assert damper == bouc_wen()  # The damper is immutable.


def test_coefficient_table_has_column_per_command():
    damper = bouc_wen()
    commands = np.array([0.0, 0.5, 1.0])
    table = damper.coefficients_at(commands)
    assert table.shape == (len(LAWS["bouc-wen"].names), 3)
    row = LAWS["bouc-wen"].names.index("rho")
    np.testing.assert_allclose(table[row], 1500.0 * np.exp(-0.3 * commands))
    assert damper.coefficients_at(0.5).shape == (table.shape[0], 1)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: bouc_wen(yeild_force=Constant(1.0)),
            "no coefficient 'yeild_force'; did you mean yield_force",
        ),
        (lambda: Damper(LAWS["dahl"], {}), "dahl: yield_force, rho not given, and there is no default"),
        (
            lambda: bouc_wen().with_parameters({"rho.at_zer": 1.0}),
            "no parameter 'rho.at_zer'; did you mean rho.at_zero",
        ),
        (
            lambda: warm(held=(400.0, 300.0)),
            r"temperature_range is \(400.0, 300.0\) K; expected low and high",
        ),
        (
            lambda: Damper(
                LAWS["bouc-wen"], bouc_wen().coefficients, "A", 0.01, actuation=Actuation(0.01, 0.02)
            ),
            "command_lag_s and an actuation are both given; expected one of them",
        ),
        (lambda: OperatingEnvelope((1.0, 0.0), (0.0, 1.0), (0.0, 1.0)), r"envelope: command is \(1.0, 0.0\)"),
    ],
)
def test_error_message_describes_invalid_damper(make, said):
    with pytest.raises(InputError, match=said):
        make()


@pytest.mark.parametrize(
    ("gain", "fine"), [(-2.3, True), (-39.9, True), (39.9, True), (-40.0, False), (41.0, False)]
)
def test_position_gain_is_limited_by_stroke(gain, fine):
    """The force factor 1 + gain x is positive within +-25 mm only if |gain| < 40 per metre."""
    damper = series_valve(position_gain=Constant(gain))
    assert (damper.problems(ENVELOPE) == ()) == fine
    if not fine:
        with pytest.raises(InputError, match=r"1 \+ position_gain x is .* at x = -?0\.025 m and 0 A"):
            damper.check(ENVELOPE)


# ----------------------------------------------------------------------------------------- temperature


def test_damper_parameters_include_temperature_parameters():
    damper = warm()
    assert damper.parameters["viscosity.activation_K"] == 1435.5
    assert damper.units["viscosity.activation_K"] == "K"
    assert damper.units["yield_force.temperature_slope"] == "1/K"
    assert damper.units["offset.c01"] == "N/K"
    assert damper.with_parameters(damper.parameters) == damper
    changed = damper.with_parameters({"viscosity.activation_K": 900.0})
    assert changed.parameters == {**damper.parameters, "viscosity.activation_K": 900.0}
    assert changed.temperature_range == RANGE
    assert changed.assumed == ("yield_force",)


def test_error_message_states_temperature_of_invalid_coefficient():
    fading = warm(yield_force=TemperatureDependent(Constant(100.0), Linear(0.015)))
    commands, kelvins = np.array([0.0, 0.0, 0.5]), np.array([293.15, 353.15, 373.15])
    (said,) = fading.violations(commands, kelvins)
    assert said.startswith("bouc-wen: yield_force is -20 N; ")
    assert said.endswith("(at 0.5 A, 100.0 degC)")
    assert fading.violations(commands) == ()
    with pytest.raises(InputError, match=r"yield_force is -\d.* N; .*\(at 0 A, 95\.0 degC\)"):
        fading.check(WARM_ENVELOPE)
    fading.check(ENVELOPE)  # An envelope without temperatures is checked at 20 degC.


def test_viscosity_pole_inside_temperature_range_is_rejected():
    frozen = warm(held=None, viscosity=TemperatureDependent(Constant(600.0), Vft(50.0, 280.0)))
    (said,) = frozen.violations([0.0, 0.0], [300.0, 275.0])
    assert said == "bouc-wen: viscosity is inf; it must be finite (at 0 A, 1.9 degC)"
