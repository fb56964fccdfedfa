"""Blocks of rows in a text: consecutive rows of numbers, separated by lines of words.

A line of words ends a block. The lines between two blocks are the header of the second block, and the
lines below the last block are a trailer. A row of numbers with one invalid cell does not end a block: the
cell is reported as an error.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from mrdamper.data.formats.lines.header import count_numbers, is_comment, split_line
from mrdamper.data.formats.table import is_missing
from mrdamper.data.formats.timestamps import is_time

_WORD = re.compile(r"\W*[^\W\d_]")


@dataclass(frozen=True, slots=True)
class Block:
    """Position of consecutive rows in a text, and the lines above these rows."""

    first: int  # Index of the first line.
    stop: int
    rows: int
    above: tuple[str, ...]


def find_blocks(lines: Sequence[str], first: int, delimiter: str) -> tuple[list[Block], list[str]]:
    """Return the list of blocks from the line ``first`` on, and the lines below the last block."""
    blocks: list[Block] = []
    above: list[str] = []  # Lines of words since the last block.
    waiting: list[str] = []  # Last lines of the current block; they may be rows or words.
    numeric: list[int] = []  # Indices of the numeric cells in the first row of the block.
    block: Block | None = None  # The block to which the next row belongs.
    for number, line in enumerate(lines[first:], first):
        if not line.strip(delimiter + " \t"):
            continue
        cells = split_line(line, delimiter)
        if block is None:
            # The first cell of a later block must be a value.
            is_value = is_missing(cells[0]) or count_numbers(cells[:1]) > 0 or is_time(cells[0])
            if not is_comment(line) and count_numbers(cells) >= 2 and (is_value or not blocks):
                numeric = [k for k, cell in enumerate(cells) if count_numbers([cell])]
                block, above = Block(number, number + 1, 1, tuple(above)), []
            else:
                above.append(line)
            continue
        kind = "words" if is_comment(line) else _kind_in_block(cells, numeric)
        if kind == "perhaps words":
            waiting.append(line)
        elif kind == "row":
            rows = block.rows + 1 + len(waiting)
            block, waiting = replace(block, stop=number + 1, rows=rows), []
        else:
            blocks.append(block)
            block, above, waiting = None, [*waiting, line], []
    if block is not None:
        return [*blocks, block], waiting
    return blocks, above


def _kind_in_block(cells: Sequence[str], numeric: Sequence[int]) -> Literal["row", "words", "perhaps words"]:
    """Return whether a line continues a block. ``numeric`` are the cells with numbers in the first row."""
    inside = [cells[k] for k in numeric if k < len(cells)]
    if not count_numbers(inside):
        are_words = any(not is_missing(cell) and _WORD.match(cell) for cell in cells)
        return "words" if are_words else "row"
    return "perhaps words" if not is_missing(inside[0]) and _WORD.match(inside[0]) else "row"
