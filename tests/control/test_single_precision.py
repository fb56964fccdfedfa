"""The controller's files on their own, as a target gets them: in single precision, without a library.

Compiled here with flags of their own, they give the bits of the extension's single precision.
"""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mrdamper import core
from mrdamper.control.config import config_fields
from mrdamper.control.controllers import controllers_for
from mrdamper.control.realtime import realtime_model
from mrdamper.control.tables.card_tables import CURVES, SPEEDS
from mrdamper.excitation import MOTIONS
from tests.control.dampers import DOUBLE

KERNEL = Path(core.__file__).parent / "kernel"
WARNINGS = ["-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Wdouble-promotion", "-Wcast-qual", "-pedantic"]
REAL, POINTER = ctypes.c_float, ctypes.POINTER(ctypes.c_float)
C_TYPES: dict[type, Any] = {float: REAL, bool: ctypes.c_bool}  # counts and choices are 32 bits


class LookupTable(ctypes.Structure):
    _fields_ = [
        ("offset", REAL), ("top", REAL), ("bits", ctypes.c_int32), ("cells", ctypes.c_int32),
        ("cell", POINTER),
    ]  # fmt: skip


def part(name):
    """Return the kernel's struct of one part of a configuration."""
    values = [each for each in config_fields() if each.part == name]
    of = [(each.name, C_TYPES.get(each.type, ctypes.c_int32)) for each in values]
    return type(name, (ctypes.Structure,), {"_fields_": of})


PARTS = {name: part(name) for name in dict.fromkeys(each.part for each in config_fields())}


class Track(ctypes.Structure):
    _fields_ = [
        *PARTS.items(),
        ("currents", ctypes.c_int32), ("pieces", ctypes.c_int32), ("levels", ctypes.c_int32),
        ("begin", ctypes.c_int32 * 6), ("row", ctypes.c_uint8 * 48),
        ("eighth", ctypes.c_uint8 * 9), ("current", POINTER),
        ("factor", POINTER), ("column", POINTER),
        *((name, LookupTable) for name in (*CURVES, *SPEEDS)), ("series", ctypes.c_void_p),
    ]  # fmt: skip


class Inputs(ctypes.Structure):
    _fields_ = [(name, REAL) for name in ("now", "ahead", "displacement", "temperature", "force")]


class ModelInputs(ctypes.Structure):
    _fields_ = [(name, REAL) for name in ("displacement", "velocity", "current", "temperature")]


def track_of(made, kept):
    """Return the kernel's struct; ``kept`` keeps its arrays alive."""

    def pointer(values):
        kept.append(np.ascontiguousarray(values, dtype=np.float32))
        return kept[-1].ctypes.data_as(POINTER)

    tables, track = made.tables, Track()
    for each in config_fields():
        setattr(getattr(track, each.part), each.name, each.of(made.config))
    track.currents, track.pieces = len(tables.currents), len(tables.factor)
    track.levels, track.begin = tables.levels, tables.begin
    track.row[: len(tables.rows)] = tables.rows
    track.eighth, track.current = tables.eighths, pointer(tables.currents)
    track.factor, track.column = pointer(tables.factor), pointer(tables.column)
    for curve, table in zip((*CURVES, *SPEEDS), tables.lookups, strict=True):
        setattr(
            track,
            curve,
            LookupTable(table.offset, table.top, table.bits, len(table.cell), pointer(table.cell)),
        )
    return track


@pytest.fixture(scope="module")
def library(tool, tmp_path_factory):
    out = tmp_path_factory.mktemp("single") / "controller.so"
    flags = [
        "-std=c99",
        "-O2",
        "-ffp-contract=off",
        "-DMRD_SINGLE",
        "-fPIC",
        "-shared",
        "-nostdlib",
        "-Werror",
    ]
    arguments = [tool("gcc"), *flags, *WARNINGS, KERNEL / "controller.c", "-lc", "-o", out]
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out


@pytest.mark.system
def test_it_needs_nothing_but_memory_copies(library, tool):
    """No mathematical library, no heap: a free-standing compiler brings memcpy and memset itself."""
    done = subprocess.run([tool("nm"), "-D", "-u", library], capture_output=True, text=True, check=True)
    wanted = {line.split()[-1].partition("@")[0] for line in done.stdout.splitlines() if " U " in line}
    assert wanted <= {"memcpy", "memset", "__stack_chk_fail"}


@pytest.mark.system
@pytest.mark.parametrize("name", ["recommended", "recommended-causal", "paper", "pi"])
def test_in_single_precision_the_command_is_the_same_within_a_milliampere(library, name):
    made = controllers_for(DOUBLE)[name]
    c = ctypes.CDLL(str(library))
    c.mrd_track_step.restype = REAL
    kept: list[np.ndarray] = []
    track = track_of(made, kept)
    state = (ctypes.c_double * 1000)()
    c.mrd_track_start(ctypes.byref(track), state)
    t = made.period_s * np.arange(3000)
    motion, rng = MOTIONS["nonperiodic"], np.random.default_rng(1)
    rows = np.full((len(t), 5), np.nan)
    rows[:, 0] = 900.0 * np.tanh(motion.velocity(t) / 0.02)
    rows[:, 1] = 900.0 * np.tanh(motion.velocity(t + 0.0155) / 0.02) if made.known_ahead else np.nan
    rows[:, 2] = motion.displacement(t) + 10e-6 * rng.standard_normal(len(t))
    rows[:, 3], rows[:, 4] = 330.0, 0.8 * rows[:, 0]
    single = [c.mrd_track_step(ctypes.byref(track), state, ctypes.byref(Inputs(*row))) for row in rows]
    _, double, _ = made.run(made.start(), rows)
    assert np.abs(np.array(single) - double).max() < 1e-3
    assert double.max() > 0.5
    same = replace(made, single=True)
    np.testing.assert_array_equal(single, same.run(same.start(), rows)[1])


@pytest.mark.parametrize("told", [True, False])
def test_the_model_s_force_has_the_bits_of_the_extension_s(library, told):
    made = realtime_model(DOUBLE, single=True)
    c = ctypes.CDLL(str(library))
    c.mrd_model_step.restype = REAL
    kept: list[np.ndarray] = []
    track = track_of(made, kept)
    state = (ctypes.c_double * 1000)()
    c.mrd_track_start(ctypes.byref(track), state)
    t = made.period_s * np.arange(3000)
    motion, rows = MOTIONS["nonperiodic"], np.empty((len(t), 4))
    rows[:, 0], rows[:, 1] = motion.displacement(t), motion.velocity(t) if told else np.nan
    rows[:, 2], rows[:, 3] = 1.0 - np.cos(2.0 * t), 300.0 + 5.0 * t
    force = [c.mrd_model_step(ctypes.byref(track), state, ctypes.byref(ModelInputs(*row))) for row in rows]
    np.testing.assert_array_equal(force, made.run(made.start(), rows)[1])
