"""Pieces: the samples of a table as the runs that they are, before anybody gives these their names.

A table is cut where its time falls back, where a column of words says that another test begins, and at
gaps; pieces whose time goes on at the same command are one run. A few missing numbers are filled in, a
displacement that was not recorded is integrated from the velocity. Each of these is told.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.core import turning_points
from mrdamper.data.finding import Finding
from mrdamper.data.formats.table import CONTINUATION_MAX_STEPS, Texts
from mrdamper.data.records import GAP_MIN_STEPS, LEAST_SAMPLES, changes_of_pace, command_slack, steady_command

_MOST_MISSING = 0.01
_SLOW = frozenset({"temperature", "command"})
_PAIRED = 0.9  # Above this ratio of repeated stamps with one displacement, rows are pairs, not samples.
_LEAST_REPEATED = 0.1  # share of the stamps: a few are faults
_FEWEST_STAMPS = 100  # different ones of a coarse time: its rate is then known to 0.3 %
_SWING, _FEWEST_TURNS, _REGULAR = 0.2, 5, 0.2  # of a periodic motion: share of its range, reversals, share
_MOST_RUNS = 1 / 16  # of the rows: a column of words that changes more often names no runs


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Some rows of a file in SI, and what was found while they were read."""

    time: FloatArray
    channels: Mapping[str, FloatArray]  # by role; the command's under "command"
    title: str = ""  # of the sheet, group, or run that it is
    findings: tuple[Finding, ...] = ()
    told: tuple[tuple[str, float, str], ...] = field(default=())  # role, value [SI], source

    def part(self, rows: slice) -> Piece:
        """Return some of the rows."""
        channels = {role: values[rows] for role, values in self.channels.items()}
        return replace(self, time=self.time[rows], channels=channels)


def run_edges(time: FloatArray, texts: Mapping[str, Texts]) -> tuple[list[int], dict[int, str]]:
    """Return the edges of the runs of a table, and the titles that a column of words gives them.

    ``time`` [s] may be of any sampling.
    """
    edges = {0}
    titles: dict[int, str] = {}
    for cells in texts.values():
        begins = [k for k in range(len(cells)) if k == 0 or cells[k] != cells[k - 1]]
        if all(cells) and 1 < len(begins) <= _MOST_RUNS * len(cells):
            edges |= set(begins)
            titles |= {k: f"{cells[k]}" for k in begins}
    if len(time) > 1 and np.isfinite(time).all():
        steps = np.diff(time)
        usual = float(np.median(np.abs(steps)))
        falls = np.flatnonzero(steps < -max(usual, 1e-12) * (LEAST_SAMPLES - 1)) + 1
        pieces = np.diff([0, *falls.tolist(), len(time)])
        if len(falls) and int(pieces.min()) >= LEAST_SAMPLES:
            edges |= set(falls.tolist())
    return [*sorted(edge for edge in edges if edge < len(time)), len(time)], titles


def joined(pieces: Sequence[Piece]) -> list[Piece]:
    """Return pieces with those joined whose time goes on from the one before at the same command."""
    found: list[Piece] = []
    for piece in pieces:
        if found and _goes_on(found[-1], piece):
            before = found[-1]
            channels = {
                role: np.concatenate([values, piece.channels[role]])
                for role, values in before.channels.items()
            }
            found[-1] = replace(before, time=np.concatenate([before.time, piece.time]), channels=channels)
        else:
            found.append(piece)
    return found


def _goes_on(before: Piece, after: Piece) -> bool:
    if len(before.time) < 2 or not len(after.time) or before.channels.keys() != after.channels.keys():
        return False
    usual = float(np.median(np.diff(before.time)))
    if not 0.0 < float(after.time[0] - before.time[-1]) < CONTINUATION_MAX_STEPS * usual:
        return False
    if before.told != after.told:
        return False
    commands = [piece.channels.get("command") for piece in (before, after)]
    held = [None if command is None else steady_command(command) for command in commands]
    if held[0] is None or held[1] is None:
        return True
    return abs(held[0] - held[1]) <= command_slack(held[0])


def filled(piece: Piece) -> Piece:
    """Return a piece with up to 1 % of missing numbers interpolated, but for those at its ends.

    A temperature or command in every so many rows was recorded more slowly, and is interpolated whole.
    """
    channels, findings = dict(piece.channels), list(piece.findings)
    rows = np.arange(len(piece.time), dtype=np.float64)
    for role, values in {"time": piece.time, **piece.channels}.items():
        missing = np.isnan(values)
        count = int(missing.sum())
        if role in _SLOW and _is_slow(missing):
            channels[role] = np.interp(rows, rows[~missing], values[~missing])
            findings.append(
                Finding(
                    kind="slow_channel",
                    severity="note",
                    channel=role,
                    size=float(len(values) - count),
                    unit="samples",
                    found=f"{role} stands in {len(values) - count} of {len(values)} rows: interpolated",
                    effect="What it does between these rows is not known",
                    remedy="Nothing, where it changes slowly",
                )
            )
            continue
        if not 0 < count <= _MOST_MISSING * len(values) or missing[0] or missing[-1]:
            continue
        whole = values.copy()
        whole[missing] = np.interp(rows[missing], rows[~missing], values[~missing])
        channels[role] = whole
        first = int(np.argmax(missing))
        findings.append(
            Finding(
                kind="missing_filled",
                channel=role,
                size=float(count),
                unit="samples",
                from_s=_at(piece.time, first),
                to_s=_at(piece.time, int(np.flatnonzero(missing)[-1])),
                found=f"{role} has {count} missing numbers, the first at sample {first}: interpolated",
                effect="A reversal among them is flattened",
                remedy="Fill them in the source if it has them",
            )
        )
    time = channels.pop("time", piece.time)
    return replace(piece, time=time, channels=channels, findings=tuple(findings))


def without_repeated_end(piece: Piece) -> Piece:
    """Return a piece without samples at its end that repeat the one before in every channel."""
    columns = [piece.time, *piece.channels.values()]
    if len({*map(len, columns)}) > 1:  # a damaged file, which is reported later
        return piece
    rows = np.column_stack(columns)
    differs = np.flatnonzero((rows[1:] != rows[:-1]).any(axis=1))
    last = int(differs[-1]) + 2 if len(differs) else len(rows)
    if last == len(rows):
        return piece
    found = Finding(
        kind="repeated_end",
        severity="note",
        channel="time",
        size=float(len(rows) - last),
        unit="samples",
        found=f"the last {len(rows) - last} samples repeat the one before, with its time: ignored",
        effect="None",
        remedy="Nothing",
    )
    return replace(piece.part(slice(0, last)), findings=(*piece.findings, found))


def evened(piece: Piece) -> Piece:
    """Return a piece of repeated stamps with samples at even distances, where each stamp is one of these.

    A time of ten milliseconds' resolution in a record of 200 Hz has each stamp twice: the even time differs
    from each by twice the resolution at most. Where it does not, samples were lost, and nothing is changed.
    """
    steps = np.diff(piece.time)
    if not (np.isfinite(steps).all() and (steps >= 0.0).all() and steps.any()):
        return piece
    repeats = steps == 0.0
    if np.mean(repeats) < _LEAST_REPEATED:
        return piece
    still = np.diff(piece.channels.get("displacement", piece.time)) == 0.0
    if "displacement" in piece.channels and np.mean(still[repeats]) > _PAIRED:  # min and max of one sample
        return piece
    resolution = float(steps[steps > 0.0].min())
    if float(piece.time[-1] - piece.time[0]) < _FEWEST_STAMPS * resolution:
        return piece
    rows = np.arange(len(piece.time), dtype=np.float64)
    slope, start = np.polyfit(rows, piece.time, 1)
    even = start + slope * rows
    if float(np.ptp(even - piece.time)) > 2.001 * resolution:
        return piece
    found = Finding(
        kind="coarse_time",
        channel="time",
        size=resolution,
        unit="s",
        found=f"time has steps of {resolution:.4g} s and repeats {int((steps == 0.0).sum())} stamps: the "
        f"samples were spread evenly, at {1.0 / slope:.4g} Hz",
        effect="Samples that came late or early are not known as such",
        remedy="Export the time with more digits",
    )
    return replace(piece, time=even, findings=(*piece.findings, found))


def _is_slow(missing: BoolArray) -> bool:
    """Tell whether numbers stand at even distances of some rows, and to within one of these of both ends."""
    there = np.flatnonzero(~missing)
    if len(there) < 2:
        return len(there) == 1 and there[0] == 0 and len(missing) > 1  # said once, in the first row
    steps = np.diff([there[0] - 1, *there.tolist(), len(missing)])
    inner = steps[1:-1]
    return bool(inner.min() > 1 and inner.max() <= inner.min() + 1 and steps.max() <= inner.max() + 1)


def cut_at_gaps(piece: Piece) -> Iterator[Piece]:
    """Give a piece as it stands between its gaps, each told; one whose parts are too short stays whole."""
    steps = np.diff(piece.time)
    if len(steps) < 2 * LEAST_SAMPLES or not (np.isfinite(steps).all() and (steps > 0.0).all()):
        yield piece
        return
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP_MIN_STEPS * usual) + 1
    edges = [0, *gaps.tolist(), len(piece.time)]
    if not len(gaps) or min(np.diff(edges)) < LEAST_SAMPLES or changes_of_pace(steps, len(gaps)) is not None:
        yield piece
        return
    for first, last in itertools.pairwise(edges):
        part = piece.part(slice(first, last))
        found: tuple[Finding, ...] = ()
        if first:
            lost = float(piece.time[first] - piece.time[first - 1])
            found = (
                Finding(
                    kind="gap",
                    channel="time",
                    size=lost,
                    unit="s",
                    from_s=float(piece.time[first - 1]),
                    to_s=float(piece.time[first]),
                    found=f"time has a gap of {lost:.4g} s before this piece, where the usual step is "
                    f"{usual:.4g} s: the record is cut there",
                    effect="The state of the hysteresis is lost in a gap: each piece begins anew",
                    remedy="Record again without losing samples, if the pieces are short",
                ),
            )
        yield replace(part, findings=(*part.findings, *found))


def integrated(piece: Piece) -> Piece:
    """Return a piece whose displacement is that of its velocity, its mean and its slope taken off."""
    velocity, time = piece.channels["velocity"], piece.time
    with np.errstate(all="ignore"):  # Faulty numbers and times are reported later.
        path = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time))])
        if len(path) > 2 and np.isfinite(path).all() and (np.diff(time) > 0.0).all():
            path = path - _slope(path, time) * (time - time[0])
            path = path - 0.5 * float(np.max(path) + np.min(path))
    found = Finding(
        kind="velocity_integrated",
        channel="displacement",
        found="there is no displacement: it is the integral of the velocity, without its mean and slope",
        effect="The place of the loop along the stroke, and slow motion, are lost",
        remedy="Record the displacement where position matters (gas spring, end stops)",
    )
    channels = {**piece.channels, "displacement": path}
    return replace(piece, channels=channels, findings=(*piece.findings, found))


def _slope(path: FloatArray, time: FloatArray) -> float:
    """Return the drift of an integral [m/s]: over whole cycles where there are any, else of the best line.

    The best line through some cycles of a sine is not level.
    """
    duration = float(time[-1] - time[0])
    line = float(np.polyfit((time - time[0]) / duration, path, 1)[0]) / duration
    level = path - line * (time - time[0])
    turns = turning_points(level, _SWING * float(np.ptp(level)))
    if len(turns) < _FEWEST_TURNS:
        return line
    halves = np.diff(time[turns[1:-1]])
    if float(np.max(np.abs(halves / np.median(halves) - 1.0))) > _REGULAR:
        return line
    inner = turns[1:-1]
    first, last = int(inner[0]), int(inner[-1 if len(inner) % 2 else -2])  # reversals of one kind
    return float((path[last] - path[first]) / (time[last] - time[first]))


def _at(time: FloatArray, k: int) -> float | None:
    return float(time[k]) if np.isfinite(time[k]) else None
