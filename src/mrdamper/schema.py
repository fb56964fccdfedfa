"""Records: one declaration for reading, checking, writing and describing TOML, JSON, options and requests.

A record is a frozen dataclass. The type of a field defines its values (``float``, ``int``, ``bool``,
``str``, ``Literal``, ``tuple[T, ...]``, ``Mapping[str, T]``, another record, and ``X | None``). An
``Option`` adds unit, range and the key in files if it differs from the name of the field. The text below a
field is its help::

    @dataclass(frozen=True, kw_only=True)
    class Body:
        length: Annotated[float, Option(key="length_mm", unit="mm", above=0.0)]
        '''Length including the caps.'''
        orientation: Literal["horizontal", "vertical"] = "horizontal"

    body = read_record(Body, table, place="damper.toml: body")     # Body(length=0.06, ...): SI inside
    table = write_record(body)                                      # {"length_mm": 60.0, ...}

A field with a ``key`` contains a value in SI (kelvin), and its file contains the value in ``unit``. Other
fields contain the value of the file.

All faults of a document are reported in one ``InputError``, one line for each: place, key, found value and
expected value. The message for an unknown key contains the nearest known key. ``__post_init__`` checks
combinations of fields and raises an ``InputError``. This module adds the place to that error.

Pydantic checks the values. It is loaded on first use, and the modules of records do not import it.
"""

from __future__ import annotations

import ast
import dataclasses
import difflib
import inspect
import json
import math
import operator
import sys
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from mrdamper.errors import InputError, MrdamperError
from mrdamper.quantities import ZERO_CELSIUS_K

Json = dict[str, Any]
"""A JSON object or a TOML table."""

Record = TypeVar("Record")

_SHOWN_NAMES_MAX = 40  # known names in one message
_VALUE_LENGTH_MAX = 60  # characters of a value in a message
_UNIT_HINTS = {"m/s": "A speed in km/h is 1/3.6 of it in m/s"}  # hints for typical unit errors
_SCALES = {"mm": 1e-3, "g": 1e-3, "ms": 1e-3, "percent": 1e-2, "kN": 1e3, "min": 60.0}
_FIELDS: dict[type, tuple[Field, ...]] = {}  # cache
_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text", Path: "a path"}


@dataclass(frozen=True, slots=True)
class Option:
    """Properties of a field beyond its type: help, unit, range, and its name in each interface.

    The range includes ``least`` and ``most``, and excludes ``above`` and ``below``. These limits are in
    ``unit``.
    """

    help: str = ""  # if there is no text below the field
    unit: str = ""
    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None
    key: str = ""  # key in files if it differs from the name; the field is then in SI
    flag: str = ""  # option of the command line if it is not --field-name; "-" hides the field there
    kind: str = ""  # kind of input (``registry.kinds``); empty for an option
    argument: bool = False  # positional argument of the command line
    in_answer: bool | None = None  # The answer contains the path. None: if the input is one required file.
    local: bool = False  # Servers have no such field, because it can execute code.
    metavar: str = ""
    among: Callable[[], Iterable[str]] | None = None  # choices that are determined at run time
    default_help: str = ""  # meaning of the default None
    pattern: str = ""
    expected: str = ""  # expected value in messages; empty: derived from type, unit and range
    most_items: int | None = None
    least_items: int | None = None
    # Properties of the field in a web form:
    label: str = ""  # empty: derived from the name
    group: str = "More"  # heading of the field; empty: above all headings
    titles: tuple[str, ...] = ()  # labels of the choices, in their order
    begins: Any = None  # initial value if it differs from the default
    offers: str = ""  # group of proposed names (``jobs.previews.choices``)
    slider: tuple[float, float, float] | None = None  # min, max, step
    places: tuple[str, ...] = ()  # subfolders of the work folder with selectable files
    files: str = ""  # suffix of selectable files
    looks: tuple[str, ...] = ()  # accepted kinds of input (``web.inputs``)
    word: str = ""  # label of an uploaded file
    part: str = ""  # The field enables this part of the geometry file. It is locked if the part is missing.

    __is_annotated_types_grouped_metadata__: typing.ClassVar[Literal[True]] = True

    def __iter__(self) -> Iterator[object]:
        """Generate the constraints for Pydantic."""
        import pydantic

        yield from pydantic.Field(
            ge=self.least,
            le=self.most,
            gt=self.above,
            lt=self.below,
            min_length=self.least_items,
            max_length=self.most_items,
            pattern=self.pattern or None,
        ).metadata
        if self.key and self.unit:
            yield pydantic.AfterValidator(self.to_si)

    @property
    def remedy(self) -> str:
        """Return the typical cause of a wrong name or value for messages; empty if there is none."""
        return _UNIT_HINTS.get(self.unit, "")

    @property
    def range_words(self) -> str:
        """Return the range in words, such as ``above 0 and at most 5 mm``; empty if there is none."""
        ends = (
            *(("above {:g}", self.above), ("at least {:g}", self.least)),
            *(("below {:g}", self.below), ("at most {:g}", self.most)),
        )
        words = [form.format(limit) for form, limit in ends if limit is not None]
        if self.least is not None and self.most is not None:
            words = [f"{self.least:g} to {self.most:g}"]
        return " and ".join(words)

    def holds(self, value: float) -> bool:
        """Return True if a number, in file units, is finite and in the range."""
        limits = (
            *((operator.ge, self.least), (operator.le, self.most)),
            *((operator.gt, self.above), (operator.lt, self.below)),
        )
        return math.isfinite(value) and all(end is None or fits(value, end) for fits, end in limits)

    def to_si(self, value: float | None) -> float | None:
        """Return a value of a file in SI."""
        if value is None:
            return None
        return value + ZERO_CELSIUS_K if self.unit == "degC" else value * _SCALES.get(self.unit, 1.0)

    def from_si(self, value: float) -> float:
        """Return a value in SI in the unit of the file."""
        if self.unit == "degC":
            return round(value - ZERO_CELSIUS_K, 10)
        scale = _SCALES.get(self.unit, 1.0)
        return value if scale == 1.0 else float(f"{value / scale:.12g}")


Positive = Annotated[float, Option(above=0.0)]
NotNegative = Annotated[float, Option(least=0.0)]


@dataclass(frozen=True)
class Field:
    """A field of a record with its option, as used by command line, file and form."""

    name: str
    key: str
    type: Any  # type without None and Annotated
    optional: bool  # None is allowed
    default: Any  # dataclasses.MISSING if the field is required
    option: Option
    record: type

    @property
    def required(self) -> bool:
        return self.default is dataclasses.MISSING

    @property
    def flag(self) -> str:
        """Return the name of the option on the command line."""
        return self.option.flag or f"--{self.name.replace('_', '-')}"

    @property
    def help(self) -> str:
        """Return the text below the field, or the help of the field's option."""
        names = [(each.__module__, each.__name__) for each in self.record.__mro__ if each is not object]
        texts = (_field_texts(module).get((name, self.name)) for module, name in names)
        return self.option.help or next(filter(None, texts), "")

    @cached_property  # Each check of a record uses it.
    def item(self) -> Any:  # noqa: ANN401 - a type
        """Return the type of the value, or of the items if the field is a list."""
        return _split_annotation(get_args(self.type)[0])[0] if get_origin(self.type) is tuple else self.type

    @property
    def item_option(self) -> Option:
        """Return the option of the field, or of its items if the field is a list."""
        return _split_annotation(get_args(self.type)[0])[1] if self.many else self.option

    @cached_property
    def many(self) -> bool:
        return get_origin(self.type) is tuple

    @property
    def choices(self) -> tuple[str, ...]:
        """Return the texts that the field accepts; empty if any text is accepted."""
        item = self.item
        if get_origin(item) is Literal:
            return tuple(str(each) for each in get_args(item))
        return tuple(self.option.among()) if self.option.among is not None else ()

    @property
    def item_words(self) -> str:
        """Return the expected value of each item in a list or table."""
        if get_origin(self.type) is Mapping:
            return _WORDS.get(get_args(self.type)[1], "a table")
        return self.words.removeprefix(self._list_words) if self.many else self.words

    @property
    def words(self) -> str:
        """Return the expected value, such as ``a number in mm, above 0``."""
        if self.option.expected:
            return self.option.expected
        if self.choices:
            words = f"one of: {', '.join(self.choices)}"
        elif dataclasses.is_dataclass(self.item):
            words = "a table"
        else:
            words = _WORDS.get(get_origin(self.item) or self.item, "a table")
            unit = f" in {self.option.unit}" if self.option.unit else ""
            limits = f", {self.option.range_words}" if self.option.range_words else ""
            words = f"{words}{unit}{limits}"
        return f"{self._list_words}{words}" if self.many else words

    @property
    def _list_words(self) -> str:
        items = get_args(self.type)
        return "a list, each " if ... in items else f"a list of {len(items)}, each "


@cache
def _field_texts(module: str) -> dict[tuple[str, str], str]:
    """Return the strings below the fields of the classes in a module, by names of class and field."""
    classes = ast.parse(inspect.getsource(sys.modules[module])).body
    return {
        (each.name, field.target.id): " ".join(text.value.value.split())
        for each in classes
        if isinstance(each, ast.ClassDef)
        for field, text in pairwise(each.body)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
        if isinstance(text.value.value, str)
    }


def fields_of(record: type) -> tuple[Field, ...]:
    """Return the fields of a record, in order. Pydantic is not loaded."""
    if record not in _FIELDS:
        _FIELDS[record] = tuple(_read_fields(record))
    return _FIELDS[record]


def _read_fields(record: Any) -> Iterator[Field]:  # noqa: ANN401 - a dataclass
    # Use the names of the module because a lambda in an annotation uses these names when it is called.
    names: dict[str, Any] = {}
    for base in reversed(record.__mro__):
        names |= vars(sys.modules[base.__module__])
    hints = typing.get_type_hints(record, globalns=names, include_extras=True)
    for each in dataclasses.fields(record):
        if not each.init:
            continue
        kind, option, optional = _split_annotation(hints[each.name])
        default = each.default
        if default is dataclasses.MISSING and each.default_factory is not dataclasses.MISSING:
            default = each.default_factory()
        yield Field(each.name, option.key or each.name, kind, optional, default, option, record)


def _split_annotation(hint: Any) -> tuple[Any, Option, bool]:  # noqa: ANN401 - a type
    """Return the type and the option of an annotation, and True if the annotation allows None."""
    option, optional = Option(), False
    while True:
        if get_origin(hint) is Annotated:
            hint, *extras = get_args(hint)
            option = next((each for each in extras if isinstance(each, Option)), option)
        elif get_origin(hint) in (Union, types.UnionType) and type(None) in get_args(hint):
            optional = True
            rest = tuple(each for each in get_args(hint) if each is not type(None))
            hint = rest[0] if len(rest) == 1 else Union[rest]  # noqa: UP007 - evaluated at run time
        else:
            return hint, option, optional


# ------------------------------------------------------------------------------------------- reading


def read_record(record: type[Record], document: Mapping[str, Any], place: str) -> Record:
    """Return the record of a document; messages begin with ``place``.

    Raises
    ------
    InputError
        If the document has faults: one line for each with place, key, found and expected value.
    """
    from pydantic import ValidationError

    try:
        text = json.dumps(document, default=lambda x: dict(x) if isinstance(x, Mapping) else str(x))
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(place=place, found="nested too deep, or not made of plain values") from error
    try:
        found = _adapter(typing.cast("Any", record)).validate_json(text, strict=True)
    except ValidationError as error:
        faults = [_fault(record, each, place) for each in error.errors(include_url=False)]
        raise InputError(faults=list({str(fault): fault for fault in faults}.values())) from None
    return typing.cast("Record", found)


@cache
def _adapter(record: Any) -> Any:  # noqa: ANN401 - of a dataclass, a TypeAdapter loaded late
    from pydantic import TypeAdapter

    for each in _records_in(record):
        if "__pydantic_config__" not in vars(each):
            keys = {field.name: field.key for field in fields_of(each)}
            config = {"extra": "forbid", "allow_inf_nan": False, "alias_generator": keys.__getitem__}
            each.__pydantic_config__ = config
    return TypeAdapter(record)


def _records_in(kind: Any) -> Iterator[Any]:  # noqa: ANN401 - types
    """Generate the dataclasses in a type, including the type itself."""
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        yield kind
        for hint in typing.get_type_hints(kind, include_extras=True).values():
            yield from _records_in(hint)
    else:
        for each in get_args(kind):
            yield from _records_in(each)


def _fault(record: type, fault: Mapping[str, Any], place: str) -> MrdamperError:
    """Convert an error of Pydantic to an error of this package."""
    location, kind, message = (fault[key] for key in ("loc", "type", "msg"))
    *parents, last = location or ("",)
    if kind == "value_error":  # raised in __post_init__ of the record
        own, raised = ".".join(map(str, location)), fault["ctx"]["error"]
        error = raised if isinstance(raised, MrdamperError) else InputError(str(raised))
        return (error.prepend_place(own) if own else error).prepend_place(place)
    where = ".".join(str(part)[:_VALUE_LENGTH_MAX] for part in parents)
    whole = f"{where}.{last}".strip(".")
    if kind in {"unexpected_keyword_argument", "extra_forbidden"}:
        known, _ = _locate(record, parents)
        words = f"{where} has no key" if where else "unknown key"
        unknown = str(last)[:_VALUE_LENGTH_MAX]
        error = unknown_name(f"{words} {unknown!r}", str(last), [each.key for each in known], place)
        hints = (each.option.remedy for each in known if each.key in error.remedy)
        error.remedy = " ".join(filter(None, (error.remedy, next(hints, ""))))
        error.move_to(place)
        return error
    _, field = _locate(record, location)
    expected, remedy = str(message).removeprefix("Input should be "), ""
    if field is not None:  # The location is an item if the field is a list.
        expected = field.words if last == field.key else field.item_words
        remedy = field.option.remedy
    if kind in {"missing", "missing_argument", "missing_keyword_only_argument"}:
        return InputError(f"{whole} is missing", place=place, expected=expected)
    if not whole:
        return InputError(f"it is {_shown(fault['input'])}", place=place, expected="a table")
    return InputError(f"{whole} is {_shown(fault['input'])}", place=place, expected=expected, remedy=remedy)


def _locate(record: type, place: Sequence[int | str]) -> tuple[tuple[Field, ...], Field | None]:
    """Return the known fields at a location in a document, and the innermost field on its path."""
    known, field = fields_of(record), None
    for part in place:
        inner = next((each for each in known if each.key == part), None)
        if inner is not None:
            field, tables = inner, list(_records_in(inner.type))
            known = fields_of(tables[0]) if tables else ()
        elif field is not None and isinstance(part, str) and get_origin(field.type) is Mapping:
            field = dataclasses.replace(field, type=get_args(field.type)[1])
    return known, field


def _shown(value: object) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    words = repr(value)
    return words if len(words) <= _VALUE_LENGTH_MAX else f"{words[:_VALUE_LENGTH_MAX]} ..."


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of a message about an unknown name: the nearest known names, or all of them.

    Upper and lower case are not distinguished. A long list of names is cut.
    """
    names = {each.lower(): each for each in known}
    near = difflib.get_close_matches(name.lower(), names, n=3, cutoff=0.6)
    if near:
        return f"did you mean {' or '.join(names[each] for each in near)}?"
    shown = list(names.values())[:_SHOWN_NAMES_MAX]
    more = f" and {len(names) - len(shown)} more" if len(names) > len(shown) else ""
    return f"expected one of: {', '.join(shown)}{more}" if names else "expected none"


def unknown_name(found: str, name: str, known: Iterable[str], place: str | Path = "") -> InputError:
    """Return the error for an unknown name, with the nearest known names or all of them."""
    words = did_you_mean(name, known)
    if words.startswith("expected "):
        return InputError(found, place=place, expected=words.removeprefix("expected "))
    return InputError(found, place=place, remedy=words)


def check_ranges(record: object, place: str) -> None:
    """Check numbers and choices of a record that was created in Python.

    Raises
    ------
    InputError
        If a field is not finite, outside its range, or not among its choices; one line for each field.
    """
    faults = []
    for field in fields_of(type(record)):
        value = getattr(record, field.name)
        for each in value if field.many and isinstance(value, tuple) else (value,):
            number = isinstance(each, int | float) and not isinstance(each, bool)
            found = field.option.from_si(each) if field.option.key and number else each
            if not _fits(field, found):
                words = field.item_words if each is not value else field.words
                found_words = f"{place}.{field.key} is {_shown(found)}"
                faults.append(InputError(found_words, expected=words, remedy=field.option.remedy))
    if faults:
        raise InputError(faults=faults)


def _fits(field: Field, value: object) -> bool:
    """Return True if a value of a field, in file units, is in the range or among the choices of the field."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return field.option.holds(value) and (field.item is not int or value == int(value))
    if field.item in (int, float) and isinstance(value, str | bool):
        return False
    return not isinstance(value, str) or not field.choices or value in field.choices


# ------------------------------------------------------------------------------------------- writing


def write_record(record: object, *, defaults: bool = False, nulls: bool = False) -> Json:
    """Return a record as a document for ``read_record``.

    Fields with None are omitted unless ``nulls`` (null in JSON). Fields with their default are omitted
    unless ``defaults``.
    """
    table: Json = {}
    for field in fields_of(type(record)):
        value = getattr(record, field.name)
        if (value is None and not nulls) or (not defaults and not field.required and value == field.default):
            continue
        stored = field.option.from_si(value) if field.option.key and isinstance(value, float) else value
        table[field.key] = _plain(stored, defaults=defaults, nulls=nulls)
    return table


def _plain(value: Any, *, defaults: bool, nulls: bool) -> Any:  # noqa: ANN401 - any value of a field
    if hasattr(type(value), "__get_pydantic_core_schema__"):  # The type is read from a text.
        return str(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return write_record(value, defaults=defaults, nulls=nulls)
    if isinstance(value, Mapping):
        return {key: _plain(each, defaults=defaults, nulls=nulls) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(each, defaults=defaults, nulls=nulls) for each in value]
    return str(value) if isinstance(value, Path) else value


def json_value(value: object) -> Any:  # noqa: ANN401 - any JSON value
    """Return a value for JSON. Records become objects, arrays become lists, NaN and infinity become null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if dataclasses.is_dataclass(value):
        return {each.name: json_value(getattr(value, each.name)) for each in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): json_value(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(part) for part in value]
    if hasattr(value, "tolist"):  # An array, or a number of NumPy.
        return json_value(value.tolist())
    return str(value) if isinstance(value, Path) else value


def finite_or_none(value: float) -> float | None:
    """Return a number for JSON, or None (null) if the number is not finite."""
    return float(value) if math.isfinite(value) else None


def toml_text(document: Mapping[str, Any], title: str = "") -> str:
    """Return a document as TOML: plain values first, then tables, lists of tables last."""
    lines = [f"# {line}" for line in title.splitlines()]
    _add_table(lines, document, ())
    return "\n".join(lines).strip("\n") + "\n"


def _add_table(lines: list[str], table: Mapping[str, Any], path: tuple[str, ...]) -> None:
    inner = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    many = {key: rows for key, rows in table.items() if _is_tables(rows)}
    lines += [
        f"{_toml_key(k)} = {_toml_value(v)}" for k, v in table.items() if k not in inner and k not in many
    ]
    for key, value in inner.items():
        place = (*path, _toml_key(key))
        if (
            any(not isinstance(each, Mapping) and not _is_tables(each) for each in value.values())
            or not value
        ):
            lines += ["", f"[{'.'.join(place)}]"]
        _add_table(lines, value, place)
    for key, rows in many.items():
        for row in rows:
            place = (*path, _toml_key(key))
            lines += ["", f"[[{'.'.join(place)}]]"]
            _add_table(lines, row, place)


def _is_tables(value: object) -> bool:
    return (
        isinstance(value, list | tuple) and bool(value) and all(isinstance(each, Mapping) for each in value)
    )


def _toml_key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else json.dumps(key)


def _toml_value(value: object) -> str:
    """Return the TOML text of a number, text, boolean or list, which equals JSON for these types."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml_value, value))}]"
    if isinstance(value, float):
        if not math.isfinite(value):
            return "nan" if math.isnan(value) else f"{value:+}"
        short = f"{value + 0.0:.12g}"  # "-0" would be read as the integer 0
        return short if float(short) == value else repr(value)  # The text is read as the same number.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # DEL is invalid in TOML.
