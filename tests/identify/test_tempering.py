"""Temperature in a template: what runs must offer for it, which coefficients follow it, and how far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.identify.problem import FitProblem, FreeParameter
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.temperature import (
    TEMPERATURES,
    Temperature,
    apply_fluid,
    scale_thinning,
    temperature_levels,
)
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper
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
    """Return a noiseless run at a temperature, or warming ``until`` another; None: no such channel."""
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


# Levels


def test_the_levels_are_the_temperatures_of_the_runs():
    assert temperature_levels(CAMPAIGN) == pytest.approx([c + CELSIUS for c in THREE])
    assert temperature_levels(campaign((40.0,))) == pytest.approx([40.0 + CELSIUS])


def at_celsius(celsius: float) -> PreparedRun:
    base = CAMPAIGN[0]
    path = replace(base.trajectory, temperature=np.full(len(base), celsius + CELSIUS))
    return replace(base, trajectory=path)


@given(st.lists(st.floats(-40.0, 150.0), min_size=1, max_size=12))
def test_levels_are_apart_and_every_temperature_is_near_one(celsius):
    runs = [at_celsius(c) for c in celsius]
    levels = np.array(temperature_levels(runs))
    assert np.all(np.diff(levels) >= 5.0)
    for c in celsius:
        below = c + CELSIUS - levels
        assert np.min(below[below >= -1e-9]) < 5.0


# What runs must offer


def test_runs_at_one_temperature_cannot_say_how_a_coefficient_changes():
    """The message names the coefficients, the tests that are missing, and both ways out."""
    with pytest.raises(InputError) as caught:
        template("bouc-wen", campaign((40.0,)))
    said = str(caught.value)
    assert said.startswith("the runs are at 1 temperature (40 degC); how ")
    for name in ("viscosity", "yield_force", "coulomb_friction", "breakaway_friction"):
        assert name in said
    assert "of bouc-wen change with temperature (arrhenius) cannot be identified from them" in said
    assert "Add the same tests at 2 or more temperatures, at least 5 K apart" in said
    assert "(--fluid)" in said
    assert "(--temperature none)" in said


@pytest.mark.parametrize(("kind", "enough"), [("arrhenius", 2), ("reynolds", 2), ("vft", 3), ("paper", 3)])
def test_each_kind_takes_as_many_temperatures_as_it_has_unknowns(kind, enough):
    celsius = (20.0, 60.0, 100.0, 140.0)
    template("bouc-wen", campaign(celsius[:enough]), temperature=kind)
    with pytest.raises(
        InputError, match=rf"at {enough - 1} temperatures?.*\({kind}\) cannot be .* at {enough} or more"
    ):
        template("bouc-wen", campaign(celsius[: enough - 1]), temperature=kind)


@pytest.mark.parametrize("kind", ["auto", "arrhenius", "paper"])
def test_runs_with_and_without_temperature_do_not_mix(kind):
    runs = [*CAMPAIGN, run_at(COLD, None, 0.5, motion=MOTIONS[0], name="cold.csv")]
    with pytest.raises(InputError) as caught:
        template("bouc-wen", runs, temperature=kind)
    said = str(caught.value)
    assert said.startswith(f"1 of {len(runs)} runs have no temperature channel (the first: cold.csv)")
    assert "state it as a constant in the channel map" in said
    assert "(--temperature none)" in said
    damper, _ = template("bouc-wen", runs, temperature="none")
    assert not damper.temperature_dependent


# What follows temperature


@pytest.mark.parametrize(
    ("kind", "factor"), [("auto", Arrhenius), ("arrhenius", Arrhenius), ("reynolds", Reynolds), ("vft", Vft)]
)
def test_viscous_parts_follow_the_viscosity_and_yield_parts_are_linear(kind, factor):
    damper, free = template("bouc-wen", CAMPAIGN, temperature=kind)
    viscosity, friction = damper.coefficients["viscosity"], damper.coefficients["coulomb_friction"]
    assert isinstance(viscosity, TemperatureDependent)
    assert isinstance(viscosity.factor, factor)
    for yielding in (damper.coefficients["yield_force"], friction):  # a product, or linear in all its numbers
        if isinstance(yielding, TemperatureDependent):
            assert isinstance(yielding.factor, Linear)
        else:
            assert isinstance(yielding, Bipolynomial)
            assert yielding.temperature_degree == 1
    for name in ("rho", "kappa", "n", "stiffness", "viscous_exponent", "stribeck_velocity"):
        assert not damper.coefficients[name].temperature_dependent, name
    assert names_of(free, "viscosity")[-len(viscosity.factor.parameters) :] == list(
        viscosity.factor.parameter_names
    )


@pytest.mark.parametrize("name", list(LAWS))
@pytest.mark.parametrize("kind", [kind for kind in TEMPERATURES if kind != "none"])
def test_every_law_has_a_tempered_template_that_can_be_simulated(name, kind):
    """Every free number is a number of the damper inside its bounds, and every factor's numbers are free."""
    damper, free = template(name, CAMPAIGN, temperature=kind)
    assert damper.temperature_dependent
    assert damper.assumed == ()
    FitProblem(damper, free, CAMPAIGN)  # knows every name, each once
    values = damper.parameters
    assert all(each.lower <= values[each.name] <= each.upper for each in free), name
    for coefficient, form in damper.coefficients.items():
        if isinstance(form, TemperatureDependent):
            assert set(names_of(free, coefficient)) >= set(form.factor.parameter_names)
    for run in CAMPAIGN[:3]:
        assert np.isfinite(simulate(damper, run.trajectory)).all()


def test_the_paper_s_kind_is_its_separable_polynomial_and_leaves_friction_alone():
    """Eq. (12) as reconstructed: each coefficient times 1 + t1 dT + t2 dT^2."""
    damper, free = template("bouc-wen", CAMPAIGN, temperature="paper", terms=("friction",))
    for name in ("viscosity", "yield_force"):
        form = damper.coefficients[name]
        assert isinstance(form, TemperatureDependent)
        assert form.factor == PolynomialFactor((0.0, 0.0))
        assert names_of(free, name)[-2:] == ["t1", "t2"]
    assert not damper.coefficients["coulomb_friction"].temperature_dependent
    assert not damper.coefficients["breakaway_friction"].temperature_dependent


@pytest.mark.parametrize("kind", TEMPERATURES)
def test_numbers_that_are_called_linear_are_linear_together(kind):
    """The promise that least squares rests on: the force is affine in them."""
    damper, free = template("bouc-wen", CAMPAIGN, temperature=kind)
    run = CAMPAIGN[2].trajectory
    rng = np.random.default_rng(0)
    linear = [each.name for each in free if each.linear]
    assert linear

    def force(share: float) -> np.ndarray:
        return simulate(damper.with_parameters({n: start[n] + share * step[n] for n in linear}), run)

    start = {n: abs(v) + 1.0 for n, v in damper.parameters.items()}
    # Small steps in what multiplies temperature, so that no coefficient falls below zero.
    step = {n: start[n] * rng.uniform(0.0, 1e-3) for n in linear}
    left, middle, right = force(0.0), force(1.0), force(2.0)
    np.testing.assert_allclose(left + right, 2.0 * middle, atol=1e-9 * np.abs(middle).max())


@pytest.mark.parametrize("celsius", [(20.0, 100.0), (-40.0, 20.0), (-40.0, 40.0), (5.0, 15.0)], ids=str)
def test_no_slope_in_its_bounds_makes_a_factor_vanish_at_the_runs_temperatures(celsius):
    """The yield force of the series valve is a Hill form times a linear factor: it must stay positive."""
    damper, free = template("series-valve", campaign(celsius))
    form = damper.coefficients["yield_force"]
    assert isinstance(form, TemperatureDependent)
    (slope,) = [each for each in free if each.name == "yield_force.temperature_slope"]
    for end in (slope.lower, slope.upper):
        factor = form.factor.with_parameters([end]).value([c + CELSIUS for c in celsius])
        assert np.all(factor >= 0.05 - 1e-12)


@pytest.mark.parametrize("celsius", [(20.0, 60.0, 100.0), (-40.0, 0.0, 40.0)], ids=str)
def test_the_pole_of_vft_stays_below_the_coldest_run(celsius):
    _, free = template("bouc-wen", campaign(celsius), temperature="vft")
    (pole,) = [each for each in free if each.name == "viscosity.vft_pole_K"]
    assert pole.upper <= min(celsius) + CELSIUS - 10.0


# Assumption


THINS, WEAKENS = Arrhenius(1435.5), Linear(1e-3)


@dataclass(frozen=True)
class Oil:
    viscosity_factor: TemperatureFactor = THINS
    yield_factor: TemperatureFactor = WEAKENS
    valid_K: tuple[float, float] = (263.15, 403.15)


def test_an_assumption_is_marked_and_moves_nothing():
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


def test_an_assumption_takes_only_what_a_fluid_knows():
    """Seal friction, gas spring and the shape of the loop are not the fluid's."""
    forms: dict[str, ParameterLaw] = {
        "viscosity": Constant(500.0),
        "rate_force": Polynomial((10.0, 1.0)),
        "yield_force": Hill(90.0, 600.0, 1.0, 1.5),
        "coulomb_friction": Constant(20.0),
        "stiffness": Constant(900.0),
        "rho": Exponential(1500.0, -0.3),
    }
    assumed = apply_fluid(forms, Oil())
    assert [name for name, form in assumed.items() if form.temperature_dependent] == [
        "viscosity",
        "rate_force",
        "yield_force",
    ]
    assert {name: form for name, form in assumed.items() if not form.temperature_dependent} == {
        name: forms[name] for name in ("coulomb_friction", "stiffness", "rho")
    }


@pytest.mark.parametrize(
    "factor", [Arrhenius(1435.5), Reynolds(0.012), Vft(600.0, 150.0)], ids=lambda f: f.kind
)
def test_an_assumed_thinning_follows_the_viscosity_to_its_exponent(factor):
    """|v|^m goes with the viscosity to the power m, whatever its law."""
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


# The truth


@pytest.mark.parametrize("kind", ["auto", "reynolds"])
def test_a_tempered_truth_is_found_again(kind: Temperature) -> None:
    """Without noise, at three temperatures: activation, rate and the yield force's fall come back."""
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
