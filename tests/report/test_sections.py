"""Terminal, report and web page show the same cells of a table."""

from __future__ import annotations

import io
import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from mrdamper.report.page import environment
from mrdamper.report.sections import Column, Table, table_of

MARKUP = "<b onclick='x'>[bold]run & 1[/bold]</b>"
ROWS = [("sine", 12.345, 20.0), (MARKUP, math.nan, 60.0), ("step", 0.5, 60.0)]


def a_table(rows=ROWS) -> Table[tuple[str, float, float]]:
    return Table(
        title="Errors",
        columns=[
            Column("run", lambda row: row[0], names_run=True),
            Column("RMS error", lambda row: row[1], "N", ".1f"),
            Column("at", lambda row: row[2], "degC", "g", printed=False),
        ],
        rows=rows,
        held=lambda row: row[2] > 20.0,
        part=lambda row: row[2],
    )


def printed(table, **options) -> list[str]:
    """Return the lines that the terminal shows for a table."""
    out = io.StringIO()
    Console(file=out, width=120).print(table.printed(**options))
    return out.getvalue().splitlines()


def rendered(table) -> str:
    text = "{% from 'table.html.j2' import table %}{{ table(it) }}"
    return environment().from_string(text).render(it=table)


def test_terminal_report_and_page_show_same_cells():
    shown = a_table().web_json()
    assert [row["cells"] for row in shown["rows"]] == [
        ["sine", "12.3", "20"],
        [MARKUP, None, "60"],
        ["step", "0.5", "60"],
    ]
    html, lines = rendered(a_table()), printed(a_table())
    for name, error, _ in (row["cells"] for row in shown["rows"]):
        assert f">{error or '–'}</td>" in html
        assert any(name in line and (error or "-") in line for line in lines)


def test_terminal_table_omits_column_that_page_shows():
    assert not any("degC" in line for line in printed(a_table()))
    assert "<small>°C</small>" in rendered(a_table())
    assert [column["unit"] for column in a_table().web_json()["columns"]] == ["", "N", "°C"]


def test_names_in_table_are_escaped():
    html = rendered(a_table())
    assert "<b onclick" not in html
    assert "&lt;b onclick" in html
    assert any(MARKUP in line for line in printed(a_table()))  # The terminal prints the name unchanged.


def test_highlighted_table_rows_and_groups_are_shown():
    assert [row["held"] for row in a_table().web_json()["rows"]] == [False, True, True]
    assert rendered(a_table()).count('<tr class="held">') == 2
    apart = sum(line.startswith("├") for line in printed(a_table()))
    assert apart == sum(line.startswith("├") for line in printed(a_table([ROWS[0]]))) + 1


@given(st.integers(1, 2000))
def test_long_table_states_omitted_rows(count):
    """A long table shows evenly spaced rows, and its caption states that rows are omitted."""
    (table,) = table_of([{"k": k, "name": "x", **{f"c{j}": None for j in range(9)}} for k in range(count)])
    shown = table.web_json()
    assert len(shown["rows"]) <= 120
    assert len(shown["columns"]) == 7
    apart = [float(row["cells"][0]) for row in shown["rows"]]
    steps = {b - a for a, b in itertools.pairwise(apart)}
    assert len(steps) <= 1
    assert bool(shown["caption"]) == (len(apart) < count)
    assert not steps or f"one of {steps.pop():g} rows" in (shown["caption"] or "one of 1 rows")


def test_empty_rows_give_no_table():
    assert table_of([]) == []


@pytest.mark.parametrize(("value", "cell"), [(None, None), (math.nan, None), (math.inf, "inf"), (0.0, "0.0")])
def test_unknown_value_gives_empty_table_cell(value, cell):
    assert Column("x", lambda row: row, form=".1f").cell(value) == cell
