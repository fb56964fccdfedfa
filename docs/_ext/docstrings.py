"""Docstrings for the API reference, with units next to their names.

``name : text [unit]`` in our docstrings is a description, not a type, and is formatted as a description. The
fields of a dataclass are listed with the comments in their source lines, which contain the units.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import textwrap

from sphinx.application import Sphinx

_ENTRY = re.compile(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*) : (.+)$")
_SECTIONS = {"Parameters", "Attributes", "Other Parameters"}
_MARKS = re.compile(r"\||(?<![\w*\\])\*(?=\w)(?![^*]*\w\*)")  # |v| and a single *name are text, not markup.


def texts_not_types(lines: list[str]) -> list[str]:
    """Return the lines of a docstring, with the text of ``name : text`` below the name."""
    section, changed = "", []
    for index, line in enumerate(lines):
        if index + 1 < len(lines) and re.fullmatch(r"-{3,}", lines[index + 1]):
            section = line
        found = _ENTRY.match(line) if section in _SECTIONS else None
        changed += [found[1], f"    {found[2]}"] if found else [line]
    return changed


def plain_marks(lines: list[str]) -> list[str]:
    """Escape bars and single stars, except in literals and displayed equations."""
    changed, equation = [], -1
    for line in lines:
        indent = len(line) - len(line.lstrip())
        if line.lstrip().startswith(".. math::"):
            equation = indent
        elif line.strip() and indent <= equation:
            equation = -1
        parts = re.split(r"(``.*?``|`.*?`)", line)
        safe = [part if i % 2 else _MARKS.sub(r"\\\g<0>", part) for i, part in enumerate(parts)]
        changed.append(line if equation >= 0 else "".join(safe))
    return changed


def fields_with_comments(kind: type) -> list[str]:
    """Return the public fields of a dataclass, each with the comment in its line."""
    try:
        source = textwrap.dedent(inspect.getsource(kind))
    except (OSError, TypeError):
        return []
    body = ast.parse(source).body[0]
    if not isinstance(body, ast.ClassDef):
        return []
    lines, listed = source.splitlines(), []
    for node in body.body:
        if not (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)):
            continue
        name = node.target.id
        if name.startswith("_") or name not in kind.__annotations__:
            continue
        rest_of_line = lines[(node.end_lineno or node.lineno) - 1][node.end_col_offset :]
        comment = rest_of_line.partition("# ")[2].strip()
        value = "" if node.value is None else f" = {ast.unparse(node.value)}"
        field = f"``{name}: {ast.unparse(node.annotation)}{value}``"
        listed.append(f"* {field} – {comment}" if comment else f"* {field}")
    return ["", ".. rubric:: Fields", "", *listed, ""] if listed else []


def process(_app: Sphinx, what: str, _name: str, thing: object, _options: object, lines: list[str]) -> None:
    """Rewrite a docstring in place. Napoleon reads it afterwards."""
    lines[:] = texts_not_types(lines)
    if what == "class" and isinstance(thing, type) and dataclasses.is_dataclass(thing):
        lines += fields_with_comments(thing)
    lines[:] = plain_marks(lines)


def plain_signature(
    _app: Sphinx,
    _what: str,
    _name: str,
    _thing: object,
    _options: object,
    arguments: str | None,
    returned: str | None,
) -> tuple[str | None, str | None]:
    """Return a signature with the names of type aliases."""
    first, second = (
        text and re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text) for text in (arguments, returned)
    )
    return first, second


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the handlers, with a smaller priority than napoleon (500)."""
    app.connect("autodoc-process-signature", plain_signature)
    app.connect("autodoc-process-docstring", process, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
