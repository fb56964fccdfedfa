"""No coefficient of a fitted damper becomes negative at the currents and temperatures of its runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.records import Dataset, Recording
from mrdamper.identify.limits import limit_coefficients
from mrdamper.jobs.fit import fit
from mrdamper.models.damper import OperatingEnvelope
from mrdamper.models.dependence import Bipolynomial, Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.temperature import Linear
from tests.support.cards import CHAIN

TEMPERATURES_K = (289.0, 305.0)
ENVELOPE = OperatingEnvelope((0.0, 2.0), (-0.01, 0.01), (-0.1, 0.1), TEMPERATURES_K)


@pytest.mark.parametrize(
    "form",
    [
        TemperatureDependent(Constant(50.0), Linear(0.145)),  # Negative above 300 K
        TemperatureDependent(Polynomial((50.0, 10.0)), Linear(0.145)),
        Polynomial((50.0, -40.0)),  # Negative above 1.25 A
        Polynomial((10.0, -60.0, 31.0)),  # Negative between 0.2 and 1.8 A
        Bipolynomial((50.0, -6.0, 10.0, 0.0), 1),
    ],
    ids=repr,
)
def test_friction_stays_positive_in_envelope(form: ParameterLaw) -> None:
    damper = replace(
        CHAIN, coefficients={**CHAIN.coefficients, "friction_force": form}, temperature_range=TEMPERATURES_K
    )
    limited, notes = limit_coefficients(damper, ENVELOPE)
    currents, temperatures = np.meshgrid(np.linspace(0.0, 2.0, 41), np.linspace(*TEMPERATURES_K, 9))
    at = currents.ravel(), temperatures.ravel()
    assert np.min(form.value(*at)) < 0.0
    assert np.min(limited.coefficients["friction_force"].value(*at)) >= 0.0
    assert any("friction_force" in note for note in notes)


def test_limits_do_not_change_coefficient_near_zero() -> None:
    vanishing = TemperatureDependent(Constant(50.0), Linear((1.0 - 1e-7) / (TEMPERATURES_K[1] - 293.15)))
    damper = replace(
        CHAIN,
        coefficients={**CHAIN.coefficients, "friction_force": vanishing},
        temperature_range=TEMPERATURES_K,
    )
    limited, _ = limit_coefficients(damper, ENVELOPE)
    temperatures = np.linspace(*TEMPERATURES_K, 9)
    before, after = (
        form.value(np.zeros(9), temperatures) for form in (vanishing, limited.coefficients["friction_force"])
    )
    np.testing.assert_allclose(after, before, atol=0.01 * np.max(before))


def test_parameter_without_effect_stays_small() -> None:
    """The breakaway force decays below the lowest sampled velocity, so no sample determines the force."""
    time = np.arange(1500) / 500.0
    volts = 0.5 * np.sin(4.0 * np.pi * time)
    speed = np.gradient(volts, time)
    runs = [
        Recording(
            name=f"{current:.1f} A",
            time=time,
            # A data logger rounds like this, so few velocities are zero.
            displacement=0.01 * np.round(volts, 5),
            force=980.665 * np.round(strength * np.tanh(speed) + 0.05 * speed, 5),
            command=np.full(len(time), current),
            command_unit="A",
            temperature=np.full(len(time), 293.15),
        ).checked()
        for current, strength in ((0.0, 0.2), (1.0, 0.9))
    ]
    found = fit(Dataset(tuple(runs)), "bouc-wen")
    breakaway = next(free for free in found.problem.linear if free.name == "breakaway_friction.value")
    assert breakaway.lower <= found.damper.parameters[breakaway.name] <= breakaway.upper
