"""Coefficients computed in one call for several parameter sets equal those computed one by one."""

from __future__ import annotations

import numpy as np
import pytest

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
from mrdamper.models.operating_points import OperatingPoints
from mrdamper.models.temperature import Arrhenius, Linear, PolynomialFactor, Reynolds, Vft

COMMAND = np.array([0.0, 0.7, 2.0, 1.3])
TEMPERATURE = np.array([293.15, 330.0, 360.0, 280.0])
FORMS: dict[str, ParameterLaw] = {
    "constant": Constant(3.0),
    "polynomial": Polynomial((3.0, -0.4, 0.2)),
    "hill": Hill(30.0, 600.0, 0.5, 1.7, 2.0),
    "exponential": Exponential(900.0, -0.4),
    "bipolynomial": Bipolynomial((5.0, 0.01, -0.3, 0.002), 1),
    "linear in temperature": TemperatureDependent(Polynomial((3.0, 0.4)), Linear(0.002)),
    "arrhenius": TemperatureDependent(Hill(30.0, 600.0, 0.5, 0.7), Arrhenius(1200.0)),
    "reynolds": TemperatureDependent(Exponential(30.0, 0.3), Reynolds(0.01)),
    "vft": TemperatureDependent(Constant(30.0), Vft(700.0, 150.0)),
    "polynomial in temperature": TemperatureDependent(
        Polynomial((3.0, 0.4)), PolynomialFactor((0.01, -1e-4))
    ),
}


def damper_with(form: ParameterLaw) -> Damper:
    coefficients = {
        "yield_force": form,
        "rho": Exponential(2000.0, -0.1),
        "kappa": Constant(-0.4),
        "n": Constant(1.5),
    }
    return Damper(LAWS["bouc-wen"], coefficients, temperature_range=(285.0, 350.0))


@pytest.mark.parametrize("kind", FORMS)
@pytest.mark.parametrize("held", [0, 1], ids=["every number moves", "the first one does not"])
def test_batched_coefficients_match_single_dampers(kind: str, held: int) -> None:
    damper = damper_with(FORMS[kind])
    names = list(damper.parameters)
    varying = [*[name for name in names if name.startswith("yield_force.")][held:], "rho.rate", LAG]
    wanted = [LAG, *varying[:-1]][::-1]
    levels = OperatingPoints(damper, varying, wanted, COMMAND, TEMPERATURE)
    draw = np.random.default_rng(0)
    given = np.array([{**damper.parameters, LAG: 0.0}[name] for name in varying])
    values = given * draw.uniform(0.9, 1.1, (5, len(varying)))
    combine = np.repeat(levels.combine[None], 5, axis=0)
    coefficients = levels.evaluate(values, combine)
    for k in range(5):
        one = damper.with_parameters(dict(zip(varying[:-1], values[k, :-1].tolist(), strict=True)))
        np.testing.assert_allclose(coefficients[k], one.coefficients_at(COMMAND, TEMPERATURE).T, rtol=1e-12)
        for row, name in enumerate(wanted):
            expected = np.zeros((len(COMMAND), len(levels.places)))
            if name != LAG:
                coefficient, _, number = name.partition(".")
                form = one.coefficients[coefficient]
                gradient = form.gradient(COMMAND, damper.clip_temperature(TEMPERATURE))[
                    form.parameter_names.index(number)
                ]
                expected[:, levels.places.index(damper.law.names.index(coefficient))] = gradient
            np.testing.assert_allclose(combine[k, :, row], expected, rtol=1e-12, atol=1e-300)
