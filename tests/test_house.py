"""Rules for all files of the repository: forbidden content, first lines, lock files, imports."""

from __future__ import annotations

import ast
import re
import subprocess
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# The host names are split so that this file does not contain them.
REGISTRY_HOSTS = re.compile(
    "|".join(
        rf"\b{host}\.{domain}\b"
        for host, domain in [
            ("pypi", "org"),
            ("pythonhosted", "org"),
            ("npmjs", "(org|com)"),
            ("debian", "org"),
            ("crates", "io"),
            ("golang", "org"),
            ("anaconda", "(org|com)"),
        ]
    )
)
MACHINE_PATHS = re.compile(r"(?<![\w.~*}/)-])/(?:home|root|work|opt|mnt|Users)/\w")


@pytest.fixture(scope="module")
def files(tool: Callable[[str], Path]) -> list[Path]:
    """Return the files in git and the new files that git does not ignore."""
    listing = [str(tool("git")), "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    run = subprocess.run(listing, cwd=ROOT, capture_output=True, text=True, check=False)
    if run.returncode:
        pytest.skip("not a git checkout")
    return [path for name in run.stdout.split("\0") if name and (path := ROOT / name).is_file()]


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")


def lines_with(pattern: re.Pattern[str], files: list[Path]) -> list[str]:
    return [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()[:100]}"
        for path in files
        for number, line in enumerate(text_of(path).splitlines(), start=1)
        if pattern.search(line)
    ]


def test_no_file_contains_registry_host(files):
    assert lines_with(REGISTRY_HOSTS, files) == []


def test_no_file_contains_local_path(files):
    assert lines_with(MACHINE_PATHS, files) == []


@pytest.mark.parametrize(
    ("suffixes", "begins"), [({".py"}, r'(#.*\n)*\s*r?"""\s*\S'), ({".c", ".h"}, r"/\*")], ids=["python", "c"]
)
def test_every_module_begins_with_description(files, suffixes, begins):
    spoken = {path for path in files if re.match(begins, text_of(path))}
    assert [str(path) for path in files if path.suffix in suffixes and path not in spoken] == []


# --------------------------------------------------------------------------------------------- lock file


def normalised(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


LOCKS = ("requirements.lock", "requirements-test.lock")


def lock_entries(name: str) -> dict[str, str]:
    """Return the entries of a lock file by package name. Continuation lines are joined."""
    joined = re.sub(r"\\\n", " ", text_of(ROOT / name))
    entries = [line for line in joined.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    return {normalised(re.split(r"[=\s]", entry, maxsplit=1)[0]): entry for entry in entries}


@pytest.mark.parametrize("lock", LOCKS)
def test_lock_entries_have_version_and_hashes(lock: str):
    entry_shape = re.compile(r"[\w.-]+==[\w.]+( ; [^#]+?)?(\s+--hash=sha256:[0-9a-f]{64})+\s*")
    assert [entry for entry in lock_entries(lock).values() if not entry_shape.fullmatch(entry)] == []


@pytest.mark.parametrize("lock", LOCKS)
def test_lock_files_contain_no_address_or_option(lock: str):
    text = text_of(ROOT / lock)
    assert re.findall(r"\w+://|^\s*-(?!-hash=)\S+|@ *file", text, re.MULTILINE) == []


def test_lock_files_cover_all_requirements():
    with (ROOT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)
    extras = project["project"]["optional-dependencies"]
    wanted = [
        *project["project"]["dependencies"],
        *(requirement for each in extras.values() for requirement in each),
        *(requirement for each in project["dependency-groups"].values() for requirement in each),
        *project["build-system"]["requires"],
    ]
    names = {normalised(re.split(r"[\[<>=!~; ]", requirement, maxsplit=1)[0]) for requirement in wanted}
    assert names - {"mrdamper"} - {name for lock in LOCKS for name in lock_entries(lock)} == set()


# --------------------------------------------------------------------------------------------- imports


def test_no_package_imports_public_interface(files):
    """The import linter cannot follow imports through ``mrdamper``. Only ``card.py`` may import it."""
    package = ROOT / "src" / "mrdamper"
    rooms = {path.stem for path in package.iterdir()} | {"__version__"}
    through_the_face = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in files
        if path.suffix == ".py"
        and package in path.parents
        and path.parent != package
        and path.name != "card.py"
        for text in [text_of(path)]
        if re.search(r"\bimport mrdamper\b|\bfrom mrdamper import\b|, *mrdamper\b", text)
        for node in ast.walk(ast.parse(text))
        if (isinstance(node, ast.Import) and any(alias.name == "mrdamper" for alias in node.names))
        or (
            isinstance(node, ast.ImportFrom)
            and node.module == "mrdamper"
            and not {alias.name for alias in node.names} <= rooms
        )
    ]
    assert through_the_face == []
