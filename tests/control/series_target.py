"""The controller's files built on their own, as a target has them, and the series valve driven."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper import core
from mrdamper.control.controllers import ForceController
from mrdamper.quantities import FloatArray

KERNEL = Path(core.__file__).parent / "kernel"
WARNINGS = ["-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Wdouble-promotion", "-Wcast-qual", "-pedantic"]

DRIVER = """
#include "controller.c"

void carry(const mrd_track *, mrd_track_state *, int, const mrd_real *, mrd_real *);
int state_size(void);

/* Rows of displacement, velocity, acceleration, applied current and temperature in, force out. */
void carry(const mrd_track *c, mrd_track_state *s, int n, const mrd_real *row, mrd_real *force)
{
    for (int i = 0; i < n; i++, row += 5) {
        const mrd_real v = i ? s->v : row[1], applied = i ? s->applied : row[3];
        s->x = row[0];
        s->v = row[1];
        s->a = row[2];
        s->applied = row[3];
        s->temperature = row[4];
        const axis_point warm = warmth(c, s->temperature);
        if (i) follow_hysteresis(c, s, warm, v, (applied + s->applied) / 2);
        force[i] = series_force(c, s, warm);
    }
}

int state_size(void) { return (int)sizeof(mrd_track_state); }
"""


def _structures(real: Any) -> Any:
    pointer = ctypes.POINTER(real)

    class Octaves(ctypes.Structure):
        _fields_ = [
            ("offset", real), ("top", real), ("bits", ctypes.c_int32), ("cells", ctypes.c_int32),
            ("cell", pointer),
        ]  # fmt: skip

    class Power(ctypes.Structure):
        _fields_ = [
            ("exponent", real), ("least", real), ("top", real), ("bits", ctypes.c_int32),
            ("octaves", ctypes.c_int32), ("scale", pointer), ("cell", pointer),
        ]  # fmt: skip

    class Series(ctypes.Structure):
        _fields_ = [
            ("currents", ctypes.c_int32), ("yield_force", pointer), ("chain", pointer),
            *((name, Power) for name in ("thinning", "leak", "viscous")),
            *((name, Octaves) for name in ("side", "fade", "corner")),
        ]  # fmt: skip

    class Track(ctypes.Structure):
        _fields_ = [
            *((name, real) for name in core.TRACK_NUMBERS),
            ("currents", ctypes.c_int32), ("temperatures", ctypes.c_int32), ("force", pointer),
            ("rho", pointer), ("curve", Octaves * 8), ("series", ctypes.POINTER(Series)),
        ]  # fmt: skip

    class Told(ctypes.Structure):
        _fields_ = [(name, real) for name in ("now", "ahead", "displacement", "temperature", "force")]

    return Octaves, Power, Series, Track, Told


@dataclass
class Target:
    """A controller of a series-valve card in a library of its own."""

    library: Path
    controller: ForceController
    single: bool
    kept: list[Any] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.real = ctypes.c_float if self.single else ctypes.c_double
        self.kind = np.float32 if self.single else np.float64
        self.c = ctypes.CDLL(str(self.library))
        self.c.mrd_track_step.restype = self.real
        octaves, power, series, track, self.told = _structures(self.real)
        tables = self.controller.tables
        assert tables.series is not None
        t, self.track = series(), track(**self.controller.numbers)
        self.track.temperatures, _, self.track.currents = tables.force.shape
        self.track.force, self.track.rho = self._pointer(tables.force), self._pointer(tables.rho)
        for k, o in enumerate(tables.octaves):
            self.track.curve[k] = octaves(o.offset, o.top, o.bits, len(o.cell), self._pointer(o.cell))
        t.currents = tables.series.yield_force.shape[1]
        t.yield_force, t.chain = map(self._pointer, (tables.series.yield_force, tables.series.chain))
        for name in ("thinning", "leak", "viscous"):
            p = getattr(tables.series, name)
            arrays = self._pointer(p.scale), self._pointer(p.cell)
            made = power(p.exponent, p.least, p.top, p.bits, len(p.scale), *arrays)
            setattr(t, name, made)
        for name in ("side", "fade", "corner"):
            o = getattr(tables.series, name)
            setattr(t, name, octaves(o.offset, o.top, o.bits, len(o.cell), self._pointer(o.cell)))
        self.kept.append(t)
        self.track.series = ctypes.pointer(t)

    def _pointer(self, values: FloatArray) -> Any:
        self.kept.append(np.ascontiguousarray(values, dtype=self.kind))
        return self.kept[-1].ctypes.data_as(ctypes.POINTER(self.real))

    def start(self) -> Any:
        state = (ctypes.c_char * self.c.state_size())()
        self.c.mrd_track_start(ctypes.byref(self.track), state)
        return state

    def carry(self, *columns: FloatArray) -> FloatArray:
        """Return the force [N] along displacement, velocity, acceleration, current, temperature."""
        rows = np.ascontiguousarray(np.column_stack(np.broadcast_arrays(*columns)), dtype=self.kind)
        force = np.empty(len(rows), dtype=self.kind)
        address = [ctypes.c_void_p(each.ctypes.data) for each in (rows, force)]
        self.c.carry(ctypes.byref(self.track), self.start(), len(rows), *address)
        return force.astype(np.float64)

    def run(self, rows: FloatArray) -> FloatArray:
        """Return the commands for rows of target now and ahead, displacement, temperature and force."""
        state = self.start()
        step, track = self.c.mrd_track_step, ctypes.byref(self.track)
        return np.array([step(track, state, ctypes.byref(self.told(*row))) for row in rows])


def build(gcc: str, folder: Path, *, single: bool, more: Sequence[str] = ()) -> Path:
    """Compile the controller's files and the driver, without the mathematical library."""
    source, out = folder / "driver.c", folder / ("single.so" if single else "double.so")
    source.write_text(DRIVER, encoding="utf-8")
    flags = [
        "-std=c99",
        "-O2",
        "-ffp-contract=off",
        "-fPIC",
        "-shared",
        "-nostdlib",
        "-Werror",
        *WARNINGS,
        *more,
    ]
    flags += ["-DMRD_SINGLE"] if single else []
    arguments = [gcc, *flags, "-I", str(KERNEL), str(source), "-lc", "-o", str(out)]
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out
