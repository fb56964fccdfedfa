"""Sections of a result, below its first screen: tables and pictures.

A table is declared once. A terminal prints it (``printed``); a report's template and a web page lay out the
same cells (``shown``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Generic, TypeVar

from rich.markup import escape
from rich.table import Table as RichTable
from rich.text import Text

from mrdamper.schema import Json

Row = TypeVar("Row")
_WIDEST, _LONGEST, _FOLDED = 7, 120, 40  # columns and rows of the general table; more rows than so many fold


@dataclass(frozen=True, slots=True)
class Column(Generic[Row]):
    """A column of a table.

    Attributes
    ----------
    value : a row's cell (a number, a text, None where it is not known), or the attribute that is it, dotted
    unit : with degC, as a terminal spells it
    form : the format of its cells, which are numbers and stand to the right (``.1%``: a share); empty: words
    printed : whether a terminal has room for it; a text: its heading there, where title and unit are too long
    names_run : its words are names of runs, which a web page can draw
    """

    title: str
    value: Callable[[Row], float | str | None] | str
    unit: str = ""
    form: str = ""
    printed: bool | str = True
    names_run: bool = False

    @property
    def heading(self) -> str:
        """What a terminal calls it: title and unit in one line."""
        return self.printed if isinstance(self.printed, str) else f"{self.title} {self.unit}".strip()

    def cell(self, row: Row) -> str | None:
        """Return a row's cell as text; None where its value is not known."""
        value = attrgetter(self.value)(row) if isinstance(self.value, str) else self.value(row)
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return None
        return value if isinstance(value, str) else f"{value:{self.form}}".replace("%", " %")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table(Generic[Row]):
    """A table of a result.

    Attributes
    ----------
    caption : how to read it, in a sentence or more
    held : whether a row stands out, as a held-out run does
    part : rows of different parts are set apart on a terminal
    folded : what the fold says that hides it on a page; empty: it is open
    """

    title: str
    columns: Sequence[Column[Row]]
    rows: Sequence[Row]
    caption: str = ""
    held: Callable[[Row], bool] = lambda _: False
    part: Callable[[Row], object] = lambda _: None
    folded: str = ""

    def printed(self, *, whole: bool = False) -> RichTable:
        """Return the table of a terminal; with ``whole`` no cell is broken into lines."""
        columns = [each for each in self.columns if each.printed]
        rows: list[list[str] | None] = []
        for k, row in enumerate(self.rows):
            if k and self.part(row) != self.part(self.rows[k - 1]):
                rows.append(None)
            cells = [each.cell(row) for each in columns]
            rows.append(["-" if cell is None else cell for cell in cells])
        left = [each.heading for each in columns if not each.form]
        return terminal_table(self.title, [each.heading for each in columns], rows, left=left, whole=whole)

    def shown(self) -> Json:
        """Return what a page lays out: headings, cells as texts (None: not known), rows that stand out."""
        return {
            "title": self.title,
            "caption": self.caption,
            "folded": self.folded,
            "columns": [
                {
                    "title": each.title,
                    "unit": each.unit.replace("degC", "°C"),
                    "number": bool(each.form),
                    "names_run": each.names_run,
                }
                for each in self.columns
            ],
            "rows": [
                {"cells": [each.cell(row) for each in self.columns], "held": bool(self.held(row))}
                for row in self.rows
            ],
        }


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture of a report, drawn as SVG when the report is written."""

    title: str
    draw: Callable[[], str]
    caption: str = ""


Section = Table[Any] | Picture


def table_of(rows: Sequence[Mapping[str, object]], title: str = "Table") -> list[Table[Mapping[str, object]]]:
    """Return the table of a result's rows: its first columns, and rows all over it."""
    if not rows:
        return []
    names = list(dict.fromkeys(name for row in rows for name in row))[:_WIDEST]
    apart = max(-(-len(rows) // _LONGEST), 1)
    some = rows[::apart]
    return [
        Table(
            title=title,
            columns=[_named(name, some[0].get(name)) for name in names],
            rows=some,
            caption=f"One row in {apart}; the table (CSV) has all of them." if apart > 1 else "",
            folded=f"{len(some)} rows" if len(some) > _FOLDED else "",
        )
    ]


def _named(name: str, first: object) -> Column[Mapping[str, object]]:
    """Return the column of a key of rows; ``first`` is its first cell."""
    number = isinstance(first, int | float)

    def value(row: Mapping[str, object]) -> float | str | None:
        cell = row.get(name)
        if isinstance(cell, int | float) and not isinstance(cell, bool):
            return float(cell) if number else f"{cell:.5g}"
        return None if cell is None else str(cell)

    return Column(name.replace("_", " "), value, form=".5g" if number else "")


_A_NAME = 24  # letters at most: other columns give way before such a one is broken


def terminal_table(
    title: str,
    columns: Iterable[str],
    rows: Iterable[Iterable[str | Text] | None],
    *,
    left: Collection[str] = (),
    whole: bool = False,
) -> RichTable:
    """Return a table whose texts are shown as they are: numbers to the right, words (``left``) to the left.

    Parameters
    ----------
    rows : the cells of each; None: a line between two sections
    left : names of the columns of words, whose long cells are folded; a name is not
    whole : a cell is not broken into lines
    """
    table = RichTable(title=escape(title))
    names, told = list(columns), [None if row is None else list(row) for row in rows]
    for k, name in enumerate(names):
        words = name in left
        longest = max((len(row[k]) for row in told if row is not None), default=0)
        table.add_column(
            escape(name),
            justify="left" if words else "right",
            overflow="fold" if words else "ellipsis",
            no_wrap=whole or (words and longest <= _A_NAME),
        )
    for row in told:
        if row is None:
            table.add_section()
        else:
            table.add_row(*(escape(cell) if isinstance(cell, str) else cell for cell in row))
    return table
