"""Commands and code in the documentation run and print the output that the pages show.

Every page runs from top to bottom in a separate folder. In a ``console`` block, each command must end with
status 0 and print the lines below the command. Words must be equal and numbers agree within 3 %. ``...``
matches any lines. A ``python`` block runs in the namespace of the page. A ``code-block`` whose caption is a
file name is written to this file. Every page except ``start.md`` begins with the results of ``start.md``.

Comments before a block change these rules. ``% exit: N`` and ``% tolerance: 10 %`` state another status and
tolerance. ``% long: reason`` moves the block to ``make test-nightly``, and ``% data: reason`` to tests with
measured data. ``% needs: PROGRAM`` names a program that the block calls.
"""

from __future__ import annotations

import contextlib
import difflib
import doctest
import importlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import mrdamper as mrdamper_itself
from mrdamper.models.laws import LAWS
from tests.support.rigs import mrdamper

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[1]
START = ROOT / "docs" / "start.md"
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
TOLERANCE = 0.03

_FENCE = re.compile(
    r"^(?P<ticks>`{3,})(?P<info>[^\n`]*)\n(?P<body>.*?)^(?P=ticks)\s*$", re.MULTILINE | re.DOTALL
)
_NUMBER = re.compile(r"[-+−]?\d+\.?\d*(?:e[-+]?\d+)?")
_TIME = re.compile(r"\([\d.]+ s\)")
Tool = Callable[[str], Path]

_LAST_OF_START = "% the other pages start here"


@dataclass(frozen=True)
class Block:
    """A block of a page between fences: its kind, text, comments before it, and line number."""

    kind: str  # One of "console", "python" and "file"
    body: str
    line: int
    notes: dict[str, str]
    file: str = ""

    @property
    def tolerance(self) -> float:
        said = self.notes.get("tolerance")
        return TOLERANCE if said is None else float(said.rstrip(" %")) / 100.0


def blocks_of(text: str) -> list[Block]:
    found = []
    for match in _FENCE.finditer(text):
        info, body = match["info"].strip(), match["body"]
        before = text[: match.start()].rstrip().splitlines()
        notes = {}
        while before and before[-1].startswith("% ") and ":" in before[-1]:
            name, _, value = before.pop()[2:].partition(":")
            notes[name.strip()] = value.strip()
        line = text[: match.start()].count("\n") + 1
        if info in {"console", "python"}:
            found.append(Block(info, body, line, notes))
        elif info.startswith("{code-block}"):
            caption = re.match(r"(?::[\w-]+:.*\n)*?:caption: (\S+\.\w+)\n(?::[\w-]+:.*\n)*\n?", body)
            if caption is not None:
                found.append(Block("file", body[caption.end() :], line, notes, caption[1]))
    return found


BLOCKS = {page: blocks_of(page.read_text(encoding="utf-8")) for page in PAGES}


def commands_of(body: str) -> Iterator[tuple[str, list[str]]]:
    """Generate each command of a console block with the output lines that the page shows below it."""
    command, shown = "", list[str]()
    lines = iter(body.splitlines())
    for line in lines:
        if line.startswith("$ "):
            if command:
                yield command, shown
            command, shown = line[2:], []
            while command.endswith("\\"):
                command = f"{command[:-1]}{next(lines).strip()}"
        else:
            shown.append(line)
    if command:
        yield command, shown


# -------------------------------------------------------------------------------------- comparison of outputs


def words_of(line: str) -> list[str]:
    """Return the words of a line without the frames of tables. A computing time becomes TIME."""
    return re.sub(r"[\u2500-\u257f]", " ", _TIME.sub("TIME", line)).split()


def is_same(wanted: str, seen: str, tolerance: float) -> bool:
    """Return True if both lines have the same words, and numbers that agree within the tolerance."""
    if wanted == seen:
        return True
    if _NUMBER.split(wanted) != _NUMBER.split(seen):
        return False
    pairs = zip(_NUMBER.findall(wanted), _NUMBER.findall(seen), strict=True)
    return all(
        abs(float(a.replace("−", "-")) - float(b.replace("−", "-")))
        <= tolerance * abs(float(a.replace("−", "-")))
        for a, b in pairs
    )


def difference(shown: Sequence[str], printed: str, tolerance: float) -> str:
    """Return the first shown line that was not printed, or "" if all lines were printed."""
    seen = [word for line in printed.splitlines() for word in words_of(line)]
    place, free = 0, False
    for line in shown:
        if line.strip() == "...":
            free = True
            continue
        wanted = words_of(line)
        last = len(seen) - len(wanted)
        for start in range(place, (last if free else min(place, last)) + 1):
            if all(is_same(a, b, tolerance) for a, b in zip(wanted, seen[start:], strict=False)):
                place, free = start + len(wanted), not wanted and free
                break
        else:
            like = difflib.get_close_matches(line, printed.splitlines(), n=1)
            return f"{line}\nthe nearest is:  {like[0]}" if like else line
    return (
        "" if free or place == len(seen) else f"(nothing more, but there is: {' '.join(seen[place:])[:200]})"
    )


# ---------------------------------------------------------------------------------------- execution of blocks


def follow(
    page: Path, blocks: Sequence[Block], folder: Path, *, also: str = "", tool: Tool | None = None
) -> None:
    """Run blocks of a page in a folder. Messages of failures contain the line number in the page.

    A block with the comment ``long`` or ``data`` runs only if ``also`` is the same word.
    """
    name = f"page_{page.stem}"  # A dataclass in a python block must find its module in ``sys.modules``.
    if page != START:
        sys.modules.pop(name, None)
    namespace = sys.modules.setdefault(name, ModuleType(name)).__dict__
    for block in blocks:
        place = f"{page.relative_to(ROOT)}:{block.line}"
        if {"long", "data"} & block.notes.keys() - {also}:
            continue
        if "needs" in block.notes and tool is not None:
            tool(block.notes["needs"])
        if block.kind == "file":
            path = folder / block.file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.body, encoding="utf-8")
        elif block.kind == "python":
            run_python(block, namespace, place)
        else:
            run_console(block, folder, place)


def run_shell(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    surroundings = {key: value for key, value in os.environ.items() if key not in {"COLUMNS", "LINES"}}
    return subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env=surroundings | {"PATH": path},
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )


def run_console(block: Block, folder: Path, place: str) -> None:
    for command, shown in commands_of(block.body):
        plain = command.startswith("mrdamper ") and not set(command) & set("|;&<>$~")
        done = mrdamper(*shlex.split(command)[1:]) if plain else run_shell(command, folder)
        status, printed, said = done.returncode, done.stdout, done.stderr
        assert status == int(block.notes.get("exit", "0")), f"{place}: {command}\n{printed}\n{said}"
        printed += said if status else ""
        missing = difference(shown, printed, block.tolerance) if shown else ""
        assert not missing, f"{place}: {command}\ndoes not print:  {missing}\n\n{printed}"


def run_python(block: Block, namespace: dict[str, Any], place: str) -> None:
    if block.body.startswith(">>>"):
        example = doctest.DocTestParser().get_doctest(block.body, namespace, place, place, block.line)
        said = io.StringIO()
        failed = doctest.DocTestRunner().run(example, out=said.write, clear_globs=False).failed
        namespace.update(example.globs)
        assert failed == 0, said.getvalue()
        return
    code = compile("\n" * block.line + block.body, place.rpartition(":")[0], "exec")
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        exec(code, namespace)


# ------------------------------------------------------------------------------------------------ tests


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the results of the start page up to the fitted card."""
    folder = tmp_path_factory.mktemp("laboratory")
    shutil.copytree(ROOT / "examples", folder / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    with contextlib.chdir(folder):
        follow(START, BLOCKS[START][: blocks_before_the_others()], folder)
    return folder


def blocks_before_the_others() -> int:
    """Return the number of blocks in the first part of the start page."""
    before, mark, _ = START.read_text(encoding="utf-8").partition(_LAST_OF_START)
    assert mark, f"{START.name} has no line {_LAST_OF_START!r}"
    return len(blocks_of(before))


def test_commands_of_start_page_give_shown_output(folder):
    """The beginning of the page has already run in the fixture ``laboratory``."""
    follow(START, BLOCKS[START][blocks_before_the_others() :], folder)


LONG = {
    "README.md",
    "fmu.md",
    "which_tests.md",
    "temperature.md",
    "heat_sink.md",
    "export.md",
    "large_campaigns.md",
    "which_law.md",
    "thermal_estimation.md",
    "hydraulic_rig.md",
    "thermal.md",
    "characteristics.md",
    "commissioning.md",
    "tracking.md",
}
"""Pages whose commands take seconds of CPU. They run in the nightly tests."""


def pages_with(mark: str = "") -> list[object]:
    """Return the pages with blocks that have a mark. Without a mark, omit the start page."""
    return [
        pytest.param(
            page,
            id=page.relative_to(ROOT).as_posix(),
            marks=[pytest.mark.nightly] if page.name in LONG else [],
        )
        for page, blocks in BLOCKS.items()
        if (mark or page != START)
        and any(mark in block.notes if mark else block.kind != "file" for block in blocks)
    ]


@pytest.fixture
def folder(laboratory: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the working directory of one page, with the results of the start page."""
    place = tmp_path / "page"
    shutil.copytree(laboratory, place)
    monkeypatch.chdir(place)
    return place


@pytest.mark.parametrize("page", pages_with())
def test_commands_of_page_give_shown_output(page, folder, tool):
    follow(page, BLOCKS[page], folder, tool=tool)


@pytest.mark.nightly
@pytest.mark.parametrize("page", pages_with("data"))
def test_commands_with_public_data_give_shown_output(page, folder, tool, real_data, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / ".cache"))
    monkeypatch.setenv("HOME", str(folder))
    follow(page, BLOCKS[page], folder, also="data", tool=tool)


@pytest.mark.nightly
@pytest.mark.parametrize("page", pages_with("long"))
def test_long_commands_of_page_give_shown_output(page, folder, tool):
    follow(page, BLOCKS[page], folder, also="long", tool=tool)


def test_make_targets_named_in_docs_exist():
    """Tests cannot run targets such as ``make test``, but these targets must exist."""
    made = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z][a-z-]*):", made, re.MULTILINE))
    pages = (*PAGES, ROOT / "CONTRIBUTING.md")
    texts = [page.read_text(encoding="utf-8") for page in pages]
    named = {name for text in texts for name in re.findall(r"(?:^ {4}|`)make ([a-z-]+)", text, re.MULTILINE)}
    assert named
    assert named <= targets


def test_pages_linked_in_docs_exist():
    broken = [
        f"{page.relative_to(ROOT)}: {link}"
        for page in (*PAGES, ROOT / "CONTRIBUTING.md")
        for link in re.findall(r"\]\(([^)#\s:]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
        if not (page.parent / link).exists()
    ]
    assert broken == []


def test_files_named_in_docs_exist():
    """A page may also name a file of the user, which begins with "my" or "your"."""
    folders = ("src", "tests", "bench", "fuzz", "examples", "docs", "cmake")
    known = {path.name for folder in folders for path in (ROOT / folder).rglob("*.*")}
    code = re.compile(r"`(?:[\w./]*/)?(\w+\.(?:py|c|h|js|toml|j2))`")
    named = {(page.name, name) for page in PAGES for name in code.findall(page.read_text(encoding="utf-8"))}
    known |= {name for _, name in named if name.startswith(("my", "your"))} | {"pyproject.toml"}
    assert {(page, name) for page, name in named if name not in known} == set()


def test_functions_named_in_docs_exist():
    missing = []
    for page in PAGES:
        for name in re.findall(r"\{py:\w+\}`~?([\w.]+)`", page.read_text(encoding="utf-8")):
            module, _, thing = name.rpartition(".")
            if not hasattr(importlib.import_module(module), thing):
                missing.append(f"{page.relative_to(ROOT)}: {name}")
    assert missing == []


def test_reference_page_lists_public_names():
    page = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
    named = re.findall(r"^\.\. auto\w+:: mrdamper\.(\w+)$", page, re.MULTILINE)
    assert sorted(named) == sorted(set(mrdamper_itself.__all__) - {"__version__"})


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_docs_describe_every_law(law):
    page = (ROOT / "docs" / "laws.md").read_text(encoding="utf-8")
    assert re.search(rf"^## .*`{law.name}`", page, re.MULTILINE)
    assert [name for name in law.names if f"`{name}`" not in page] == []


def test_changelog_entries_are_short() -> None:
    """A version has at most 40 lines of at most 120 characters."""
    _, *versions = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").split("\n## ")
    for version in versions:
        lines = version.splitlines()
        assert len(lines) <= 40
        assert max(map(len, lines)) <= 120
