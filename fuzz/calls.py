"""Target: the binding of the C kernel, called with wrong shapes, kinds and sizes.

A call gives its result or one of Python's errors; what lies beside an array that is written to stays as it
was.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from fuzz.contract import require
from fuzz.edits import Draws
from mrdamper.arrays import FloatArray
from mrdamper.control.config import config_values
from mrdamper.control.controllers import controllers_for
from mrdamper.core import _kernel
from tests.control.dampers import DOUBLE

__all__ = ["binding"]

_ANSWERS = (ValueError, TypeError, OverflowError, BufferError, MemoryError, AttributeError)
_NUMBERS = (0.0, 1.0, -1.0, 0.5, 1e-3, 1e300, -1e300, 1e-300, np.inf, -np.inf, np.nan, 12.0, 20.0, 2e9)
_MOST = 40  # samples
_GUARD = 4242.0
_RECOMMENDED = controllers_for(DOUBLE)["recommended"]


def binding(content: bytes) -> None:
    """Make the calls that bytes stand for."""
    draws = Draws(content)
    for _ in range(1 + draws.whole(3)):
        draws.pick(_CALLS)(draws)


def _number(draws: Draws) -> float:
    return draws.pick(_NUMBERS) if draws.whole(4) else (draws.whole(256) - 128) / 64.0


def _values(draws: Draws, size: int) -> FloatArray:
    rng = np.random.default_rng(draws.whole(256))
    values = rng.normal(size=size) * draws.pick((1e-3, 1.0, 1e6))
    for _ in range(draws.whole(3)):
        if size:
            values[draws.whole(size)] = _number(draws)
    return values


def _array(draws: Draws, size: int) -> Any:  # noqa: ANN401 - or what is no array
    """Return an array of about so many numbers, now and then of another size or kind."""
    made: Any = _values(draws, size)
    match draws.whole(24):
        case 0:
            made = _values(draws, draws.whole(_MOST))
        case 1:
            made = made.astype(np.float32)
        case 2:
            made = np.asfortranarray(np.ones((3, 4)))[::2]
        case 3:
            made = draws.pick((None, 1.0, "text", b"bytes", [1.0, 2.0], np.arange(4), np.ones(4, complex)))
        case 4:
            made.setflags(write=False)
        case 5:
            made = memoryview(bytearray(8 * size + 1))[1:].cast("d") if size else np.empty(0)
        case 6:
            made = made.reshape(1, -1)
        case 7:
            made = made.astype(">f8")
    return made


class _Kept:
    """Arrays to be written to, each with a guard on both sides."""

    def __init__(self) -> None:
        self._rooms: list[FloatArray] = []

    def out(self, draws: Draws, size: int) -> Any:  # noqa: ANN401 - or what is no array
        if draws.whole(16) == 0:
            return _array(draws, size)
        room = np.full(size + 16, _GUARD)
        self._rooms.append(room)
        return room[8 : 8 + size]

    def check(self) -> None:
        """Require that no guard was touched."""
        for room in self._rooms:
            require((room[:8] == _GUARD).all() and (room[-8:] == _GUARD).all(), "written beside an array")


def _answered(call: Callable[..., object], *given: object) -> object:
    try:
        return call(*given)
    except _ANSWERS:
        return None


def _record(draws: Draws) -> tuple[Any, int]:
    size = 1 + draws.whole(_MOST)
    step, band = draws.pick((1e-3, 1e-2, 1.0)), draws.pick((0.0, 1e-3))
    if not draws.whole(6):
        step, band = _number(draws), _number(draws)
    arrays = [_array(draws, size) for _ in range(3)]
    return _answered(_kernel.Record, step, *arrays, band, draws.pick((2.5e-3, 1.0, _number(draws)))), size


def _law(draws: Draws) -> int:
    return draws.pick((0, 1, 2, 3, 4, 5, 6, 7, 8, -1, 9, 1 << 20))


def _call_run(draws: Draws) -> None:
    record, size = _record(draws)
    kept, law = _Kept(), _law(draws)
    count = draws.whole(22)
    chosen = [draws.whole(22) - 1 for _ in range(draws.whole(5))]
    seeds = None if draws.whole(2) else _array(draws, len(chosen) * draws.pick((1, size)))
    force, columns = kept.out(draws, size), kept.out(draws, len(chosen) * size)
    workspace = _kernel.Workspace() if draws.whole(2) else None
    coefficients = _array(draws, count * draws.pick((1, size)))
    _answered(_kernel.run, law, record, coefficients, chosen, seeds, force, columns, workspace)
    kept.check()


def _call_causal(draws: Draws) -> None:
    record, size = _record(draws)
    kept = _Kept()
    _answered(_kernel.causal, _law(draws), record, _array(draws, draws.whole(22)), kept.out(draws, size))
    kept.check()


def _call_squared_errors(draws: Draws) -> None:
    kept, candidates, count = _Kept(), draws.whole(4), draws.whole(22)
    records = [_record(draws) for _ in range(1 + draws.whole(3))]
    measured = [_array(draws, size) for _, size in records]
    starts = [draws.pick((0, 1, size, size + 9, -1)) for _, size in records]
    given = [record for record, _ in records]
    coefficients = _array(draws, candidates * len(records) * count)
    out = kept.out(draws, candidates * len(records))
    _answered(_kernel.squared_errors, _law(draws), given, measured, starts, coefficients, out)
    kept.check()


def _call_gram(draws: Draws) -> None:
    kept, rows, size = _Kept(), draws.whole(9) - 1, draws.whole(_MOST)
    out = kept.out(draws, max(rows, 0) ** 2)
    _answered(_kernel.gram, _array(draws, max(rows, 0) * size), rows, draws.whole(_MOST) - 2, out)
    kept.check()


def _call_curve(draws: Draws) -> None:
    kept, size = _Kept(), draws.whole(_MOST)
    kappa, n = draws.pick((0.5, -1.0, 1.0, _number(draws))), draws.pick((2.0, 0.2, 20.0, _number(draws)))
    outs = [kept.out(draws, size) for _ in range(4)]
    _answered(_kernel.curve, kappa, n, _array(draws, size), *outs)
    kept.check()


def _call_lag(draws: Draws) -> None:
    kept, size = _Kept(), draws.whole(_MOST)
    times = [draws.pick((1e-3, 0.02, _number(draws))) for _ in range(5)]
    outs = [kept.out(draws, size) for _ in range(2)]
    _answered(_kernel.lag, *times, _array(draws, size), *outs, None)
    kept.check()


def _call_tracker(draws: Draws) -> None:
    """A controller from odd parts: shapes that do not fit and numbers out of range are refused."""
    lookups = [
        (1.0, 1.5, draws.whole(4), _array(draws, 4 << draws.whole(4))) for _ in range(8 + draws.whole(3))
    ]
    pieces, terms, currents = 1 + draws.whole(3), draws.whole(9), 1 + draws.whole(12)
    columns = draws.whole(terms + 2)
    current, factor = np.linspace(0.0, 2.0, currents), np.zeros((pieces, terms, 3))
    rows = bytes(draws.whole(12) for _ in range(terms))
    config = SimpleNamespace()
    for part, values in config_values(_RECOMMENDED.config).items():
        setattr(config, part, SimpleNamespace())
        for name in values:
            odd = draws.whole(64) == 0
            value = draws.pick((None, "text", [1.0], True)) if odd else _number(draws)
            setattr(getattr(config, part), name, value)
    _answered(
        _kernel.Tracker,
        config,
        rows,
        current,
        factor,
        np.zeros((currents, columns)),
        lookups,
        bool(terms % 2),
    )


_CALLS = (_call_run, _call_causal, _call_squared_errors, _call_gram, _call_curve, _call_lag, _call_tracker)
