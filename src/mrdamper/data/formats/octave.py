"""Text files of Octave (``save -text``): variables by name, with lines of tags such as ``# type: matrix``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.data.formats.table import FileOptions, Table
from mrdamper.data.formats.variables import table_of_variables


def read_octave(path: Path, options: FileOptions) -> Table:
    """Return the variables of a text file of Octave as columns."""
    lines = iter(path.read_text(encoding="utf-8").splitlines())
    variables: dict[str, Any] = {}
    while name := _tag(lines, "name"):
        variables[name] = _value(lines)
    return table_of_variables(variables, path, options, "Octave text")


def _tag(lines: Iterator[str], key: str) -> str:
    """Return the value in the next line ``# key: value``, "" at the end of the file."""
    begin = f"# {key}:"
    return next((line.removeprefix(begin).strip() for line in lines if line.startswith(begin)), "")


def _value(lines: Iterator[str]) -> Any:  # noqa: ANN401 - any value
    """Return the next value in the file: a variable, a cell element or a structure field."""
    kind = _tag(lines, "type")
    if kind.endswith("string"):
        texts = [next(lines) for _ in range(int(_tag(lines, "elements"))) if _tag(lines, "length")]
        return texts[0] if len(texts) == 1 else texts
    if kind == "cell":
        count = int(_tag(lines, "rows")) * int(_tag(lines, "columns"))
        return [_value(lines) for _ in range(count) if _tag(lines, "name")]
    if kind == "scalar struct":
        return {_tag(lines, "name"): _value(lines) for _ in range(int(_tag(lines, "length")))}
    if kind == "matrix":
        rows, columns = int(_tag(lines, "rows")), int(_tag(lines, "columns"))
        return np.array([next(lines).split() for _ in range(rows)], dtype=np.float64).reshape(rows, columns)
    return float(next(lines)) if kind in {"scalar", "bool"} else None
