"""Correlations agree with other programs, have physical limits, and reject values outside their range."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import EnvelopeError
from mrdamper.thermal.films.air import air_at
from mrdamper.thermal.films.correlations import (
    STEFAN_BOLTZMANN,
    annular_fin_efficiency,
    groove_emissivity,
    nusselt_cross_flow,
    nusselt_fin_disc,
    nusselt_horizontal_cylinder,
    nusselt_slender_vertical_cylinder,
    nusselt_vertical_plate,
    radiation_film,
)

PRANDTL = st.floats(0.6, 10.0)


def powers_of_ten(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


# --------------------------------------------------------- agreement with the libraries ht and CoolProp


@given(grashof=powers_of_ten(-2, 11), prandtl=PRANDTL, slenderness=st.floats(0.5, 20.0))
def test_natural_convection_agrees_with_library_ht(grashof, prandtl, slenderness):
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
def test_forced_convection_agrees_with_library_ht(reynolds, prandtl):
    ht = pytest.importorskip("ht")
    assert nusselt_cross_flow(reynolds, prandtl) == pytest.approx(
        ht.Nu_cylinder_Churchill_Bernstein(reynolds, prandtl), rel=1e-12
    )


@pytest.mark.system
@given(
    film=st.floats(0.1, 500.0),
    root=st.floats(0.005, 0.1),
    width=st.floats(0.005, 0.1),
    thickness=st.floats(2e-4, 5e-3),
    conductivity=st.floats(15.0, 400.0),
)
def test_fin_efficiency_agrees_with_library_ht(film, root, width, thickness, conductivity):
    ht = pytest.importorskip("ht")
    theirs = ht.fin_efficiency_Kern_Kraus(2 * root, 2 * (root + width), thickness, conductivity, film)
    ours = annular_fin_efficiency(film, root, root + width, thickness, conductivity)
    # For a very effective fin, both programs subtract nearly equal products and lose digits.
    assert ours == pytest.approx(theirs, rel=1e-12 if theirs < 0.99 else 1e-10)


@pytest.mark.nightly
def test_air_properties_agree_with_coolprop():
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
def test_radiation_follows_stefan_boltzmann(emissivity, surface, ambient):
    flux = float(radiation_film(emissivity, surface, ambient)) * (surface - ambient)
    exact = emissivity * STEFAN_BOLTZMANN * (surface**4 - ambient**4)
    assert flux == pytest.approx(exact, rel=1e-9, abs=1e-9)


@given(emissivity=st.floats(0.01, 1.0), ratio=st.floats(0.01, 1.0))
def test_groove_emissivity_exceeds_wall_emissivity(emissivity, ratio):
    apparent = groove_emissivity(emissivity, ratio, 1.0)
    assert emissivity * (1 - 1e-12) <= apparent <= 1.0
    # The groove cannot radiate more than its walls emit.
    assert apparent * ratio <= emissivity * (1 + 1e-12)


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda: nusselt_horizontal_cylinder(1e13, 0.7), "Ra_D of a horizontal cylinder is 1e.13"),
        (lambda: nusselt_cross_flow(0.1, 0.7), "Re Pr of a cylinder is 0.07; .* 0.2"),
        (lambda: air_at(20.0), "film temperature is 20 K; .* Temperatures are in kelvin"),
        (lambda: air_at([300.0, 700.0]), "film temperature is 700 K"),
    ],
)
def test_correlation_outside_its_range_is_rejected(ask, said):
    with pytest.raises(EnvelopeError, match=said):
        ask()


def test_still_air_conducts_heat_without_convection():
    assert nusselt_horizontal_cylinder(0.0, 0.7) == pytest.approx(0.36)
    assert nusselt_vertical_plate(0.0, 0.7) == pytest.approx(0.825**2)
    one, none = (float(nusselt_slender_vertical_cylinder(gr, 0.7, 2.0)) for gr in (1.0, 0.0))
    assert none == one > 0.0


@pytest.mark.parametrize(("metres", "pascal"), [(0.0, 101325.0), (1000.0, 89874.6), (5000.0, 54019.9)])
def test_air_density_follows_standard_atmosphere(metres: float, pascal: float):
    """Pressures are from the printed table. Dry air of 28.9647 g/mol is an ideal gas."""
    low, high = air_at(300.0), air_at(300.0, metres)
    ratio = float(low.kinematic_viscosity / high.kinematic_viscosity)
    assert ratio == pytest.approx(pascal / 101325.0, rel=2e-5)
    dynamic = float(high.prandtl * high.conductivity) / (1005.4 + 380e-6 * (300.0 - 247.4) ** 2)
    density = pascal * 0.0289647 / (8.314462618 * 300.0)
    assert float(high.kinematic_viscosity) * density == pytest.approx(dynamic, rel=3e-5)
