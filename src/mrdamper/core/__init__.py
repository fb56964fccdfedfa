"""The compiled kernel behind NumPy: shapes and types are checked here, the arithmetic is in C.

The arithmetic is ``kernel/`` (C99, compiled once per instruction set with equal bits).
cffi calls it and releases the GIL during a call. Law numbers and the order of their coefficients are those of
``models.laws``.
"""

from __future__ import annotations

from collections.abc import Sequence
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
"""Longest step [s] of the implicit laws; a longer sample interval is divided."""

STEPS_PER_SAMPLE_MAX = 1e6
"""Maximum number of steps of the implicit laws in a sample."""

MOST_DIRECTIONS: int = lib.MRD_DIRECTIONS
"""Most tangent columns of one call."""

MOTION_NUMBERS: int = ffi.sizeof("mrd_motion") // ffi.sizeof("double")
"""Numbers in the state of a motion between two batches."""

STATE_NUMBERS: int = ffi.sizeof("mrd_state") // ffi.sizeof("double")
"""Numbers in the state of a law between two batches."""

_MOTION_PATH: int = ffi.offsetof("mrd_motion", "path") // ffi.sizeof("double")


class Record:
    """The kinematics of a run or a batch with its turning points. The arrays must not change.

    Parameters
    ----------
    step : sample interval [s]
    displacement, velocity, acceleration : [m], [m/s], [m/s^2], shape (n,)
    dead_band : reversals up to this size are ignored [m]
    longest_step : of the implicit laws [s]
    batch : patience, whether the run ends here, and the motion (see ``open_batch``); None: a whole run
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
        """Number of samples of a batch that were computed with the batch before: 0 or 1."""
        return self.native.behind  # type: ignore[no-any-return]

    @property
    def substeps(self) -> int:
        """Steps of the implicit laws per sample."""
        return self.native.substeps  # type: ignore[no-any-return]

    @property
    def pieces(self) -> tuple[tuple[int, float, int], ...]:
        """Monotone pieces: first sample, displacement at the start [m], direction (1 or -1)."""
        r = self.native
        sides = (1 if side > 0.0 else -1 for side in ffi.unpack(r.side, r.pieces))
        return tuple(zip(ffi.unpack(r.first, r.pieces), ffi.unpack(r.turn, r.pieces), sides, strict=True))


class Workspace:
    """The universal curve that was tabulated last, for one thread at a time."""

    __slots__ = ("native",)

    def __init__(self) -> None:
        native = DOUBLE.api.workspace_open()
        if not native:
            raise MemoryError
        self.native = ffi.gc(native, DOUBLE.api.workspace_close)


def _check(status: int) -> None:
    """Raise the exception of a status of the kernel."""
    if status == lib.MRD_OK:
        return
    if status == lib.MRD_NO_MEMORY:
        raise MemoryError
    if status == lib.MRD_SHAPE_VARIES:
        raise ValueError("kappa and n must be constant over a run whose command varies")
    raise ValueError("expected -1 <= kappa <= 1, 0.2 <= n <= 20 and rho not negative")


def _state(numbers: FloatArray, kind: str, name: str) -> Any:  # noqa: ANN401 - a pointer of cffi
    """Return a pointer to a structure of doubles in an array of its size."""
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
    """Return a law with its coefficients, of shape (m,) or (m, samples), as an argument ``mrd_model *``."""
    count = _coefficient_count(law)
    if coefficients.size not in (count, count * samples):
        raise ValueError(
            f"law {law} takes {count} coefficients (or {count} rows of {samples} samples), "
            f"got {coefficients.size} numbers"
        )
    return [(law, doubles(coefficients, "coefficients"), 0 if coefficients.size == count else samples)]


def _places(law: int, directions: Sequence[int]) -> list[int]:
    """Return coefficients of a law, by their places in it, after a check."""
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
    """Return runs as arguments of the kernel: their number, records, forces and first samples."""
    if not 0 < len(records) == len(measured) == len(starts):
        raise ValueError("records, measured and starts must have one, nonzero length")
    for record, force, start in zip(records, measured, starts, strict=True):
        if force.size != record.samples or not 0 <= start <= record.samples:
            raise ValueError("measured force does not have its record's length, or starts beyond it")
    forces_N = [doubles(force, "measured force") for force in measured]
    return len(records), [record.native for record in records], forces_N, [int(start) for start in starts]


def open_record(trajectory: Trajectory, *, longest_step: float = LONGEST_STEP) -> Record:
    """Return the kernel's view of a trajectory, with its turning points; it holds on to the arrays.

    The implicit laws take no step longer than ``longest_step`` [s].
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
    """Return the force [N], shape (n,), and its tangent columns, shape (len(directions), n).

    Parameters
    ----------
    coefficients : in the law's order and units, shape (m,) when constant over the run, else (m, n)
    directions : coefficients to differentiate by, by their place in the law
    seeds : how fast each direction's coefficient moves, shape (d,) or (d, n); None: unit rate
    columns : where to put the tangent columns, shape (len(directions), n)
    workspace : keeps the curve of a call for the next with the same kappa and n; for one thread at a time

    Raises
    ------
    ValueError
        Wrong shapes, an unknown law, or kappa or n that vary over the run.
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
    """Return the settled samples of a batch of a run as a record; later batches settle the others.

    Parameters
    ----------
    kinematics : displacement [m], velocity [m/s] and acceleration [m/s^2], shape (n,) each: the last
        settled sample of the batch before (``behind`` is 1, but for the first), those not settled, new ones
    motion : state of the motion, shape (MOTION_NUMBERS,), zero before the first batch; updated
    patience : maximum number of samples after an extreme that can remain unsettled
    last : True for the last batch, which settles all samples
    """
    if patience < 1:
        raise ValueError("patience must be 1 sample or more")
    if not motion[_MOTION_PATH] >= 0.0:  # A motion may come from a file, and its path becomes an index.
        raise ValueError("motion: its path is not a travel since a turning point")
    return Record(step, *kinematics, dead_band, longest_step, batch=(patience, last, motion))


def carry(
    law: int, batch: Record, coefficients: FloatArray, state: FloatArray, workspace: Workspace
) -> FloatArray:
    """Return the force [N] of a batch, shape (n,); the value of the sample ``behind`` is undefined.

    Parameters
    ----------
    coefficients : shape (m,), or (m, all samples of the batch)
    state : state of the law, shape (STATE_NUMBERS,), zero before the first batch; updated

    Raises
    ------
    ValueError
        If shapes are wrong, the law is unknown, kappa or n vary, or the state belongs to another batch.
    """
    native, force = batch.native, np.zeros(batch.samples)
    model, at = _model(law, coefficients, native.known), _state(state, "mrd_state *", "state")
    if native.n > native.behind and (at.begun != 0.0) != bool(native.behind):
        raise ValueError("the state is not that of the batch before")
    _check(DOUBLE.api.carry(model, native, at, doubles(force, "force"), workspace.native))
    return force


def causal(law: int, record: Record, coefficients: FloatArray) -> FloatArray:
    """Return the force [N] of the per-sample map, as a controller on the target computes it."""
    force = np.empty(record.samples)
    model = _model(law, coefficients, record.samples)
    _check(DOUBLE.api.causal(model, record.native, doubles(force, "force")))
    return force


def gram(columns: FloatArray, start: int = 0) -> FloatArray:
    """Return the sums of products of the rows of ``columns`` from sample ``start`` on, shape (rows, rows)."""
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
) -> FloatArray:
    """Return the sums of products of every candidate's tangents and residual on every run.

    Rows are the tangents by the coefficients at ``places``, and measured less computed force:
    shape (candidates, runs, rows, rows).

    Parameters
    ----------
    coefficients : constant over each run, shape (candidates, runs, m)
    starts : first sample of each run that counts
    """
    rows = len(places) + 1
    out = np.empty((*coefficients.shape[:2], rows, rows))
    _sum_products(law, _runs(records, measured, starts), coefficients, _places(law, places), out)
    return out


def _sum_products(
    law: int,
    runs: tuple[int, list[Any], list[Any], list[int]],
    coefficients: FloatArray,
    places: list[int],
    out: FloatArray,
    residuals: FloatArray | None = None,
) -> None:
    """Fill the sums, and the residuals of shape (candidates, samples of all runs) unless None."""
    left = ffi.NULL if residuals is None else doubles(residuals, "residuals")
    _check(
        DOUBLE.api.gram_sums(
            law,
            *runs,
            *_candidates(law, coefficients, runs[0]),
            len(places),
            places,
            doubles(out, "out"),
            left,
        )
    )


def _candidates(law: int, coefficients: FloatArray, runs: int) -> tuple[int, Any]:
    """Return the number of candidates and a pointer to coefficients of shape (candidates, runs, m)."""
    count = _coefficient_count(law)
    if coefficients.ndim != 3 or coefficients.shape[1:] != (runs, count):
        raise ValueError(
            f"coefficients must have shape (candidates, {runs}, {count}), not {coefficients.shape}"
        )
    return len(coefficients), doubles(coefficients, "coefficients")


def forces(law: int, records: Sequence[Record], coefficients: FloatArray) -> list[FloatArray]:
    """Return the force [N] along every record, shape (n,) each, several at once where the law is stepped.

    Parameters
    ----------
    coefficients : constant over each record, shape (records, m)
    """
    ends = np.cumsum([record.samples for record in records])
    left, sums = np.zeros(int(ends[-1])), np.empty(len(records))
    nothing = np.split(np.zeros(len(left)), ends[:-1])
    runs = _runs(records, nothing, [0] * len(records))
    _sum_products(law, runs, coefficients[None], [], sums, left)
    return np.split(-left, ends[:-1])


def squared_errors(
    law: int,
    records: Sequence[Record],
    measured: Sequence[FloatArray],
    starts: Sequence[int],
    coefficients: FloatArray,
) -> FloatArray:
    """Return the sum of squared errors [N^2] of every candidate on every run, shape (candidates, runs).

    Parameters
    ----------
    coefficients : constant over each run, shape (candidates, runs, m)
    starts : first scored sample of each run
    """
    errors = np.empty(coefficients.shape[:2])
    runs = _runs(records, measured, starts)
    candidates = _candidates(law, coefficients, runs[0])
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
    """Return a command after a first-order lag [s], and its derivative by the lag.

    Exact for a command that is linear between samples; it starts settled, or from output and derivative at
    the first sample (``before``). With ``fall`` the lag is ``rise`` only while the absolute input exceeds
    the output. The output then falls at most with the free-wheeling time constant ``wheel`` (0: no
    free-wheeling). With ``saturation`` input and output are the flux ``I / (1 + I / saturation)`` of a
    current ``I`` (0: the current).
    """
    applied, by_lag = np.empty_like(command), np.empty_like(command)
    falls = rise if fall is None else fall
    arrays = doubles(command, "command"), doubles(applied, "applied"), doubles(by_lag, "by_lag")
    DOUBLE.api.lag(command.size, step, rise, falls, wheel, saturation, *arrays, before or ffi.NULL)
    return applied, by_lag


def curve(kappa: float, n: float, tau: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the universal curve Y(tau), dY/dtau, dY/dkappa and dY/dn as the kernel tabulates them."""
    if not (-1.0 <= kappa <= 1.0 and 0.2 <= n <= 20.0):
        raise ValueError("the curve is tabulated for -1 <= kappa <= 1 and 0.2 <= n <= 20")
    out = [np.empty_like(tau) for _ in range(4)]
    DOUBLE.api.curve(kappa, n, tau.size, doubles(tau, "tau"), *(doubles(each, "curve") for each in out))
    return out[0], out[1], out[2], out[3]


def turning_points(displacement: FloatArray, dead_band: float) -> NDArray[np.intp]:
    """Return the samples at which a motion turns by more than the dead band [m], shape (m,).

    A turning point is an extreme after which the displacement returns by more than the dead band. The first
    of equal extremes counts; the ends of the motion do not. Upper and lower ones alternate.
    """
    x, at = np.ascontiguousarray(displacement), np.empty(len(displacement))
    arrays = doubles(x, "displacement"), doubles(at, "turning points")
    count = DOUBLE.api.turns(ffi.new("mrd_turns *"), x.size, arrays[0], dead_band, arrays[1])
    return at[:count].astype(np.intp)
