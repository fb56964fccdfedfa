"""Entries of structured documents: JSON, XML, YAML, TOML, INI, and assignments in scripts.

Each notation is parsed to nested mappings. The items of a list have the keys 1, 2, ... The mappings
are written as lines: ``coil current: 0.5 A`` for a value, ``2 pos [mm]`` for a column, and rows of cells
for a table.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import TypeAlias
from xml.etree import ElementTree

from mrdamper.data.formats.lines.cells import is_number
from mrdamper.data.words.headers import word_and_unit
from mrdamper.quantities import is_any_unit, roles_of_unit

Node: TypeAlias = "dict[str | int, Node | str]"

SCRIPTS = frozenset({".m", ".py", ".r", ".jl"})
_COMMENT_SIGNS = {".m": "%", ".ini": "[#;]", ".cfg": "[#;]"}
NOTATIONS = frozenset({".json", ".xml", ".yaml", ".yml", ".toml", *_COMMENT_SIGNS, *SCRIPTS})
ITEMS = "item of "
"""Header of the column with the numbers of the items, followed by their count, in a table of a script."""

_SECTION = re.compile(r"\[+([^\]=,]+)\]+")
_ENTRY = re.compile(r"(\s*)(- +)?(?:(\"[^\"]*\"|'[^']*'|[^\s:=\[{\"'][^:=]*?)\s*(?::(?=\s|$)|=|<-)\s*)?(.*)")
_STATEMENT_END = re.compile(r";\s+(?=[A-Za-z_][\w.(){}]*\s*=[^=])")
_TOKEN = re.compile(r"'[^']*'|\"[^\"]*\"|[\[\]{}(),;:=]|[^\s\[\]{}(),;:=]+")
_BRACKET = re.compile(r"(?:(?:(?:np\.)?array|c)\()?\s*[\[{]|c\(")
_VALUES = ("value", "val", "mean", "set")
_NAMES = ("name", "channel", "column", "label", "signal", "quantity", "title")


def entries_of(text: str, suffix: str) -> list[str]:
    """Return the entries of a document in the notation of its suffix as lines.

    Raise ValueError if the document is not valid JSON or XML, RecursionError if it is nested too
    deeply.
    """
    if suffix == ".json":
        return [*_lines(_tree_of_object(json.loads(text)))]
    if suffix == ".xml":
        if "<!" in re.sub(r"<!--|<!\[CDATA\[", "", text):
            raise ValueError("XML with a document type is not read")
        try:
            root = ElementTree.fromstring(text)
        except ElementTree.ParseError as error:
            raise ValueError(f"{error}") from error
        return [*_lines({_bare_tag(root): _tree_of_element(root)})]
    remarks, tree = _tree_of_lines(text, suffix)
    return [*remarks, *_lines(tree, is_script=suffix in SCRIPTS)]


def _tree_of_object(value: object) -> Node | str:
    if isinstance(value, dict):
        return {f"{key}": _tree_of_object(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return {k: _tree_of_object(inner) for k, inner in enumerate(value, 1)}
    return f"{value}"


def _tree_of_element(element: ElementTree.Element) -> Node | str:
    """Return the attributes and children of an XML element. Its text is the entry ``value``."""
    node: Node = dict(element.attrib.items())
    groups: dict[str, list[Node | str]] = {}
    for child in element:
        groups.setdefault(_bare_tag(child), []).append(_tree_of_element(child))
    for tag, found in groups.items():
        node[tag] = found[0] if len(found) == 1 else dict(enumerate(found, 1))
    text = (element.text or "").strip()
    if not node:
        return text
    return {**node, "value": text} if text else node


def _bare_tag(element: ElementTree.Element) -> str:
    return element.tag.rpartition("}")[2]


def _tree_of_lines(text: str, suffix: str) -> tuple[list[str], Node]:
    """Return the comments of a text, and its entries nested by indentation and by sections ``[name]``.

    A comment after a number that is a unit, as in ``I = 0.5; % A``, is added to the name.
    """
    sign = _COMMENT_SIGNS.get(suffix, "#")
    comment = re.compile(rf"((?:'[^']*'|\"[^\"]*\"|[^'\"])*?)(?:^|(?<=[\s;,])){sign}+(.*)")
    remarks: list[str] = []
    tree: Node = {}
    levels: list[tuple[float, Node]] = [(-1.0, tree)]  # The open mappings with their indentations.
    begun = ""  # The beginning of an entry with open brackets.
    for line in text.expandtabs(4).splitlines():
        found = comment.match(line)
        body, remark = (found[1], found[2].strip()) if found else (line, "")
        body = begun + body.rstrip(" ;,." if suffix in SCRIPTS else " ;,")
        is_open = sum(map(body.count, "[{")) > sum(map(body.count, "]}"))
        begun = f"{body}, " if is_open else ""
        remarks += [remark] if remark and not body.strip() else []
        for part in [] if is_open else _STATEMENT_END.split(body) if suffix in SCRIPTS else [body]:
            _add_entry(part, suffix, remark, tree, levels)
    return remarks, tree


def _add_entry(line: str, suffix: str, remark: str, tree: Node, levels: list[tuple[float, Node]]) -> None:
    """Add the entry of a line to the last of the open mappings ``levels``. A section closes them."""
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
        *outer, name = re.findall(r"\w+", name) if suffix in SCRIPTS else [name]
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
    """Return the name of an entry. A unit in the remark after numbers is added."""
    name = name.strip("'\"")
    cells = [value] if isinstance(value, str) else [*value.values()]
    unit = next((unit for unit in (re.split(r"[,;(]", remark)[0].strip(" []"), word_and_unit(remark)[1])
                 if is_any_unit(unit)), "")  # fmt: skip
    are_numbers = all(map(_is_number, cells))
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


def _lines(node: Node | str, path: str = "", depth: int = 0, *, is_script: bool = False) -> Iterator[str]:
    """Generate the lines of a mapping: headings, entries with the names of all levels, and tables."""
    if isinstance(node, str):
        yield f"{' ' * depth}{path}: {node}"
        return
    lists = {
        key: [*inner.values()] for key, inner in node.items() if isinstance(inner, dict) and _is_list(inner)
    }
    plain = {key: items for key, items in lists.items() if not any(isinstance(item, dict) for item in items)}
    for count in dict.fromkeys(map(len, plain.values())):
        named = {f"{key}": items for key, items in plain.items() if len(items) == count > 1}
        for units in [key for key, items in named.items() if all(_is_unit(item) for item in items)][:1]:
            words = [key for key in named if key != units]
            before = [key for key in words if [*named].index(key) < [*named].index(units)]
            own = {key: named.pop(key) for key in (*(before[-1:] or words[:1]), units)}
            yield from _table(
                [dict(zip(own, cells, strict=True)) for cells in zip(*own.values(), strict=True)]
            )
        rows = [dict(zip(named, cells, strict=True)) for cells in zip(*named.values(), strict=True)]
        if is_script and rows:
            rows = [{f"{ITEMS}{count}": f"{k}", **row} for k, row in enumerate(rows, 1)]
        yield from _table(rows)
    if all(f"{key}".isdigit() for key in node) and all(map(_is_row, node.values())):
        numbers = () if _is_list(node) else node
        yield from _table(
            [{**({"": f"{key}"} if numbers else {}), **dict(_flat(inner))} for key, inner in node.items()]
        )
        return
    for key, inner in node.items():
        name = f"{path} {key}".strip()
        if key in plain or (isinstance(inner, str) and not inner):
            continue
        if isinstance(inner, str):
            word, unit = word_and_unit(name) if is_number(inner) else ("", "")
            entry = f"{word}: {inner} {unit}" if word and unit else f"{name}: {inner}"
            yield f"{' ' * depth}{f'{key} [{inner}]' if roles_of_unit(inner) else entry}"
        elif word_and_unit(f"{key}")[1] and all(map(_is_number, inner.values())):
            yield from _table([{"": f"{run}", f"{key}": value} for run, value in inner.items()])
        elif unit := _text(inner, ("unit", "units")):
            yield from _with_unit(key, name, inner, unit, depth)
        else:
            yield f"{' ' * depth}{key}"
            yield from _lines(inner, name, depth + 1)


def _with_unit(key: str | int, name: str, node: Node, unit: str, depth: int) -> Iterator[str]:
    """Generate the lines of a mapping with a unit: a value, or the description of a column."""
    word = _text(node, _NAMES) or f"{key}"
    has_one = sum(map(_is_number, node.values())) == 1
    value = _text(node, _VALUES)
    if value:
        yield f"{' ' * depth}{name if word == f'{key}' else word}: {value} {unit}"
        return
    number = re.sub(r".*?(\d*)$", r"\1", f"{key}") if word != f"{key}" else ""
    yield f"{' ' * depth}{number} {word} [{unit}]"
    for other, inner in node.items():
        if isinstance(inner, str) and inner not in {unit, word}:
            yield f"{' ' * depth}{word} {other}: {inner}{f' {unit}' if has_one and is_number(inner) else ''}"


def _text(node: Node, keys: tuple[str, ...]) -> str:
    """Return the first text at one of the keys, in any case; "" if there is none."""
    return next((value for wanted in keys for key, value in node.items()
                 if isinstance(value, str) and f"{key}".lower() == wanted), "")  # fmt: skip


def _is_number(value: Node | str) -> bool:
    return isinstance(value, str) and is_number(value)


def _is_unit(value: Node | str) -> bool:
    return isinstance(value, str) and bool(roles_of_unit(value))


def _is_list(node: Node) -> bool:
    return bool(node) and [*node] == [*range(1, len(node) + 1)]


def _is_row(node: Node | str) -> bool:
    """Return True if an item of a list is a row of a table, and not the description of a column."""
    return isinstance(node, dict) and bool(_text(node, _VALUES) or not _text(node, ("unit", "units")))


def _flat(node: Node | str, path: str = "") -> Iterator[tuple[str, str]]:
    """Generate the entries of a row: name with the names of all levels, and value with its unit."""
    if isinstance(node, str):
        yield path, node
    elif (value := _text(node, _VALUES)) and (unit := _text(node, ("unit", "units"))):
        yield path, f"{value} {unit}"
    else:
        for key, inner in node.items():
            yield from _flat(inner, f"{path} {key}".strip())


def _table(rows: list[dict[str, Node | str]]) -> Iterator[str]:
    """Generate the lines of a table: numbered names and units of columns, else a header and rows of cells."""
    names = dict.fromkeys(name for row in rows for name in row)
    units = [name for name in names if rows and all(_is_unit(row.get(name, "")) for row in rows)]
    if len(units) == 1 and len(names) > 1:
        words = next(name for name in names if name != units[0] and not f"{rows[0].get(name)}".isdigit())
        yield from (f"{k} {row.get(words, '')} [{row[units[0]]}]" for k, row in enumerate(rows, 1))
    elif len(names) == 1 and all(word_and_unit(f"{row[name]}")[1] for name in names for row in rows):
        yield from (f"{k} {row[name]}" for name in names for k, row in enumerate(rows, 1))
    elif rows:
        yield "\t".join(names)
        yield from ("\t".join(f"{row.get(name, '')}".replace("\t", " ") for name in names) for row in rows)
