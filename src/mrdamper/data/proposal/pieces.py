"""Pieces: ranges of rows of a table that become runs.

A table is divided where time decreases, where a column of words changes, and at time gaps. Pieces with
continuous time and equal command are joined. Few missing numbers are interpolated. Each of these
changes is reported as a finding.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.finding import Finding
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import Moment, Texts
from mrdamper.data.records import GAP_MIN_STEPS, LEAST_SAMPLES, changes_of_pace, command_slack, steady_command
from mrdamper.quantities import CommandUnit
from mrdamper.schema import finite_or_none


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Rows of a file converted to SI, and the findings of the conversion."""

    time: FloatArray
    channels: Mapping[str, FloatArray]  # role, or "command" -> values
    title: str = ""  # Title of the sheet, group or run.
    findings: tuple[Finding, ...] = ()
    start: Moment | None = None  # Moment of time zero.
    command_unit: CommandUnit = "A"
    told: tuple[tuple[str, float, str], ...] = ()  # (role, value [SI], source) from words

    def part(self, rows: slice) -> Piece:
        """Return the piece of a range of rows."""
        channels = {role: values[rows] for role, values in self.channels.items()}
        return replace(self, time=self.time[rows], channels=channels)


def run_edges(time: FloatArray, texts: Mapping[str, Texts]) -> tuple[list[int], dict[int, str]]:
    """Return the limits of runs in a table, and the title of each run by first row.

    The limits are the first row of each run, followed by the number of rows. ``time`` are the times of the
    rows [s]. A title is a cell in a column of words.
    """
    edges = {0}
    titles: dict[int, str] = {}
    for cells in texts.values():
        begins = [k for k in range(len(cells)) if k == 0 or cells[k] != cells[k - 1]]
        # A column of words that changes more often than every 16 rows does not name runs.
        if all(cells) and 1 < len(begins) <= (1 / 16) * len(cells):
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


def join_pieces(pieces: Sequence[Piece]) -> list[Piece]:
    """Join successive pieces if the time continues and the command is equal."""
    found: list[Piece] = []
    for piece in pieces:
        if found and _continues(found[-1], piece):
            before = found[-1]
            own = before.channels.items()
            channels = {role: np.concatenate([values, piece.channels[role]]) for role, values in own}
            found[-1] = replace(before, time=np.concatenate([before.time, piece.time]), channels=channels)
        else:
            found.append(piece)
    return found


def _continues(before: Piece, after: Piece) -> bool:
    if len(before.time) < 2 or not len(after.time) or before.channels.keys() != after.channels.keys():
        return False
    pause, usual = float(after.time[0] - before.time[-1]), float(np.median(np.diff(before.time)))
    is_same = before.told == after.told and before.command_unit == after.command_unit
    if not is_same or not 0.0 < pause < SETTINGS.continuation_max_steps * usual:
        return False
    first, second = (steady_command(piece.channels["command"]) for piece in (before, after))
    return first is None or second is None or abs(first - second) <= command_slack(first)


def _filled(piece: Piece) -> Piece:
    """Interpolate missing numbers inside a channel, up to 1 % of its samples and three in sequence.

    Infinity is a value outside of the range of the recorder and is reported as clipping.
    """
    channels, findings = {"time": piece.time, **piece.channels}, list(piece.findings)
    for role, values in channels.items():
        missing, known = (np.flatnonzero(part) for part in (~np.isfinite(values), np.isfinite(values)))
        count = len(missing)
        if not 0 < count <= SETTINGS.missing_ratio_max * len(values) or {0, len(values) - 1} & {*missing}:
            continue
        longest = int(np.diff(known).max()) - 1
        if longest > SETTINGS.missing_samples_max:
            continue
        channels[role] = np.interp(np.arange(len(values)), known, values[known])
        first, last = missing[[0, -1]].tolist()
        found = f"{role} has {count} missing numbers, the first at sample {first}"
        found += f" and at most {longest} in sequence: interpolated"
        effect, remedy = "A reversal among them is flattened", "Fill them in the source if it has them"
        begin, end = (finite_or_none(piece.time[k]) for k in (first, last))
        finding = Finding("missing_filled", found, effect, remedy, channel=role, from_s=begin, to_s=end)
        findings.append(replace(finding, size=float(count), unit="samples"))
        if over := int(np.isinf(values).sum()):
            found = f"{role} is outside of the range of the recorder (infinite) at {over} samples: clipped"
            remedy = "Set the range of the recorder larger, and record again"
            size = 100.0 * over / len(values)
            findings.append(Finding("clipped", found, effect, remedy, channel=role, size=size, unit="%"))
    return replace(piece, time=channels.pop("time"), channels=channels, findings=tuple(findings))


def _without_repeated_end(piece: Piece) -> Piece:
    """Remove last samples that repeat the time and all values of an earlier sample."""
    columns = [piece.time, *piece.channels.values()]
    if len({*map(len, columns)}) > 1:  # A damaged file is reported later.
        return piece
    rows = np.column_stack(columns)
    repeats = (rows[1:] == rows[:-1]).all(axis=1)
    count = int(np.argmin(np.append(repeats[::-1], False)))
    if not count or repeats.all():
        return piece
    found = f"the last {count} samples repeat the one before, with its time: ignored"
    finding = Finding("repeated_end", found, "None", "Nothing", severity="note", channel="time")
    finding = replace(finding, size=float(count), unit="samples")
    return replace(piece.part(slice(0, len(rows) - count)), findings=(*piece.findings, finding))


def repaired_parts(piece: Piece) -> Iterator[Piece]:
    """Repair a piece, and generate its parts between gaps if none is too short, with findings on changes."""
    piece = _filled(_without_repeated_end(piece))
    steps = np.diff(piece.time)
    increases = len(steps) > 0 and bool(np.isfinite(steps).all() and (steps > 0.0).all())
    usual = float(np.median(steps)) if increases else np.inf
    gaps = np.flatnonzero(steps > GAP_MIN_STEPS * usual) + 1
    edges = [0, *gaps.tolist(), len(piece.time)]
    if not len(gaps) or min(np.diff(edges)) < LEAST_SAMPLES or changes_of_pace(steps, len(gaps)) is not None:
        edges = [0, len(piece.time)]
    for first, last in itertools.pairwise(edges):
        part = piece.part(slice(first, last))
        if first:
            lost = float(piece.time[first] - piece.time[first - 1])
            found = f"time has a gap of {lost:.4g} s (usual step: {usual:.4g} s): the record is cut there"
            effect = "The state of the hysteresis is lost in a gap: each piece is a separate run"
            remedy = "Record again without losing samples, if the pieces are short"
            gap = Finding("gap", found, effect, remedy, channel="time", size=lost, unit="s")
            gap = gap.between(piece.time[first - 1], piece.time[first])
            part = replace(part, findings=(*part.findings, gap))
        yield part


def with_stated_signs(
    channels: dict[str, FloatArray], signs: Mapping[str, int]
) -> tuple[dict[str, FloatArray], tuple[str, ...]]:
    """Return the channels with extension and tension positive, and a remark if a channel was reversed.

    ``signs`` are the stated signs of displacement and force. A sign that is not stated follows from the other
    one, because the damper dissipates energy. Signs that contradict the dissipation are not applied.
    """
    motion, force = channels.get("displacement"), channels.get("force")
    if motion is None or force is None or len(motion) != len(force) or -1 not in signs.values():
        return channels, ()
    work = force[1:] * np.diff(motion)
    power = 1 if np.sum(work[np.isfinite(work)]) > 0.0 else -1
    of_motion = signs.get("displacement") or power * signs.get("force", 0)
    of_force = signs.get("force") or power * of_motion
    if power * of_motion * of_force < 0:
        return channels, ()
    names = ("displacement", "velocity") * (of_motion < 0) + ("force",) * (of_force < 0)
    remark = f"{' and '.join(sorted({*names} - {'velocity'}))} reversed: compression is stated as positive"
    return {name: -values if name in names else values for name, values in channels.items()}, (remark,)
