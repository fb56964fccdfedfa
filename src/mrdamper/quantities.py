"""Quantities: roles of rig channels, their SI units, plausible ranges and header names.

Readers convert with :func:`to_si`; all other modules use SI and kelvin. ``data.channels`` assigns columns to
roles.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from mrdamper.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mrdamper.arrays import FloatArray

ZERO_CELSIUS_K = 273.15
"""0 degC [K]. The package uses kelvin internally. Jobs and their interfaces use degC."""

REFERENCE_K = 293.15
"""20 degC [K], the reference of temperature factors and coil resistances."""

CommandUnit = Literal["A", "V"]
"""Unit of the command of a damper: the current of the coil, or the voltage of its driver."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity in a channel of a rig file.

    ``low`` and ``high`` are the plausible range [SI] for a damper on a rig. Values outside this range are due
    to a wrong unit or a failed sensor. ``headers`` are names of the quantity in column headers. Upper and
    lower case are distinguished only in names of one letter. ``units`` are listed in messages.
    """

    role: str
    symbol: str
    unit: str  # SI unit of ``to_si``
    low: float
    high: float
    headers: tuple[str, ...]
    units: tuple[str, ...]


_TABLE = (
    Quantity(
        "time", "t", "s", -1e11, 1e11,
        (
            *("time", "running time", "elapsed time", "t", "zeit", "tempo", "temps", "tiempo", "czas"),
            *("время", "zaman", "时间", "時間", "시간"),
        ),
        ("s", "ms", "min"),
    ),
    Quantity(
        "displacement", "x", "m", -2, 2,
        (
            "displacement", "axial displacement", "disp", "displ", "position", "pos", "stroke", "x", "weg",
            "desplazamiento", "deslocamento", "déplacement", "spostamento", "位移", "行程", "変位", "변위",
            "extension", "travel", "hub", "gauge", "course", "carrera", "curso", "corsa", "przemieszczenie",
            "перемещение", "ход", "siirtymä", "elmozdulás", "verplaatsing", "förskjutning", "forskyvning",
        ),
        ("m", "mm", "in"),
    ),
    Quantity(
        "velocity", "v", "m/s", -10, 10,
        (
            "velocity", "speed", "vel", "geschwindigkeit", "velocidad", "velocidade", "vitesse", "velocità",
            "速度", "속도",
        ),
        ("m/s", "mm/s", "in/s"),
    ),
    Quantity(
        "force", "F", "N", -1e6, 1e6,
        (
            "force", "axial force", "load", "axial load", "kraft", "fuerza", "força", "forza", "力", "阻尼力",
            "载荷", "荷重", "하중", "effort", "siła", "carga", "усилие", "сила", "нагрузка",
            "voima", "kracht", "síla", "kuvvet",
        ),
        ("N", "kN", "kgf", "lbf"),
    ),
    Quantity(
        "current", "I", "A", -100, 100,
        ("current", "strom", "corriente", "corrente", "courant", "prąd", "ток", "电流", "電流", "전류",
         "virta", "stroom", "ström", "strøm", "proud", "áram", "akım"),
        ("A", "mA"),
    ),
    Quantity(
        "voltage", "U", "V", -1000, 1000,
        (
            "voltage", "spannung", "tensione", "tension", "tensión", "tensão", "voltaje", "napięcie",
            "напряжение", "电压", "電圧", "전압",
        ),
        ("V", "mV"),
    ),
    Quantity(
        "temperature", "T", "K", 223, 453,
        ("temperature", "temp", "temperatur", "temperatura", "température", "температура", "温度", "油温",
         "온도", "lämpötila", "temperatuur", "teplota", "hőmérséklet", "sıcaklık"),
        ("K", "degC", "degF"),
    ),
)  # fmt: skip

QUANTITIES: Mapping[str, Quantity] = MappingProxyType({quantity.role: quantity for quantity in _TABLE})

# Spellings of units in rig files, in lower case, without blanks, dots and parentheses. Units that Pint can
# interpret need no entry.
_SPELLINGS: Mapping[str, str] = MappingProxyType(
    {
        "sec": "s", "secs": "s", "sek": "s", "seg": "s", "sn": "s", "second": "s", "seconds": "s",
        "msec": "ms", "msecs": "ms", "millis": "ms", "micros": "us",
        "metre": "m", "meter": "m", "metres": "m", "meters": "m", "millimetre": "mm", "millimeter": "mm",
        "millimetres": "mm", "millimeters": "mm", "inch": "in", "inches": "in", "micron": "um",
        "mil": "thou", "mils": "thou",
        "m_s": "m/s", "mm_s": "mm/s", "in_s": "in/s", "m/sec": "m/s", "mm/sec": "mm/s", "in/sec": "in/s",
        "m_per_s": "m/s", "mm_per_s": "mm/s", "ms-1": "m/s", "mms-1": "mm/s",
        "newton": "N", "newtons": "N", "kilonewton": "kN", "kp": "kgf", "lbf": "lbf", "lbsf": "lbf",
        "kip": "kip", "kips": "kip", "klbf": "kip",
        "amp": "A", "amps": "A", "ampere": "A", "amperes": "A", "milliamp": "mA", "milliamps": "mA",
        "volt": "V", "volts": "V", "millivolt": "mV", "millivolts": "mV",
        "deg_c": "degC", "degc": "degC", "°c": "degC", "℃": "degC", "celsius": "degC", "deg.c": "degC",
        "deg_f": "degF", "degf": "degF", "°f": "degF", "fahrenheit": "degF", "kelvin": "K", "deg_k": "K",
        "ºc": "degC", "ºf": "degF", "초": "s", "秒": "s",
        # Cyrillic letters
        "с": "s", "м": "m", "мм": "mm", "см": "cm", "м/с": "m/s", "мм/с": "mm/s", "н": "N", "кн": "kN",
        "кгс": "kgf", "а": "A", "в": "V", "°с": "degC",
    }
)  # fmt: skip
# Spellings that are ambiguous without the role (quantity) of the column. For example, F is degF for a
# temperature only. MS and MA have no entry because M can mean mega.
_SPELLINGS_OF_ROLE: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "time": {"S": "s", "SEC": "s", "мс": "ms"},
        "displacement": {"MM": "mm", "CM": "cm", "IN": "in", "M": "m"},
        "velocity": {"MM/S": "mm/s", "M/S": "m/s", "IN/S": "in/s", "mps": "m/s", "ips": "in/s"},
        "force": {
            "KN": "kN",
            "kn": "kN",
            "n": "N",
            "daN": "daN",
            "dan": "daN",
            "LBF": "lbf",
            "KGF": "kgf",
            "lbs": "lbf",
        },
        "current": {"a": "A", "ma": "mA", "мА": "mA"},
        "voltage": {"v": "V", "mv": "mV", "мВ": "mV"},
        "temperature": {"C": "degC", "F": "degF", "c": "degC", "f": "degF", "k": "K"},
    }
)
# Conversions of frequent units, equal to Pint (a test compares them), because Pint is slow to load.
_FREQUENT_UNITS: Mapping[tuple[str, str], tuple[float, float]] = MappingProxyType(
    {
        ("time", "ms"): (1e-3, 0.0),
        ("displacement", "mm"): (1e-3, 0.0),
        ("velocity", "mm/s"): (1e-3, 0.0),
        ("force", "kN"): (1e3, 0.0),
        ("current", "mA"): (1e-3, 0.0),
        ("voltage", "mV"): (1e-3, 0.0),
        ("temperature", "degC"): (1.0, ZERO_CELSIUS_K),
        ("temperature", "degF"): (0.5555555555555429, 255.37222222222223),
        ("time", "min"): (60.0, 0.0),
        ("displacement", "cm"): (1e-2, 0.0),
        ("displacement", "in"): (0.0254, 0.0),
        ("velocity", "in/s"): (0.0254, 0.0),
        ("force", "daN"): (10.0, 0.0),
        ("force", "kgf"): (9.80665, 0.0),
        ("force", "lbf"): (4.4482216152605005, 0.0),
    }
)
# Units of quantities without a role, such as pressure. They are recognised without loading Pint.
_UNITS_WITHOUT_ROLE = frozenset(
    {
        "-",
        "%",
        "1",
        "hz",
        "khz",
        "rpm",
        "bar",
        "pa",
        "kpa",
        "mpa",
        "psi",
        "g",
        "m/s2",
        "m/s^2",
        "m/s²",
        "mm/s2",
        "w",
    }
    | {
        "kw",
        "j",
        "nm",
        "n m",
        "n·m",
        "deg",
        "°",
        "rad",
        "count",
        "counts",
        "bit",
        "bits",
        "raw",
        "none",
        "ohm",
        "n/a",
    }
    | {
        "pas",
        "mpas",
        "cp",
        "mt",
        "a/m",
        "ka/m",
        "1/s",
        "s-1",
        "1/min",
        "l/min",
        "mnm",
    }
)
# Prefixes of other units are not used on rigs: "fd" is the name of a column, and no femtoday.
_PREFIXED_UNITS = frozenset({"second", "meter", "inch", "newton", "force_gram", "ampere", "volt", "kelvin"})
_LIKELY_UNIT = re.compile(r"[A-Za-zµμ°Ω]{1,12}([\s/*·^._-]{1,2}[A-Za-z0-9]{1,6}){0,2}[²³]?")
_HEADER_WORDS = frozenset(word for quantity in _TABLE for word in quantity.headers if len(word) > 2)
_ROLE_OF: Mapping[str, str] = MappingProxyType(
    {unit: quantity.role for quantity in _TABLE for unit in (quantity.unit, *quantity.units)}
)
# Longer texts, other characters, and numbered names such as "column 3" are not units.
_UNIT = re.compile(r"(?!.*[^\W\d]\s\d)[\w\s°℃%/*^·².+()-]{1,32}")
# Exponent of one digit, such as s**2 or m^-1.
_POWER = re.compile(r"(?<=\w)\s*(?:\*\*|\^)\s*-?\d(?![\w.]|\s*(?:\*\*|\^))")


def find_quantity(role: str) -> Quantity:
    """Return the quantity of a role; raise InputError if the role is unknown."""
    if role not in QUANTITIES:
        raise InputError(f"{role!r} is not a role of a channel", expected=f"one of: {', '.join(QUANTITIES)}")
    return QUANTITIES[role]


def to_degC(kelvin: float) -> float:
    """Return a temperature in degC."""
    return kelvin - ZERO_CELSIUS_K


def spell_unit(unit: str, role: str) -> str:
    """Return the Pint name of a unit that a rig file spells as ``deg_C``, ``Sec`` or ``Newtons``."""
    text = unit.strip()
    if text[:1] + text[-1:] in {"[]", "()"}:
        text = text[1:-1].strip()
    spelling = _SPELLINGS_OF_ROLE.get(role, {}).get(text)
    if spelling is not None:
        return spelling
    bare = re.sub(r"[\s·*^]", "", text).lower()
    return _SPELLINGS.get(bare, text)


def to_si(values: ArrayLike, unit: str, role: str) -> FloatArray:
    """Return the values of a role, converted from a unit to the SI unit of the role, as float64.

    Raises
    ------
    InputError
        If the unit is unknown or does not belong to the role.
    """
    import numpy as np

    array = np.asarray(values, dtype=np.float64)
    quantity = find_quantity(role)
    spelled = spell_unit(unit, role)
    if spelled == quantity.unit:  # Pint is not required.
        return array
    scale, zero = _line_to_si(spelled, role, unit)
    with np.errstate(over="ignore", invalid="ignore"):  # The range checks reject values that overflow.
        return array * scale if zero == 0.0 else array * scale + zero


@cache
def _line_to_si(spelled: str, role: str, found: str) -> tuple[float, float]:
    """Return factor and offset of the linear conversion from a unit to the SI unit of the role."""
    usual = _FREQUENT_UNITS.get((role, spelled))
    if usual is not None:
        return usual
    quantity = QUANTITIES[role]
    choices = ", ".join(quantity.units)
    if not spelled:
        raise InputError(f"{role} has no unit", expected=f"one of: {choices}")
    stored = "" if role == "time" else f" (stored in {quantity.unit})"
    refusal = InputError(
        f"unit {found[:40]!r} is not a unit of {role}{stored}", expected=f"one of: {choices}"
    )
    unbounded = re.search(r"\*\*|\^", _POWER.sub("", spelled))  # Pint evaluates N**9**9**9 for hours.
    if not _UNIT.fullmatch(spelled) or unbounded or _ROLE_OF.get(spelled, role) != role:
        raise refusal
    import tokenize

    import pint

    try:
        unit = pint.application_registry.Unit(spelled)
        names = pint.application_registry.parse_unit_name(spelled)
        zero, one = (
            float(pint.application_registry.Quantity(x, unit).to(quantity.unit).magnitude) for x in (0.0, 1.0)
        )
    # The parser of Pint raises any of these on invalid units.
    except (
        *(pint.errors.PintError, tokenize.TokenError, SyntaxError, RecursionError, MemoryError),
        *(AssertionError, ArithmeticError, AttributeError, LookupError, ValueError, TypeError),
    ) as error:
        raise refusal from error
    is_odd = names and all(prefix and name not in _PREFIXED_UNITS for prefix, name, _ in names)
    if is_odd or not 1e-13 < one - zero < 1e9:  # "Ts" and "fs" are no units of time.
        raise refusal
    return one - zero, zero


@cache
def roles_of_unit(unit: str) -> tuple[str, ...]:
    """Return the roles for which a unit is valid, typically one; else an empty tuple."""
    if not unit or unit.strip("[]() ").lower() in _UNITS_WITHOUT_ROLE:
        return ()
    roles_without_pint = tuple(role for role in QUANTITIES if _is_frequent(spell_unit(unit, role), role))
    if roles_without_pint:
        return roles_without_pint
    bare = unit.strip("[]() ")
    named = _HEADER_WORDS.intersection((bare.lower(), *re.split(r"[\s_.-]", bare.lower(), maxsplit=1)[:1]))
    # Column names such as time_s and force are not units.
    likely = _LIKELY_UNIT.fullmatch(bare) is not None and not named
    return tuple(role for role in QUANTITIES if is_unit(unit, [role])) if likely else ()


def is_any_unit(word: str) -> bool:
    """Return True if a word is a unit of a role or of another quantity of rigs and rheometers."""
    bare = re.sub(r"[\s.·⋅*^]", "", word.strip("[]() ")).lower()
    return bool(roles_of_unit(word)) or bare in _UNITS_WITHOUT_ROLE


def _is_frequent(spelled: str, role: str) -> bool:
    return spelled == QUANTITIES[role].unit or (role, spelled) in _FREQUENT_UNITS


def is_unit(word: str, roles: Iterable[str] = QUANTITIES) -> bool:
    """Return True if a word is a unit of one of the roles (all roles by default)."""
    for role in roles:
        try:
            to_si(0.0, word, role)
        except InputError:
            continue
        return True
    return False
