"""Force-tracking controllers of the kernel and their closed loops. The state of a controller is bytes."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.core.native import DOUBLE, SINGLE, doubles, ffi, lib

__all__ = ["Tracker", "follow"]

# Arguments of C for a power function (see controller.h): exponent, smallest and largest argument, log2 of the
# number of cells in an octave, factor of each octave, cells.
Power = tuple[float, float, float, int, FloatArray, FloatArray]
# Arguments of C for another function: offset, largest argument, log2 of the number of cells in an octave,
# cells.
Lookup = tuple[float, float, int, FloatArray]
# Tables of the laws ``series-valve`` and ``chain``: coefficients versus temperature and current, further
# coefficients versus temperature, power functions, and the functions tanh u and exp(-u^2).
Series = tuple[FloatArray, FloatArray, Sequence[Power], Sequence[Lookup]]
# Settings of a closed loop: damper steps per sample, delay in samples, additional delay in steps, flag. The
# flag is True if the force is measured. The other values are gain and offset of the damper force, largest
# current, and resolutions of current and measured force.
Settings = tuple[int, int, int, bool, float, float, float, float, float]

PIECES_MAX = 10_000
"""Maximum number of pieces of the temperature axis."""

COUNT_MAX = 1_000_000_000
"""Maximum of an integer in a configuration."""

CHOICE_MAX = 2
"""Largest value of each enumeration in a configuration."""

CURRENT_TOLERANCE_RATIO = 1e-9
"""Rounding tolerance of the table currents at 1/4, 1/2 and 3/4 of the largest current / largest current."""

DELAY_MAX: int = lib.MRD_TRACK_DELAY_LINE
"""Maximum number of commands in the dead time between controller and coil."""

STEPS_MAX: int = lib.MRD_TRACK_STEPS
"""Maximum number of steps of a prediction."""

_address_of = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", ctypes.pythonapi)
)


class Tracker:
    """A force-tracking controller, or a damper model, with its tables; immutable.

    Parameters
    ----------
    config : object whose nested attributes have the names of the structures in ``controller_config.h``
    rows : row (index of a coefficient) of each term; terms that do not depend on the current are first
    current : currents of the tables [A], shape (currents,)
    factor : parabola of temperature of each term in each temperature piece, shape (pieces, terms, 3)
    column : function of current of each term that depends on the current, shape (currents, columns)
    lookups : tables of functions of one positive argument, in the order of ``mrd_track``
    single : compute in single precision
    series : tables of the laws ``series-valve`` and ``chain``

    Raises
    ------
    ValueError
        If a value of configuration or tables is out of its range.
    """

    __slots__ = ("_arrays", "_build", "native")

    def __init__(
        self,
        config: object,
        rows: bytes,
        current: FloatArray,
        factor: FloatArray,
        column: FloatArray,
        lookups: Sequence[Lookup],
        *,
        single: bool = False,
        series: Series | None = None,
    ) -> None:
        self._build = SINGLE if single else DOUBLE
        self._arrays: list[Any] = []  # memory that the C structure points to
        self.native = self._build.ffi.new("mrd_track *")
        is_valid = (
            self._set_config(config)
            and self._set_terms(rows, current, factor, column)
            and self._set_lookups(self.native, lookups)
            and (series is None or self._set_series(*series))
        )
        if not is_valid or not self._build.lib.mrd_track_is_sound(self.native):
            raise ValueError("a controller's configuration or tables are out of their range")

    def start(self) -> bytes:
        """Return the state before the first sample."""
        state = self._build.ffi.new("mrd_track_state *")
        self._build.api.track_start(self.native, state)
        return bytes(self._build.ffi.buffer(state))

    def step(
        self,
        state: bytes,
        now: float,
        ahead: float | None,
        displacement: float,
        temperature: float,
        force: float | None,
    ) -> tuple[bytes, float]:
        """Return the next state and the command [A]; None and NaN mean unknown values."""
        memory, at = self._open(state)
        inputs = (now, _number(ahead), displacement, temperature, _number(force))
        command: float = self._build.api.track_step(self.native, at, [inputs])
        return bytes(memory), command

    def model(
        self,
        state: bytes,
        displacement: float | None,
        velocity: float | None,
        current: float | None,
        temperature: float | None,
    ) -> tuple[bytes, float]:
        """Return the next state and the force of the model [N]; None and NaN mean unknown values."""
        memory, at = self._open(state)
        inputs = tuple(map(_number, (displacement, velocity, current, temperature)))
        force: float = self._build.api.model_step(self.native, at, [inputs])
        return bytes(memory), force

    def run(self, state: bytes, inputs: FloatArray) -> tuple[bytes, FloatArray, NDArray[np.int64]]:
        """Compute n control steps for inputs (n, 5); return state, commands and flags."""
        return self._steps(self._build.lib.mrd_track_run, "mrd_inputs[]", state, inputs)

    def simulate(self, state: bytes, inputs: FloatArray) -> tuple[bytes, FloatArray, NDArray[np.int64]]:
        """Compute n model steps for inputs (n, 4); return state, forces and flags."""
        return self._steps(self._build.lib.mrd_model_run, "mrd_model_inputs[]", state, inputs)

    def read(self, state: bytes) -> tuple[Any, tuple[float, float, float, float]]:
        """Return a state as C structure; its yield, viscous, friction and other force [N]."""
        at = self._open(state)[1]
        parts = self._build.ffi.new("mrd_real[4]")
        self._build.api.track_parts(self.native, at, parts)
        return at, (parts[0], parts[1], parts[2], parts[3])

    def _open(self, state: bytes) -> tuple[bytearray, Any]:
        """Return a copy of a state, and the C structure that is stored in the copy."""
        memory = bytearray(state)
        if len(memory) == self._build.state_size:
            at = self._build.ffi.from_buffer(self._build.state, memory)
            is_sound = 0 <= at.newest_command < DELAY_MAX and 0 <= at.prediction_samples < STEPS_MAX
            if is_sound:  # The checked values are array indices in C. A state file can be damaged.
                return memory, at
        raise ValueError("this is not a controller's state")

    def _steps(
        self,
        call: Any,  # noqa: ANN401 - a function of cffi
        kind: str,
        state: bytes,
        inputs: FloatArray,
    ) -> tuple[bytes, FloatArray, NDArray[np.int64]]:
        build = self._build
        memory, at = self._open(state)
        rows, out, flags = (
            self._rounded(inputs),
            np.empty(len(inputs), build.real),
            np.empty(len(inputs), "i4"),
        )
        pointers = [build.ffi.from_buffer(*each) for each in (("mrd_real[]", out), ("int32_t[]", flags))]
        call(build.api, self.native, at, len(rows), build.ffi.from_buffer(kind, rows), *pointers)
        return bytes(memory), out.astype(np.float64), flags.astype(np.int64)

    def _rounded(self, values: FloatArray) -> NDArray[np.floating[Any]]:
        """Return values in the controller's precision; too large values become infinite."""
        with np.errstate(over="ignore"):
            return np.ascontiguousarray(values, dtype=self._build.real)

    def _pointer(self, values: FloatArray) -> Any:  # noqa: ANN401 - a pointer of cffi
        self._arrays.append(self._build.ffi.from_buffer("mrd_real[]", self._rounded(values)))
        return self._arrays[-1]

    def _set_config(self, config: object) -> bool:
        parts = self._build.ffi.typeof("mrd_track").fields
        return all(
            _set_members(getattr(self.native, name), part.type, getattr(config, name))
            for name, part in parts
            if part.type.cname.startswith("mrd_config_")
        )

    def _set_terms(self, rows: bytes, current: FloatArray, factor: FloatArray, column: FloatArray) -> bool:
        t, (pieces, terms, _), (currents, columns) = self.native, factor.shape, column.shape
        levels = terms - columns
        quarters = current[-1] * np.linspace(0.0, 1.0, lib.MRD_TRACK_BANK)
        nearest = np.abs(current[:, None] - quarters).argmin(axis=0)
        distance = np.abs(current[nearest] - quarters).max()
        if not (
            factor.shape == (pieces, len(rows), 3)
            and pieces <= PIECES_MAX
            and 0 <= levels <= terms <= lib.MRD_TRACK_TERMS
            and all(row < lib.MRD_ROW_YIELD for row in rows[:levels])
            and all(row < lib.MRD_TABLE_ROWS for row in rows[levels:])
            and rows[levels:] == bytes(sorted(rows[levels:]))
            and len(current) == currents <= lib.MRD_TRACK_CURRENTS
            and current[0] == 0.0
            and (np.diff(current) > 0.0).all()
            and distance <= CURRENT_TOLERANCE_RATIO * current[-1]
            and self._build.real(current[-1]) == t.axes.largest
        ):
            return False
        t.pieces, t.currents, t.levels, t.row, t.quarter = (
            pieces,
            currents,
            levels,
            list(rows),
            nearest.tolist(),
        )
        ends = ("MRD_ROW_YIELD", "MRD_ROW_SECOND", "MRD_ROW_RHO", "MRD_ROW_SECOND_RHO", "MRD_TABLE_ROWS")
        t.begin = [0, *(sum(row < getattr(lib, end) for row in rows[levels:]) for end in ends)]
        t.current, t.factor, t.column = map(self._pointer, (current, factor, column))
        return True

    def _set_lookups(self, struct: Any, lookups: Sequence[Lookup]) -> bool:  # noqa: ANN401 - a structure
        names = _members(self._build.ffi.typeof(struct).item, "mrd_lookup")
        for name, (offset, top, bits, cell) in zip(names, lookups, strict=True):
            setattr(struct, name, (offset, top, bits, cell.size // 4, self._pointer(cell)))
        return True

    def _set_series(
        self, planes: FloatArray, chain: FloatArray, powers: Sequence[Power], lookups: Sequence[Lookup]
    ) -> bool:
        t, series = self.native, self._build.ffi.new("mrd_series *")
        sheets = t.pieces + 1 if t.axes.warmest > t.axes.coldest else 1
        is_chain = t.law.chain
        if chain.shape != (sheets, lib.MRD_CHAIN_ALL if is_chain else lib.MRD_CHAIN):
            return False
        if planes.shape != (sheets, planes.shape[1], lib.MRD_PLANES if is_chain else 1):
            return False
        names = _members(self._build.ffi.typeof(series).item, "mrd_power")
        for name, (exponent, least, top, bits, scale, cell) in zip(names, powers, strict=True):
            if cell.size != 4 << bits:
                return False
            pointers = self._pointer(scale), self._pointer(cell)
            setattr(series, name, (exponent, least, top, bits, scale.size, *pointers))
        series.currents, t.series = planes.shape[1], series
        setattr(series, "yield", self._pointer(planes))
        series.chain = self._pointer(chain)
        self._arrays.append(series)
        return self._set_lookups(series, lookups)


def follow(
    plant: object,
    displacement: FloatArray,
    velocity: FloatArray,
    loops: Sequence[tuple[Tracker, bytes, Settings, FloatArray, FloatArray, FloatArray, FloatArray]],
) -> bool:
    """Simulate closed loops of controllers and dampers on one motion.

    Return False if a command is not finite, or if an input of a damper is invalid.

    Parameters
    ----------
    plant : capsule with one damper per loop (``binding/loop_plant.h``); the call changes the states of the
        dampers
    displacement, velocity : motion at every plant step [m], [m/s], shape (steps,)
    loops : for each loop a controller in double precision, its state, its settings, and four arrays: sensor
        readings, shape (samples, 5); 1 where the force sensor is frozen, else 0, shape (samples,); output
        force [N], shape (steps,); output commands, shape (delay + 1 + samples,)

    Raises
    ------
    ValueError
        If the lengths of the arrays do not agree.
    """
    native = ffi.cast("loop_plant *", _address_of(plant, b"mrdamper.loop_plant"))
    if not 0 < len(loops) == native.count <= lib.MRD_LOOPS_MAX:
        raise ValueError("expected a loop for each damper")
    steps, (every, _, apart) = displacement.size, loops[0][2][:3]
    members = ffi.new("mrd_loop[]", len(loops))
    memory = []  # keeps states and arrays alive during the call
    for k, (tracker, state, settings, sensed, frozen, force, given) in enumerate(loops):
        late, samples = settings[1], frozen.size
        sizes = sensed.size, force.size, given.size, velocity.size
        is_valid = every >= 1 and late >= 0 and 0 <= apart < every and steps and samples == -(-steps // every)
        if (
            not is_valid
            or sizes != (5 * samples, steps, late + 1 + samples, steps)
            or settings[:3:2] != (every, apart)
        ):
            raise ValueError("lengths of a closed loop do not fit its samples, or its timing differs")
        at = tracker._open(state)[1]  # noqa: SLF001 - the same module
        readings = ffi.cast("mrd_inputs *", doubles(sensed, "sensed"))
        arrays = (
            doubles(frozen, "frozen"),
            doubles(force, "force", write=True),
            doubles(given, "given", write=True),
        )
        members[k] = (tracker.native, at, late, *settings[3:], readings, *arrays)
        memory += [at, *arrays]
    motion = doubles(displacement, "displacement"), doubles(velocity, "velocity")
    return bool(lib.mrd_follow(DOUBLE.api, native, steps, *motion, every, apart, len(loops), members))


def _set_members(struct: Any, kind: Any, values: object) -> bool:  # noqa: ANN401 - types of cffi
    """Set the members of a C structure and of its inner structures. Return False if an integer is invalid."""
    for name, field in kind.fields:
        value, cname = getattr(values, name), field.type.cname
        if field.type.kind == "struct":
            if not _set_members(getattr(struct, name), field.type, value):
                return False
            continue
        if cname not in ("float", "double"):
            value = int(value)
            largest = {"int32_t": COUNT_MAX, "int": COUNT_MAX, "_Bool": 1}.get(cname, CHOICE_MAX)
            if not 0 <= value <= largest:
                return False
        setattr(struct, name, value)
    return True


def _members(struct: Any, kind: str) -> list[str]:  # noqa: ANN401 - a type of cffi
    """Return the names of the members of a C structure that have a given type, in their order."""
    return [name for name, field in struct.fields if field.type.cname == kind]


def _number(value: float | None) -> float:
    return nan if value is None else value
