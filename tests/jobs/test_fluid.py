"""The command ``fluid`` fits laws to rheometer tables and writes a fluid file and a page."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mrdamper.models.fluids.carlson import Carlson, flux_density
from mrdamper.models.fluids.fluid_file import find_fluid
from mrdamper.models.temperature import Arrhenius, Linear, Vft
from mrdamper.registry import JOBS
from tests.support.rigs import answer_of, mrdamper

CELSIUS = np.arange(20.0, 151.0, 5.0)
VISCOSITY = 0.153 * Arrhenius(1435.5).value(CELSIUS + 273.15) / (1.0 + np.exp((CELSIUS - 141.0) / 1.5))
FIELD = np.repeat([12.7e3, 27.5e3, 66.8e3, 129.6e3], 5)
AT = np.tile([20.0, 40.0, 60.0, 80.0, 100.0], 4)
STRESS = Carlson(47.9e3).stress(FIELD) * Linear(1.67e-3).value(AT + 273.15)


def fluid(tables, *, like="paper", out=None) -> Any:
    given = {"tables": tables, "like": like}
    return JOBS["fluid"].perform(given, out=out)[1]


def write(path, header, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.9g")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("rheometer")
    rng = np.random.default_rng(1)
    eta, tau = (v * np.exp(0.005 * rng.standard_normal(v.size)) for v in (VISCOSITY, STRESS))
    write(place / "viscosity.csv", "temperature_degC,viscosity_mPas", CELSIUS, 1e3 * eta)
    flux = 1e3 * flux_density(FIELD, 0.32)
    write(place / "yield.csv", "field_mT,temperature_degC,yield_stress_kPa", flux, AT, tau / 1e3)
    write(place / "strength.csv", "field_kA_m,temperature_K,yield_stress_Pa", FIELD / 1e3, AT + 273.15, tau)
    return place


@pytest.fixture(scope="module")
def fitted(folder):
    tables = (folder / "viscosity.csv", folder / "yield.csv")
    return mrdamper("fluid", *tables, "--out", folder / "out", "--json")


def near(number, truth):
    return abs(number["value"] - truth) < 3.0 * number["standard_error"]


def test_true_fluid_laws_are_recovered(fitted):
    answer = answer_of(fitted)
    laws = {law["law"]: law["numbers"] for law in answer["viscosity"]["laws"]}
    assert laws.keys() == {"arrhenius", "reynolds", "vft"}
    assert near(laws["arrhenius"]["activation_K"], 1435.5)
    assert near(laws["arrhenius"]["at_20degC_Pa_s"], 0.153)
    numbers = answer["yield_stress"]["numbers"]
    assert near(numbers["temperature_slope"], 1.67e-3)
    assert near(numbers["saturation_Pa"], 47.9e3)
    assert answer["viscosity"]["points"] == 23
    assert answer["viscosity"]["temperature_degC"] == pytest.approx([20.0, 130.0])
    assert fitted.stderr == ""


def test_fluid_file_contains_fitted_laws(fitted, folder):
    answer = answer_of(fitted)
    found, best = find_fluid(answer["file"]), answer["viscosity"]
    assert found.viscosity_factor.kind == best["law"]
    assert found.viscosity_Pa_s == best["numbers"]["at_20degC_Pa_s"]["value"]
    assert "law fitted to 23 points" in found.source
    assert found.density_kg_m3 == find_fluid("paper").density_kg_m3
    assert found.collapse is None
    names = sorted(path.name for path in (folder / "out").iterdir())
    assert names == ["fluid.html", "fluid.toml"]
    again = fluid([folder / "yield.csv"], like=answer["file"])
    assert again["viscosity"] is None
    assert any("those of 'viscosity': viscosity, density" in note for note in again["notes"])


def test_flux_density_and_field_strength_give_same_law(fitted, folder):
    by_flux = answer_of(fitted)["yield_stress"]["numbers"]["saturation_Pa"]
    by_field = fluid([folder / "strength.csv"])["yield_stress"]["numbers"]["saturation_Pa"]
    assert by_field["value"] == pytest.approx(by_flux["value"], rel=1e-6)


def test_iron_fraction_is_taken_from_option_like(folder):
    (folder / "iron.toml").write_text('like = "paper"\n[properties]\nparticle_fraction = 0.22\n')
    given = fluid([folder / "yield.csv"], like=folder / "iron.toml")
    assert given["particle_fraction"] == 0.22
    assert any("with 22 % of iron by volume" in note for note in given["notes"])


def test_valid_range_excludes_pole_of_viscosity_law(tmp_path):
    """A VFT law with a pole at -35 degC has no value at -40 degC, the default minimum temperature."""
    celsius = np.linspace(-20.0, 100.0, 25)
    viscosity = 0.1 * Vft(400.0, 238.0).value(celsius + 273.15)
    write(tmp_path / "cold.csv", "temperature_degC,viscosity_Pas", celsius, viscosity)
    answer = fluid([tmp_path / "cold.csv"])
    assert answer["viscosity"]["law"] == "vft"
    assert answer["valid_degC"] == pytest.approx([-20.0, 100.0])
    assert any("in the range of the tables only: -20 to 100 degC" in note for note in answer["notes"])


def test_fluid_example_in_docs_is_correct(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "fluid.md").read_text(encoding="utf-8")
    blocks = dict(re.findall(r"`(\w+\.(?:csv|toml))`:\n\n((?:    .*\n|\n)+)", page))
    table = "".join(f"{line.strip()}\n" for line in blocks["oil.csv"].splitlines() if line.strip())
    (tmp_path / "oil.csv").write_text(table, encoding="utf-8")
    printed = mrdamper("fluid", tmp_path / "oil.csv").stdout
    (line,) = re.findall(r"viscosity falls by .* from 20 to 100 degC", printed)
    assert f"    {line}\n" in page
    file = "".join(f"{line[4:]}\n" for line in blocks["myoil.toml"].splitlines())
    (tmp_path / "myoil.toml").write_text(file, encoding="utf-8")
    assert find_fluid(tmp_path / "myoil.toml").viscosity_factor == Arrhenius(1650.0)
