"""Cards, targets and output folders for the tests of exports. Nothing is fitted, and targets are cached."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.codegen.c_code import c_files
from mrdamper.codegen.target import Target, target_of
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.damper import Damper, OperatingEnvelope
from tests.support.cards import DAMPERS, SERIES

ENVELOPE = OperatingEnvelope((0.0, 2.0), (-0.012, 0.012), (-0.08, 0.08), (293.15, 393.15))
RUN = {"name": "nobody_measured_this", "split": "training", "rmse_N": 20.0, "nrmse_percent": 3.0}
STRICT = [
    "-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Wcast-qual",
    "-pedantic", "-Werror",
]  # fmt: skip


def card_of(damper: Damper, *, title: str = "For an export") -> ModelCard:
    evidence = Evidence(runs=(RUN,), method="varpro", cost=3.0, dataset_fingerprint="sha256:0")
    return ModelCard(title=title, damper=damper, envelope=ENVELOPE, evidence=evidence)


@cache
def a_target(law: str = "double-bouc-wen", **options: object) -> Target:
    damper = SERIES if law == "series-valve" else DAMPERS[law]
    return target_of(card_of(damper), **options)  # type: ignore[arg-type]


def write(target: Target, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in c_files(target).items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    return folder


def run(*command: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(list(map(str, command)), cwd=cwd, capture_output=True, text=True, check=False)


def ran(*command: object, cwd: Path | None = None) -> str:
    """Run a command that must succeed without output on standard error, and return its standard output."""
    done = run(*command, cwd=cwd)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def motion(count: int, *, seed: int = 1) -> dict[str, FloatArray]:
    """Return input rows in single precision: two sines, rising temperature, target in phase with velocity."""
    t = 1e-3 * np.arange(count)
    rng = np.random.default_rng(seed)
    x = 6e-3 * np.sin(7.0 * t) + 3e-3 * np.sin(19.0 * t + seed) + 1e-6 * rng.standard_normal(count)
    columns = {
        "displacement_m": x,
        "temperature_K": 300.0 + 10.0 * t,
        "current_A": 1.0 + np.sin(3.0 * t),
        "wanted_N": 700.0 * np.sign(np.cos(7.0 * t)),
    }
    return {name: values.astype(np.float32).astype(np.float64) for name, values in columns.items()}


def read_csv(path: Path) -> dict[str, FloatArray]:
    names = path.read_text(encoding="ascii").partition("\n")[0].split(",")
    return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2).T, strict=True))
