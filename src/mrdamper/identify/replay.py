"""A model replayed over a record of any length: rows in, the same rows out with the model's force.

The motion is conditioned as ``prepare_run`` does it (``data.conditioning``), the damper's state goes over
from batch to batch (``simulate_batch``). After a break of the record it begins anew, from rest. Rows come
out late: by some periods of the motion, and by as long as it rests inside its dead band.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.batches import Batch
from mrdamper.data.conditioning import Conditioner, Rules, known_temperature
from mrdamper.data.prepare import Preparation, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.data.segments import HEAD_ROWS, Head, Segmenter, moved_by
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import RunState, finish_run, simulate_batch
from mrdamper.quantities import QUANTITIES, REFERENCE_K, CommandUnit

MOST_HEADS = 8


class Replay:
    """Give it the batches of a record, in order, then close it.

    Parameters
    ----------
    name : of the record, for messages
    command_unit : of the record
    preparation : as the card has it
    reference_temperature : a record without temperature is at 20 degC
    head_rows : from which the rules of the conditioning are chosen; a rest before the motion is passed, and
        where no run can be made of them, up to ``MOST_HEADS`` times as many are tried

    Raises
    ------
    InputError
        The command is in another unit than the damper's.
    """

    def __init__(
        self,
        damper: Damper,
        preparation: Preparation,
        name: str,
        command_unit: CommandUnit,
        *,
        reference_temperature: bool = False,
        head_rows: int = HEAD_ROWS,
    ) -> None:
        if command_unit != damper.command_unit:
            raise InputError(
                place=name,
                found=(
                    f"the command is in {command_unit}, the model's in {damper.command_unit}; map the "
                    "channel that the model was identified with"
                ),
            )
        if damper.law.kernel is None:
            raise InputError(place=damper.law.name, found="a law in Python runs whole, not in batches")
        self.name = name
        self._damper, self._preparation, self._unit = damper.on_limits(), preparation, command_unit
        self._reference_temperature, self._head_rows = reference_temperature, head_rows
        self.rules: Rules | None = None  # None until the head is read
        self.extremes: dict[str, tuple[float, float]] = {}  # of what the model was driven through, by name
        self.segments = 0
        self.pace = 1.0  # the worst of a segment, as ``Conditioner`` has it
        self._segmenter = Segmenter()
        self._head = Head(head_rows)
        self._refused: list[Batch] = []  # heads by which no rules could be chosen
        self._segment: _Segment | None = None
        self._temperature_K: float | None = None
        self._rows: list[Batch] = []  # not given back yet
        self._seen = 0  # row after the last that was driven
        self._answers: list[tuple[int, FloatArray]] = []  # first row, force

    def step_batch(self, batch: Batch) -> Iterator[Batch]:
        """Take the next rows; give back those whose force is certain."""
        self._rows.append(batch)
        batch = self._trimmed(batch)
        while len(batch) and self.rules is None:
            batch = self._head.take(batch)
            if self._head.full:
                self._begin(last=False)
        if len(batch):
            self._drive(batch)
        yield from self._released()

    def close(self, *, cut_short: bool = False) -> Iterator[Batch]:
        """Give back what is left: the record ends here.

        Where it was ``cut_short``, a head by which no rules can be chosen leaves its rows without a force.
        """
        if self._head or self._refused:
            try:
                self._begin(last=True)
            except InputError:
                if not cut_short:
                    raise
                self._seen = self._rows[-1].row + len(self._rows[-1])
        self._end()
        yield from self._released()

    def _begin(self, *, last: bool) -> None:
        """Choose the rules from the head and drive through it; a head at rest is passed."""
        heads = [*self._refused, *([self._head.release()] if self._head else [])]
        whole = Batch.joined(heads)
        if not self._segmenter.measure(whole):
            self._segmenter.skip(whole)
            self._seen, self._refused = whole.row + len(whole), []
            return
        if self._damper.temperature_dependent:
            self._temperature_K = self._first_temperature(whole)
        try:
            self.rules = self._chosen(whole)
        except InputError:
            self.rules = self._chosen_or_none(heads[-1])
            if self.rules is None:
                if last or len(heads) == MOST_HEADS:
                    raise
                self._refused = heads
                return
        self._refused = []
        self._drive(whole)

    def _chosen_or_none(self, head: Batch) -> Rules | None:
        try:
            return self._chosen(head)
        except InputError:
            return None

    def _chosen(self, head: Batch) -> Rules:
        """Return the rules by the longest segment of a head that moves."""
        segments: list[list[Batch]] = []
        for fresh, part in Segmenter(self._segmenter.step_s).step_batch(head):
            segments += [[]] if fresh or not segments else []
            segments[-1].append(part)
        joined = [Batch.joined(parts) for parts in segments]
        longest = max(joined, key=lambda segment: (moved_by(segment.displacement) > 0.0, len(segment)))
        try:
            run = RigRun(
                name=self.name,
                time=longest.time,
                displacement=longest.displacement,
                force=longest.force,
                command=longest.command,
                command_unit=self._unit,
                velocity=longest.velocity if self._preparation.velocity == "channel" else None,
            )
            return prepare_run(run, replace(self._preparation, from_s=None, to_s=None)).rules
        except InputError as error:
            rows = f"rows {longest.row} to {longest.row + len(longest) - 1}"
            raise error.within(f"{rows}, by which the record is prepared for the model") from error

    def _first_temperature(self, head: Batch) -> float:
        """Return the first temperature [K] of the head."""
        if head.temperature is None:
            if self._reference_temperature:
                return REFERENCE_K
            raise InputError(
                place=self.name,
                found="has no temperature channel, and the model depends on temperature",
                expected="a column such as temperature_degC",
                remedy=(
                    "Map the channel, or state it as a constant in the channel map ([constant] "
                    "temperature_degC = 20)"
                ),
            )
        known = known_temperature(head.temperature, np.nan)
        known = known[np.isfinite(known)]
        if not len(known):
            low, high = (QUANTITIES["temperature"].low, QUANTITIES["temperature"].high)
            raise InputError(
                place=self.name,
                found=(
                    f"temperature is never a number of {low:g} to {high:g} K in its first {len(head)} rows; "
                    "the model needs it"
                ),
                remedy="Check the sensor, and the column's unit",
            )
        return float(known[0])

    def _trimmed(self, batch: Batch) -> Batch:
        """Return the batch with no time in the rows that the card's preparation cuts off."""
        begin, end = self._preparation.from_s, self._preparation.to_s
        if begin is None and end is None:
            return batch
        low, high = (-np.inf if begin is None else begin), (np.inf if end is None else end)
        inside = (batch.time >= low) & (batch.time <= high)
        return replace(batch, time=np.where(inside, batch.time, np.nan))

    def _drive(self, batch: Batch) -> None:
        if self.rules is None:
            return
        for fresh, part in self._segmenter.step_batch(batch):
            if fresh or self._segment is None:
                self._end()
                self.segments += 1
                conditioner = Conditioner(
                    self.rules, temperature_K=self._temperature_K, window=self._head_rows
                )
                self._segment = _Segment(conditioner)
            self._spread("temperature", part.temperature)
            self._advance(self._segment, self._segment.taken(part))
        self._seen = batch.row + len(batch)

    def _advance(self, segment: _Segment, paths: Iterator[Trajectory]) -> None:
        """Bring the model forward over what is conditioned, and keep the answers for rows."""
        for path in paths:
            if self._damper.temperature_dependent and path.temperature is None:
                path = replace(path, temperature=np.full(len(path), REFERENCE_K))  # noqa: PLW2901
            for name in ("command", "displacement", "velocity"):
                self._spread(name, getattr(path, name))
            try:
                force, segment.state = simulate_batch(self._damper, path, segment.state)
            except InputError as error:
                raise InputError(place=self.name, found=f"from row {segment.row_due} on: {error}") from error
            segment.forces.append(force)
        self._answers += segment.answered(self._preparation.force_offset_N)

    def _end(self) -> None:
        """Bring the open segment to its end: what follows is another."""
        segment, self._segment = self._segment, None
        if segment is None:
            return
        self._advance(segment, segment.conditioner.rest())
        segment.forces.append(finish_run(self._damper, segment.state)[0])
        self._answers += segment.answered(self._preparation.force_offset_N, last=True)
        self._temperature_K = segment.conditioner.temperature_K
        if abs(segment.conditioner.pace - 1.0) > abs(self.pace - 1.0):
            self.pace = segment.conditioner.pace

    def _spread(self, name: str, values: FloatArray | None) -> None:
        if values is None:
            return
        low, high = self.extremes.get(name, (np.inf, -np.inf))
        self.extremes[name] = (
            float(np.fmin.reduce(values, initial=low)),
            float(np.fmax.reduce(values, initial=high)),
        )

    def _released(self) -> Iterator[Batch]:
        """Give back the rows whose force is certain, or certainly none."""
        until = self._seen if self._segment is None else self._segment.row_due
        while self._rows and self._rows[0].row < until:
            whole = self._rows.pop(0)
            batch = whole.part(slice(0, until - whole.row))
            if len(batch) < len(whole):
                self._rows.insert(0, whole.part(slice(len(batch), None)))
            yield replace(batch, modelled=self._filled(batch.row, len(batch)))

    def _filled(self, row: int, count: int) -> FloatArray:
        force = np.full(count, np.nan)
        while self._answers and self._answers[0][0] < row + count:
            first, values = self._answers.pop(0)
            fitting = values[: row + count - first]
            force[first - row : first - row + len(fitting)] = fitting
            if len(fitting) < len(values):
                self._answers.insert(0, (first + len(fitting), values[len(fitting) :]))
        return force


class _Segment:
    """A segment under way: its rows wait with their places on the grid for the force there."""

    def __init__(self, conditioner: Conditioner) -> None:
        self.conditioner = conditioner
        self.state = RunState()
        self.forces: list[FloatArray] = []  # on the grid, from sample `_base` on
        self._base = 0
        self._waiting: list[tuple[int, FloatArray]] = []  # first row, places
        self.row_due = 0  # first row without an answer

    def taken(self, part: Batch) -> Iterator[Trajectory]:
        """Take the next rows; return what can be gone through now."""
        if not self._waiting and not self._base and not self.forces:
            self.row_due = part.row
        self._waiting.append((part.row, self.conditioner.take(part)))
        return self.conditioner.ready()

    def answered(self, tare_N: float, *, last: bool = False) -> list[tuple[int, FloatArray]]:
        """Return first row and force of the rows whose place on the grid has one.

        At the end of the segment every row has: the last ones may lie behind the grid by a part of a step.
        """
        force = np.concatenate(self.forces) if self.forces else np.empty(0)
        self.forces = [force]
        if last and not len(force):  # too short for a model
            return []
        end = self._base + len(force) - 1  # place of the last force
        found = []
        while self._waiting:
            row, places = self._waiting[0]
            count = len(places) if last else int(np.searchsorted(places, end, side="right"))
            if count:
                found.append((row, _at(force, places[:count] - self._base) + tare_N))
                self.row_due = row + count
            if count < len(places):
                self._waiting[0] = (row + count, places[count:])
                break
            self._waiting.pop(0)
        first = self._waiting[0][1][0] if self._waiting else end + 1
        keep = min(int(first) - self._base - 1, len(force) - 1)
        if keep > 0:
            self.forces, self._base = [force[keep:].copy()], self._base + keep
        return found


def _at(values: FloatArray, places: FloatArray) -> FloatArray:
    """Return values at places among them, linear between two."""
    low = np.clip(places.astype(np.int64), 0, len(values) - 1)
    off = places - low
    if not off.any():
        return values[low]
    high = np.minimum(low + 1, len(values) - 1)
    return np.asarray(values[low] + off * (values[high] - values[low]))
