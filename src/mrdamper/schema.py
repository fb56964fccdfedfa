"""Records: data classes that define the content of TOML, JSON, options, requests.

A record is a frozen dataclass. The type of a field defines its values. An ``Option`` adds unit and range. The
text below a field is its help::

    @dataclass(frozen=True, kw_only=True)
    class Body:
        length: Annotated[float, Option(key="length_mm", unit="mm", above=0.0)]
        '''Length including the caps.'''

    body = read_record(Body, table, place="damper.toml: body")     # Body(length=0.06): SI inside
    table = write_record(body)                                      # {"length_mm": 60.0}

If a field has a ``key`` and a unit, the record contains its value in SI (kelvin), and the file in this unit.

All faults of a document are reported in one ``InputError``, one line for each: place, key, found value and
expected value. ``__post_init__`` checks combinations of fields and raises an ``InputError``. This module adds
the place to that error. Pydantic checks the values. It is loaded on first use.
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
from functools import cache
from itertools import chain, pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar, Union, get_args, get_origin

from mrdamper.errors import InputError, MrdamperError
from mrdamper.interrupts import hold_interrupts
from mrdamper.quantities import ZERO_CELSIUS_K

Json = dict[str, Any]
"""A JSON object or a TOML table."""

Record = TypeVar("Record")

_SHOWN_NAMES_MAX = 40  # max number of known names in one message
_VALUE_LENGTH_MAX = 60  # max number of characters of a value in a message
_UNIT_HINTS = {"m/s": "A speed in km/h is 1/3.6 of it in m/s"}  # unit: hint in messages about this unit
_SCALES = {"mm": 1e-3, "g": 1e-3, "ms": 1e-3, "percent": 1e-2, "kN": 1e3, "min": 60.0}
MORE = "More"  # heading of the fields that are rarely changed
_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text", Path: "a path"}


@dataclass(frozen=True, slots=True)
class Option:
    """Properties of a field in addition to its type, such as help, unit and range.

    The range includes ``least`` and ``most``, and excludes ``above`` and ``below``. These limits are in
    ``unit``. If an annotation contains several options, the options are merged. If two options define the
    same property, the last option decides. Therefore a field can extend a shared type.
    """

    help: str = ""  # help text, used if there is no text below the field
    unit: str = ""
    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None
    # Name in files and requests, if it differs from the name of the field. If ``key`` and ``unit`` are set,
    # the value in files and requests is in ``unit``, and the value of the field is in SI.
    key: str = ""
    flag: str = ""  # option of the command line if it is not --field-name; "-" hides the field there
    metavar: str = ""
    among: Callable[[], Iterable[str]] | None = None  # choices that are determined at run time
    default_help: str = ""  # meaning of the default None
    pattern: str = ""
    expected: str = ""  # expected value in messages; empty: derived from type, unit and range
    most_items: int | None = None
    least_items: int | None = None
    # The next properties apply only to inputs and outputs of jobs.
    read: str = ""  # function that reads a path or preset, as ``module:function``; empty: value unchanged
    reading: tuple[str, ...] = ()  # names of the options for reading, which are keyword arguments of ``read``
    argument: bool = False  # positional argument of the command line
    output: bool = False  # path of an output
    local: bool = False  # True: missing in requests to a server, because the field can execute code
    # The next properties apply only to web forms.
    label: str = ""  # empty: derived from the name
    group: str = ""  # heading above the field; empty: the field is above the first heading
    titles: tuple[str, ...] = ()  # labels of the choices, in their order
    begins: Any = None  # initial value in the form if it differs from the default
    offers: str = ""  # group of proposed names (``jobs.previews.choices``)
    places: tuple[str, ...] = ()  # subfolders of the work folder with selectable files
    files: str = ".toml"  # suffix of selectable inputs
    looks: tuple[str, ...] = ()  # accepted kinds of input files (``jobs.previews.choices``)
    word: str = ""  # name of the kind of input, such as "card"
    part: str = ""  # part of the geometry file that the field enables; the field is locked without the part

    __is_annotated_types_grouped_metadata__: ClassVar[Literal[True]] = True

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
            yield pydantic.PlainSerializer(self.from_si, when_used="unless-none")

    @property
    def non_defaults(self) -> Json:
        """Return the properties that differ from their default."""
        pairs = ((each, getattr(self, each.name)) for each in dataclasses.fields(self))
        return {each.name: value for each, value in pairs if value != each.default}

    @property
    def remedy(self) -> str:
        """Return a hint for messages: typical cause of a wrong name or value; empty if there is none."""
        return _UNIT_HINTS.get(self.unit, "")

    @property
    def _limits(self) -> list[tuple[str, Callable[[float, float], bool], float]]:
        limits = (
            *(("above", operator.gt, self.above), ("at least", operator.ge, self.least)),
            *(("below", operator.lt, self.below), ("at most", operator.le, self.most)),
        )
        return [(words, fits, limit) for words, fits, limit in limits if limit is not None]

    @property
    def range_words(self) -> str:
        """Return the range in words, such as ``above 0 and at most 5 mm``; empty if there is none."""
        if self.least is not None and self.most is not None:
            return f"{self.least:g} to {self.most:g}"
        return " and ".join(f"{words} {limit:g}" for words, _, limit in self._limits)

    def holds(self, value: float) -> bool:
        """Return True if a number, in file units, is finite and in the range."""
        return math.isfinite(value) and all(fits(value, limit) for _, fits, limit in self._limits)

    def to_si(self, value: float | None) -> float | None:
        """Convert a value from the unit of the file to SI. None stays None."""
        if value is None:
            return None
        return value + ZERO_CELSIUS_K if self.unit == "degC" else value * _SCALES.get(self.unit, 1.0)

    def from_si(self, value: float) -> float:
        """Convert a value from SI to the unit of the file."""
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
    type: Any  # such as float for ``Annotated[float | None, Option()]``
    optional: bool  # None is allowed
    default: Any  # dataclasses.MISSING if the field is required
    option: Option
    record: type
    many: bool  # The field is a list.
    item: Any  # type of the items if the field is a list, otherwise ``type``
    item_option: Option  # option of the items if the field is a list, otherwise ``option``

    @property
    def required(self) -> bool:
        return self.default is dataclasses.MISSING

    @property
    def flag(self) -> str:
        """Return the name of the option on the command line."""
        return self.option.flag or f"--{self.name.replace('_', '-')}"

    @property
    def help(self) -> str:
        """Return the text below the field, or else the help of its option."""
        names = [(each.__module__, each.__name__) for each in self.record.__mro__ if each is not object]
        texts = (_field_texts(module).get((name, self.name)) for module, name in names)
        return next(filter(None, texts), self.option.help)

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
        return self.words.removeprefix(self._list_words)

    @property
    def words(self) -> str:
        """Return the expected value, such as ``a number in mm, above 0``."""
        if self.option.expected:
            return self.option.expected
        if self.choices:
            return f"{self._list_words}one of: {', '.join(self.choices)}"
        kind = _WORDS.get(get_origin(self.item) or self.item, "a table")
        unit = f" in {self.option.unit}" if self.option.unit else ""
        limits = f", {self.option.range_words}" if self.option.range_words else ""
        return f"{self._list_words}{kind}{unit}{limits}"

    @property
    def _list_words(self) -> str:
        items = get_args(self.type) if self.many else ()
        return "a list, each " if ... in items else f"a list of {len(items)}, each " if items else ""


@cache
def _field_texts(module: str) -> dict[tuple[str, str], str]:
    """Return the text below each field in a module, by names of class and field."""
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


def fields_of(record: Any) -> tuple[Field, ...]:  # noqa: ANN401 - a dataclass
    """Return the fields of a record, in order. Pydantic is not loaded."""
    return _declared(record)[0]


def class_fields_of(record: Any) -> tuple[Field, ...]:  # noqa: ANN401 - a dataclass
    """Return the class variables of a record as fields, in order."""
    return _declared(record)[1]


@cache
def _declared(record: Any) -> tuple[tuple[Field, ...], tuple[Field, ...]]:  # noqa: ANN401
    # Annotations are evaluated in the namespace of the module, because they can contain lambda functions.
    names: dict[str, Any] = {}
    for base in reversed(record.__mro__):
        names |= vars(sys.modules[base.__module__])
    hints = typing.get_type_hints(record, globalns=names, include_extras=True)
    fields = []
    for each in dataclasses.fields(record):
        default: Any = each.default if each.default_factory is dataclasses.MISSING else each.default_factory()
        fields += [_field(record, each.name, hints[each.name], default)] if each.init else []
    variables = (
        _field(record, name, get_args(hint)[0], getattr(record, name, dataclasses.MISSING))
        for name, hint in hints.items()
        if get_origin(hint) is ClassVar
    )
    return tuple(fields), tuple(variables)


def _field(record: type, name: str, hint: object, default: object) -> Field:
    kind, option, optional = _split_annotation(hint)
    many = get_origin(kind) is tuple
    item, item_option, _ = _split_annotation(get_args(kind)[0]) if many else (kind, option, optional)
    key = option.key or name
    return Field(name, key, kind, optional, default, option, record, many, item, item_option)


def _split_annotation(hint: Any) -> tuple[Any, Option, bool]:  # noqa: ANN401 - a type
    """Return the type and the merged options of an annotation, and True if the annotation allows None."""
    given: Json = {}
    optional = False
    while True:
        if get_origin(hint) is Annotated:
            hint, *extras = get_args(hint)
            options = (each.non_defaults.items() for each in extras if isinstance(each, Option))
            given = dict(chain(*options)) | given
        elif get_origin(hint) in (Union, types.UnionType) and type(None) in get_args(hint):
            optional = True
            rest = tuple(each for each in get_args(hint) if each is not type(None))
            hint = rest[0] if len(rest) == 1 else Union[rest]  # noqa: UP007 - evaluated at run time
        else:
            return hint, Option(**given), optional


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
        found: Record = _adapter(typing.cast("Any", record)).validate_json(text, strict=True)
    except ValidationError as error:
        faults = [_fault(record, each, place) for each in error.errors(include_url=False)]
        raise InputError(faults=list({str(fault): fault for fault in faults}.values())) from None
    return found


@cache
def _adapter(record: Any) -> Any:  # noqa: ANN401 - of a dataclass, a TypeAdapter loaded late
    from pydantic import TypeAdapter

    for each in _records_in(record):
        if "__pydantic_config__" not in vars(each):
            keys = {field.name: field.key for field in fields_of(each)}
            config = {"extra": "forbid", "allow_inf_nan": False, "alias_generator": keys.__getitem__}
            each.__pydantic_config__ = config
    with hold_interrupts():  # Pydantic can lose an exception that a signal handler raises.
        return TypeAdapter(record)


def _records_in(kind: Any) -> Iterator[Any]:  # noqa: ANN401 - types
    """Generate the dataclasses in a type, including the type itself."""
    is_record = isinstance(kind, type) and dataclasses.is_dataclass(kind)
    if is_record:
        yield kind
    for part in (field.type for field in fields_of(kind)) if is_record else get_args(kind):
        yield from _records_in(part)


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
    if kind.startswith(("unexpected", "extra")):
        known, _ = _locate(record, parents)
        words = f"{where} has no key" if where else "unknown key"
        unknown = str(last)[:_VALUE_LENGTH_MAX]
        error = unknown_name(f"{words} {unknown!r}", str(last), [each.key for each in known], place)
        hints = (each.option.remedy for each in known if each.key in error.remedy)
        error.remedy = " ".join(filter(None, (error.remedy, next(hints, ""))))
        return error
    _, field = _locate(record, location)
    expected, remedy = str(message).removeprefix("Input should be "), ""
    if field is not None:  # ``location`` is the whole field, or an item of a list.
        expected = field.words if last == field.key else field.item_words
        remedy = field.option.remedy
    if kind.startswith("missing"):
        return InputError(f"{whole} is missing", place=place, expected=expected)
    if not whole:
        return InputError(f"it is {_shown(fault['input'])}", place=place, expected="a table")
    return InputError(f"{whole} is {_shown(fault['input'])}", place=place, expected=expected, remedy=remedy)


def _locate(record: type, place: Sequence[int | str]) -> tuple[tuple[Field, ...], Field | None]:
    """Return the fields of the table at a location, and the field at the location."""
    known, field = fields_of(record), None
    for part in place:
        inner = next((each for each in known if each.key == part), None)
        if inner is not None:
            field, tables = inner, list(_records_in(inner.type))
            known = fields_of(tables[0]) if tables else ()
        elif field is not None and isinstance(part, str) and get_origin(field.type) is Mapping:
            value = get_args(field.type)[1]
            field = dataclasses.replace(field, type=value, item=value)
    return known, field


def _shown(value: object) -> str:
    words = str(value) if isinstance(value, float) else repr(value)
    return words if len(words) <= _VALUE_LENGTH_MAX else f"{words[:_VALUE_LENGTH_MAX]} ..."


def unknown_name(found: str, name: str, known: Iterable[str], place: str | Path = "") -> InputError:
    """Return the error for an unknown name, with the nearest known names or a list of all known names.

    Upper and lower case are not distinguished. A long list of names is cut.
    """
    names = {each.lower(): each for each in known}
    near = difflib.get_close_matches(name.lower(), names, n=3, cutoff=0.6)
    if near:
        remedy = f"did you mean {' or '.join(names[each] for each in near)}?"
        return InputError(found, place=place, remedy=remedy)
    shown = list(names.values())[:_SHOWN_NAMES_MAX]
    more = f" and {len(names) - len(shown)} more" if len(names) > len(shown) else ""
    return InputError(found, place=place, expected=f"one of: {', '.join(shown)}{more}" if names else "none")


def check_ranges(record: object, place: str) -> None:
    """Check numbers and choices of a record that was created in Python.

    Raises
    ------
    InputError
        If a field is not finite, outside its range, or not among its choices; one line for each field.
    """
    faults = []
    for field in fields_of(type(record)):
        value, option = getattr(record, field.name), field.option
        for each in value if field.many and isinstance(value, tuple) else (value,):
            found = each
            if isinstance(each, int | float) and not isinstance(each, bool):
                found = option.from_si(each) if option.key else each
                is_valid = option.holds(found) and (field.item is not int or found == int(found))
            elif field.item in (int, float):
                is_valid = not isinstance(each, str | bool)
            else:
                is_valid = not isinstance(each, str) or not field.choices or each in field.choices
            if not is_valid:
                words = f"{place}.{field.key} is {_shown(found)}"
                expected = field.words if each is value else field.item_words
                faults.append(InputError(words, expected=expected, remedy=option.remedy))
    if faults:
        raise InputError(faults=faults)


def write_record(record: object, *, defaults: bool = False, nulls: bool = False) -> Json:
    """Return a record as a document for ``read_record``.

    Fields with their default value are written only if ``defaults`` is True. Fields with the value None are
    written only if ``nulls`` is True (null in JSON).
    """
    omitted = {"exclude_defaults": not defaults, "exclude_none": not nulls}
    table: Json = _adapter(typing.cast("Any", type(record))).dump_python(
        record, mode="json", by_alias=True, warnings=False, fallback=dict, **omitted
    )
    return table


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
