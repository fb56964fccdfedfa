"""Generate C99 source code for an export (target): unchanged kernel files, tables, thin wrappers.

The kernel files, the meaning of flags and their numbers are read from the installed C sources. The templates
print the values of a ``Target``. Each number is printed as the shortest decimal that a compiler
converts to the same float or double. Therefore a card gives the same files on every machine, and the compiled
code computes with exactly the same numbers as Python.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from mrdamper import __version__
from mrdamper.codegen.record import Verification
from mrdamper.codegen.structs import (
    FROZEN_K,
    HORIZON_S,
    Nested,
    Pointer,
    Table,
    Value,
    steps_between_updates,
    thermal_members,
    track_members,
)
from mrdamper.codegen.target import Precision, Target
from mrdamper.codegen.verification_rows import replay_columns, replay_outputs
from mrdamper.errors import InputError

if TYPE_CHECKING:
    from jinja2 import Environment


_REAL_BYTES = {"float": 4, "double": 8}
_ENTRY, _THERMAL_ENTRY = "controller.c", "thermal.c"
"""Main kernel files of an export. The files that they include are exported as well."""


@cache
def kernel_files(*, thermal: bool = False) -> Mapping[str, str]:
    """Return the texts of all kernel files that an export needs, by file name."""
    folder = files("mrdamper.core").joinpath("kernel")
    found: dict[str, str] = {}
    waiting = [_ENTRY, *([_THERMAL_ENTRY] if thermal else [])]
    while waiting:
        name = waiting.pop(0)
        if name not in found:
            found[name] = folder.joinpath(name).read_bytes().decode("utf-8")
            waiting += re.findall(r'^\s*#\s*include\s+"([^"]+)"', found[name], re.MULTILINE)
    return dict(sorted(found.items()))


@dataclass(frozen=True, slots=True)
class FlagText:
    """A flag of the kernel: name in C, value (one bit), and meaning."""

    name: str
    value: int
    text: str


@cache
def flag_texts() -> tuple[FlagText, ...]:
    """Return the flags that the header ``controller.h`` of the kernel defines."""
    found = re.search(
        r"/\* Flags of the last step.*?\benum \{(.*?)\};", kernel_files()["controller.h"], re.DOTALL
    )
    lines = re.findall(
        r"(MRD_\w+) = (\d+),?[ \t]*(?:/\*\s*(.*?)\s*\*/)?", found[1] if found else "", re.DOTALL
    )
    return tuple(
        FlagText(
            name, int(bit), re.sub(r"\s+", " ", text or name.partition("_")[2].replace("_", " ").lower())
        )
        for name, bit, text in lines
    )


def c_files(target: Target, record: Verification | None = None) -> dict[str, str]:
    """Return the texts of all exported C files and their README, by file name.

    If the ``record`` of a verification is given, the README contains its measured code sizes.
    """
    name = target.name
    context = _context(target) | {"record": record}
    render = environment().get_template

    def text(template: str) -> str:
        return render(template).render(context)

    return {
        **kernel_files(thermal=target.thermal is not None),
        **{f"{name}_thermal.{end}": text(f"damper_thermal.{end}.j2") for end in "hc" if target.thermal},
        f"{name}.h": text("damper.h.j2"),
        f"{name}.c": text("damper.c.j2"),
        f"{name}_tables.c": text("damper_tables.c.j2"),
        "main.c": text("main.c.j2"),
        "CMakeLists.txt": text("CMakeLists.txt.j2"),
        "README.md": text("README.md.j2"),
        "misra.md": files("mrdamper.codegen").joinpath("misra.md").read_text(encoding="utf-8"),
    }


def sources_sha256(sources: Mapping[str, str]) -> str:
    """Return the hash of the C files in ``sources``. A verification is valid only for this hash."""
    digest = hashlib.sha256()
    for name, text in sorted(sources.items()):
        if name.endswith((".c", ".h")):
            for part in (name, text):
                data = part.encode("utf-8")
                digest.update(len(data).to_bytes(8, "big") + data)
    return f"sha256:{digest.hexdigest()}"


def tables_bytes(target: Target) -> int:
    """Return the total size of all tables in the compiled code [bytes]. Shared tables are counted once."""
    return sum(_print_parts(target, thermal=thermal).table_bytes for thermal in (False, True))


def literal(value: float, precision: Precision) -> str:
    """Return a C literal that the compiler converts to the given value in this number type.

    Raises
    ------
    InputError
        If the value is not finite, or too large for a float.
    """
    kind = np.float32 if precision == "float" else np.float64
    with np.errstate(over="ignore"):
        number = kind(value)
    if not np.isfinite(number):
        raise InputError(
            place="export",
            found=f"a number of the tables is {value!r}",
            expected=f"one that a {precision} holds",
        )
    text = np.format_float_positional(number, unique=True, trim="0")
    if len(text) > 12:
        text = np.format_float_scientific(number, unique=True, trim="0")
    return text + ("f" if precision == "float" else "")


def banner(target: Target) -> str:
    """Return the comment at the beginning of every generated file, without comment marks."""
    damper = target.card.damper
    warm = damper.temperature_range
    held = "" if warm is None else f", temperatures held at {warm[0]:g} and {warm[1]:g} K"
    content = ["model"] if target.model is not None else []
    if target.controller is not None:
        content.append(f"controller ({target.controller.name})")
    if target.thermal is not None:
        content.append(f"thermal model of {target.thermal.states} states")
    return "\n".join(
        [
            f"Generated by mrdamper {__version__} from a model card; not meant to be edited.",
            f"card        {_escape(target.card.title)}",
            f"fingerprint {target.fingerprint}",
            f"law         {target.law}{held}",
            f"content     {', '.join(content)}",
            f"numbers     {target.precision}; SI units, kelvin; command in {target.command_unit}, "
            f"0 to {target.largest:g} {target.command_unit}",
            f"step        {1e3 * target.period_s:g} ms ({target.rate_Hz:g} Hz)",
            f"heating     {target.heating.capacity_J_K:.4g} J/K, {target.heating.loss_W_K:.3g} W/K "
            f"({_escape(target.heating.source)}): detects a frozen thermometer",
        ]
    )


@cache
def environment() -> Environment:
    """Return the Jinja environment; its filter ``plain`` makes texts safe in C comments."""
    import jinja2

    made = jinja2.Environment(
        loader=jinja2.PackageLoader("mrdamper.codegen", "templates"),
        autoescape=False,  # C, CMake and Markdown need no HTML escapes; ``plain`` cleans user texts.
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    made.filters["plain"] = _escape
    return made


@dataclass(frozen=True, slots=True)
class _Array:
    """A constant table as C text."""

    name: str
    comment: str
    values: tuple[str, ...]

    @property
    def lines(self) -> Iterator[str]:
        values_per_line = 8
        for start in range(0, len(self.values), values_per_line):
            yield ", ".join(self.values[start : start + values_per_line])


@dataclass(frozen=True, slots=True)
class _Struct:
    """A constant struct: C type, name, and pairs of member name and C text."""

    kind: str
    name: str
    members: tuple[tuple[str, str], ...]


def _thermal(target: Target) -> dict[str, Value]:
    model = target.thermal
    return {} if model is None else thermal_members(model, target.period_s, target.amperes)


class _Print:
    """C text of all structs and tables of an export part; equal tables are shared."""

    def __init__(self, target: Target, *, thermal: bool = False) -> None:
        self.arrays: list[_Array] = []
        self.inner: list[_Struct] = []
        self._target = target
        parts = {kind: ("mrd_track", track_members(part)) for kind, part in target.parts.items()}
        if thermal:
            members = _thermal(target)
            parts = {"thermal": ("mrd_thermal", members)} if members else {}
        self.parts = [
            _Struct(kind, f"{target.name}_{part}_data", self._members(part, members))
            for part, (kind, members) in parts.items()
        ]

    @property
    def table_bytes(self) -> int:
        return sum(len(array.values) for array in self.arrays) * _REAL_BYTES[self._target.precision]

    def _members(self, place: str, members: Mapping[str, Value]) -> tuple[tuple[str, str], ...]:
        return tuple((name, self._text(f"{place}_{name}", value)) for name, value in members.items())

    def _text(self, place: str, value: Value) -> str:
        if isinstance(value, Table):
            return self._array(place, value)
        if isinstance(value, Nested):
            inner = ", ".join(f".{name} = {text}" for name, text in self._members(place, value.members))
            return f"{{{inner}}}"
        if isinstance(value, Pointer):
            return self._pointer(place, value)
        if isinstance(value, tuple):
            return f"{{{', '.join(self._text(place, each) for each in value)}}}"
        return str(value) if isinstance(value, int) else literal(value, self._target.precision)

    def _array(self, place: str, table: Table) -> str:
        printed = tuple(literal(value, self._target.precision) for value in np.ravel(table.values).tolist())
        for array in self.arrays:
            if array.values == printed:
                return array.name
        name = f"{self._target.name}_{place}"
        self.arrays.append(_Array(name, table.comment, printed))
        return name

    def _pointer(self, place: str, value: Pointer) -> str:
        if value.members is None:
            return "NULL"
        members = self._members(place, value.members)
        for struct in self.inner:
            if (struct.kind, struct.members) == (value.kind, members):
                return f"&{struct.name}"
        self.inner.append(_Struct(value.kind, f"{self._target.name}_{place}", members))
        return f"&{self.inner[-1].name}"


@lru_cache(maxsize=8)
def _print_parts(target: Target, *, thermal: bool = False) -> _Print:
    """Return the C text for model and controller, or for the thermal model; cached."""
    return _Print(target, thermal=thermal)


def _context(target: Target) -> dict[str, Any]:
    kernel = hashlib.sha256("".join(kernel_files().values()).encode("utf-8")).hexdigest()
    digest = hashlib.sha256(f"{kernel} {target.precision}".encode()).hexdigest()
    printed = _print_parts(target)
    return {
        "target": target,
        "name": target.name,
        "NAME": target.name.upper(),
        "banner": banner(target),
        "unit": target.command_unit,
        "columns": replay_columns(target),
        "outputs": [column for part in replay_outputs(target).values() for column in part.values()],
        "printed": printed,
        "kernel_digest": f"0x{digest[:8]}",
        "digits": 9 if target.single else 17,
        "flags": flag_texts(),
        "envelope": target.card.envelope,
        "kernel_files": list(kernel_files(thermal=target.thermal is not None)),
        "options": target.compile_options,
        "tables_bytes": tables_bytes(target),
        "thermal": _print_parts(target, thermal=True),
        "literal": literal,
        "thermal_horizon": HORIZON_S,
        "thermal_frozen": FROZEN_K,
        "thermal_update": steps_between_updates(target.period_s) * target.period_s,
    }


def _escape(text: str) -> str:
    """Convert a user's text to one line of ASCII that is safe in a C comment."""
    one_line = " ".join(text.split()).encode("ascii", "backslashreplace").decode("ascii")
    return re.sub(r"\?(?=\?)", "? ", one_line.replace("*/", "* /").replace("/*", "/ *")).rstrip("\\")
