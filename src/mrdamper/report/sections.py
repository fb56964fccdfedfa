"""Tables and figures of a result, which follow below the top of an HTML page.

A table is declared once. ``Table.printed`` formats the table for a terminal. ``Table.web_json`` returns the
same cells for the HTML page and for the browser interface.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from rich.console import Console
from rich.markup import escape
from rich.padding import Padding
from rich.table import Table as RichTable
from rich.text import Text

from mrdamper.runtime.pool import Pool
from mrdamper.schema import Json

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = TypeVar("Row")
OPEN_ROW_COUNT_MAX = 40  # A longer table is folded on a page.


@dataclass(frozen=True, slots=True)
class Column(Generic[Row]):
    """A column of a table.

    Attributes
    ----------
    value : returns the cell of a row (number, text, or None if it is unknown), or the dotted name of an
        attribute of the row
    unit : unit as text, degC for degrees Celsius
    form : format of numbers, which are aligned to the right; empty for words
    printed : False omits the column in a terminal; a text is its heading in a terminal
    names_run : True if the cells are names of runs, so that a web page can plot the run of a row
    """

    title: str
    value: Callable[[Row], float | str | None] | str
    unit: str = ""
    form: str = ""
    printed: bool | str = True
    names_run: bool = False

    @property
    def heading(self) -> str:
        """Heading in a terminal: title and unit in one line."""
        return self.printed if isinstance(self.printed, str) else f"{self.title} {self.unit}".strip()

    def cell(self, row: Row) -> str | None:
        """Return the cell of a row as text, or None if its value is unknown."""
        value = attrgetter(self.value)(row) if isinstance(self.value, str) else self.value(row)
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return None
        return value if isinstance(value, str) else f"{value:{self.form}}".replace("%", " %")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table(Generic[Row]):
    """A table of a result.

    Attributes
    ----------
    caption : explanation in one or more sentences
    held : returns True if a row is highlighted, for example because the run is held out
    part : returns the group of a row; a terminal draws a line between groups
    folded : label of a table that a page initially hides; empty if the rows are visible
    """

    title: str
    columns: Sequence[Column[Row]]
    rows: Sequence[Row]
    caption: str = ""
    held: Callable[[Row], bool] = lambda _: False
    part: Callable[[Row], object] = lambda _: None
    folded: str = ""

    def printed(self, *, whole: bool = False) -> RichTable:
        """Return the table for a terminal. If ``whole`` is True, cells are never wrapped."""
        columns = [each for each in self.columns if each.printed]
        rows: list[list[str] | None] = []
        for k, row in enumerate(self.rows):
            if k and self.part(row) != self.part(self.rows[k - 1]):
                rows.append(None)
            cells = [each.cell(row) for each in columns]
            rows.append(["-" if cell is None else cell for cell in cells])
        left = [each.heading for each in columns if not each.form]
        return terminal_table(self.title, [each.heading for each in columns], rows, left=left, whole=whole)

    def web_json(self) -> Json:
        """Return headings, cells (text, or None if unknown) and highlighted rows for a page."""
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


@dataclass(frozen=True)
class Picture:
    """A figure of a report. It is drawn when the report is written, and omitted if ``draw`` returns None."""

    title: str
    draw: Callable[[], Figure | None]
    caption: str = ""

    @cached_property
    def svg(self) -> str:
        """The figure as SVG, or an empty string."""
        from mrdamper.report.figures.style import svg_drawn_by  # Matplotlib is loaded only if needed.

        return svg_drawn_by(self.draw, self.title)


def draw_all(pictures: Sequence[Picture]) -> None:
    """Draw all pictures of a page in parallel processes. Afterwards ``svg`` returns the finished figures."""
    import mrdamper.report.figures.style  # noqa: F401 - All processes use the Matplotlib of this process.

    for picture, svg in zip(pictures, Pool().map(lambda each: each.svg, pictures), strict=True):
        vars(picture)["svg"] = svg


Section = Table[Any] | Picture


def table_of(rows: Sequence[Mapping[str, object]], title: str = "Table") -> list[Table[Mapping[str, object]]]:
    """Return a table of any result: its first seven columns, and at most 120 evenly spaced rows."""
    # A page with more columns is hard to read.
    column_count_max = 7
    if not rows:
        return []
    names = list(dict.fromkeys(name for row in rows for name in row))[:column_count_max]
    step = max(-(-len(rows) // 120), 1)
    selected = rows[::step]
    return [
        Table(
            title=title,
            columns=[_column(name, selected[0].get(name)) for name in names],
            rows=selected,
            caption=f"The table shows one of {step} rows. The CSV file has all rows." if step > 1 else "",
            folded=f"{len(selected)} rows" if len(selected) > OPEN_ROW_COUNT_MAX else "",
        )
    ]


def _column(name: str, first: object) -> Column[Mapping[str, object]]:
    """Return the column for a key of the rows. The type of the first cell selects the format."""
    number = isinstance(first, int | float)

    def value(row: Mapping[str, object]) -> float | str | None:
        cell = row.get(name)
        if isinstance(cell, int | float) and not isinstance(cell, bool):
            return float(cell) if number else f"{cell:.5g}"
        return None if cell is None else str(cell)

    return Column(name.replace("_", " "), value, form=".5g" if number else "")


def terminal_table(
    title: str,
    columns: Iterable[str],
    rows: Iterable[Iterable[str | Text] | None],
    *,
    left: Collection[str] = (),
    whole: bool = False,
) -> RichTable:
    """Return a table for a terminal. Its texts are not interpreted as markup.

    Parameters
    ----------
    rows : cells of each row; None draws a line between two groups
    left : titles of columns with words, which are aligned to the left; their cells may be wrapped
    whole : True if cells are never wrapped
    """
    name_length_max = 24  # A column of words is wrapped only if a cell is longer.
    table = RichTable(title=escape(title))
    names, cell_rows = list(columns), [None if row is None else list(row) for row in rows]
    for k, name in enumerate(names):
        words = name in left
        longest = max((len(row[k]) for row in cell_rows if row is not None), default=0)
        table.add_column(
            escape(name),
            justify="left" if words else "right",
            overflow="fold" if words else "ellipsis",
            no_wrap=whole or (words and longest <= name_length_max),
        )
    for row in cell_rows:
        if row is None:
            table.add_section()
        else:
            table.add_row(*(escape(cell) if isinstance(cell, str) else cell for cell in row))
    return table


def print_compact(table: RichTable, console: Console) -> None:
    """Print a table without its frame and title."""
    table.box, table.title = None, None
    console.print(Padding(table, (0, 0, 0, 2), expand=False))
