"""Formulas in documents that convert raw columns, such as ``F = (counts - tare) / counts_per_newton``.

The statements of a script may also assign columns without names: ``F = 200 * d(:,2);  % force, N``.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.table import Table
from mrdamper.data.proposal.column import headers_of, renamed
from mrdamper.data.words.headers import means, word_and_unit
from mrdamper.quantities import roles_of_unit

_FORMULA = re.compile(r"(?<![\w=.])([A-Za-z]\w*)\s*=\s*([-+*/().\w ]{1,200}[\w)])")
_STATEMENT = re.compile(r"\s*([A-Za-z]\w*)(?: \[([^\]]+)\])?: ([-+*/().\w ]*\bcolumn_\d[-+*/().\w ]*)")
_NUMBER = re.compile(
    r"(?:.*[\s.])?([A-Za-z]\w*)(?: \[[^\]]+\])?\s*[:=]\s*([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)\s*"
)
_OPERATIONS = {ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide}


def converted(table: Table, notes: Sequence[str], chosen: ChannelMap) -> Table:
    """Return a table in which the formulas in the lines of documents convert columns without unit.

    A formula contains one column, and numbers that the documents state once. The names of the numbers state
    the unit: ``stroke_mm``, ``counts_per_newton``. The formula must have the dimension of this unit.
    """
    stated = {match.groups() for match in map(_NUMBER.fullmatch, notes) if match}
    names = [name for name, _ in stated]
    numbers = {name: float(text) for name, text in stated if names.count(name) == 1}
    table = table if chosen.channels else _assigned(table, numbers, notes)
    headers = headers_of(table)
    raw = {each.name for each in headers if not each.unit} - numbers.keys()
    formulas = {pair for line in notes for pair in _FORMULA.findall(line)}
    for role in ("displacement", "velocity", "force", "current"):
        own = {text: {*re.findall(r"[A-Za-z_]\w*", text)} for left, text in formulas if means(left, role)}
        own = {text: words for text, words in own.items() if words & raw}
        if len(own) != 1 or role in chosen.channels or any(role in each.of_unit for each in headers):
            continue
        text, words = own.popitem()
        column, *others = words & raw
        known, units = {column: table.columns[column]}, set()
        for name in words & numbers.keys():
            above, below = (_unit(part, role) for part in f"{name}_per_".split("_per_")[:2])
            power = bool(above) - bool(below)
            known[name] = numbers[name] * np.array([[1.0], [2.0**power]])  # in the unit, and in half of it
            units |= {above, below} - {""}
        try:
            values, twice = _value(ast.parse(text.strip(), mode="eval").body, known)
        except (SyntaxError, KeyError, ValueError):  # A formula with other numbers or functions.
            continue
        if not others and len(units) == 1 and np.allclose(twice, 2.0 * values, equal_nan=True):
            layout = replace(table.layout, notes=(*table.layout.notes, f"{role} by a formula: {text}"))
            table = replace(table, columns={**table.columns, column: values}, layout=layout)
            table = renamed(table, {column: f"{role} [{units.pop()}]"})
    return table


def _assigned(table: Table, numbers: Mapping[str, float], notes: Sequence[str]) -> Table:
    """Return a table with the columns that a script assigns, as in ``F [N]: 200 * column_2``.

    The columns have no names, and the script must assign each of them once. Then it skips no column.
    """
    order = {name.replace(" ", "_"): name for name in table.names}
    columns, names = dict[str, FloatArray](), dict[str, str]()
    statements = {match.groups("") for match in map(_STATEMENT.fullmatch, notes) if match}
    for left, unit, text in statements:
        try:
            tree = ast.parse(re.sub(r"\.(?=[*/])", "", text).strip(), mode="eval").body
            literals = {ast.unparse(each) for each in ast.walk(tree) if isinstance(each, ast.Constant)}
            known = {**numbers, **{literal: float(literal) for literal in literals}}
            (word,) = re.findall(r"column_\d+", text)
            columns[order[word]] = _value(tree, {**known, word: table.columns[order[word]]})
        except (SyntaxError, KeyError, ValueError, TypeError):  # A statement with other numbers or functions.
            return table
        names[order[word]] = f"{left} [{unit}]" if unit else left
    has_units = all(all(word_and_unit(name)) for name in names.values())
    if not (has_units and len(names) == len(statements) == len(table.names)):
        return table
    layout = replace(table.layout, notes=(*table.layout.notes, f"columns by a script: {[*names.values()]}"))
    return renamed(replace(table, columns=columns, layout=layout), names)


def _unit(name: str, role: str) -> str:
    unit = name if roles_of_unit(name) else word_and_unit(name)[1]
    return unit if role in roles_of_unit(unit) else ""


def _value(node: ast.expr, known: Mapping[str, Any]) -> Any:  # noqa: ANN401 - a number or an array
    """Return the value of an expression. Its only other literal is 100, because numbers may be units."""
    if isinstance(node, ast.BinOp):
        with np.errstate(all="ignore"):
            return _OPERATIONS[type(node.op)](_value(node.left, known), _value(node.right, known))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_value(node.operand, known)
    return {**known, "100": np.asarray(100.0)}[ast.unparse(node)]
