"""The public interface has a function for each job, whose result has a summary and a figure."""

from __future__ import annotations

import ast
import inspect
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import click
import pandas as pd
import pytest

import mrdamper
from mrdamper.cli import cli
from mrdamper.registry import JOBS
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import find_preset
from tests.support.cards import RIG_ENVELOPE, card_of, rig_damper
from tests.support.interface import FILE, interface

pytestmark = pytest.mark.system

PUBLIC_NAMES = {job.attribute for job in JOBS.values()}

SCRIPT = Path(__file__).parent / "support" / "typed_script.py"


@pytest.mark.parametrize("name", sorted(JOBS))
def test_command_has_option_for_each_field(name):
    from mrdamper.cli.commands import parameters_of

    job = JOBS[name]
    made = {parameter.name for parameter in parameters_of(job)}
    shown = {field.name for field in job.fields if field.option.flag != "-"}
    assert shown | {each.name for each in job.inputs if each.option.flag != "-"} <= made
    assert {field.name for field in job.reading} <= made


def test_job_result_has_summary_and_figure(tmp_path):
    hot = mrdamper.heat(
        card_of(rig_damper(), envelope=RIG_ENVELOPE), "paper", ambient_degC=35.0, model="lumped"
    )
    assert hot.rise.fluid_degC[0] == pytest.approx(35.0)
    assert "Limit of the fluid (130 degC" in hot.summary()
    assert len(repr(hot).splitlines()) <= 10
    assert "<svg" in hot._repr_html_()
    assert hot.plot().axes
    assert len(hot.to_frame()) == len(hot.rise.time)
    hot.save(tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"heat.html", "heat.json", "heat.csv"}


@pytest.mark.nightly
@pytest.mark.parametrize("checker", ["mypy", "pyright"])
def test_type_checker_reports_wrong_calls(checker, tmp_path, tool):
    """The type checker accepts the correct calls of a script and reports an error in every marked line."""
    if checker == "mypy":
        command = [sys.executable, "-m", "mypy", str(SCRIPT)]
    else:
        settings = {
            "include": [str(SCRIPT)],
            "extraPaths": [str(SOURCE.parent)],
            "reportUnnecessaryTypeIgnoreComment": "error",
        }
        (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings), encoding="utf-8")
        command = [str(tool("pyright")), "--project", str(tmp_path), "--pythonpath", sys.executable]
    run = subprocess.run(command, cwd=SOURCE.parents[1], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout


# ----------------------------------------------------------------------------- short scripts for common tasks

FRAMES_TO_LOOPS = """
import mrdamper
fit = mrdamper.fit([low, high], law="bouc-wen")
fit.plot()
"""  # The task needs at most 4 lines.

LOGGER_TO_CONTROLLER = """
import mrdamper
runs = mrdamper.read("logger.csv", {"displacement_mm": "Pos", "force_kN": "Load", "current_A": "Coil"})
card = mrdamper.fit(runs, "bouc-wen").card()
proved = card.export(c="controller")
"""  # The task needs at most 6 lines.


@pytest.fixture(scope="module")
def logged():
    """Return runs at two currents and a run with current steps, as data frames."""
    campaign = Campaign(motions=("sine5mm1Hz",), currents_A=(0.5, 2.0), temperatures_degC=(20.0,))
    frames = [
        pd.DataFrame(
            {
                "time_s": run.time,
                "displacement_mm": 1e3 * run.displacement,
                "force_N": run.force,
                "current_A": run.command,
            }
        )
        for run, _ in measure(find_preset("nominal"), campaign)
    ]
    return frames


def test_two_data_frames_give_plotted_loops(logged):
    names = {"low": logged[0], "high": logged[1]}
    exec(FRAMES_TO_LOOPS, names)
    assert len(FRAMES_TO_LOOPS.strip().splitlines()) <= 4
    figure = names["fit"].plot()
    assert len(figure.axes) == 4  # Each of the two runs is plotted versus displacement and velocity.
    titles = [axes.get_title(loc="left") for axes in figure.axes[:2]]
    for title, error in zip(titles, names["fit"].assessment.runs, strict=True):
        assert f"{error.rmse_N:.0f} N" in title
    assert names["fit"]._repr_html_().count("<svg") == 1


def test_logger_file_gives_compiled_controller(logged, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    raw = pd.concat(logged)
    raw["force_N"] /= 1e3
    raw.columns = ["time_s", "Pos", "Load", "Coil"]
    raw.to_csv("logger.csv", index=False)
    names: dict[str, object] = {}
    exec(LOGGER_TO_CONTROLLER, names)
    assert len(LOGGER_TO_CONTROLLER.strip().splitlines()) <= 6
    proved = names["proved"]
    assert proved.code.record.passed  # type: ignore[attr-defined]
    assert any((tmp_path / "controller").glob("*.c"))


def test_card_has_method_for_each_job():
    begins = {job.name for job in JOBS.values() if job.inputs and job.inputs[0].name == "card"}
    assert begins <= {*vars(mrdamper.ModelCard)}


def test_public_functions_match_declarations():
    """If this test fails, run ``make interface``, which writes the functions from the declarations."""
    assert FILE.read_text(encoding="utf-8").endswith(interface())
    assert {*PUBLIC_NAMES, "read"} <= {*mrdamper.__all__}


@pytest.mark.parametrize("name", [name for name in mrdamper.__all__ if name[0].islower()])
def test_public_function_has_explicit_signature(name):
    """Every parameter has a name, a type and a line of documentation."""
    function = getattr(mrdamper, name)
    for parameter in inspect.signature(function).parameters.values():
        assert parameter.kind not in {parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL}
        assert parameter.annotation not in {parameter.empty, "Any"}
        if name in PUBLIC_NAMES and parameter.name != "on_progress":
            assert f"\n{parameter.name} : " in (inspect.getdoc(function) or "")


# --------------------------------------------------------------------------------------- options in messages

SOURCE = Path(mrdamper.__file__).parent
NAMED_OPTION = re.compile(r"(?:mrdamper ([a-z]+)[^.;()]*? )?(?<![^\s(`])(--[a-z][\w-]*)")
NAMED_FUNCTION = re.compile(r"\bmrdamper\.(\w+)(?![\w.:])")
CLI_ONLY = ("--out", "--resume", "--json", "--write-map")
READERS = tuple(name for name, job in JOBS.items() if "channels" in [field.name for field in job.reading])
# Commands that print the messages of a package. Messages of all other packages name their command.
COMMANDS_OF = {
    "cli": ("serve",),
    "web": ("serve",),
    "codegen": ("export",),
    "data": READERS,
    "report/identification": ("fit",),
    "jobs/sweep": ("sweep",),
}
# Texts in these modules name no command.
OTHER_TEXTS = ("registry/__init__.py", "cli/commands.py", "report/base.py")


def message_texts(path: Path) -> Iterator[str]:
    """Generate the string literals of a module except docstrings. Formatted values are replaced by {}."""
    source = path.read_text(encoding="utf-8")
    if not NAMED_OPTION.search(source):
        return  # Parsing takes most of the time of this test.
    tree = ast.parse(source)
    skipped = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            skipped |= {id(part) for part in ast.walk(node)}
            yield "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)  # type: ignore[misc]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in skipped:
            yield node.value


def printed_texts() -> Iterator[tuple[tuple[str, ...], str]]:
    """Generate each text that a command can print, with the commands that print it."""
    for name, job in JOBS.items():
        yield (name,), job.help
    for path in sorted(SOURCE.rglob("*.py")):
        module = path.relative_to(SOURCE).as_posix()
        packages = [package for package in COMMANDS_OF if module.startswith(f"{package}/")]
        own = (path.stem,) if path.stem in JOBS else ()
        for text in message_texts(path):
            # Names of options and modules are not messages.
            if not (re.fullmatch(r"--[\w-]+|[\w.:]+", text) or module in OTHER_TEXTS):
                yield COMMANDS_OF[packages[0]] if packages else own, text


@cache
def options_of(command: str) -> dict[str, str]:
    """Return the options of a command, each with the name of its parameter."""
    made = cli.commands[command]
    return {flag: each.name or "" for each in made.get_params(click.Context(made)) for flag in each.opts}


def test_options_named_in_messages_exist():
    """Each option in a message exists on the command line, and as a keyword of the Python function."""
    checked = set()
    for printed_by, text in printed_texts():
        for command, option in NAMED_OPTION.findall(text):
            commands = (command,) if command else printed_by
            assert commands, f"{text!r} does not name the command of {option}"
            for name in commands:
                assert option in options_of(name), f"{text!r}: mrdamper {name} has no {option}"
                if name in JOBS and option not in CLI_ONLY:
                    keyword = options_of(name)[option]
                    assert keyword in inspect.signature(getattr(mrdamper, JOBS[name].attribute)).parameters, (
                        f"{text!r}: {keyword}"
                    )
                checked.add((name, option))
        for function in NAMED_FUNCTION.findall(text):
            assert hasattr(mrdamper, function), f"{text!r}: there is no mrdamper.{function}"
    assert len(checked) > 20
