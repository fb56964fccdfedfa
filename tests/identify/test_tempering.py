"""A fit begins with the chosen temperature dependence and recovers the dependence of simulated runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import Sine, drive
from mrdamper.identify.problem import FitProblem, FreeParameter
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.temperature import (
    Temperature,
    apply_fluid,
    scale_thinning,
)
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import (
    Constant,
    Hill,
    Polynomial,
    TemperatureDependent,
)
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate
from mrdamper.models.temperature import Arrhenius, Linear, PolynomialFactor, Reynolds, TemperatureFactor, Vft
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS

CELSIUS = 273.15
THREE = (20.0, 60.0, 100.0)


def run_at(
    damper: Damper,
    celsius: float | None,
    command: float,
    *,
    motion: Sine,
    name: str = "",
    until: float | None = None,
) -> PreparedRun:
    """Return a noiseless run at ``celsius``, or warming to ``until``. None omits the temperature channel."""
    path = drive(motion, duration=2.0, rate_Hz=250.0, command=command)
    if celsius is not None:
        end = celsius if until is None else until
        path = replace(path, temperature=np.linspace(celsius, end, len(path)) + CELSIUS)
    run = RigRun(
        name=name or f"{motion.frequency:g} Hz {command:g} A {celsius} degC",
        time=path.time,
        displacement=np.array(path.displacement),
        force=simulate(damper, path),
        command=np.full(len(path), command),
        command_unit="A",
        temperature=path.temperature,
    )
    return prepare_run(run, NO_SMOOTHING)


COLD = REFERENCE_DAMPERS["bingham"]
MOTIONS = (Sine(5e-3, 1.0), Sine(10e-3, 2.0))


def campaign(
    celsius: Sequence[float | None], damper: Damper = COLD, commands: Sequence[float] = (0.0, 0.5, 1.0, 2.0)
) -> tuple[PreparedRun, ...]:
    return tuple(run_at(damper, c, i, motion=m) for m in MOTIONS for i in commands for c in celsius)


CAMPAIGN = campaign(THREE)


def names_of(free: Sequence[FreeParameter], coefficient: str) -> list[str]:
    return [each.name.partition(".")[2] for each in free if each.name.partition(".")[0] == coefficient]


# Coefficients that depend on temperature


def test_paper_temperature_dependence_is_polynomial_factor():
    """In Eq. (12) of the paper, as reconstructed, each coefficient is multiplied by 1 + t1 dT + t2 dT^2."""
    damper, free = template("bouc-wen", CAMPAIGN, temperature="paper", terms=("friction",))
    for name in ("viscosity", "yield_force"):
        form = damper.coefficients[name]
        assert isinstance(form, TemperatureDependent)
        assert form.factor == PolynomialFactor((0.0, 0.0))
        assert names_of(free, name)[-2:] == ["t1", "t2"]
    assert not damper.coefficients["coulomb_friction"].temperature_dependent
    assert not damper.coefficients["breakaway_friction"].temperature_dependent


# Assumed temperature dependence of a fluid


THINS, WEAKENS = Arrhenius(1435.5), Linear(1e-3)


@dataclass(frozen=True)
class Oil:
    viscosity_factor: TemperatureFactor = THINS
    yield_factor: TemperatureFactor = WEAKENS
    valid_K: tuple[float, float] = (263.15, 403.15)


def test_assumed_temperature_dependence_is_marked_and_fixed():
    runs = campaign((None,))
    plain, free = template("bouc-wen", runs)
    damper, moved = template("bouc-wen", runs, fluid=Oil())
    assert moved == free
    assert damper.assumed == ("viscosity", "yield_force")
    viscosity = damper.coefficients["viscosity"]
    assert isinstance(viscosity, TemperatureDependent)
    assert viscosity.form == plain.coefficients["viscosity"]
    assert viscosity.factor == THINS
    assert damper.temperature_range == Oil().valid_K
    at_20 = replace(runs[0].trajectory, temperature=np.full(len(runs[0]), 293.15))
    np.testing.assert_array_equal(simulate(damper, at_20), simulate(plain, runs[0].trajectory))


@pytest.mark.parametrize(
    "factor", [Arrhenius(1435.5), Reynolds(0.012), Vft(600.0, 150.0)], ids=lambda f: f.kind
)
def test_assumed_thinning_force_scales_with_viscosity(factor):
    """The shear-thinning force c|v|^m is proportional to the viscosity to the power m."""
    forms = dict(REFERENCE_DAMPERS["series-valve"].coefficients)
    truth = Damper(LAWS["series-valve"], apply_fluid(forms, Oil(viscosity_factor=factor)))
    kelvin = np.array([273.15, 293.15, 350.0])
    final = scale_thinning(truth)
    for name, exponent in (("thinning", 0.5), ("leak_damping", 0.95)):
        form = final.coefficients[name]
        assert isinstance(form, TemperatureDependent)
        assert form.assumed
        np.testing.assert_allclose(form.factor.value(kelvin), factor.value(kelvin) ** exponent, rtol=1e-12)
    assert final.coefficients["yield_force"] == truth.coefficients["yield_force"]
    identified = replace(
        truth,
        coefficients={
            n: replace(f, assumed=False) if isinstance(f, TemperatureDependent) else f
            for n, f in truth.coefficients.items()
        },
    )
    assert scale_thinning(identified) == identified


# Recovery of a known temperature dependence


@pytest.mark.parametrize("kind", ["auto", "reynolds"])
def test_known_temperature_dependence_is_recovered(kind: Temperature) -> None:
    """Runs at three temperatures determine how viscosity and yield force depend on temperature."""
    factor = Arrhenius(1435.5) if kind == "auto" else Reynolds(0.012)
    truth = Damper(
        LAWS["bouc-wen"],
        {
            "viscosity": TemperatureDependent(Polynomial((900.0, 300.0)), factor),
            "yield_force": TemperatureDependent(Hill(80.0, 700.0, 1.2, 1.5, reference=1.5), Linear(1.2e-3)),
            "offset": Constant(30.0),
            "rho": Constant(1800.0),
            "kappa": Constant(-0.5),
            "n": Constant(1.4),
        },
    )
    runs = campaign(THREE, truth, commands=(0.0, 0.4, 0.8, 1.5))
    damper, free = template("bouc-wen", runs, temperature=kind, terms=())
    result = fit_variable_projection(FitProblem(damper, free, runs), starts=1)
    assert result.cost_percent < 0.2
    found = result.damper.parameters
    name = f"viscosity.{factor.parameter_names[0]}"
    assert found[name] == pytest.approx(factor.parameters[0], rel=0.02)
    kelvin = np.array([310.0, 340.0, 365.0])
    at = np.full(3, 1.0)
    for coefficient in ("viscosity", "yield_force"):
        np.testing.assert_allclose(
            result.damper.coefficients[coefficient].value(at, kelvin),
            truth.coefficients[coefficient].value(at, kelvin),
            rtol=0.02,
        )
