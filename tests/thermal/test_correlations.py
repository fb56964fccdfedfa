"""Correlations: other programs' numbers, limits that physics asks for, ranges that are kept."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import EnvelopeError, InputError
from mrdamper.thermal.films.air import air_at
from mrdamper.thermal.films.correlations import (
    STEFAN_BOLTZMANN,
    annular_fin_efficiency,
    groove_emissivity,
    mixed_nusselt,
    nusselt_cross_flow,
    nusselt_fin_channel,
    nusselt_fin_disc,
    nusselt_fin_vdi,
    nusselt_flat_plate,
    nusselt_horizontal_cylinder,
    nusselt_slender_vertical_cylinder,
    nusselt_vertical_plate,
    radiation_film,
)

PRANDTL = st.floats(0.6, 10.0)


def powers_of_ten(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


# -------------------------------------------------------------------------------- against the library ht


@given(grashof=powers_of_ten(-2, 11), prandtl=PRANDTL, slenderness=st.floats(0.5, 20.0))
def test_natural_convection_is_that_of_ht(grashof, prandtl, slenderness):
    ht = pytest.importorskip("ht")
    rayleigh = grashof * prandtl
    assert nusselt_horizontal_cylinder(rayleigh, prandtl) == pytest.approx(
        ht.Nu_horizontal_cylinder_Churchill_Chu(Pr=prandtl, Gr=grashof), rel=1e-12
    )
    assert nusselt_vertical_plate(rayleigh, prandtl) == pytest.approx(
        ht.Nu_vertical_plate_Churchill(Pr=prandtl, Gr=grashof), rel=1e-12
    )
    if grashof >= 1.0:
        assert nusselt_slender_vertical_cylinder(grashof, prandtl, slenderness) == pytest.approx(
            ht.Nu_vertical_cylinder_Popiel_Churchill(Pr=prandtl, Gr=grashof, L=slenderness, D=1.0), rel=1e-12
        )
    if rayleigh <= 1e10:
        faces = [ht.Nu_horizontal_plate_McAdams(Pr=prandtl, Gr=grashof, buoyancy=up) for up in (True, False)]
        assert nusselt_fin_disc(rayleigh) == pytest.approx(sum(faces) / 2.0, rel=1e-12)


@given(reynolds=powers_of_ten(0.1, 5.9), prandtl=PRANDTL)
def test_forced_convection_is_that_of_ht(reynolds, prandtl):
    ht = pytest.importorskip("ht")
    assert nusselt_cross_flow(reynolds, prandtl) == pytest.approx(
        ht.Nu_cylinder_Churchill_Bernstein(reynolds, prandtl), rel=1e-12
    )
    if reynolds <= 5e5:
        assert nusselt_flat_plate(reynolds, min(prandtl, 9.9)) == pytest.approx(
            ht.conv_external.Nu_horizontal_plate_laminar_Baehr(reynolds, min(prandtl, 9.9)), rel=1e-12
        )


@pytest.mark.system
@given(
    film=st.floats(0.1, 500.0),
    root=st.floats(0.005, 0.1),
    width=st.floats(0.005, 0.1),
    thickness=st.floats(2e-4, 5e-3),
    conductivity=st.floats(15.0, 400.0),
)
def test_fin_efficiency_is_that_of_ht(film, root, width, thickness, conductivity):
    ht = pytest.importorskip("ht")
    theirs = ht.fin_efficiency_Kern_Kraus(2 * root, 2 * (root + width), thickness, conductivity, film)
    ours = annular_fin_efficiency(film, root, root + width, thickness, conductivity)
    # both take differences of nearly equal products where the fin is very effective
    assert ours == pytest.approx(theirs, rel=1e-12 if theirs < 0.99 else 1e-10)


@pytest.mark.nightly
def test_air_is_within_a_percent_of_the_reference_equation_of_state():
    coolprop = pytest.importorskip("CoolProp.CoolProp")
    for kelvin in np.linspace(233.15, 573.15, 18):
        ours = air_at(kelvin)
        state = ("T", kelvin, "P", 101325.0, "Air")
        viscosity, density = coolprop.PropsSI("V", *state), coolprop.PropsSI("D", *state)
        assert ours.conductivity == pytest.approx(coolprop.PropsSI("L", *state), rel=0.01)
        assert ours.kinematic_viscosity == pytest.approx(viscosity / density, rel=0.01)
        assert ours.prandtl == pytest.approx(coolprop.PropsSI("Prandtl", *state), rel=0.01)


# ------------------------------------------------------------------------------------- limits and shapes


@given(emissivity=st.floats(0.01, 1.0), surface=st.floats(250.0, 600.0), ambient=st.floats(250.0, 350.0))
def test_radiation_is_the_law_of_stefan_and_boltzmann(emissivity, surface, ambient):
    flux = float(radiation_film(emissivity, surface, ambient)) * (surface - ambient)
    exact = emissivity * STEFAN_BOLTZMANN * (surface**4 - ambient**4)
    assert flux == pytest.approx(exact, rel=1e-9, abs=1e-9)


@given(emissivity=st.floats(0.01, 1.0), ratio=st.floats(0.01, 1.0))
def test_a_groove_is_blacker_than_its_walls_and_never_more_than_black(emissivity, ratio):
    apparent = groove_emissivity(emissivity, ratio, 1.0)
    assert emissivity * (1 - 1e-12) <= apparent <= 1.0
    # all that it radiates comes from its walls
    assert apparent * ratio <= emissivity * (1 + 1e-12)


def test_fin_efficiency_goes_to_one_without_a_film_and_to_the_straight_fin_s_on_a_wide_tube():
    assert annular_fin_efficiency(0.0, 0.023, 0.046, 1e-3, 160.0) == pytest.approx(1.0, abs=1e-9)
    film, width, thickness, conductivity = 200.0, 0.03, 1e-3, 160.0
    straight = math.sqrt(2.0 * film / (conductivity * thickness)) * width
    wide = annular_fin_efficiency(film, 1e3, 1e3 + width, thickness, conductivity)
    assert wide == pytest.approx(math.tanh(straight) / straight, rel=1e-4)


def test_no_fin_is_too_long_for_the_formula():
    """Scaled Bessel functions: a fin of any length gives off what its root lets through."""
    assert 0.0 < float(annular_fin_efficiency(1e4, 0.02, 20.0, 1e-4, 15.0)) < 1e-3


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda: nusselt_horizontal_cylinder(1e13, 0.7), "Ra_D of a horizontal cylinder is 1e.13"),
        (lambda: nusselt_horizontal_cylinder(math.nan, 0.7), "Ra_D of a horizontal cylinder is nan"),
        (lambda: nusselt_cross_flow(0.1, 0.7), "Re Pr of a cylinder is 0.07; .* 0.2"),
        (lambda: nusselt_flat_plate([1e3, 6e5], 0.7), "Re_L of a plate is 600000"),
        (lambda: air_at(20.0), "film temperature is 20 K; .* Temperatures are in kelvin"),
        (lambda: air_at([300.0, 700.0]), "film temperature is 700 K"),
    ],
)
def test_outside_its_range_a_correlation_says_so(ask, said):
    with pytest.raises(EnvelopeError, match=said):
        ask()


def test_a_fin_that_cannot_be_is_refused():
    with pytest.raises(InputError, match=r"annular fin: radii 0.05 and 0.02 m"):
        annular_fin_efficiency(10.0, 0.05, 0.02, 1e-3, 160.0)


@pytest.mark.parametrize(
    ("law", "low", "high"),
    [
        (lambda x: nusselt_horizontal_cylinder(x, 0.7), 0.0, 1e12),
        (lambda x: nusselt_vertical_plate(x, 0.7), 0.0, 1e12),
        (lambda x: nusselt_slender_vertical_cylinder(x, 0.01, 2.0), 0.0, 1e14),
        (lambda x: nusselt_slender_vertical_cylinder(1e6, x, 2.0), 0.01, 100.0),
        (lambda x: nusselt_fin_channel(x, 0.1), 0.0, 1e20),
        (lambda x: nusselt_fin_vdi(x, 0.1), 0.0, 1e20),
        (nusselt_fin_disc, 0.0, 1e10),
        (lambda x: nusselt_cross_flow(x, 1.0), 0.2, 1e7),
        (lambda x: nusselt_flat_plate(x, 0.7), 0.0, 5e5),
        (lambda x: nusselt_flat_plate(1e4, x), 0.5, 10.0),
        (lambda x: annular_fin_efficiency(x, 0.02, 0.04, 1e-3, 160.0), 0.0, 1e6),
        (lambda x: air_at(x).prandtl, 220.0, 600.0),
    ],
)  # fmt: skip
def test_a_correlation_holds_to_both_ends_of_its_range_and_no_further(law, low, high):
    assert np.isfinite(law(np.array([low, high]))).all()
    outside = [math.nextafter(low, -math.inf), math.nan]
    if high not in (1e20, 1e6):
        outside.append(math.nextafter(high, math.inf))
    for value in outside:
        with pytest.raises(EnvelopeError):
            law(value)


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_what_must_be_positive_is(value: float):
    for law in (
        lambda: nusselt_horizontal_cylinder(1e5, value),
        lambda: nusselt_fin_channel(1e5, value),
        lambda: nusselt_fin_vdi(1e5, value),
        lambda: nusselt_slender_vertical_cylinder(1e5, 0.7, value),
    ):
        with pytest.raises(EnvelopeError, match="expected positive, finite numbers"):
            law()
    for fin in ((value, 0.04, 1e-3, 160.0), (0.02, 0.04, value, 160.0), (0.02, 0.04, 1e-3, value)):
        if value <= 0.0 or math.isnan(value):
            with pytest.raises(InputError, match="expected root below tip, all positive"):
                annular_fin_efficiency(10.0, *fin)
    with pytest.raises(InputError, match="expected root below tip"):
        annular_fin_efficiency(10.0, 0.02, 0.02, 1e-3, 160.0)


def test_without_a_difference_of_temperature_still_air_only_conducts():
    assert nusselt_horizontal_cylinder(0.0, 0.7) == pytest.approx(0.36)
    assert nusselt_vertical_plate(0.0, 0.7) == pytest.approx(0.825**2)
    assert float(nusselt_fin_channel(0.0, 0.1)) < 1e-9
    assert float(nusselt_fin_vdi(0.0, 0.1)) == 0.0
    one, none = (float(nusselt_slender_vertical_cylinder(gr, 0.7, 2.0)) for gr in (1.0, 0.0))
    assert none == one > 0.0


def test_a_disc_s_upper_face_turns_turbulent_at_ten_million():
    """0.54 Ra^1/4 up to there, 0.15 Ra^1/3 beyond; 0.27 Ra^1/4 below at any."""
    for rayleigh, upper in ((1e7, 0.54 * 1e7**0.25), (math.nextafter(1e7, 2e7), 0.15 * 1e7 ** (1 / 3))):
        lower = 0.27 * 1e7**0.25
        assert float(nusselt_fin_disc(rayleigh)) == pytest.approx(0.5 * (upper + lower), rel=1e-9)


def test_where_one_kind_of_convection_is_none_the_other_is_all():
    assert float(mixed_nusselt(0.0, 7.0)) == pytest.approx(7.0)
    assert float(mixed_nusselt(3.0, 4.0)) == pytest.approx((27.0 + 64.0) ** (1 / 3))


@pytest.mark.parametrize(
    ("emissivity", "opening", "said"),
    [
        (-0.1, 0.5, "emissivity is -0.1"),
        (1.1, 0.5, "emissivity is 1.1"),
        (0.5, 0.0, "opening is 0.0"),
        (0.5, 1.1, "1.1"),
    ],
)
def test_a_groove_that_cannot_be_is_refused(emissivity: float, opening: float, said: str):
    with pytest.raises(InputError, match=f"groove: .*{said}"):
        groove_emissivity(emissivity, opening, 1.0)
    assert groove_emissivity(0.0, 1.0, 1.0) == 0.0
    assert groove_emissivity(1.0, 0.5, 1.0) == 1.0
    assert groove_emissivity(0.5, 1.0, 1.0) == 0.5  # walls that send nothing to each other


@pytest.mark.parametrize(("metres", "pascal"), [(0.0, 101325.0), (1000.0, 89874.6), (5000.0, 54019.9)])
def test_air_thins_as_the_standard_atmosphere(metres: float, pascal: float):
    """Its pressures as printed; dry air of 28.9647 g/mol as an ideal gas."""
    low, high = air_at(300.0), air_at(300.0, metres)
    ratio = float(low.kinematic_viscosity / high.kinematic_viscosity)
    assert ratio == pytest.approx(pascal / 101325.0, rel=2e-5)
    dynamic = float(high.prandtl * high.conductivity) / (1005.4 + 380e-6 * (300.0 - 247.4) ** 2)
    density = pascal * 0.0289647 / (8.314462618 * 300.0)
    assert float(high.kinematic_viscosity) * density == pytest.approx(dynamic, rel=3e-5)


@given(kelvin=st.floats(220.0, 600.0))
def test_air_goes_by_sutherland_s_forms(kelvin: float):
    """Viscosity and conductivity as T^1.5 over T plus a constant, as its page says."""
    air = air_at(kelvin)
    viscosity = 1.5067e-6 * kelvin**1.5 / (kelvin + 122.1)
    conductivity = 2.399e-3 * kelvin**1.5 / (kelvin + 172.0)
    assert float(air.conductivity) == pytest.approx(conductivity, rel=1e-12)
    assert float(air.kinematic_viscosity) == pytest.approx(viscosity * 287.055 * kelvin / 101325.0, rel=1e-12)
    grashof = float(air.grashof(0.05, -40.0))
    assert grashof == pytest.approx(9.80665 * 40.0 / kelvin * 0.05**3 / float(air.kinematic_viscosity) ** 2)
    assert float(air.rayleigh(0.05, 40.0)) == pytest.approx(grashof * float(air.prandtl))
