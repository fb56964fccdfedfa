"""Documents of further laboratories: notations, run lists, protocols, recorders, directions, contradictions."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mrdamper.data.proposal.notation import entries_of
from mrdamper.data.proposal.questions import AskingError
from mrdamper.data.readers import read_each, read_runs
from mrdamper.data.words.signs import signs_in
from tests.data.test_laboratories import CURRENTS, RUNS, assert_read
from tests.data.test_unseen_layouts import BARE, FULL, NAMES, bare, columns, full, table, write

WARM_K = 303.15


def opaque(folder: Path, head: str = "a,b,c\n", sign: str = ",") -> None:
    """Write runs whose columns have no meaning without a document."""
    for name, run in zip(NAMES, RUNS, strict=True):
        write(folder, f"{name}.csv", head + table(*columns(run)[:3], sign=sign))


def beside(suffix: str, text: Callable[[float], str]) -> Callable[[Path], None]:
    """Return a writer of opaque runs with one document for each run."""

    def writer(folder: Path) -> None:
        opaque(folder)
        for name, current in zip(NAMES, CURRENTS, strict=True):
            write(folder, f"{name}{suffix}", text(current))

    return writer


def with_document(name: str, text: str, head: str = "a,b,c\n", sign: str = ",") -> Callable[[Path], None]:
    """Return a writer of opaque runs with one document about all of them."""

    def writer(folder: Path) -> None:
        opaque(folder, head, sign)
        write(folder, name, text)

    return writer


def workbook(*rows: list[object]) -> Callable[[Path], None]:
    def writer(folder: Path) -> None:
        from openpyxl import Workbook

        bare(folder)
        book = Workbook()
        for row in rows:
            book.active.append(row)
        book.save(folder / "plan.xlsx")

    return writer


A, B, C = CURRENTS
DOCUMENTS: dict[str, Callable[[Path], None]] = {
    "json_of_each_run": beside(
        "_meta.json",
        lambda i: json.dumps(
            {
                "conditions": {"coil": {"value": 1e3 * i, "unit": "mA"}, "oil": {"value": 30, "unit": "degC"}},
                "limits": {"current": {"value": 9, "unit": "A"}},
                "channels": [{"name": n, "unit": u} for n, u in zip("abc", ("s", "mm", "N"), strict=True)],
            }
        ).replace('"a"', '"a", "quantity": "time"'),
    ),
}
