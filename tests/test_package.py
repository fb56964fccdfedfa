"""The package's own face: what it names, and how little it costs to import."""

from __future__ import annotations

import re
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mrdamper

pytestmark = pytest.mark.system


def cpu_ms(*command: str, repeats: int = 5) -> float:
    """Return the least CPU time of a command over some runs [ms]: what it needs, without the noise."""

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


HEAVY = {"numpy", "scipy", "polars", "matplotlib", "pint", "jinja2", "pooch", "pymoo", "cma"}


def test_importing_the_package_loads_none_of_the_heavy_libraries():
    assert modules_after("import mrdamper") & HEAVY == set()


def test_the_command_line_loads_none_of_the_heavy_libraries_before_a_job_starts():
    assert modules_after("import mrdamper.cli") & HEAVY == set()


def test_a_card_is_scored_without_loading_what_fits_one():
    """Nor Pint: ``mrdamper predict`` has half a second of CPU, measured by ``python -m bench startup``."""
    loaded = modules_after("import mrdamper.jobs.predict, mrdamper.cli.terminal")
    unwanted = {"scipy.optimize", "scipy.stats", "scipy.linalg", "pint", "polars", "jinja2", "matplotlib"}
    assert loaded & unwanted == set()
    assert "mrdamper.identify.search.variable_projection" not in loaded


def test_importing_the_package_takes_at_most_30_ms_of_cpu():
    bare = cpu_ms(sys.executable, "-c", "pass")
    assert cpu_ms(sys.executable, "-c", "import mrdamper") - bare <= 30.0


def test_the_first_picture_of_own_data_takes_at_most_3_s_of_cpu(tmp_path, monkeypatch):
    """As after an installation: Matplotlib has looked at no font yet."""
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path / "fonts"))
    time = np.arange(0.0, 3.0, 2e-3)
    x = 0.01 * np.sin(2.0 * np.pi * time)
    force = 400.0 * np.tanh(50.0 * np.gradient(x, time)) + 1e3 * np.gradient(x, time)
    np.savetxt(
        tmp_path / "own.csv",
        np.column_stack([time, 1e3 * x, force, np.ones_like(time)]),
        delimiter=",",
        header="time_s,displacement_mm,force_N,current_A",
        comments="",
    )
    code = f"import mrdamper; mrdamper.read({str(tmp_path / 'own.csv')!r}).plot().savefig('own.svg')"
    monkeypatch.chdir(tmp_path)
    assert cpu_ms(sys.executable, "-c", code, repeats=1) <= 3000.0
    assert "<svg" in (tmp_path / "own.svg").read_text(encoding="utf-8")


def test_every_module_is_imported_where_unix_alone_has_some():
    """As on Windows: no fcntl, resource, pwd, grp or termios, and a select without poll."""
    code = """
import importlib, pkgutil, select, sys
for name in ("fcntl", "resource", "pwd", "grp", "termios"):
    sys.modules[name] = None
del select.poll, select.POLLIN, select.POLLOUT
import mrdamper
found = [each.name for each in pkgutil.walk_packages(mrdamper.__path__, "mrdamper.")]
for name in found:
    if not name.endswith("__main__"):
        importlib.import_module(name)
print(len(found))
"""
    run = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) > 200


def test_help_takes_at_most_200_ms_of_cpu():
    assert cpu_ms(script(), "--help") <= 200.0


@pytest.mark.parametrize("name", mrdamper.__all__)
def test_every_public_name_resolves(name):
    assert getattr(mrdamper, name) is not None
    assert name in dir(mrdamper)


def test_a_misspelt_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'reed_runs'"):
        _ = mrdamper.reed_runs  # type: ignore[attr-defined]


def test_the_version_is_the_one_in_the_project_file():
    project = (Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8")
    written = re.search(r'^version = "(.+)"$', project, re.MULTILINE)
    assert written is not None
    assert mrdamper.__version__ == written[1]
