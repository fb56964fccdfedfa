"""Tables of a terminal."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from rich.markup import escape
from rich.table import Table
from rich.text import Text


def terminal_table(
    title: str,
    columns: Iterable[str],
    rows: Iterable[Iterable[str | Text] | None],
    *,
    left: Collection[str] = (),
    whole: bool = False,
) -> Table:
    """Return a table whose texts are shown as they are: numbers to the right, words (``left``) to the left.

    Parameters
    ----------
    rows : the cells of each; None: a line between two sections
    left : names of the columns of words, whose long cells are folded
    whole : a cell is not broken into lines
    """
    table = Table(title=escape(title))
    for name in columns:
        words = name in left
        table.add_column(
            escape(name),
            justify="left" if words else "right",
            overflow="fold" if words else "ellipsis",
            no_wrap=whole,
        )
    for row in rows:
        if row is None:
            table.add_section()
        else:
            table.add_row(*(escape(cell) if isinstance(cell, str) else cell for cell in row))
    return table
