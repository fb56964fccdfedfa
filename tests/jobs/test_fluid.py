"""``mrdamper fluid``: from rheometer tables to laws, a file that is a fluid, a picture, or one message."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.jobs.options import FluidOptions
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


def fluid(tables, *, like="paper", out=None, **options) -> Any:
    """Run the job in this process; return its answer."""
    given = {"tables": tables, "like": like}
    return JOBS["fluid"].perform(given, FluidOptions(**options), out=out)[1]


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
    """Run the command once, for all tests that look at the outcome."""
    tables = (folder / "viscosity.csv", folder / "yield.csv")
    return mrdamper("fluid", *tables, "--out", folder / "out", "--json")


def near(number, truth):
    return abs(number["value"] - truth) < 3.0 * number["standard_error"]


def test_the_truth_of_the_tables_comes_back_within_three_standard_errors(fitted):
    answer = answer_of(fitted)
    laws = {law["law"]: law["numbers"] for law in answer["viscosity"]["laws"]}
    assert laws.keys() == {"arrhenius", "reynolds", "vft"}
    assert near(laws["arrhenius"]["activation_K"], 1435.5)
    assert near(laws["arrhenius"]["at_20degC_Pa_s"], 0.153)
    numbers = answer["yield_stress"]["numbers"]
    assert near(numbers["temperature_slope"], 1.67e-3)
    assert near(numbers["saturation_Pa"], 47.9e3)
    assert answer["yield_stress"]["carrier_constant"] == pytest.approx(1.0, abs=0.05)
    assert fitted.stderr == ""


def test_the_fall_from_20_to_100_degC_is_the_papers_and_that_of_the_yield_stress_is_less(fitted):
    answer = answer_of(fitted)
    viscosity, stress = answer["viscosity"], answer["yield_stress"]
    fall, error = viscosity["fall_20_to_100_degC_percent"], viscosity["fall_standard_error_percent"]
    assert abs(fall - 65.0) < 0.1 + 3.0 * error
    assert 0.0 < stress["fall_20_to_100_degC_percent"] < fall


def test_what_lies_above_130_degC_is_listed_and_in_no_law(fitted):
    answer = answer_of(fitted)
    assert [row["temperature_degC"] for row in answer["viscosity"]["left_out"]] == [
        135.0,
        140.0,
        145.0,
        150.0,
    ]
    assert answer["viscosity"]["points"] == 23
    assert answer["viscosity"]["temperature_degC"] == [20.0, 130.0]
    assert any("the fluid fails there" in note for note in answer["notes"])


def test_the_file_is_a_fluid_with_the_fitted_numbers_and_their_origin(fitted, folder):
    answer = answer_of(fitted)
    made = find_fluid(answer["file"])
    best = answer["viscosity"]
    assert made.viscosity_factor.kind == best["law"]
    assert made.viscosity_Pa_s == best["numbers"]["at_20degC_Pa_s"]["value"]
    origin = made.origins["viscosity.at_20degC_Pa_s"]
    assert origin.standard_error == best["numbers"]["at_20degC_Pa_s"]["standard_error"]
    assert "viscosity.csv: 23 points, 20 to 130 degC" in origin.source
    assert made.density_kg_m3 == find_fluid("paper").density_kg_m3
    assert made.collapse is None
    assert sorted(path.name for path in (folder / "out").iterdir()) == [
        "fluid.html",
        "fluid.svg",
        "fluid.toml",
    ]


def test_the_file_serves_as_the_fluid_that_another_table_is_like(fitted, folder):
    answer = fluid([folder / "yield.csv"], like=answer_of(fitted)["file"])
    assert answer["viscosity"] is None
    assert answer["like"] == "viscosity"
    assert any("the viscosity" in note and "taken from 'viscosity'" in note for note in answer["notes"])


def test_the_picture_is_well_formed_and_says_what_it_shows(fitted):
    root = ET.parse(answer_of(fitted)["picture"]).getroot()
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    texts = {text for element in root.iter() if (text := (element.text or "").strip())}
    assert {"Viscosity without field, Pa s", "Yield stress over temperature, kPa", "left out"} <= texts


def test_flux_density_and_field_strength_lead_to_the_same_law(fitted, folder):
    by_flux = answer_of(fitted)["yield_stress"]["numbers"]["saturation_Pa"]
    by_field = fluid([folder / "strength.csv"])["yield_stress"]["numbers"]["saturation_Pa"]
    assert by_field["value"] == pytest.approx(by_flux["value"], rel=1e-6)


def test_an_assumed_share_of_iron_is_told_and_a_given_one_is_taken(folder):
    told = fluid([folder / "yield.csv"])
    assert any("32 % of iron by volume (of 'paper'; --particle-fraction" in note for note in told["notes"])
    given = fluid([folder / "yield.csv"], particle_fraction=0.22)
    assert given["yield_stress"]["particle_fraction"] == 0.22
    assert not any("--particle-fraction⟧" in note for note in given["notes"])
    most = [answer["yield_stress"]["field_A_m"][1] for answer in (told, given)]
    assert most[1] > most[0]  # less iron: more field for the same flux


def test_a_law_that_ends_within_the_range_of_use_narrows_it_and_says_so(tmp_path):
    """A VFT pole at -53 degC: below the coldest point the law is not what -40 degC needs."""
    celsius = np.linspace(-20.0, 100.0, 25)
    viscosity = 0.1 * Vft(400.0, 238.0).value(celsius + 273.15)
    write(tmp_path / "cold.csv", "temperature_degC,viscosity_Pas", celsius, viscosity)
    answer = fluid([tmp_path / "cold.csv"])
    assert answer["viscosity"]["law"] == "vft"
    assert answer["valid_degC"] == [-20.0, 100.0]
    assert any("hold no further than the tables: -20 to 100 degC" in note for note in answer["notes"])


def test_without_json_the_laws_their_errors_and_the_fall_are_printed(folder):
    run = mrdamper("fluid", folder / "viscosity.csv")
    assert run.returncode == 0
    for word in ("arrhenius", "reynolds", "vft", "activation_K", "standard error", "from 20 to 100 degC"):
        assert word in run.stdout


def test_the_same_tables_give_the_same_bytes(fitted, folder):
    fluid([folder / "viscosity.csv", folder / "yield.csv"], out=folder / "again")
    for name in ("fluid.toml", "fluid.svg"):
        assert (folder / "again" / name).read_bytes() == (folder / "out" / name).read_bytes()


def test_a_bad_table_ends_in_one_message_exit_code_3_and_no_file(tmp_path):
    (tmp_path / "bad.csv").write_text(
        "temperature_degC,viscosity_mPas\n20,150\n20,151\n20,149\n", encoding="utf-8"
    )
    run = mrdamper("fluid", tmp_path / "bad.csv", "--out", tmp_path / "out", "--json")
    assert run.returncode == 3
    assert run.stdout == ""
    assert run.stderr.startswith("mrdamper: bad.csv: one temperature (20 degC) within -40 to 130 degC")
    assert "expected at least 3" in run.stderr
    assert "Measure at more temperatures" in run.stderr
    assert run.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["bad.csv"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("temperature_degC,viscosity_mPas\n20,150\n40,-110\n60,80\n", "viscosity is -0.11 Pa s at 40 degC"),
        ("temperature_degC,viscosity_furlong\n20,150\n40,110\n60,80\n", "unit 'furlong'"),
        ("temperature_degC,viscosity_mPas\n20,150\n40,110\n", "2 temperatures .20 to 40 degC."),
        ("field_T,temperature_degC,yield_stress_kPa\n100,20,4\n200,60,8\n400,90,19\n", "a field of 400 T"),
    ],
)
def test_bad_tables_are_refused_with_the_place_and_leave_no_file(text, said, tmp_path):
    (tmp_path / "bad.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=rf"^bad\.csv: .*{said}.*; expected"):
        fluid([tmp_path / "bad.csv"], out=tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["bad.csv"]


def test_a_share_of_iron_in_percent_is_refused(folder):
    with pytest.raises(InputError, match=r"32 % by volume is 0\.32"):
        fluid([folder / "yield.csv"], particle_fraction=32.0)


def test_the_example_of_the_docs_gives_the_numbers_that_the_docs_print(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "fluid.md").read_text(encoding="utf-8")
    blocks = dict(re.findall(r"`(\w+\.(?:csv|toml))`:\n\n((?:    .*\n|\n)+)", page))
    table = "".join(f"{line.strip()}\n" for line in blocks["oil.csv"].splitlines() if line.strip())
    (tmp_path / "oil.csv").write_text(table, encoding="utf-8")
    answer = fluid([tmp_path / "oil.csv"])
    fall, error = (answer["viscosity"][f"fall_{key}_percent"] for key in ("20_to_100_degC", "standard_error"))
    assert f"viscosity without field falls by {fall:.1f} ± {error:.2g} % from 20 to 100 degC" in page
    file = "".join(f"{line[4:]}\n" for line in blocks["mine.toml"].splitlines())
    (tmp_path / "mine.toml").write_text(file, encoding="utf-8")
    assert find_fluid(tmp_path / "mine.toml").viscosity_factor == Arrhenius(1650.0)
