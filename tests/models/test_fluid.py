"""Fluids: what the paper says of its fluid, presets with sources, files there and back, ranges that warn."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import EnvelopeError, EnvelopeWarning, InputError
from mrdamper.models.fluids.carlson import Carlson, saturation_stress
from mrdamper.models.fluids.fluid import Collapse, Origin, fall_percent
from mrdamper.models.fluids.fluid_file import PRESETS, find_fluid, fluid_from_toml, fluid_to_toml
from mrdamper.models.temperature import Arrhenius, Linear, PolynomialFactor, Reynolds, Vft

PAPER = find_fluid("paper")
LORD = find_fluid("lord-mrf-132dg")
C20, C100 = 293.15, 373.15


def with_viscosity(fluid, factor, **changes):
    """Return a fluid with another viscosity law, every number with an origin again."""
    kept = {
        name: origin
        for name, origin in fluid.origins.items()
        if not name.startswith(("viscosity.", "collapse."))
    }
    names = ("at_20degC_Pa_s", *factor.parameter_names)
    new = {f"viscosity.{name}": Origin("test", "D") for name in names}
    return replace(fluid, viscosity_factor=factor, collapse=None, origins={**kept, **new}, **changes)


# ------------------------------------------------------------------------------------------- the paper


def test_the_papers_viscosity_falls_by_65_percent_from_20_to_100_degC():
    cold, hot = PAPER.viscosity([C20, C100])
    assert 100.0 * (1.0 - hot / cold) == pytest.approx(65.0, abs=0.1)
    assert fall_percent(PAPER.viscosity_factor) == pytest.approx(65.0, abs=0.1)


def test_the_papers_viscosity_falls_steeply_to_60_degC_and_slower_from_there():
    """Per kelvin, from 20 to 60 and from 60 to 130 degC."""
    at_20, at_60, at_130 = PAPER.viscosity([C20, 333.15, 403.15])
    assert (at_20 - at_60) / 40.0 > 2.0 * (at_60 - at_130) / 70.0


@pytest.mark.parametrize("flux_density", [0.1, 0.2, 0.4, 0.6])
def test_the_papers_yield_stress_falls_linearly_and_less_than_the_viscosity(flux_density):
    kelvin = np.linspace(C20, 403.15, 12)
    stress = PAPER.yield_stress(kelvin, flux_density_T=flux_density)
    steps = np.diff(stress)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-9)
    assert steps[0] < 0.0
    viscosity = PAPER.viscosity(kelvin)
    assert (stress[1:] / stress[0] > viscosity[1:] / viscosity[0]).all()


def test_the_papers_fluid_collapses_above_138_degC_and_not_before():
    collapse = PAPER.collapse
    assert collapse is not None
    assert float(collapse.value(273.15 + 130.0)) > 0.999
    assert 0.85 < float(collapse.value(273.15 + 138.0)) < 0.9
    assert float(collapse.value(273.15 + 146.0)) < 0.05


@given(st.floats(200.0, 500.0))
def test_a_collapse_is_the_logistic_curve_on_paper(kelvin):
    on_paper = 1.0 / (1.0 + math.exp((kelvin - 414.15) / 1.5))
    assert float(Collapse(414.15, 1.5).value(kelvin)) == pytest.approx(on_paper, rel=1e-9, abs=1e-15)


def test_the_collapse_is_there_only_when_asked_for():
    hot = 273.15 + 145.0
    with pytest.warns(EnvelopeWarning):
        plain = float(PAPER.viscosity(hot))
    with pytest.warns(EnvelopeWarning):
        fallen = float(PAPER.viscosity(hot, with_collapse=True))
    assert plain == pytest.approx(0.153 * math.exp(1435.5 * (1 / hot - 1 / C20)))
    assert fallen < 0.1 * plain
    with pytest.raises(InputError, match="'lord-mrf-132dg': states no collapse"):
        LORD.viscosity(C20, with_collapse=True)


# ------------------------------------------------------------------------------------------- presets


@pytest.mark.parametrize("name", PRESETS)
def test_every_number_of_a_preset_has_a_source_and_a_confidence(name):
    fluid = find_fluid(name)
    assert fluid.parameters.keys() == fluid.origins.keys()
    assert all(
        len(origin.source) > 15 or origin.source.startswith("As ") for origin in fluid.origins.values()
    )
    assert {origin.confidence for origin in fluid.origins.values()} <= set("ABCD")


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_holds_from_minus_40_to_130_degC_and_its_viscosity_from_20(name):
    fluid = find_fluid(name)
    assert fluid.valid_K == pytest.approx((233.15, 403.15))
    assert fluid.viscosity_fitted_K == pytest.approx((293.15, 403.15))


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_has_the_manufacturers_viscosity_at_40_degC(name):
    assert float(find_fluid(name).viscosity(313.15)) == pytest.approx(0.112, rel=2e-3)


@pytest.mark.parametrize("name", PRESETS)
def test_a_presets_yield_stress_is_carlsons(name):
    fluid = find_fluid(name)
    assert fluid.yield_field.saturation_Pa == pytest.approx(
        saturation_stress(fluid.particle_fraction), rel=1e-3
    )
    assert 1.0 / fluid.yield_field.field_scale_A_m == pytest.approx(6.33e-6)


def test_lords_viscosity_law_is_walthers_of_a_pao_4_oil():
    """log10 log10(nu + 0.7) = A - B log10 T through 17 mm^2/s at 40 and 3.9 mm^2/s at 100 degC."""

    def twice(nu):
        return math.log10(math.log10(nu + 0.7))

    b = (twice(17.0) - twice(3.9)) / (math.log10(373.15) - math.log10(313.15))
    a = twice(17.0) + b * math.log10(313.15)
    kelvin = np.linspace(293.15, 403.15, 23)
    nu = 10.0**10.0 ** (a - b * np.log10(kelvin)) - 0.7
    np.testing.assert_allclose(LORD.viscosity_factor.value(kelvin), nu / nu[0], rtol=3e-3)


def test_a_hydrocarbon_with_32_percent_of_iron_has_lords_density_and_not_the_papers():
    """Iron 7860, oil 800 to 960 kg/m^3: the paper's 2300 contradicts its 32 %, and both stand as given."""
    light, heavy = (0.32 * 7860.0 + 0.68 * oil for oil in (800.0, 960.0))
    assert LORD.density_kg_m3 is not None
    assert PAPER.density_kg_m3 is not None
    assert LORD.particle_fraction == PAPER.particle_fraction == 0.32
    assert light - 150.0 < LORD.density_kg_m3 < heavy + 50.0
    assert PAPER.density_kg_m3 < light - 500.0


# ------------------------------------------------------------------------------------------- ranges


def test_inside_its_range_a_fluid_says_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        PAPER.viscosity(np.linspace(293.15, 403.15, 5))
        PAPER.yield_stress(np.linspace(233.15, 403.15, 5), field_A_m=1e5)


@pytest.mark.parametrize(
    ("celsius", "said"),
    [
        ([20.0, 140.0, 150.0], "viscosity asked for at 150 degC; its law is valid for -40 to 130 degC"),
        ([-50.0, 20.0], "viscosity asked for at -50 degC; its law is valid for -40 to 130 degC"),
        ([0.0, 20.0], "viscosity asked for at 0 degC; its law is from measurements at 20 to 130 degC"),
    ],
)
def test_outside_its_range_a_fluid_warns_once_with_the_numbers_and_answers(celsius, said):
    with pytest.warns(EnvelopeWarning) as caught:
        values = PAPER.viscosity(np.array(celsius) + 273.15)
    assert [str(warning.message) for warning in caught] == [f"fluid 'paper': {said}"]
    assert caught[0].filename == __file__  # the caller's line, not ours
    assert np.isfinite(values).all()


def test_a_yield_stress_warns_on_the_fluids_range_alone():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        PAPER.yield_stress(273.15, field_A_m=1e5)
    with pytest.warns(EnvelopeWarning, match="yield stress asked for at 140 degC"):
        PAPER.yield_stress(413.15, field_A_m=1e5)


@pytest.mark.parametrize("kelvin", [25.0, 0.0, -10.0, 1000.0, math.nan])
def test_celsius_passed_as_kelvin_is_refused(kelvin):
    with pytest.raises(EnvelopeError, match=r"expected 223 to 453 K\. Temperatures are in kelvin"):
        PAPER.viscosity(kelvin)


def test_where_a_law_ends_there_is_no_value():
    """A slope of 0.7 % per kelvin leaves nothing of the yield stress at 163 degC."""
    steep = replace(PAPER, yield_factor=Linear(7e-3))
    with pytest.raises(EnvelopeError, match="linear law of the yield stress has no value at 170 degC"):
        steep.yield_stress(443.15, field_A_m=1e5)


def test_field_and_flux_density_are_two_ways_to_say_the_same():
    by_flux = PAPER.yield_stress(C20, flux_density_T=0.4)
    assert float(PAPER.yield_stress(C20, field_A_m=66787.318)) == pytest.approx(float(by_flux), rel=1e-6)
    for wrong in ({}, {"field_A_m": 1.0, "flux_density_T": 1.0}):
        with pytest.raises(InputError, match="give either field_A_m or flux_density_T"):
            PAPER.yield_stress(C20, **wrong)


def test_fields_and_temperatures_broadcast():
    stress = PAPER.yield_stress(np.array([[C20], [C100]]), field_A_m=np.array([1e4, 5e4, 1e5]))
    assert stress.shape == (2, 3)
    np.testing.assert_allclose(stress[1] / stress[0], 1.0 - 1.67e-3 * 80.0)


# ------------------------------------------------------------------------------------------- building


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"name": ""}, "it has no name"),
        ({"viscosity_Pa_s": -0.1}, r"viscosity\.at_20degC_Pa_s is -0\.1; expected a positive number"),
        ({"density_kg_m3": math.nan}, r"properties\.density_kg_m3 is nan"),
        ({"particle_fraction": 3.0}, "volume fraction of iron"),
        ({"valid_K": (403.0, 233.0)}, "valid range is 403 to 233 K"),
        ({"viscosity_fitted_K": (20.0, 130.0)}, "fitted range is 20 to 130 K"),
        (
            {"yield_factor": Linear(1e-2)},
            r"yield stress: its linear law is -0\.\d+ at 12\d.*must be positive",
        ),
        ({"origins": {}}, "no origin is given for viscosity.at_20degC_Pa_s, viscosity.activation_K"),
        ({"origins": {**PAPER.origins, "colour": Origin("x", "A")}}, "numbers it does not have: colour"),
        ({"collapse": None}, "numbers it does not have: collapse.middle_K, collapse.width_K"),
    ],
)
def test_a_fluid_that_cannot_be_is_refused_with_the_place(changes, said):
    with pytest.raises(InputError, match=said):
        replace(PAPER, **changes)


def test_a_vft_law_must_have_its_pole_below_the_range_of_use():
    with pytest.raises(InputError, match=r"its vft law is inf at .*over the fluid's range -40 to 130 degC"):
        with_viscosity(PAPER, Vft(700.0, 250.0))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Origin("x", "E"), "confidence is 'E'; expected one of A, B, C, D"),  # type: ignore[arg-type]
        (lambda: Origin("x", "A", -1.0), "standard error is -1.0"),
        (lambda: Collapse(414.0, 0.0), r"collapse\.width_K is 0; expected a positive number"),
    ],
)
def test_origins_and_collapses_are_checked(make, said):
    with pytest.raises(InputError, match=said):
        make()


# ------------------------------------------------------------------------------------------- files

sources = st.text(max_size=30)
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
    source=sources,
    error=st.one_of(st.none(), positive),
)
def test_a_fluid_written_and_read_back_is_the_same_fluid(
    factor, viscosity, stress, slope, name, source, error
):
    fluid = with_viscosity(
        PAPER,
        factor,
        name=name,
        title=source,
        viscosity_Pa_s=viscosity,
        yield_field=Carlson(stress, 1e5),
        yield_factor=Linear(slope),
    )
    fluid = replace(fluid, origins=dict.fromkeys(fluid.parameters, Origin(source, "B", error)))
    text = fluid_to_toml(fluid)
    again = fluid_from_toml(text)
    assert again == fluid
    assert fluid_to_toml(again) == text


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_written_to_a_file_is_found_by_its_path(name, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(fluid_to_toml(find_fluid(name)), encoding="utf-8")
    assert find_fluid(path) == find_fluid(name)
    assert find_fluid(str(path)) == find_fluid(name)


def test_what_a_short_file_leaves_out_comes_from_the_preset_it_is_like():
    fluid = fluid_from_toml(
        'name = "ours"\nlike = "paper"\n[viscosity]\nlaw = "reynolds"\nat_20degC_Pa_s = 0.2\n'
        "temperature_rate = 0.02\n[properties]\ndensity_kg_m3 = 2800\n"
    )
    assert fluid.viscosity_factor == Reynolds(0.02)
    assert fluid.density_kg_m3 == 2800.0
    assert fluid.yield_factor == PAPER.yield_factor
    assert fluid.origins["viscosity.temperature_rate"] == Origin("no source given", "D")
    assert fluid.origins["yield_stress.temperature_slope"] == PAPER.origins["yield_stress.temperature_slope"]
    assert fluid.collapse is None  # it went with the paper's viscosity


def test_a_fluid_like_a_preset_and_nothing_else_is_the_preset_by_another_name():
    assert replace(fluid_from_toml('like = "paper"', "ours.toml"), title=PAPER.title) == replace(
        PAPER, name="ours"
    )


SHORT = 'like = "paper"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = [", "mine.toml: not a TOML file"),
        ('likes = "paper"', "mine.toml: unknown key 'likes'; did you mean like"),
        ('like = "papper"', "like is 'papper'; expected one of: paper, lord-mrf-132dg"),
        (SHORT + "schema_version = 2", "schema_version is 2; expected one of: 1"),
        (SHORT + "viscosity = 3", "viscosity is 3; expected a table"),
        ('name = "x"', r"the table \[viscosity\] is missing; give it, or `like`"),
        (SHORT + "valid_degC = 130", "valid_degC is 130; expected a list of 2, each a number in degC"),
        (
            SHORT + "[viscosity]\nlaw = 'reynolds'",
            "viscosity: at_20degC_Pa_s is missing; expected a number in Pa s or a table",
        ),
        (
            SHORT + "[viscosity]\nat_20degC_Pa_s = 0.1",
            "viscosity.law is None; expected one of: linear, arrhenius",
        ),
        (
            SHORT + '[properties]\ndensity_kg_m3 = "2300"',
            r"properties\.density_kg_m3 is '2300'; expected a number in kg/m\^3 or a table",
        ),
        (
            SHORT + "[viscosity]\nlaw = 'reynolds'\ntemperature_rate = 0.02\n"
            "at_20degC_Pa_s = {value = 1, unit = 'mPa s'}",
            r"viscosity\.at_20degC_Pa_s: unit is 'mPa s'; expected 'Pa s', or none",
        ),
        (
            SHORT + "[viscosity]\nlaw = 'reynolds'\ntemperature_rate = 0.02\n"
            "at_20degC_Pa_s = {value = 1, confidence = 'Z'}",
            r"at_20degC_Pa_s\.confidence is 'Z'; expected one of: A, B, C, D",
        ),
        (
            SHORT + "[viscosity]\nlaw = 'arrhenius'\nat_20degC_Pa_s = 0.1\nactivation = 1400",
            "viscosity: unknown key 'activation'; did you mean activation_K",
        ),
        (
            SHORT + "[viscosity]\nlaw = 'vft'\nat_20degC_Pa_s = 0.1\nvft_K = 1\nvft_pole_K = 300",
            "vft_pole_K is 300 K; it must be below 293.15 K",
        ),
        (
            SHORT + "[yield_stress]\nlaw = 'linear'\nfield_law = 'langevin'",
            "field_law is 'langevin'; expected one of: carlson",
        ),
        (SHORT + "[properties]\nparticle_fraction = 32", "volume fraction of iron"),
        (SHORT + "[properties]\nmass = 1", "properties has no key 'mass'"),
    ],
)
def test_a_file_that_is_no_fluid_is_refused_with_the_place_in_it(text, said, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        find_fluid(path)


def test_a_name_that_is_neither_preset_nor_file_is_answered_by_the_presets():
    with pytest.raises(
        InputError, match=r"no file that can be read .* expected a preset \(paper, lord-mrf-132dg\) or a file"
    ):
        find_fluid("papper")
