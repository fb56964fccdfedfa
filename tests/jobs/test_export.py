"""The command ``export`` writes C code, a table and an FMU, or prints one message."""

from __future__ import annotations

import html
import json
import os
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from mrdamper.codegen.c_code import kernel_files
from mrdamper.jobs.export import export as exported
from mrdamper.jobs.options import ExportOptions
from mrdamper.models.actuation import Actuation
from mrdamper.models.card_schema import read_card
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial
from mrdamper.models.laws import LAWS
from tests.support.cards import CHAIN, DAMPERS, ENVELOPE, RIG_LAG, passive, rig_damper, write_card_of
from tests.support.rigs import answer_of, command, mrdamper
from tests.support.tiers import one_by_day

pytestmark = pytest.mark.system

FILES = {
    "damper.h", "damper.c", "damper_tables.c", "main.c", "CMakeLists.txt", "README.md", "misra.md",
    "verification.json", "export.html",
    *kernel_files(),
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("export")
    write_card_of(place / "card.json")
    write_card_of(place / "quick.json", rig_damper(lag=Actuation(0.001, 0.001)))
    tanh: dict[str, ParameterLaw] = {
        "yield_force": Polynomial((50.0, 300.0)),
        "slope": Constant(300.0),
        "shift": Constant(0.0),
    }
    write_card_of(place / "tanh.json", Damper(LAWS["tanh"], tanh))
    return place


@pytest.fixture(scope="module")
def made(folder, tool):
    """Export all outputs once for all tests."""
    tool("cc")
    places = ("--c", folder / "c", "--table", folder / "map.csv", "--fmu", folder / "damper.fmu")
    return mrdamper("export", folder / "card.json", *places, "--json")


def test_json_output_of_export_states_files_and_verification(made, folder):
    answer = answer_of(made)
    assert made.stderr == ""
    assert answer["controller"] == "recommended"
    assert answer["verification"]["passed"] is True
    assert answer["verification"]["samples"] == 100_000
    assert answer["verification"]["worst_ulp"] == 0
    assert {Path(path) for path in answer["files"]} == {
        *(folder / "c" / name for name in FILES), folder / "map.csv", folder / "damper.fmu",
    }  # fmt: skip


def test_all_exported_files_state_same_verification(made, folder):
    record = json.loads((folder / "c" / "verification.json").read_text(encoding="utf-8"))
    assert {path.name for path in (folder / "c").iterdir()} == FILES
    assert list(folder.rglob(".*")) == []
    assert record == answer_of(made)["verification"]
    with zipfile.ZipFile(folder / "damper.fmu") as archive:
        assert json.loads(archive.read("documentation/verification.json")) == record
        assert archive.read("sources/damper.c") == (folder / "c" / "damper.c").read_bytes()
    page = html.unescape((folder / "c" / "export.html").read_text(encoding="utf-8"))
    assert "The compiled code is identical to the model in all bits, in 100,000 samples" in page
    readme, sizes = (folder / "c" / "README.md").read_text(encoding="utf-8"), record["sizes_bytes"]
    assert f"| tables (constant) | {sizes['tables']} |" in readme
    assert f"| a state | {sizes['state']} |" in readme


@pytest.mark.nightly
def test_export_in_another_process_gives_same_bytes(made, folder):
    assert made.returncode == 0
    done = subprocess.run(
        command("export", folder / "card.json", "--c", folder / "again", "--table", folder / "again.csv"),
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONHASHSEED": "7"},
    )
    assert done.returncode == 0, done.stderr
    for name in FILES:
        assert (folder / "again" / name).read_bytes() == (folder / "c" / name).read_bytes(), name
    assert (folder / "again.csv").read_bytes() == (folder / "map.csv").read_bytes()


@pytest.mark.nightly
def test_export_uses_heat_capacity_of_geometry_file(folder, tmp_path, tool):
    tool("cc")
    (tmp_path / "mine.txt").write_text("mine", encoding="ascii")
    drawing = Path(__file__).parents[2] / "examples" / "paper_damper.toml"
    options = ("--damper", drawing, "--content", "model", "--name", "front", "--step", "500us")
    done = mrdamper("export", folder / "card.json", "--c", tmp_path, *options, "--json")
    assert not any("paper's damper" in note for note in answer_of(done)["notes"])
    header = (tmp_path / "front.h").read_text(encoding="ascii")
    assert "(drawing paper_damper" in header
    assert "step        0.5 ms (2000 Hz)" in header
    assert (tmp_path / "mine.txt").read_text(encoding="ascii") == "mine"


@pytest.mark.parametrize("law", one_by_day(["double-bouc-wen", "chain"]))
def test_card_of_single_current_exports_only_model(law, tmp_path, tool):
    """If the current does not change the force, a model can be exported, but no controller."""
    tool("cc")
    damper = passive({**DAMPERS, "chain": CHAIN}[law])
    write_card_of(tmp_path / "card.json", damper, envelope=replace(ENVELOPE, command=(0.0, 0.0)))
    export = ("export", tmp_path / "card.json", "--c", tmp_path / "c", "--fmu", tmp_path / "damper.fmu")
    assert answer_of(mrdamper(*export, "--content", "model", "--json"))["verification"]["passed"]
    done = mrdamper(*export, "--content", "both")
    assert (done.returncode, done.stderr.count("does not depend on the command")) == (3, 1)


# -------------------------------------------------------------------------------- errors without output files


def test_export_without_compiler_writes_nothing(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("CC", "")
    done = mrdamper("export", folder / "card.json", "--c", tmp_path / "c")
    assert done.returncode == 3
    assert "there is no C compiler (looked for $CC, cc, gcc, clang)" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_export_fails_if_code_differs_from_model(folder, tool, tmp_path, monkeypatch):
    """The verification runs the compiled program. In this test, a compiler wrapper changes a table."""
    wrapper = tmp_path / "cc"
    wrapper.write_text(
        "#!/bin/sh\n[ -f damper_tables.c ] && sed -i 's/largest = 2.0f/largest = 2.0001f/' damper_tables.c\n"
        f'exec {tool("gcc")} "$@"\n',
        encoding="ascii",
    )
    wrapper.chmod(0o755)
    monkeypatch.setenv("CC", str(wrapper))
    done = mrdamper("export", folder / "card.json", "--c", tmp_path / "c", "--content", "model")
    assert done.returncode == 5
    assert "the compiled code is not the model in Python: model.force" in done.stderr
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("card", "arguments", "code", "message"),
    [
        ("nowhere.json", ("--c", "c"), 3, "nowhere.json: cannot read the card"),
        ("quick.json", ("--c", "c", "--step", "5ms"), 3, "quick.json: controller: the period is 5 ms"),
        ("card.json", ("--c", "c", "--name", "front-left"), 3, "name is 'front-left'"),
        ("card.json", ("--fmu", "x", "--table", "x"), 3, "is given for two outputs"),
        ("card.json", (), 2, "No output is given. Use --c DIR, --fmu FILE, --table FILE or --matlab DIR"),
    ],
)
def test_invalid_export_input_gives_one_message(folder, tmp_path, card, arguments, code, message):
    done = mrdamper("export", folder / card, *arguments, cwd=tmp_path)
    assert done.returncode == code, done.stderr
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("lag", "knows_temperature"), [(True, False), (False, True)])
def test_export_notes_list_missing_parts_of_card(lag, knows_temperature, tmp_path, monkeypatch):
    monkeypatch.setattr("mrdamper.jobs.export.verify_c", lambda _: SimpleNamespace(passed=True))
    damper = rig_damper(lag=RIG_LAG if lag else None, temperature_dependent=knows_temperature)
    card = read_card(write_card_of(tmp_path / "card.json", damper))
    found = exported(card, ExportOptions(what=("c",), content="model"))
    notes = " ".join(found.notes)
    assert ("no actuation" in notes) == (not lag)
    assert ("does not know temperature" in notes) == (not knows_temperature)
