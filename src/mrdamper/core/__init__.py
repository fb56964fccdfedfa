"""Python interface of the compiled kernel, which checks NumPy shapes and types.

The arithmetic is in ``kernel/`` (C99, compiled once per instruction set, with bitwise equal results).
cffi calls the kernel and releases the GIL during a call. ``models.laws`` defines the number of each law and
the order of its coefficients.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.core.native import DOUBLE, doubles, ffi, level, levels, lib, use_level
from mrdamper.core.tracker import Tracker, follow
from mrdamper.excitation import Trajectory

__all__ = [
    "LONGEST_STEP",
    "MOST_DIRECTIONS",
    "MOTION_NUMBERS",
    "STATE_NUMBERS",
    "Record",
    "Tracker",
    "Workspace",
    "carry",
    "causal",
    "curve",
    "first_order_lag",
    "follow",
    "forces",
    "gram",
    "gram_sums",
    "level",
    "levels",
    "open_batch",
    "open_record",
    "run",
    "squared_errors",
    "turning_points",
    "use_level",
]


LONGEST_STEP = 2.5e-3
"""Longest integration step [s] of the implicit laws. A longer sample interval is divided into steps."""

STEPS_PER_SAMPLE_MAX = 1e6
"""Maximum number of integration steps of the implicit laws per sample."""

MOST_DIRECTIONS: int = lib.MRD_DIRECTIONS
"""Maximum number of tangent columns in one call of the kernel."""

MOTION_NUMBERS: int = ffi.sizeof("mrd_motion") // ffi.sizeof("double")
"""Number of values in the state of a motion that is passed from one batch to the next."""

STATE_NUMBERS: int = ffi.sizeof("mrd_state") // ffi.sizeof("double")
"""Number of values in the state of a law that is passed from one batch to the next."""

_MOTION_PATH: int = ffi.offsetof("mrd_motion", "path") // ffi.sizeof("double")


class Record:
    """Motion and turning points of a run or of a batch; arrays must not change later.

    Parameters
    ----------
    step : sample interval [s]
    displacement, velocity, acceleration : [m], [m/s], [m/s^2], shape (n,)
    dead_band : reversals up to this size are ignored [m]
    longest_step : longest integration step of the laws ``series-valve`` and ``chain`` [s]
    batch : arguments ``patience``, ``last`` and ``motion`` of ``open_batch``; None for a whole run
    """

    __slots__ = ("_arrays", "native")

    def __init__(
        self,
        step: float,
        displacement: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        dead_band: float,
        longest_step: float,
        *,
        batch: tuple[int, bool, FloatArray] | None = None,
    ) -> None:
        if not (
            step > 0.0
            and dead_band >= 0.0
            and longest_step > 0.0
            and step / longest_step <= STEPS_PER_SAMPLE_MAX
        ):
            raise ValueError("step and longest_step must be positive, dead_band not negative")
        n = displacement.size
        if not 0 < n == velocity.size == acceleration.size:
            raise ValueError("displacement, velocity and acceleration must have one, nonzero length")
        api = DOUBLE.api
        self.native = ffi.gc(ffi.new("mrd_record *"), api.record_close)
        self._arrays = (
            doubles(displacement, "displacement"),
            doubles(velocity, "velocity"),
            doubles(acceleration, "acceleration"),
        )
        arguments = (self.native, n, step, *self._arrays, dead_band, longest_step)
        if batch is None:
            status = api.record_open(*arguments)
        else:
            patience, last, motion = batch
            status = api.batch_open(*arguments, patience, last, _state(motion, "mrd_motion *", "motion"))
        _check(status)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.native.n  # type: ignore[no-any-return]

    @property
    def behind(self) -> int:
        """Number of samples at the beginning (0 or 1) that belong to the previous batch."""
        return self.native.behind  # type: ignore[no-any-return]

    @property
    def substeps(self) -> int:
        """Number of integration steps per sample for ``series-valve`` and ``chain``."""
        return self.native.substeps  # type: ignore[no-any-return]

    @property
    def pieces(self) -> tuple[tuple[int, float, int], ...]:
        """First sample, displacement at the start [m] and direction (1 or -1) of each monotone piece."""
        r = self.native
        sides = (1 if side > 0.0 else -1 for side in ffi.unpack(r.side, r.pieces))
        return tuple(zip(ffi.unpack(r.first, r.pieces), ffi.unpack(r.turn, r.pieces), sides, strict=True))


class Workspace:
    """Memory for the last hysteresis curve (see ``curve``); not for several threads."""

    __slots__ = ("native",)

    def __init__(self) -> None:
        native = DOUBLE.api.workspace_open()
        if not native:
            raise MemoryError
        self.native = ffi.gc(native, DOUBLE.api.workspace_close)


def _check(status: int) -> None:
    if status == lib.MRD_OK:
        return
    if status == lib.MRD_NO_MEMORY:
        raise MemoryError
    if status == lib.MRD_SHAPE_VARIES:
        raise ValueError("kappa and n must be constant over a run whose command varies")
    raise ValueError("expected -1 <= kappa <= 1, 0.2 <= n <= 20 and rho not negative")


def _state(numbers: FloatArray, kind: str, name: str) -> Any:  # noqa: ANN401 - a pointer of cffi
    """Return a C pointer to an array that stores a structure of doubles."""
    expected = ffi.sizeof(ffi.typeof(kind).item) // ffi.sizeof("double")
    if numbers.size != expected:
        raise ValueError(f"{name} has {numbers.size} numbers; expected {expected}")
    return ffi.cast(kind, doubles(numbers, name, write=True))


@cache
def _coefficient_count(law: int) -> int:
    count: int = DOUBLE.api.coefficient_count(law)
    if not count:
        raise ValueError("the kernel has no such law")
    return count


def _model(law: int, coefficients: FloatArray, samples: int) -> list[Any]:
    count = _coefficient_count(law)
    if coefficients.size not in (count, count * samples):
        raise ValueError(
            f"law {law} takes {count} coefficients (or {count} rows of {samples} samples), "
            f"got {coefficients.size} numbers"
        )
    return [(law, doubles(coefficients, "coefficients"), 0 if coefficients.size == count else samples)]


def _places(law: int, directions: Sequence[int]) -> list[int]:
    places, count = [int(place) for place in directions], _coefficient_count(law)
    if len(places) > MOST_DIRECTIONS:
        raise ValueError(f"at most {MOST_DIRECTIONS} directions, got {len(places)}")
    for place in places:
        if not 0 <= place < count:
            raise ValueError(f"the law has no coefficient number {place}")
    return places


def _runs(
    records: Sequence[Record], measured: Sequence[FloatArray], starts: Sequence[int]
) -> tuple[int, list[Any], list[Any], list[int]]:
    if not 0 < len(records) == len(measured) == len(starts):
        raise ValueError("records, measured and starts must have one, nonzero length")
    for record, force, start in zip(records, measured, starts, strict=True):
        if force.size != record.samples or not 0 <= start <= record.samples:
            raise ValueError("measured force does not have its record's length, or starts beyond it")
    forces_N = [doubles(force, "measured force") for force in measured]
    return len(records), [record.native for record in records], forces_N, [int(start) for start in starts]


def open_record(trajectory: Trajectory, *, longest_step: float = LONGEST_STEP) -> Record:
    """Return the motion of a trajectory with its turning points, for the kernel.

    The record uses the arrays of the trajectory without a copy. ``longest_step`` [s] limits the integration
    step of ``series-valve`` and ``chain``.
    """
    return Record(
        trajectory.step,
        trajectory.displacement,
        trajectory.velocity,
        trajectory.acceleration,
        trajectory.dead_band,
        longest_step,
    )


def run(
    law: int,
    record: Record,
    coefficients: FloatArray,
    directions: Sequence[int] = (),
    seeds: FloatArray | None = None,
    *,
    columns: FloatArray | None = None,
    workspace: Workspace | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the force [N], shape (n,), and its derivatives (tangents), shape (d, n).

    Parameters
    ----------
    coefficients : in the law's order and units, shape (m,) if constant over the run, otherwise (m, n)
    directions : indices of the d coefficients with respect to which the force is differentiated
    seeds : factors on the derivatives, shape (d,) or (d, n), for the chain rule; None: 1
    columns : memory for the derivatives, shape (d, n)
    workspace : stores the tabulated hysteresis curve for the next call with the same kappa and n

    Raises
    ------
    ValueError
        If shapes are wrong, the hysteresis law is unknown, or kappa or n vary during the run.
    """
    samples, places = record.samples, _places(law, directions)
    count, model = len(places), _model(law, coefficients, record.native.known)
    force = np.empty(samples)
    if columns is None:
        columns = np.empty((count, samples))
    if columns.size != count * samples or (seeds is not None and seeds.size not in (count, count * samples)):
        raise ValueError("columns or seeds do not have the record's length")
    along: list[tuple[int, Any, int]] = [(place, ffi.NULL, 0) for place in places]
    if seeds is not None:
        rates, stride = doubles(seeds, "seeds"), int(seeds.size == count * samples and samples != 1)
        step = samples if stride else 1
        along = [(place, rates + d * step, stride) for d, place in enumerate(places)]
    _check(
        DOUBLE.api.run(
            model,
            record.native,
            count,
            along,
            doubles(force, "force"),
            doubles(columns, "columns", write=True) if count else ffi.NULL,
            workspace.native if workspace else ffi.NULL,
        )
    )
    return force, columns


def open_batch(
    step: float,
    kinematics: tuple[FloatArray, FloatArray, FloatArray],
    motion: FloatArray,
    *,
    dead_band: float = 0.0,
    longest_step: float = LONGEST_STEP,
    patience: int,
    last: bool = False,
) -> Record:
    """Return the record of those samples in a batch that later samples cannot affect.

    A run is processed in batches. The motion is divided into pieces at its turning points. A sample is
    *settled* if later samples cannot change the piece that contains the sample. Samples that are not settled
    must be passed again with the next batch.

    Parameters
    ----------
    kinematics : displacement [m], velocity [m/s] and acceleration [m/s^2], shape (n,) each. They begin with
        the last settled sample of the previous batch (the first batch has no such sample, and ``behind`` is
        0). The samples that are not settled are next, then the new samples.
    motion : state of the motion, shape (MOTION_NUMBERS,), zero before the first batch; updated in place
    patience : maximum number of samples after a turning point that are not settled
    last : True for the last batch, which settles all samples
    """
    if patience < 1:
        raise ValueError("patience must be 1 sample or more")
    if not motion[_MOTION_PATH] >= 0.0:  # A state from a damaged file would give an invalid array index in C.
        raise ValueError("motion: its path is not a travel since a turning point")
    return Record(step, *kinematics, dead_band, longest_step, batch=(patience, last, motion))


def carry(
    law: int, batch: Record, coefficients: FloatArray, state: FloatArray, workspace: Workspace
) -> FloatArray:
    """Return the force [N] of a batch, shape (n,).

    If ``batch.behind`` is 1, the first sample belongs to the previous batch. Its force is then undefined in
    the result.

    Parameters
    ----------
    coefficients : shape (m,), or (m, all samples of the batch)
    state : state of the law, shape (STATE_NUMBERS,), zero before the first batch; updated in place

    Raises
    ------
    ValueError
        If shapes are wrong, the hysteresis law is unknown, kappa or n vary, or the state is not from the
        previous batch.
    """
    native, force = batch.native, np.zeros(batch.samples)
    model, at = _model(law, coefficients, native.known), _state(state, "mrd_state *", "state")
    if native.n > native.behind and (at.begun != 0.0) != bool(native.behind):
        raise ValueError("the state is not that of the batch before")
    _check(DOUBLE.api.carry(model, native, at, doubles(force, "force"), workspace.native))
    return force


def causal(law: int, record: Record, coefficients: FloatArray) -> FloatArray:
    """Return the force [N], shape (n,), computed sample by sample as on a real-time target."""
    force = np.empty(record.samples)
    model = _model(law, coefficients, record.samples)
    _check(DOUBLE.api.causal(model, record.native, doubles(force, "force")))
    return force


def gram(columns: FloatArray, start: int = 0) -> FloatArray:
    """Return the Gram matrix of the rows of ``columns``, shape (rows, rows).

    An element is the inner product of two rows. Samples before ``start`` are ignored.
    """
    rows, samples = columns.shape
    if not 0 <= start <= samples:
        raise ValueError("start must be one of the samples")
    out = np.empty((rows, rows))
    _check(DOUBLE.api.gram(rows, samples, doubles(columns, "columns"), start, doubles(out, "out")))
    return out


def gram_sums(
    law: int,
    records: Sequence[Record],
    measured: Sequence[FloatArray],
    starts: Sequence[int],
    coefficients: FloatArray,
    places: Sequence[int],
    *,
    threads: int = 1,
) -> FloatArray:
    """Return the sums that a linear least-squares fit needs, as Gram matrices.

    A candidate is one set of coefficients. The result has the shape (candidates, runs, k, k). Its elements
    are the inner products of k signals. These signals are the derivatives of the force with respect to the
    coefficients with the indices ``places``, then the residual (measured minus computed force).

    Parameters
    ----------
    coefficients : constant over each run, shape (candidates, runs, m)
    starts : first scored sample of each run
    threads : number of threads; the result does not depend on it
    """
    rows = len(places) + 1
    out = np.empty((*coefficients.shape[:2], rows, rows))
    work = (law, _runs(records, measured, starts), coefficients, _places(law, places), out)
    if threads == 1:
        _sum_products(*work)
        return out
    executor = _executor(os.getpid(), threads)
    others = [executor.submit(_sum_products, *work, part, threads) for part in range(1, threads)]
    _sum_products(*work, 0, threads)
    for each in others:
        each.result()
    return out


@cache
def _executor(process: int, threads: int) -> ThreadPoolExecutor:
    """Return the threads of a process for parts of a computation."""
    return ThreadPoolExecutor(threads - 1)


def _sum_products(
    law: int,
    runs: tuple[int, list[Any], list[Any], list[int]],
    coefficients: FloatArray,
    places: list[int],
    out: FloatArray,
    part: int = 0,
    parts: int = 1,
    residuals: FloatArray | None = None,
) -> None:
    """Compute the Gram matrices into ``out``, and the residuals into ``residuals`` unless it is None.

    The residuals have the shape (candidates, samples of all runs). The work is divided into ``parts`` parts
    that can run in parallel threads. A call does one of them.
    """
    left = ffi.NULL if residuals is None else doubles(residuals, "residuals")
    _check(
        DOUBLE.api.gram_sums(
            law,
            *runs,
            *_candidate_count_and_pointer(law, coefficients, runs[0]),
            len(places),
            places,
            part,
            parts,
            doubles(out, "out"),
            left,
        )
    )


def _candidate_count_and_pointer(law: int, coefficients: FloatArray, runs: int) -> tuple[int, Any]:
    count = _coefficient_count(law)
    if coefficients.ndim != 3 or coefficients.shape[1:] != (runs, count):
        raise ValueError(
            f"coefficients must have shape (candidates, {runs}, {count}), not {coefficients.shape}"
        )
    return len(coefficients), doubles(coefficients, "coefficients")


def forces(law: int, records: Sequence[Record], coefficients: FloatArray) -> list[FloatArray]:
    """Return the force [N] along every record, shape (n,) each.

    For ``series-valve`` and ``chain``, several records are computed in parallel.

    Parameters
    ----------
    coefficients : constant over each record, shape (records, m)
    """
    ends = np.cumsum([record.samples for record in records])
    left, sums = np.zeros(int(ends[-1])), np.empty(len(records))
    nothing = np.split(np.zeros(len(left)), ends[:-1])
    runs = _runs(records, nothing, [0] * len(records))
    _sum_products(law, runs, coefficients[None], [], sums, residuals=left)
    return np.split(-left, ends[:-1])


def squared_errors(
    law: int,
    records: Sequence[Record],
    measured: Sequence[FloatArray],
    starts: Sequence[int],
    coefficients: FloatArray,
) -> FloatArray:
    """Return the sum of squared errors [N^2] of every candidate on every run, shape (candidates, runs).

    A candidate is one set of coefficients.

    Parameters
    ----------
    coefficients : constant over each run, shape (candidates, runs, m)
    starts : first scored sample of each run
    """
    errors = np.empty(coefficients.shape[:2])
    runs = _runs(records, measured, starts)
    candidates = _candidate_count_and_pointer(law, coefficients, runs[0])
    _check(DOUBLE.api.squared_errors(law, *runs, *candidates, doubles(errors, "errors")))
    return errors


def first_order_lag(
    command: FloatArray,
    step: float,
    rise: float,
    fall: float | None = None,
    *,
    wheel: float = 0.0,
    saturation: float = 0.0,
    before: tuple[float, float] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return a command after a first-order lag, and the derivative with respect to the time constant.

    The result is exact for a command that is linear between samples. ``before`` contains the output and its
    derivative at the first sample; None: equilibrium.

    If ``fall`` is given, the time constant is ``rise`` [s] while the absolute input exceeds the output,
    otherwise ``fall`` [s]. The output falls no faster than with the free-wheeling time constant ``wheel`` [s]
    (0: no free-wheeling). The lag acts on the flux ``I / (1 + I / saturation)`` of the current ``I``, or on
    the current if ``saturation`` [A] is 0.
    """
    applied, by_lag = np.empty_like(command), np.empty_like(command)
    falls = rise if fall is None else fall
    arrays = doubles(command, "command"), doubles(applied, "applied"), doubles(by_lag, "by_lag")
    DOUBLE.api.lag(command.size, step, rise, falls, wheel, saturation, *arrays, before or ffi.NULL)
    return applied, by_lag


def curve(kappa: float, n: float, tau: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the Bouc-Wen curve Y(tau), dY/dtau, dY/dkappa and dY/dn from the kernel's tables.

    Y is the hysteresis variable between two reversals: dY/dtau = 1 - Y^n for Y >= 0 and 1 - kappa |Y|^n for Y
    < 0, with Y(0) = 0. tau is the travel from the point with Y = 0, divided by the yield displacement.
    """
    if not (-1.0 <= kappa <= 1.0 and 0.2 <= n <= 20.0):
        raise ValueError("the curve is tabulated for -1 <= kappa <= 1 and 0.2 <= n <= 20")
    out = [np.empty_like(tau) for _ in range(4)]
    DOUBLE.api.curve(kappa, n, tau.size, doubles(tau, "tau"), *(doubles(each, "curve") for each in out))
    return out[0], out[1], out[2], out[3]


def turning_points(displacement: FloatArray, dead_band: float) -> NDArray[np.intp]:
    """Return the samples at which a motion turns by more than the dead band [m], shape (m,).

    A turning point is a maximum or minimum after which the displacement returns by more than the dead band.
    The first of several equal values counts. The ends of the motion do not count. Maxima and minima
    alternate.
    """
    x, at = np.ascontiguousarray(displacement), np.empty(len(displacement))
    arrays = doubles(x, "displacement"), doubles(at, "turning points")
    count = DOUBLE.api.turns(ffi.new("mrd_turns *"), x.size, arrays[0], dead_band, arrays[1])
    return at[:count].astype(np.intp)
