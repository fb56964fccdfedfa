"""Records: one declaration to read, check, write and describe TOML, JSON, options and requests.

A record is a frozen dataclass. The type of a field defines its values (``float``, ``int``, ``bool``,
``str``, ``Literal``, ``tuple[T, ...]``, ``Mapping[str, T]``, another record, and ``X | None``). An
``Option`` adds unit, range and help, and the key in files if it differs from the name of the field::

    @dataclass(frozen=True, kw_only=True)
    class Body:
        length: Annotated[float, Option("without caps", key="length_mm", unit="mm", above=0.0)]
        orientation: Literal["horizontal", "vertical"] = "horizontal"

    body = read_record(Body, table, place="damper.toml: body")     # Body(length=0.06, ...): SI inside
    table = write_record(body)                                      # {"length_mm": 60.0, ...}

A field with a ``key`` contains a value in SI (kelvin), and its file contains the value in ``unit``. Other
fields contain the value of the file. A table can have a short form: the function ``short`` of an ``Option``
converts a single value (such as a number or ``false``) to a table.

All faults of a document are reported in one ``InputError``, one line for each: place, key, found value and
expected value. The message for an unknown key contains the nearest known key. ``__post_init__`` checks
combinations of fields and raises an ``InputError``, which gets its place here.

Pydantic checks the values. It is loaded on first use, and the modules of records do not import it.
"""

from __future__ import annotations

import dataclasses
import difflib
import json
import math
import sys
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
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
# Caches by type of record.
_FIELDS: dict[type, tuple[Field, ...]] = {}
_ADAPTERS: dict[type, Any] = {}
_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text", Path: "a path"}


@dataclass(frozen=True, slots=True, kw_only=True)
class OnPage:
    """Options of a form field that do not follow from type, unit and range."""

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


@dataclass(frozen=True, slots=True)
class Option:
    """Properties of a field beyond its type: help, unit, range, and its name in each interface.

    The range includes ``least`` and ``most``, and excludes ``above`` and ``below``. All are in ``unit``.
    """

    help: str = ""
    unit: str = ""
    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None
    key: str = ""  # key in files if it differs from the name; the field is then in SI
    flag: str = ""  # option of the command line if it is not --field-name; "-" hides the field there
    label: str = ""  # label in forms; empty: derived from the name
    page: OnPage = OnPage()
    local: bool = False  # Servers have no such field, because it can execute code.
    metavar: str = ""
    among: Callable[[], Iterable[str]] | None = None  # choices that are determined at run time
    default_help: str = ""  # meaning of the default None
    pattern: str = ""
    expected: str = ""  # expected value in messages; empty: derived from type, unit and range
    most_items: int | None = None
    least_items: int | None = None
    short: Callable[[Any], Any] | None = None  # converts a single value to a table (or None)

    __is_annotated_types_grouped_metadata__: typing.ClassVar[Literal[True]] = True

    def __iter__(self) -> Iterator[object]:
        """Yield the constraints for Pydantic."""
        import annotated_types as kinds

        pairs = (
            (kinds.Ge, self.least),
            (kinds.Le, self.most),
            (kinds.Gt, self.above),
            (kinds.Lt, self.below),
        )
        yield from (kind(limit) for kind, limit in pairs if limit is not None)
        if self.least_items is not None:
            yield kinds.MinLen(self.least_items)
        if self.most_items is not None:
            yield kinds.MaxLen(self.most_items)
        if self.pattern:
            from pydantic import StringConstraints

            yield StringConstraints(pattern=self.pattern)
        if self.key and self.unit:
            from pydantic import AfterValidator

            yield AfterValidator(self.to_si)

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
        return (
            math.isfinite(value)
            and (self.least is None or value >= self.least)
            and (self.most is None or value <= self.most)
            and (self.above is None or value > self.above)
            and (self.below is None or value < self.below)
        )

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


@dataclass(frozen=True)
class Field:
    """A field of a record with its option, as used by command line, file and form."""

    name: str
    key: str
    type: Any  # type without None and Annotated
    optional: bool  # None is allowed
    default: Any  # dataclasses.MISSING if the field is required
    option: Option

    @property
    def required(self) -> bool:
        return self.default is dataclasses.MISSING

    @property
    def flag(self) -> str:
        """Return the name of the option on the command line."""
        return self.option.flag or f"--{self.name.replace('_', '-')}"

    @cached_property  # Each check of a record uses it.
    def item(self) -> Any:  # noqa: ANN401 - a type
        """Return the type of the values in a list, or the type of a single value."""
        return _split_annotation(get_args(self.type)[0])[0] if get_origin(self.type) is tuple else self.type

    @property
    def item_option(self) -> Option:
        """Return the option of each value of a list; for a single value that of the field."""
        return _split_annotation(get_args(self.type)[0])[1] if self.many else self.option

    @cached_property
    def many(self) -> bool:
        return get_origin(self.type) is tuple

    @property
    def choices(self) -> tuple[str, ...]:
        """Return the texts that the field accepts; empty if it accepts any text."""
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


def fields_of(record: type) -> tuple[Field, ...]:
    """Return the fields of a record, in order. Pydantic is not loaded."""
    if record not in _FIELDS:
        _FIELDS[record] = tuple(_read_fields(record))
    return _FIELDS[record]


def _read_fields(record: Any) -> Iterator[Field]:  # noqa: ANN401 - a dataclass
    # Use the names of the module: a lambda in an annotation looks there when it is called.
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
        yield Field(each.name, option.key or each.name, kind, optional, default, option)


def _split_annotation(hint: Any) -> tuple[Any, Option, bool]:  # noqa: ANN401 - a type
    """Return (type, option, None allowed) of an annotation with Annotated and None in any order."""
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
        text = json.dumps(_expand_short_forms(record, document), default=_plain_json)
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(place=place, found="nested too deep, or not made of plain values") from error
    try:
        found = _adapter(record).validate_json(text, strict=True)
    except ValidationError as error:
        faults = [_fault(record, each, place) for each in error.errors(include_url=False)]
        raise InputError(faults=list({str(fault): fault for fault in faults}.values())) from None
    return typing.cast("Record", found)


def _expand_short_forms(kind: Any, value: Any) -> Any:  # noqa: ANN401 - a type and any value
    """Return a value of a document with short forms expanded to tables."""
    origin, parts = get_origin(kind), get_args(kind)
    if isinstance(value, Mapping) and origin is Mapping:
        return {key: _expand_short_forms(parts[1], each) for key, each in value.items()}
    if isinstance(value, list | tuple) and origin is tuple:
        return [_expand_short_forms(parts[0], each) for each in value]
    if not (isinstance(value, Mapping) and isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        return value
    found = dict(value)
    for field in fields_of(kind):
        if field.key in found:
            given, short = found[field.key], field.option.short
            given = given if short is None or isinstance(given, Mapping) else short(given)
            found[field.key] = _expand_short_forms(field.type, given)
    return found


def _plain_json(value: object) -> object:
    return dict(value) if isinstance(value, Mapping) else str(value)


def _adapter(record: Any) -> Any:  # noqa: ANN401 - of a dataclass, a TypeAdapter loaded late
    if record in _ADAPTERS:
        return _ADAPTERS[record]
    from pydantic import TypeAdapter

    for each in _records_in(record):
        if "__pydantic_config__" not in vars(each):
            keys = {field.name: field.key for field in fields_of(each)}
            config = {"extra": "forbid", "allow_inf_nan": False, "alias_generator": keys.__getitem__}
            each.__pydantic_config__ = config
    _ADAPTERS[record] = TypeAdapter(record)
    return _ADAPTERS[record]


def _records_in(kind: Any) -> Iterator[Any]:  # noqa: ANN401 - types
    """Yield the dataclasses in a type, including the type itself."""
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        yield kind
        for hint in typing.get_type_hints(kind, include_extras=True).values():
            yield from _records_in(hint)
    else:
        for each in get_args(kind):
            yield from _records_in(each)


def _fault(record: type, fault: Mapping[str, Any], place: str) -> MrdamperError:
    """Return an error of Pydantic as an error of this package."""
    *parents, last = [part for part in fault["loc"] if isinstance(part, int | str)] or [""]
    kind, field = fault["type"], _field_at(record, fault["loc"])
    if kind == "value_error":  # raised in __post_init__ of the record
        own, raised = ".".join(str(part) for part in fault["loc"]), fault["ctx"]["error"]
        error = raised if isinstance(raised, MrdamperError) else InputError(str(raised))
        return (error.prepend_place(own) if own else error).prepend_place(place)
    where = ".".join(str(part)[:_VALUE_LENGTH_MAX] for part in parents)
    whole = f"{where}.{last}".strip(".")
    if kind in {"unexpected_keyword_argument", "extra_forbidden"}:
        known = [each.key for each in _fields_at(record, parents)]
        words = f"{where} has no key" if where else "unknown key"
        error = unknown_name(f"{words} {str(last)[:_VALUE_LENGTH_MAX]!r}", str(last), known, place)
        meant = next((each for each in _fields_at(record, parents) if each.key in error.remedy), None)
        if meant is not None and meant.option.remedy:
            error.remedy = f"{error.remedy} {meant.option.remedy}"
            error.move_to(place)
        return error
    expected = str(fault["msg"]).removeprefix("Input should be ")
    if field is not None:  # The location is an item if the field is a list.
        expected = field.words if last == field.key else field.item_words
    if kind in {"missing", "missing_argument", "missing_keyword_only_argument"}:
        return InputError(f"{whole} is missing", place=place, expected=expected)
    if not whole:
        return InputError(f"it is {_shown(fault['input'])}", place=place, expected="a table")
    remedy = field.option.remedy if field is not None else ""
    return InputError(f"{whole} is {_shown(fault['input'])}", place=place, expected=expected, remedy=remedy)


def _fields_at(record: Any, place: Sequence[int | str]) -> tuple[Field, ...]:  # noqa: ANN401 - a type
    for part in place:
        field = next((each for each in fields_of(record) if each.key == part), None)
        if field is None:
            continue
        inner = next((each for each in _records_in(field.type)), None)
        if inner is None:
            return ()
        record = inner
    return fields_of(record) if isinstance(record, type) and dataclasses.is_dataclass(record) else ()


def _field_at(record: type, place: Sequence[int | str]) -> Field | None:
    """Return the innermost field on the path to a location in a document."""
    names = [part for part in place if isinstance(part, str)]
    for k in range(len(names), 0, -1):
        for field in _fields_at(record, names[: k - 1]):
            if field.key == names[k - 1]:
                among_values = k < len(names) and get_origin(field.type) is Mapping
                return dataclasses.replace(field, type=get_args(field.type)[1]) if among_values else field
    return None


def _shown(value: object) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    words = repr(value)
    return words if len(words) <= _VALUE_LENGTH_MAX else f"{words[:_VALUE_LENGTH_MAX]} ..."


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of a message about an unknown name: the nearest known names, or all of them.

    Upper and lower case are equal. A long list of names is cut.
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
    """Return True if one value of a field, in file units, is in range or one of its choices."""
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


def finite_or_none(value: float) -> float | None:
    """Return a number for JSON: None (null) if it is not finite."""
    return value if math.isfinite(value) else None


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
    """Return a number, text, boolean or list as TOML, which equals JSON for these types."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml_value, value))}]"
    if isinstance(value, float):
        if not math.isfinite(value):
            return "nan" if math.isnan(value) else f"{value:+}"
        short = f"{value + 0.0:.12g}"  # "-0" would be read as the integer 0
        return short if float(short) == value else repr(value)  # The text is read as the same number.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # DEL is invalid in TOML.
