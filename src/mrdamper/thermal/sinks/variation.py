"""A heat sink over any number of its drawing: what each value does to the fluid, the coil and the mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.errors import InputError
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import calibrated_text, drawing_of
from mrdamper.thermal.duty import Duty
from mrdamper.thermal.sinks.efficiency import SinkEffect, judge_sink
from mrdamper.thermal.temperature_rise import loads_of

_MOST = 200


@dataclass(frozen=True, slots=True)
class Variation:
    """A drawing's number at several values, and what the sink does at each."""

    key: str  # table.entry, as in the drawing's file: "sink.width_mm"
    values: tuple[float, ...]  # in the file's unit
    effects: tuple[SinkEffect, ...]


def read_variation(said: str) -> tuple[str, tuple[float, ...]]:
    """Return the key and the values of ``table.entry=1,2,3`` or ``table.entry=FROM:TO:NUMBER``.

    Raises
    ------
    InputError
        Another form, no number, fewer than two values or more than 200.
    """
    expected = "TABLE.ENTRY=1,2,3 or TABLE.ENTRY=FROM:TO:NUMBER, as in sink.width_mm=18:33:4"
    key, equals, told = said.partition("=")
    if not equals or key.count(".") != 1:
        raise InputError(place="--vary", found=repr(said), expected=expected)
    try:
        if ":" in told:
            first, last, count = told.split(":")
            low, high, number = float(first), float(last), min(int(count), _MOST + 1)
            values = [low + k * (high - low) / max(number - 1, 1) for k in range(number)]
        else:
            values = [float(value) for value in told.split(",")]
    except ValueError as fault:
        raise InputError(place="--vary", found=repr(said), expected=expected) from fault
    if not 2 <= len(values) <= _MOST or not np.isfinite(values).all():
        raise InputError(
            place="--vary", found=f"{len(values)} values in {said!r}", expected=f"2 to {_MOST} finite ones"
        )
    return key.strip(), tuple(values)


def vary(drawing: DamperDrawing, said: str, works: Sequence[LoopWork], duty: Duty) -> Variation:
    """Return what a drawing's sink does over one of the drawing's numbers, by the zone network.

    Raises
    ------
    InputError
        No such entry, a value that no damper can have, or a drawing without a sink.
    """
    key, values = read_variation(said)
    table, entry = key.split(".")
    effects = []
    for value in values:
        whole = entry == "fins"
        if whole and value != int(value):
            raise InputError(place="--vary", found=f"{key} = {value:g}", expected="whole numbers of fins")
        text = calibrated_text(
            drawing.text, {table: {entry: int(value) if whole else value}}, key, sink=drawing.sink
        )
        changed = drawing_of(text, f"{drawing.name} with {key} = {value:g}")
        if changed.sink is None:
            raise InputError(place=drawing.name, found="it has no heat sink", expected="one, to vary")
        effects.append(judge_sink(changed, changed.sink, loads_of(works, changed, duty)))
    return Variation(key, values, tuple(effects))
