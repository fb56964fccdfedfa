"""Entries of structured documents: JSON, YAML, TOML, INI, and assignments in scripts.

Each notation is parsed to nested mappings. The items of a list have the keys 1, 2, ... The mappings are then
written as lines. A value becomes ``coil current: 0.5 A``, a column becomes ``2 pos [mm]``. An item with
several entries becomes a line with its texts, followed by its indented entries.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from itertools import zip_longest
from typing import TypeAlias

from mrdamper.data.formats.lines.cells import is_number
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.words.headers import word_and_unit
from mrdamper.quantities import is_any_unit, roles_of_unit

Node: TypeAlias = "dict[str | int, Node | str]"

SCRIPTS = frozenset({".m", ".py", ".r", ".jl"})
_COMMENT_SIGNS = {".m": "%", ".ini": "[#;]", ".cfg": "[#;]"}
NOTATIONS = frozenset({".json", ".yaml", ".yml", ".toml", *_COMMENT_SIGNS, *SCRIPTS})
_SECTION = re.compile(r"\[+([^\]=,]+)\]+")
_ENTRY = re.compile(r"(\s*)(- +)?(?:(\"[^\"]*\"|'[^']*'|[^\s:=\[{\"'][^:=]*?)\s*(?::(?=\s|$)|=|<-)\s*)?(.*)")
_STATEMENT_END = re.compile(r";\s+(?=[A-Za-z_][\w.(){}]*\s*=[^=])")
_TOKEN = re.compile(r"'[^']*'|\"[^\"]*\"|[\[\]{}(),;:=]|[^\s\[\]{}(),;:=]+")
_COLUMN = re.compile(r"\b[\w.]+[(\[{]:?\s*,\s*(\d{1,2})[)\]}]")  # d(:,2), data[:, 1], d[,2]
_LOADED = re.compile(
    r"sprintf\(\s*.([^'\"%]*%0?\d?[di][^'\"%]*).\s*,\s*(\w+)\s*\)"
)  # sprintf('run%02d.txt', k)
_BRACKET = re.compile(r"(?:(?:(?:np\.)?array|c)\()?\s*[\[{]|c\(")
_UNITS = ("unit", "units")
_VALUES = ("value", "val", "mean", "set", "setpoint", "nominal", "actual")
_NAMES = ("name", "names", "channel", "channels", "column", "columns", "label", "signal", "quantity", "title")


def entries_of(text: str, suffix: str) -> list[str]:
    """Return the entries of a document as lines. Raise ValueError or RecursionError for damaged JSON."""
    if suffix == ".json":
        return [*_lines(_tree_of_object(json.loads(text)))]
    remarks, tree = _tree_of_lines(text, suffix)
    if loaded := _LOADED.search(text):  # The loop that loads file k also uses item k of a list.
        indexed = {*re.findall(rf"\b(\w+)[(\[{{]+{loaded[2]}[)\]}}]", text)}
        counts = {len(node) for name, node in tree.items() if f"{name}".split(" [")[0] in indexed}
        tree |= {"file": {k: loaded[1] % k for k in range(1, counts.pop() + 1)}} if len(counts) == 1 else {}
    if suffix in SCRIPTS:
        tree = {key: _with_keys(node, remarks) for key, node in tree.items()}
    return [*remarks, *_lines(tree)]


def _with_keys(node: Node | str, remarks: list[str]) -> Node | str:
    """Return a list of equally long rows with the names of the columns from the only fitting comment.

    Example: ``# file, coil current in A`` above ``[("run1.csv", 0.5), ("run2.csv", 1.0)]``. The comment may
    also state the units of the keys of the rows, as in ``# I in A``.
    """
    rows = [*node.values()] if isinstance(node, dict) else []
    columns = {tuple(row) if isinstance(row, dict) else () for row in rows}
    if not isinstance(node, dict) or len(columns) != 1 or not (keys := columns.pop()):
        return node
    lists = [[word_and_unit(chunk) for chunk in re.split(r"[,;|]\s*", remark)] for remark in remarks]
    if keys == (*range(1, len(keys) + 1),):
        lists = [each for each in lists if len(each) == len(keys) > 1 and any(unit for _, unit in each)]
        names = dict(zip(keys, lists[0], strict=True)) if len(lists) == 1 else {}
    else:
        units = [pair for each in lists for pair in each if pair[0] in keys and pair[1]]
        names = {word: (word, unit) for word, unit in units if [word for word, _ in units].count(word) == 1}
    titles = {key: f"{word} [{unit}]" if unit else word for key, (word, unit) in names.items()}
    return {
        number: {titles.get(key, key): cell for key, cell in row.items()}
        for number, row in node.items()
        if isinstance(row, dict)
    }


def _tree_of_object(value: object) -> Node | str:
    if isinstance(value, dict):
        return {f"{key}": _tree_of_object(inner) for key, inner in value.items()}
    return dict(enumerate(map(_tree_of_object, value), 1)) if isinstance(value, list) else f"{value}"


def _tree_of_lines(text: str, suffix: str) -> tuple[list[str], Node]:
    """Return the comments of a text, and its entries as nested mappings.

    Indentation and sections ``[name]`` show the nesting. A unit in a comment after a number, as in
    ``I = 0.5; % A``, is added to the name of the entry.
    """
    sign = _COMMENT_SIGNS.get(suffix, "#")
    comment = re.compile(rf"((?:'[^']*'|\"[^\"]*\"|[^'\"])*?)(?:^|(?<=[\s;,])){sign}+(.*)")
    remarks: list[str] = []
    tree: Node = {}
    levels: list[tuple[float, Node]] = [(-1.0, tree)]  # (indentation, mapping) around the next entry
    begun = ""  # An entry whose brackets are not closed yet.
    for whole_line in text.expandtabs(4).splitlines()[: SETTINGS.document_lines_max]:
        line = whole_line[: SETTINGS.document_line_length_max]
        found = comment.match(line)
        body, remark = (found[1], found[2].strip()) if found else (line, "")
        if suffix in SCRIPTS:
            body = re.sub(r"\)\s*\{\s*$", ")", body)  # The lines of a loop in R are separate.
            body = _COLUMN.sub(lambda found: f"column_{int(found[1]) + (suffix == '.py')}", body)
        body = begun + body.rstrip(" ;,." if suffix in SCRIPTS else " ;,")
        is_open = sum(map(body.count, "[{")) > sum(map(body.count, "]}"))
        begun = f"{body}, " if is_open else ""
        remarks += [remark] if remark and (is_open or not body.strip()) else []
        parts = [] if is_open else _STATEMENT_END.split(body) if suffix in SCRIPTS else [body]
        values = [part for part in parts if is_number(part.rpartition("=")[2].strip())]
        units = re.split(r"[,;]\s*", remark)[: len(values)]  # "I = 0.5; T = 25; % A, degC"
        remark_of = dict(zip_longest(values, units, fillvalue="")) if values[1:] else {}
        for part in parts:
            _add_entry(part, suffix, remark_of.get(part, remark), tree, levels)
    return remarks, tree


def _add_entry(line: str, suffix: str, remark: str, tree: Node, levels: list[tuple[float, Node]]) -> None:
    """Add the entry of a line to the last mapping in ``levels``. A section ``[name]`` replaces ``levels``."""
    if section := _SECTION.fullmatch(line.strip()):
        node = tree
        for name in section[1].split(".") if suffix == ".toml" else [section[1]]:
            node = _child(node, name.strip(" \"'"))
        levels[:] = [(-1.0, _child(node, len(node) + 1) if line.strip()[:2] == "[[" else node)]
        return
    entry = _ENTRY.fullmatch(line)
    if entry is not None and (entry[2] or re.search(r"\w", entry[3] or "")):
        blanks, dash, name, value = entry.groups(default="")
        depth = (len(blanks) + 0.5 * bool(dash)) * (suffix not in SCRIPTS)
        while len(levels) > 1 and levels[-1][0] >= depth:
            levels.pop()
        node = levels[-1][1]
        if dash and name:
            node = _child(node, len(node) + 1)
            levels.append((depth, node))
        read = _literal(value)
        *outer, name = re.findall(r"\w+", name) if suffix in SCRIPTS and " " not in name else [name]
        for level in outer:
            node = _child(node, level)
        key = _key(name, read, remark) if name else len(node) + 1
        if value:
            node[key] = read
        elif name:
            levels.append((depth + bool(dash), _child(node, key)))


def _child(node: Node, key: str | int) -> Node:
    """Return the mapping at a key, which is added if it is missing."""
    inner = node.get(key)
    if not isinstance(inner, dict):
        node[key] = inner = {}
    return inner


def _key(name: str, value: Node | str, remark: str) -> str:
    """Return the name of an entry, with the unit of numbers from the remark."""
    name = name.strip("'\"")
    cells = [value] if isinstance(value, str) else [*value.values()]
    chunks = (*(chunk.strip(" []") for chunk in re.split(r"[,;(]", remark)), word_and_unit(remark)[1])
    unit = re.sub(r"^C$", "degC", next(filter(is_any_unit, chunks), ""))
    are_numbers = all(isinstance(each, str) and (is_number(each) or "column_" in each) for each in cells)
    return f"{name} [{unit}]" if unit and are_numbers and not all(word_and_unit(name)) else name


def _literal(text: str) -> Node | str:
    """Return a list or a mapping in brackets, and any other value as text without quotation marks."""
    found = _BRACKET.match(text)
    if found is None:
        return text.strip(" '\"")
    tokens = iter(_TOKEN.findall(text[found.end() :]))
    node = _bracket(tokens)
    return text if any(token not in ")'" for token in tokens) else node


def _bracket(tokens: Iterator[str]) -> Node:
    """Return the items up to the closing bracket. Items are separated by commas, semicolons or blanks."""
    node: Node = {}
    key: str | None = None
    for token in tokens:
        if token in {"]", "}", ")"}:
            break
        if token in {":", "="} and node:
            key = f"{node.popitem()[1]}"
        elif token not in {",", ";"}:
            is_open = token in {"[", "{", "("}
            node[len(node) + 1 if key is None else key] = _bracket(tokens) if is_open else token.strip("'\"")
            key = None
    return node


def _lines(tree: Node | str, path: tuple[str, ...] = ()) -> Iterator[str]:
    """Generate a line for each entry. The line begins with all enclosing keys."""
    blanks = " " * len(path)
    for key, inner in _items(tree) if isinstance(tree, dict) else ():
        own = key if isinstance(key, str) else ""
        name = " ".join(filter(None, (*path, own)))
        if isinstance(inner, str):
            yield f"{blanks}{key} [{inner}]" if roles_of_unit(inner) else f"{blanks}{name}: {inner}"
            continue
        unit, value, word = (_text(inner, keys) for keys in (_UNITS, _VALUES, _NAMES))
        texts = {other: text for other, text in inner.items() if isinstance(text, str) and text != unit}
        if unit and value:
            yield f"{blanks}{word or name}: {value} {unit}"
            continue
        if unit:
            number = re.sub(r".*?(\d*)$", r"\1", f"{key}") if texts else ""
            own = word or own or next(iter(texts.values()), "")
            yield f"{blanks}{number} {own} [{unit}]"
            yield from (f"{own}: {text}, {unit}" for text in texts.values() if text != own)
            kept: Node = {other: text for other, text in inner.items() if text not in (unit, own)}
            yield from _lines(kept, (*path, own))
            continue
        if f"{key}".isdigit():  # The texts and whole numbers in a list item may be the name of a run.
            items = (pair for pair in texts.items() if not is_number(pair[1]) or pair[1].isdigit())
            heading = [f"{other} {text}" for other, text in items if not word_and_unit(f"{other}")[1]]
            yield blanks + re.sub("[:=]", " ", " ".join((*(path[-1:] if own else ()), own, *heading)))
        else:
            yield blanks + own
        yield from _lines(inner, (*path, own))


def _items(tree: Node) -> Iterator[tuple[str | int, Node | str]]:
    """Generate the items of a mapping. Lists of equal length become rows of one table."""
    lists: dict[int, dict[str | int, Node | str]] = {}
    for key, inner in tree.items():
        cells = [cell for cell in inner.values() if isinstance(cell, str)] if isinstance(inner, dict) else []
        if not isinstance(inner, dict) or len(cells) < max(len(inner), 2):
            yield key, inner
        elif [*inner] == [*range(1, len(inner) + 1)]:
            lists.setdefault(len(cells), {})[key] = inner
        elif word_and_unit(f"{key}")[1] and all(map(is_number, cells)):
            yield from ((run, {key: value}) for run, value in inner.items())
        else:
            yield key, inner
    for count, columns in lists.items():
        for number in range(1, count + 1):
            row: Node = {key: column[number] for key, column in columns.items() if isinstance(column, dict)}
            word, unit = word_and_unit(f"{next(iter(row.values()))}")
            yield number, {"name": word, "unit": unit} if word and unit else row


def _text(node: Node, keys: tuple[str, ...]) -> str:
    """Return the first text with one of the keys (upper or lower case), else ""."""
    return next((value for wanted in keys for key, value in node.items()
                 if isinstance(value, str) and f"{key}".lower() == wanted), "")  # fmt: skip
