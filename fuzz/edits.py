"""Documents with edits: bytes are read as a list of changes to a sound document.

Random bytes are seldom TOML or JSON; a sound document with a few odd values reaches the checks behind the
parser.
"""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Sequence
from typing import Any, TypeVar

__all__ = ["ODD", "Draws", "edited", "toml_of"]

Item = TypeVar("Item")

ODD: tuple[Any, ...] = (
    0, -1, 1, 2, 3, True, False, 0.0, -0.0, 1e-300, 1e300, -1e300, math.inf, -math.inf, math.nan, 1 << 31,
    1 << 63, -(1 << 63), 10**400, 0.5, 1e-6, 1e6, 293.15, "", "A", "V", "\0", "\x7f", "é", "\ud800", "<b>",
    "../..", "N", "mm", "inf", "nan", "1e999", "x" * 300, "%s{0}", [], {}, [0], [[]], {"a": 1}, [1.0, 2.0],
    [2.0, 1.0], [math.nan, 1.0], ["a", "b"], [0.0] * 70, {"value": 1.0}, None,
)  # fmt: skip
"""Values that a person or a program may have put where another was meant."""


class Draws:
    """Choices that bytes make; when they end, every choice is the first."""

    def __init__(self, content: bytes) -> None:
        self._content, self._at = content, 0

    def whole(self, below: int) -> int:
        """Return a number from 0 up to ``below``."""
        size = 1 if below <= 256 else 2
        taken = self._content[self._at : self._at + size]
        self._at += size
        return int.from_bytes(taken, "little") % max(below, 1)

    def pick(self, among: Sequence[Item]) -> Item:
        """Return one of several."""
        return among[self.whole(len(among))]

    def text(self) -> str:
        """Return a short text."""
        size = self.whole(12)
        taken = self._content[self._at : self._at + size]
        self._at += size
        return taken.decode("utf-8", "replace")

    @property
    def left(self) -> bool:
        """Tell whether bytes are left."""
        return self._at < len(self._content)


def edited(document: dict[str, Any], draws: Draws, *, most: int = 8) -> dict[str, Any]:
    """Return a document with as many edits as the bytes ask for."""
    made: dict[str, Any] = json.loads(json.dumps(document))  # a copy, in less time than a deep one takes
    for _ in range(most):
        if not draws.left:
            break
        _edit(made, draws)
    return made


def _edit(made: dict[str, Any], draws: Draws) -> None:
    at: Any = made
    while True:
        keys: list[Any] = list(at) if isinstance(at, dict) else list(range(len(at)))
        if not keys:
            return
        key = draws.pick(keys)
        if isinstance(at[key], dict | list) and at[key] and draws.whole(4):
            at = at[key]
            continue
        break
    match draws.whole(8):
        case 0:
            del at[key]
        case 1 if isinstance(at, dict):
            at[draws.text()] = at.pop(key)
        case 2 if isinstance(at, dict):
            at[draws.text()] = copy.deepcopy(draws.pick(ODD))
        case 3 if isinstance(at[key], float) and math.isfinite(at[key]):
            at[key] = at[key] * draws.pick((-1.0, 0.0, 1e-3, 1e3, 1e12, 1.0000001, math.nan))
        case 4:
            at[key] = [copy.deepcopy(at[key])]
        case 5:
            at[key] = draws.text()
        case _:
            at[key] = copy.deepcopy(draws.pick(ODD))


def toml_of(document: dict[str, Any]) -> str:
    """Return a document as TOML, tables in the lines where they stand."""
    return "".join(f"{_key(key)} = {_value(value)}\n" for key, value in document.items() if value is not None)


def _key(key: str) -> str:
    return json.dumps(key)


def _value(value: Any) -> str:  # noqa: ANN401 - whatever TOML holds
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items() if v is not None) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_value(each) for each in value if each is not None) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return json.dumps(value)
