"""Blocks of rows in a text: consecutive rows of numbers, separated by lines of words.

A line of words ends a block. The lines between two blocks are the header of the second block, and the
lines below the last block are a trailer. A row of numbers with one invalid cell does not end a block: the
cell is reported as an error.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from mrdamper.data.formats.lines.header import count_numbers, is_comment, split_line
from mrdamper.data.formats.table import MISSING_MARKS
from mrdamper.data.formats.timestamps import is_time

_WORD = re.compile(r"\W*[^\W\d_]")
_Kind = Literal["blank", "row", "words", "perhaps words"]


@dataclass(frozen=True, slots=True)
class Block:
    """The position of rows in a text, and the lines above them."""

    start: int  # bytes
    stop: int
    first_line: int  # Lines of the text before the first row.
    rows: int
    above: tuple[str, ...]
    first_row: str


class _Scan:
    """Split the lines of a text into blocks."""

    def __init__(self, delimiter: str) -> None:
        self.blocks: list[Block] = []
        self.above: list[str] = []  # Lines of words since the last block.
        self._delimiter = delimiter
        self._numeric: list[int] = []  # Indices of the cells with numbers in the current block.
        self._waiting: list[tuple[str, int]] = []  # Lines that may be words, with the next byte.
        self._open: Block | None = None

    def take(self, line: str, start: int, stop: int, number: int) -> None:
        kind = self._kind(line)
        if kind == "blank":
            return
        if kind == "perhaps words" and self._open is not None:
            self._waiting.append((line, stop))
        elif kind != "row":
            self.end()
            self.above.append(line)
        elif self._open is None:
            cells = split_line(line, self._delimiter)
            self._numeric = [k for k, cell in enumerate(cells) if count_numbers([cell])]
            self._open, self.above = Block(start, stop, number, 1, tuple(self.above), line), []
        else:
            now = self._open
            rows = now.rows + 1 + len(self._waiting)
            self._open = Block(now.start, stop, now.first_line, rows, now.above, now.first_row)
            self._waiting = []

    def end(self) -> None:
        """End the present block. Pending lines that may be words are then treated as words."""
        if self._open is not None:
            self.blocks.append(self._open)
            self.above = [line for line, _ in self._waiting]
            self._open, self._waiting = None, []

    def _kind(self, line: str) -> _Kind:
        if not line.strip(self._delimiter + " \t"):
            return "blank"
        cells = split_line(line, self._delimiter)
        if is_comment(line):
            return "words"
        if self._open is None:
            first = cells[0]
            is_value = first in {"", *MISSING_MARKS} or count_numbers([first]) > 0 or is_time(first)
            began = not self.blocks or is_value
            return "row" if count_numbers(cells) >= 2 and began else "words"
        inside = [cells[k] for k in self._numeric if k < len(cells)]
        if not count_numbers(inside):
            words = any(cell and cell not in MISSING_MARKS and _WORD.match(cell) for cell in cells)
            return "words" if words else "row"
        return "perhaps words" if inside[0] not in MISSING_MARKS and _WORD.match(inside[0]) else "row"


def find_blocks(
    content: bytes, start: int, first_line: int, delimiter: str, encoding: str
) -> tuple[list[Block], int]:
    """Return the list of blocks from byte ``start`` on, and the number of lines below the last block."""
    scan = _Scan(delimiter)
    at = start
    for number, raw in enumerate(content[start:].splitlines(keepends=True), first_line):
        line = raw.decode(encoding, "replace").rstrip("\r\n")
        scan.take(line, at, at + len(raw), number)
        at += len(raw)
    scan.end()
    return scan.blocks, len(scan.above)
