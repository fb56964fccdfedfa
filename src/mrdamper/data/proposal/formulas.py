"""Formulas in documents that convert raw columns, such as ``F = (counts - tare) / counts_per_newton``."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.table import Table
from mrdamper.data.proposal.column import headers_of, renamed
from mrdamper.data.words.headers import means, word_and_unit
from mrdamper.quantities import roles_of_unit

_FORMULA = re.compile(r"(?<![\w=.])([A-Za-z]\w*)\s*=\s*([-+*/().\w ]{1,200}[\w)])")
_NUMBER = re.compile(r"(?:.*[\s.])?([A-Za-z]\w*)\s*[:=]\s*([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)\s*")
_OPERATIONS = {ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide}


def converted(table: Table, notes: Sequence[str], chosen: ChannelMap) -> Table:
    """Return a table in which the formulas in the lines of documents convert columns without unit.

    A formula contains one column, and numbers that the documents state once. The names of the numbers state
    the unit: ``stroke_mm``, ``counts_per_newton``. The formula must have the dimension of this unit.
    """
    stated = {match.groups() for match in map(_NUMBER.fullmatch, notes) if match}
    names = [name for name, _ in stated]
    numbers = {name: float(text) for name, text in stated if names.count(name) == 1}
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


def _unit(name: str, role: str) -> str:
    unit = name if roles_of_unit(name) else word_and_unit(name)[1]
    return unit if role in roles_of_unit(unit) else ""


def _value(node: ast.expr, known: Mapping[str, FloatArray]) -> FloatArray:
    """Return the value of an expression. Its only literal is 100, because other numbers may be units."""
    if isinstance(node, ast.BinOp):
        with np.errstate(all="ignore"):
            return _OPERATIONS[type(node.op)](_value(node.left, known), _value(node.right, known))
    return {**known, "100": np.asarray(100.0)}[ast.unparse(node)]
