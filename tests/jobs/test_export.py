"""``mrdamper export``: files, answer, exit codes, and one message for whatever cannot be."""

from __future__ import annotations

import html
import json
import os
import subprocess
import zipfile
from pathlib import Path

import pytest

from mrdamper.codegen.kernel_files import kernel_files
from mrdamper.errors import InputError
from mrdamper.jobs.export import export as exported
from mrdamper.jobs.options import ExportOptions
from mrdamper.models.actuation import Actuation
from mrdamper.models.card_schema import read_card
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial
from mrdamper.models.laws import LAWS
from mrdamper.notes import Note
from mrdamper.registry import JOBS
from tests.support.rigs import answer_of, command, mrdamper
from tests.support.tracked import LAG, a_damper, write_a_card

pytestmark = pytest.mark.system

FILES = {
    "damper.h", "damper.c", "damper_tables.c", "main.c", "CMakeLists.txt", "README.md", "misra.md",
    "verification.json",
    *kernel_files(),
}  # fmt: skip


def export(card, options, **places):
    """Run the job in this process; return its answer."""
    return JOBS["export"].perform({"card": card}, options, outputs=places)[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("export")
    write_a_card(place / "card.json")
    write_a_card(place / "quick.json", a_damper(lag=Actuation(0.001, 0.001)))
    tanh: dict[str, ParameterLaw] = {
        "yield_force": Polynomial((50.0, 300.0)),
        "slope": Constant(300.0),
        "shift": Constant(0.0),
    }
    write_a_card(place / "tanh.json", Damper(LAWS["tanh"], tanh))
    broken = json.loads((place / "card.json").read_text(encoding="utf-8"))
    broken["envelope"].pop("velocity_m_s")
    (place / "broken.json").write_text(json.dumps(broken), encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def made(folder, tool):
    """Export once, for all tests that look at the outcome."""
    tool("cc")
    return mrdamper(
        "export", folder / "card.json", "--c", folder / "c", "--table", folder / "map.csv", "--json"
    )


def test_it_answers_with_one_json_object(made, folder):
    answer = answer_of(made)
    assert made.stderr == ""
    assert answer["law"] == "double-bouc-wen"
    assert answer["name"] == "damper"
    assert answer["controller"] == "recommended"
    assert answer["precision"] == "float"
    assert answer["step_s"] == 1e-3
    assert answer["verification"]["passed"] is True
    assert answer["verification"]["samples"] == 100_000
    assert answer["verification"]["worst_ulp"] == 0
    assert answer["tables_bytes"] > 0
    assert answer["code_bytes"] > 0
    assert {Path(path) for path in answer["files"]} == {folder / "c" / f for f in FILES} | {
        folder / "map.csv"
    }


def test_it_leaves_these_files_and_nothing_else(made, folder):
    assert made.returncode == 0
    assert {path.name for path in (folder / "c").iterdir()} == FILES
    assert list(folder.rglob(".*")) == []
    record = json.loads((folder / "c" / "verification.json").read_text(encoding="utf-8"))
    assert record == answer_of(made)["verification"]
    assert (folder / "map.csv").read_text(encoding="utf-8").startswith("# Force map")
    readme, sizes = (folder / "c" / "README.md").read_text(encoding="utf-8"), record["sizes_bytes"]
    assert f"| tables | {sizes['tables']} bytes |" in readme
    assert f"| a state | {sizes['state']} bytes |" in readme
    assert "steps of the law up to now, at most, in a control step | 1 |" in readme


@pytest.mark.nightly
def test_its_page_says_what_was_proved_and_what_was_not(folder, tmp_path, tool):
    """Compared, it gives the model's own bits; not compared, it does not say so."""
    tool("cc")
    pages = {}
    for verify in (True, False):
        place = tmp_path / f"{verify}.html"
        answer = export(str(folder / "card.json"), ExportOptions(verify=verify), report=place)
        assert answer["report"] == str(place)
        pages[verify] = html.unescape(place.read_text(encoding="utf-8"))
    assert "The compiled code gives the model's own bits in 100,000 samples" in pages[True]
    assert "0 bits" in pages[True]
    assert "0 bits" not in pages[False]
    assert "the code was not compared with the model" in pages[False]


@pytest.mark.nightly
def test_the_same_card_gives_the_same_bytes_in_another_process(made, folder):
    assert made.returncode == 0
    arguments = ["export", folder / "card.json", "--c", folder / "again", "--table", folder / "again.csv"]
    arguments.append("--no-verify")
    done = subprocess.run(
        command(*arguments),
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONHASHSEED": "7"},
    )
    assert done.returncode == 0, done.stderr
    for path in (folder / "c" / name for name in FILES - {"verification.json", "README.md"}):  # sizes
        assert (folder / "again" / path.name).read_bytes() == path.read_bytes(), path.name
    assert (folder / "again.csv").read_bytes() == (folder / "map.csv").read_bytes()


@pytest.mark.nightly
def test_without_json_it_says_how_it_was_proved(folder, tmp_path):
    done = mrdamper(
        *("export", folder / "card.json", "--c", tmp_path / "front", "--content", "model", "--name", "front"),
        *("--precision", "double", "--step", "500us"),
    )
    assert done.returncode == 0, done.stderr
    assert 'front: model of "Strong as the rig\'s", law double-bouc-wen, double, step 0.5 ms' in done.stdout
    said = " ".join(done.stdout.split())
    assert "run over 100000 samples and compared with the model in Python: the same bits" in said
    assert "a frozen thermometer is told by the heat capacity of the paper's damper" in said
    text = (tmp_path / "front" / "front.h").read_text(encoding="ascii")
    assert "step        0.5 ms (2000 Hz)" in text
    assert "controller_step" not in text


def test_a_drawing_gives_the_heat_capacity(folder, tmp_path):
    drawing = Path(__file__).parents[2] / "examples" / "paper_damper.toml"
    done = mrdamper(
        *("export", folder / "card.json", "--c", tmp_path / "c", "--damper", drawing, "--no-verify", "--json")
    )
    assert not any("paper's damper" in note for note in answer_of(done)["notes"])
    assert "(drawing paper_damper" in (tmp_path / "c" / "damper.h").read_text(encoding="ascii")


def test_what_is_not_verified_says_so_and_what_else_lies_in_the_folder_stays(folder, tmp_path):
    (tmp_path / "damper.h").write_text("old", encoding="ascii")
    (tmp_path / "mine.txt").write_text("mine", encoding="ascii")
    done = mrdamper("export", folder / "card.json", "--c", tmp_path, "--no-verify", "--content", "model")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "mine.txt").read_text(encoding="ascii") == "mine"
    assert "damper_model_step" in (tmp_path / "damper.h").read_text(encoding="ascii")
    assert "not verified" in done.stdout
    record = json.loads((tmp_path / "verification.json").read_text(encoding="utf-8"))
    assert (record["verified"], record["passed"]) == (False, False)


def test_folder_fmu_and_map_come_from_one_check(folder, tmp_path):
    places = {"c": tmp_path / "c", "fmu": tmp_path / "damper.fmu", "table": tmp_path / "map.csv"}
    answer = export(folder / "card.json", ExportOptions(content="model", fmi="2.0"), **places)
    assert str(tmp_path / "damper.fmu") in answer["files"]
    with zipfile.ZipFile(tmp_path / "damper.fmu") as archive:
        names = archive.namelist()
        record = json.loads(archive.read("documentation/verification.json"))
        assert archive.read("sources/damper.c") == (tmp_path / "c" / "damper.c").read_bytes()
    assert "modelDescription.xml" in names
    assert record == json.loads((tmp_path / "c" / "verification.json").read_text(encoding="utf-8"))


# ---------------------------------------------------------------------------------------- unproved


def test_without_a_compiler_nothing_is_written(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("CC", "")
    done = mrdamper("export", folder / "card.json", "--c", tmp_path / "c")
    assert done.returncode == 3
    assert "there is no C compiler (looked for $CC, cc, gcc, clang)" in done.stderr
    assert "--no-verify" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_compiler_that_computes_something_else_ends_with_5_and_nothing_is_written(
    folder, tool, tmp_path, monkeypatch
):
    """The look at the bits is real: here a compiler that changes a table."""
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
    assert "the compiled code is not the model in Python: model.force is not Python's at" in done.stderr
    assert "Nothing was written" in done.stderr
    assert not (tmp_path / "c").exists()


# ------------------------------------------------------------------------------------- what cannot be


@pytest.mark.parametrize(
    ("card", "arguments", "said"),
    [
        ("nowhere.json", (), "nowhere.json: cannot read the card: No such file or directory"),
        ("broken.json", (), "broken.json: envelope"),
        ("tanh.json", (), "tanh.json: controller: the law is 'tanh'; expected one of bouc-wen"),
        (
            "quick.json",
            ("--step", "5ms"),
            "quick.json: controller: the period is 5 ms, and the force follows",
        ),
        ("card.json", ("--step", "1s"), "card.json: step is 1000 ms; expected 0.05 to 10 ms"),
        ("card.json", ("--name", "front-left"), "name is 'front-left'; expected a C identifier"),
        ("card.json", ("--controller", "papper"), "there is no controller 'papper'; did you mean paper"),
        ("card.json", ("--damper", "nowhere.toml"), "nowhere.toml"),
    ],
)
def test_bad_input_is_one_message_and_exit_code_3(folder, tmp_path, card, arguments, said):
    done = mrdamper(
        "export", folder / card, "--c", tmp_path / "c", "--table", tmp_path / "map.csv", *arguments
    )
    assert done.returncode == 3, done.stderr
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    assert said in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "nothing to write: give --c DIR, --fmu FILE, --table FILE, --matlab DIR or --report FILE"),
        (("--c", "x", "--step", "soon"), "'soon' is not a time; expected such as 1ms"),
        (("--c", "x", "--step", "1"), "'1' is not a time"),
        (("--c", "x", "--precision", "half"), "'half' is not one of"),
        (("--c", "x", "--content", "all"), "'all' is not one of"),
        (("--fmu", "x.fmu", "--fmi", "1.0"), "'1.0' is not one of"),
        (("--fmu", "x.fmu", "--no-verify"), "an FMU is made from proved sources"),
    ],
)
def test_wrong_usage_is_exit_code_2(folder, tmp_path, arguments, said):
    done = mrdamper("export", folder / "card.json", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_to_is_told_before_anything_is_made(folder, tmp_path, monkeypatch):
    def refuse(*_: object) -> None:
        raise AssertionError("something was made")

    monkeypatch.setattr("mrdamper.jobs.export.verify_c", refuse)
    monkeypatch.setattr("mrdamper.jobs.export.force_map", refuse)
    (tmp_path / "file").write_text("a file", encoding="ascii")
    card = folder / "card.json"
    for place in ({"c": tmp_path / "file"}, {"table": tmp_path / "file" / "map.csv"}):
        with pytest.raises(InputError, match="is a file; expected a folder to write to"):
            export(card, ExportOptions(), **place)
    with pytest.raises(InputError, match="is a folder; expected the name of a file to write"):
        export(card, ExportOptions(), c=tmp_path / "c", table=tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file"]


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc, which is closed even to root")
def test_a_folder_that_is_closed_is_told(folder):
    with pytest.raises(
        InputError, match=r"c: cannot write there: .*; nothing was changed there. Choose another folder"
    ):
        export(folder / "card.json", ExportOptions(verify=False), c=Path("/proc/self/c"))


def test_a_map_that_fails_takes_the_folder_with_it(folder, tmp_path, monkeypatch):
    def refuse(_: object) -> str:
        raise InputError("no map today")

    monkeypatch.setattr("mrdamper.jobs.export.force_map", refuse)
    places = {"c": tmp_path / "c", "table": tmp_path / "map.csv"}
    with pytest.raises(InputError, match="no map today"):
        export(folder / "card.json", ExportOptions(verify=False), **places)
    assert list(tmp_path.iterdir()) == []


def test_one_place_cannot_be_two_things(folder, tmp_path):
    with pytest.raises(InputError, match="is to be two things at once"):
        export(folder / "card.json", ExportOptions(), fmu=tmp_path / "x", table=tmp_path / "x")


def test_the_wheel_s_files_are_found_where_the_package_is_installed():
    """Kernel and templates are data of the package: found by name, not by a path of the source tree."""
    from importlib.resources import files

    assert files("mrdamper.core").joinpath("kernel", "controller.c").is_file()
    assert files("mrdamper.codegen").joinpath("templates", "damper.h.j2").is_file()
    project = Path(__file__).parents[2] / "pyproject.toml"
    excluded = next(
        line for line in project.read_text(encoding="utf-8").splitlines() if "wheel.exclude" in line
    )
    assert "core/kernel" not in excluded
    assert "templates" not in excluded


@pytest.mark.parametrize("lag", [True, False])
@pytest.mark.parametrize("knows_temperature", [True, False])
def test_what_a_card_lacks_for_a_target_is_told(lag, knows_temperature, tmp_path):
    damper = a_damper(lag=LAG if lag else None, temperature_dependent=knows_temperature)
    card = read_card(write_a_card(tmp_path / "card.json", damper))
    found = exported(card, ExportOptions(what=("c", "table"), verify=False))
    expected = {"no_actuation": not lag, "no_temperature": not knows_temperature}
    kinds = {note.kind for note in found.notes if isinstance(note, Note)}
    assert {kind: kind in kinds for kind in expected} == expected
    assert found.code is not None
    assert found.table is not None
    only_map = exported(card, ExportOptions(what=("table",)))
    assert (only_map.code, only_map.notes) == (None, ())
