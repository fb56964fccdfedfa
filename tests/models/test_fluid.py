"""Fluid models have published values and a valid range, and fluid files are read back unchanged."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import EnvelopeError, EnvelopeWarning, InputError
from mrdamper.models.fluids.carlson import Carlson, saturation_stress
from mrdamper.models.fluids.fluid import Collapse, fall_percent
from mrdamper.models.fluids.fluid_file import PRESETS, find_fluid, fluid_from_toml, fluid_to_toml
from mrdamper.models.temperature import Arrhenius, Linear, PolynomialFactor, Reynolds, Vft

PAPER = find_fluid("paper")
LORD = find_fluid("lord-mrf-132dg")
C20, C100 = 293.15, 373.15

# Fluid of the paper


def test_viscosity_of_paper_fluid_falls_by_65_percent():
    cold, hot = PAPER.viscosity([C20, C100])
    assert 100.0 * (1.0 - hot / cold) == pytest.approx(65.0, abs=0.1)
    assert fall_percent(PAPER.viscosity_factor) == pytest.approx(65.0, abs=0.1)


@pytest.mark.parametrize("flux_density", [0.1, 0.6])
def test_yield_stress_of_paper_fluid_falls_linearly(flux_density):
    """With temperature, the yield stress falls linearly and less than the viscosity."""
    kelvin = np.linspace(C20, 403.15, 12)
    stress = PAPER.yield_stress(kelvin, flux_density_T=flux_density)
    steps = np.diff(stress)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-9)
    assert steps[0] < 0.0
    viscosity = PAPER.viscosity(kelvin)
    assert (stress[1:] / stress[0] > viscosity[1:] / viscosity[0]).all()


@given(st.floats(200.0, 500.0))
def test_viscosity_collapse_is_logistic_in_temperature(kelvin):
    expected = 1.0 / (1.0 + math.exp((kelvin - 414.15) / 1.5))
    assert float(Collapse(414.15, 1.5).value(kelvin)) == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_viscosity_collapse_is_included_on_request():
    """The collapse reduces the viscosity from 138 degC on, outside the valid range."""
    hot = 273.15 + 145.0
    with pytest.warns(EnvelopeWarning):
        plain, collapsed = float(PAPER.viscosity(hot)), float(PAPER.viscosity(hot, with_collapse=True))
    assert plain == pytest.approx(0.153 * math.exp(1435.5 * (1 / hot - 1 / C20)))
    assert collapsed < 0.1 * plain
    assert PAPER.collapse is not None
    assert 0.85 < float(PAPER.collapse.value(273.15 + 138.0)) < 0.9
    with pytest.raises(InputError, match="'lord-mrf-132dg': has no collapse"):
        LORD.viscosity(C20, with_collapse=True)


# Predefined fluids


@pytest.mark.parametrize("name", PRESETS)
def test_fluid_preset_has_published_properties(name):
    """Presets are valid from -40 to 130 degC, with 0.112 Pa s at 40 degC and Carlson's yield stress."""
    fluid = find_fluid(name)
    assert fluid.valid_K == pytest.approx((233.15, 403.15))
    assert fluid.viscosity_fitted_K == pytest.approx((293.15, 403.15))
    assert float(fluid.viscosity(313.15)) == pytest.approx(0.112, rel=2e-3)
    assert fluid.yield_field.saturation_Pa == pytest.approx(
        saturation_stress(fluid.particle_fraction), rel=1e-3
    )
    assert 1.0 / fluid.yield_field.field_scale_A_m == pytest.approx(6.33e-6)
    assert "Viscosity: " in fluid.source


def test_lord_viscosity_follows_walther_equation():
    """log10 log10(nu + 0.7) = A - B log10 T, with 17 mm^2/s at 40 degC and 3.9 mm^2/s at 100 degC."""

    def twice(nu):
        return math.log10(math.log10(nu + 0.7))

    b = (twice(17.0) - twice(3.9)) / (math.log10(373.15) - math.log10(313.15))
    a = twice(17.0) + b * math.log10(313.15)
    kelvin = np.linspace(293.15, 403.15, 23)
    nu = 10.0**10.0 ** (a - b * np.log10(kelvin)) - 0.7
    np.testing.assert_allclose(LORD.viscosity_factor.value(kelvin), nu / nu[0], rtol=3e-3)


def test_lord_density_agrees_with_iron_fraction():
    """32 % iron (7860 kg/m^3) in oil (800 to 960 kg/m^3) is denser than the paper's 2300 kg/m^3."""
    light, heavy = (0.32 * 7860.0 + 0.68 * oil for oil in (800.0, 960.0))
    assert LORD.density_kg_m3 is not None
    assert PAPER.density_kg_m3 is not None
    assert light - 150.0 < LORD.density_kg_m3 < heavy + 50.0
    assert PAPER.density_kg_m3 < light - 500.0


# Valid temperatures


@pytest.mark.parametrize(
    ("celsius", "said"),
    [
        ([20.0, 140.0, 150.0], "viscosity requested at 150 degC; its law is valid for -40 to 130 degC"),
        ([-50.0, 20.0], "viscosity requested at -50 degC; its law is valid for -40 to 130 degC"),
        ([0.0, 20.0], "viscosity requested at 0 degC; its law is from measurements at 20 to 130 degC"),
    ],
)
def test_fluid_warns_once_outside_range(celsius, said):
    with pytest.warns(EnvelopeWarning) as caught:
        values = PAPER.viscosity(np.array(celsius) + 273.15)
    assert [str(warning.message) for warning in caught] == [f"fluid 'paper': {said}"]
    assert caught[0].filename == __file__
    assert np.isfinite(values).all()


@pytest.mark.parametrize("kelvin", [25.0, -10.0, 1000.0, math.nan])
def test_fluid_temperature_in_celsius_is_rejected(kelvin):
    with pytest.raises(EnvelopeError, match=r"expected 223 to 453 K\. Temperatures are in kelvin"):
        PAPER.viscosity(kelvin)


def test_yield_stress_without_positive_value_is_rejected():
    """With a slope of 0.7 % per kelvin, the yield stress reaches zero at 163 degC."""
    steep = replace(PAPER, yield_factor=Linear(7e-3))
    with pytest.raises(EnvelopeError, match="linear law of the yield stress has no value at 170 degC"):
        steep.yield_stress(443.15, field_A_m=1e5)


def test_field_and_flux_density_give_same_stress():
    by_flux = PAPER.yield_stress(C20, flux_density_T=0.4)
    assert float(PAPER.yield_stress(C20, field_A_m=66787.318)) == pytest.approx(float(by_flux), rel=1e-6)
    stress = PAPER.yield_stress(np.array([[C20], [C100]]), field_A_m=np.array([1e4, 5e4, 1e5]))
    np.testing.assert_allclose(stress[1] / stress[0], 1.0 - 1.67e-3 * 80.0)
    for wrong in ({}, {"field_A_m": 1.0, "flux_density_T": 1.0}):
        with pytest.raises(InputError, match="give either field_A_m or flux_density_T"):
            PAPER.yield_stress(C20, **wrong)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"particle_fraction": 3.0}, "volume fraction of iron"),
        ({"valid_K": (403.0, 233.0)}, "valid range is 403 to 233 K"),
        ({"yield_factor": Linear(1e-2)}, "yield stress: its linear law is not positive"),
        ({"viscosity_factor": Vft(700.0, 250.0)}, "viscosity: its vft law is not positive"),
    ],
)
def test_impossible_fluid_is_rejected(changes, said):
    with pytest.raises(InputError, match=said):
        replace(PAPER, **changes)


# Fluid files

positive = st.floats(1e-6, 1e6)
factors = st.one_of(
    st.builds(Arrhenius, st.floats(0.0, 5000.0)),
    st.builds(Reynolds, st.floats(0.0, 0.03)),
    st.builds(Vft, st.floats(0.0, 2000.0), st.floats(-100.0, 200.0)),
    st.builds(PolynomialFactor, st.tuples(st.floats(-1e-3, 1e-3), st.floats(-1e-6, 1e-6))),
)


@given(
    factor=factors,
    viscosity=positive,
    stress=positive,
    slope=st.floats(0.0, 5e-3),
    name=st.text(min_size=1, max_size=20),
    source=st.text(max_size=30),
)
def test_fluid_file_survives_round_trip(factor, viscosity, stress, slope, name, source):
    fluid = replace(
        PAPER,
        name=name,
        title=source,
        source=source,
        viscosity_factor=factor,
        viscosity_Pa_s=viscosity,
        yield_field=Carlson(stress, 1e5),
        yield_factor=Linear(slope),
    )
    text = fluid_to_toml(fluid)
    again = fluid_from_toml(text)
    assert again == fluid
    assert fluid_to_toml(again) == text


def test_fluid_named_by_like_supplies_omitted_values():
    fluid = fluid_from_toml(
        'name = "ours"\nlike = "paper"\n[viscosity]\nlaw = "reynolds"\nat_20degC_Pa_s = 0.2\n'
        "temperature_rate = 0.02\n[properties]\ndensity_kg_m3 = 2800\n"
    )
    assert fluid.viscosity_factor == Reynolds(0.02)
    assert fluid.density_kg_m3 == 2800.0
    assert fluid.yield_factor == PAPER.yield_factor
    # The thermal collapse belongs to the viscosity of the paper, which is replaced.
    assert fluid.collapse is None
    same = fluid_from_toml('like = "paper"', "ours.toml")
    assert replace(same, title=PAPER.title) == replace(PAPER, name="ours")


SHORT = 'like = "paper"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('likes = "paper"', "unknown key 'likes'; did you mean like"),
        ('like = "papper"', "like is 'papper'; expected one of: paper, lord-mrf-132dg"),
        (
            SHORT + "[viscosity]\nlaw = 'reynold'\nat_20degC_Pa_s = 0.1",
            "no temperature factor of kind 'reynold'",
        ),
        (
            SHORT + "[viscosity]\nlaw = 'reynolds'\nat_20degC_Pa_s = 0.1\nactivation_K = 1",
            "reynolds has no parameter 'activation_K'",
        ),
        (SHORT + "[properties]\ndensity_kg_m3 = -1", "density_kg_m3 is -1.0; expected a number, above 0"),
    ],
)
def test_invalid_fluid_file_is_rejected_with_location(text, said):
    with pytest.raises(InputError, match=said) as caught:
        fluid_from_toml(text, "mine.toml")
    assert str(caught.value).startswith("mine.toml: ")
