"""The package has the documented public names, a fast import, and a build that works."""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

import mrdamper

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[1]


def cpu_ms(*command: str, repeats: int = 3) -> float:
    """Return the minimum CPU time of repeated calls of a command [ms]. The minimum excludes noise."""

    def once() -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return 1e3 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)

    return min(once() for _ in range(repeats))


def modules_after(statement: str) -> set[str]:
    code = f"import sys\n{statement}\nprint(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return set(run.stdout.split())


def script() -> str:
    return str(Path(sys.executable).with_name("mrdamper"))


HEAVY = {"numpy", "scipy", "polars", "matplotlib", "pint", "jinja2", "pooch", "pymoo"}


def test_import_loads_no_heavy_library():
    assert modules_after("import mrdamper") & HEAVY == set()


def test_import_takes_at_most_50_ms():
    bare = cpu_ms(sys.executable, "-c", "pass")
    assert cpu_ms(sys.executable, "-c", "import mrdamper") - bare <= 50.0


def test_help_takes_at_most_200_ms():
    assert cpu_ms(script(), "--help") <= 200.0


@pytest.mark.parametrize("name", mrdamper.__all__)
def test_public_name_can_be_imported(name):
    assert getattr(mrdamper, name) is not None
    assert name in dir(mrdamper)


def test_version_follows_git_tag(tmp_path):
    """The version is the git tag, or later the next version. CITATION.cff states the version of the tag."""
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    without = _version_of(tmp_path)
    assert re.search(
        rf"^version: {re.escape(without)}$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))["version"] == without
    assert tuple(map(int, mrdamper.__version__.split(".")[:2])) >= tuple(map(int, without.split(".")[:2]))

    author = ("-c", "user.name=nobody", "-c", "user.email=nobody@localhost", "-c", "commit.gpgsign=false")

    def git(*words: str) -> None:
        subprocess.run(("git", *author, *words), cwd=tmp_path, check=True, capture_output=True)

    git("init")
    git("add", "pyproject.toml")
    git("commit", "--message", "a release")
    git("tag", "v9.8.7")
    assert _version_of(tmp_path) == "9.8.7"
    git("commit", "--allow-empty", "--message", "work on the next")
    assert _version_of(tmp_path).startswith("9.8.8.dev1+g")


def _version_of(root: Path) -> str:
    found = subprocess.run(
        [sys.executable, "-m", "setuptools_scm", "--root", "."],
        cwd=root, env=os.environ | {"GIT_CEILING_DIRECTORIES": str(root.parent)}, check=True,
        capture_output=True, text=True,
    )  # fmt: skip
    return found.stdout.strip()


@pytest.mark.nightly
def test_source_archive_builds_working_wheel(tmp_path):
    """The wheel contains types and templates, and the installed program runs."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"

    def run(*command: str, folder: Path) -> None:
        subprocess.run(command, cwd=folder, env=os.environ | {"PATH": path}, check=True, capture_output=True)

    make = "import sys; from scikit_build_core.build import build_sdist; build_sdist(sys.argv[1])"
    run(sys.executable, "-c", make, str(tmp_path), folder=ROOT)
    (archive,) = tmp_path.glob("*.tar.gz")
    shutil.unpack_archive(archive, tmp_path / "source", filter="data")
    (source,) = (tmp_path / "source").iterdir()
    assert (source / "tests" / "conftest.py").is_file()
    pip = (sys.executable, "-m", "pip", "--quiet")
    run(*pip, "wheel", "--no-build-isolation", "--no-deps", ".", "-w", str(tmp_path), folder=source)
    (wheel,) = tmp_path.glob("*.whl")
    run(*pip, "install", "--no-deps", "--target", str(tmp_path / "there"), str(wheel), folder=tmp_path)
    assert (tmp_path / "there" / "mrdamper" / "py.typed").is_file()
    code = "import mrdamper; print(mrdamper.__file__); mrdamper.rig(campaign='short').dataset.plot()"
    # The option -S ignores .pth files, so the editable installation of this repository is not imported.
    where = os.pathsep.join((str(tmp_path / "there"), sysconfig.get_path("purelib")))
    ran = subprocess.run(
        [sys.executable, "-S", "-c", code],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": where}, check=False,
        capture_output=True, text=True,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith(str(tmp_path))


def test_package_works_without_polars(tmp_path):
    code = """
import sys
sys.modules["polars"] = None
import numpy as np
import mrdamper
time = np.arange(600) / 200.0
angle = 2.0 * np.pi * time
rows = zip(time, 5.0 * np.sin(angle), 300.0 * np.tanh(3.0 * np.cos(angle)), np.full(600, 0.5))
lines = [";".join(f"{each:.6f}".replace(".", ",") for each in row) + ";note" for row in rows]
open("own.csv", "w").write("\\n".join(["time_s;displacement_mm;force_N;current_A;remark", *lines]))
found = mrdamper.check("own.csv")
found.save("out")
open("own.parquet", "wb").write(b"PAR1" + bytes(100))
for ask in (found.to_frame, lambda: mrdamper.read("own.parquet")):
    try:
        ask()
    except mrdamper.MrdamperError as missing:
        print(missing)
"""
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, check=False, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("mrdamper[rig-files]") == 2, run.stdout
    assert (tmp_path / "out" / "check.html").is_file()
