"""NumPy interface of the compiled kernel. It only passes arrays.

The arithmetic is ``kernel/`` (C99, one translation unit, compiled once per instruction set with equal
bits); ``binding/`` hands it buffers and releases the GIL around it. Law numbers and the order of their
coefficients are those of ``models.laws``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.core import _kernel
from mrdamper.core._kernel import (
    MOTION_NUMBERS,
    STATE_NUMBERS,
    TURNS_NUMBERS,
    Record,
    Tracker,
    Workspace,
    follow,
)
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
    "follow",
    "forces",
    "gram",
    "gram_sums",
    "lagged",
    "open_batch",
    "open_record",
    "run",
    "solve_banded",
    "squared_errors",
    "turning_points",
]


LONGEST_STEP = 2.5e-3
"""Longest step [s] of the implicit laws; a longer sample interval is divided."""

MOST_DIRECTIONS = 96
"""Most tangent columns of one call (MRD_DIRECTIONS in kernel.h)."""


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
    force = np.empty(record.samples)
    if columns is None:
        columns = np.empty((len(directions), record.samples))
    _kernel.run(law, record, coefficients, directions, seeds, force, columns, workspace)
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
    return _kernel.batch(step, *kinematics, dead_band, longest_step, patience, last, motion)


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
    force = np.zeros(batch.samples)
    _kernel.carry(law, batch, coefficients, state, force, workspace)
    return force


def causal(law: int, record: Record, coefficients: FloatArray) -> FloatArray:
    """Return the force [N] of the per-sample map, as a controller on the target computes it."""
    force = np.empty(record.samples)
    _kernel.causal(law, record, coefficients, force)
    return force


def gram(columns: FloatArray, start: int = 0) -> FloatArray:
    """Return the sums of products of the rows of ``columns`` from sample ``start`` on, shape (rows, rows)."""
    out = np.empty((len(columns), len(columns)))
    _kernel.gram(columns, len(columns), start, out)
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
    _kernel.gram_sums(law, records, measured, starts, coefficients, places, out, None)
    return out


def forces(law: int, records: Sequence[Record], coefficients: FloatArray) -> list[FloatArray]:
    """Return the force [N] along every record, shape (n,) each, several at once where the law is stepped.

    Parameters
    ----------
    coefficients : constant over each record, shape (records, m)
    """
    ends = np.cumsum([record.samples for record in records])
    left, sums = np.zeros(int(ends[-1])), np.empty(len(records))
    nothing = np.split(np.zeros(len(left)), ends[:-1])
    _kernel.gram_sums(law, records, nothing, [0] * len(records), coefficients, [], sums, left)
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
    _kernel.squared_errors(law, tuple(records), tuple(measured), tuple(starts), coefficients, errors)
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
    _kernel.lag(step, rise, falls, wheel, saturation, command, applied, by_lag, before)
    return applied, by_lag


def curve(kappa: float, n: float, tau: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the universal curve Y(tau), dY/dtau, dY/dkappa and dY/dn as the kernel tabulates them."""
    out = [np.empty_like(tau) for _ in range(4)]
    _kernel.curve(kappa, n, tau, *out)
    return out[0], out[1], out[2], out[3]


def solve_banded(lower: FloatArray, right: FloatArray) -> FloatArray:
    """Return the solution of a symmetric positive definite system of a narrow band; ``right`` becomes it.

    Parameters
    ----------
    lower : ``lower[d, j]`` is the matrix' element (j + d, j), shape (bands, n); its factor afterwards
    right : shape (n,)

    Raises
    ------
    ValueError
        The matrix is not positive definite.
    """
    _kernel.banded(lower, right)
    return right


def turning_points(displacement: FloatArray, dead_band: float) -> NDArray[np.intp]:
    """Return the samples at which a motion turns by more than the dead band [m], shape (m,).

    A turning point is an extreme after which the displacement returns by more than the dead band. The first
    of equal extremes counts; the ends of the motion do not. Upper and lower ones alternate.
    """
    at = np.empty(len(displacement))
    count = _kernel.turns(np.zeros(TURNS_NUMBERS), np.ascontiguousarray(displacement), dead_band, at)
    return at[:count].astype(np.intp)
