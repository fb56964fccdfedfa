"""Properties of channels above a table: name, unit, factor and offset of each channel.

Four layouts are read: a row for each property (``Unit;mm;N;A``, ``UNIT mm,N,A``) or with its values below it,
a table with a row for each channel, and entries with the channel number (``ch2.unit = kN``, ``[Channel2]``).
Names and units are also found without a label in a known language because units are the same everywhere.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest

from mrdamper.data.formats.clocks import Sampling, is_setting_of_time, stated_sampling
from mrdamper.data.formats.lines.cells import is_number, number_in
from mrdamper.data.words.headers import parse_header, speaks_of, word_and_unit
from mrdamper.quantities import QUANTITIES, is_any_unit, roles_of_unit

_WORDS: Mapping[str, re.Pattern[str]] = {
    "name": re.compile(
        r"names?|labels?|titles?|signals?|traces?|waves?|descriptors?|descriptions?|variables?|parameters?|tags?"
        r"|bezeichnung|kanalname|nome?|nombre|voies?|quantity|messgröße|channel|[kc]ana+le?|source|sinal|segnale"
        r"|grandezza|grandeur|désignation|señal|magnitud|naa?mn?|nazwa|název|név|имя|наименование|канал|сигнал"
        r"|名称|通道|信号|チャンネル|이름|채널|신호"
    ),
    "unit": re.compile(
        r"units?|v?einheit(en)?|unit[ée]s?|unidad(es?)?|unità|jednost?k[aiy]|eenheid|enhet|birim|mértékegység"
        r"|единиц[аы]|单位|単位|단위"
    ),
    "factor": re.compile(
        r"fa[ckt]?t(or|eur)e?|scale|scaling|gain|slope|multiplier|skalierung|steigung|coeff?icient[ei]?|guadagno"
        r"|pente|pendenza|pendiente|[eé]s?c[ah]ell?[ae]|scala|mnożnik|współczynnik|množitel|koeficient|szorzó"
        r"|множитель|коэффициент|масштаб|系数|係数|倍率|계수|배율"
    ),
    "offset": re.compile(
        r"offset|nullpunkt|versatz|intercept|décalage|zéro|przesunięcie|posun|смещение|сдвиг|偏移|零点|オフセット"
        r"|오프셋"
    ),
}
# "physical = Gain * (reading - Zero)", "value = SLOPE * code + Y_OFFSET"
_RAW = (
    r"raw|roh|reading|count|code|number|adc|digit|bit|sample|lectur|brut|volt|conteggi|grezz|lettur|leitur|cuenta"
    r"|contagem|comptage|zähl|код|отсч|读数|原始|计数"
)
_TERM, _LEFT = r"[^\W\d][\w ]*\w", rf"(?:.*[:;,\t])?(?:(?!{_RAW})[^=:;,\t])+="
_CODE, _FACTOR = rf"\s*(?:\w+ )?(?:{_RAW})[\w ]*?\s*", rf"\s*(?P<factor>{_TERM})\s*"
_SHIFT = rf"(?P<sign>[-+])\s*(?P<offset>{_TERM})\s*"
_EQUATIONS = (
    re.compile(rf"{_LEFT}{_FACTOR}\*\s*\(?{_CODE}(?:{_SHIFT})?\W*", re.IGNORECASE),
    re.compile(rf"{_LEFT}\s*\({_CODE}{_SHIFT}\)\s*\*{_FACTOR}\W*", re.IGNORECASE),
    re.compile(rf"{_LEFT}{_CODE}\*{_FACTOR}(?:{_SHIFT})?\W*", re.IGNORECASE),
)
_OTHER_EQUATION = re.compile(
    r"\(\s*[^\W\d]\w*\s*[-+−]\s*[^\W\d]\w*\s*\)\s*[*×·/]|[*×·]\s*[^\W\d]\w*\s*[-−]\s*[^\W\d]"
    rf"|(?i:{_RAW})\w*\s*=[^=]*[*×·]"  # "code = Gain * value + Zero"
)
_OF_TIME = frozenset({"x", "h", "t", "horz", "horizontal", "time"})
_NUMBERED = re.compile(r"\W*([^\W\d]*)[ _.#]*?(\d+)[\]\s_.:)]*(.*?)\W*")
_CHANNEL = re.compile(
    r"(ch|chn|chan|channel|[kc]ana+le?|col|column|spalte|signal|sig|voie|канал|通道|チャンネル|채널)?",
    re.IGNORECASE,
)
# Igor scales the time axis of a wave by x, and its values by y: SetScale/P x 0,0.001,"s", force
_AXIS = re.compile(r'\b([xy]) +[^\s,"]+,([^\s,"]+),"([^"]*)", *(\w+)')
_CHANNELS = re.compile(
    r"series|columns|channels|signals|spalten|kanäle|signale|canaux|canales", re.IGNORECASE
)
_KEYWORD = re.compile(r"\W*([^\W\d]\w*)\s+([^:=]+)")  # "VERT_UNITS mm,N,A"
_ENTRY = re.compile(r"\W*(.*?)\s*(?:=|:|\t|;)\s*(.*?)\s*")


@dataclass(frozen=True, slots=True)
class Header:
    """Names of columns, and the lines above the names with their cells separated by blanks."""

    names: tuple[str, ...]
    said: tuple[str, ...]
    named: bool = True  # False: no row of names was found
    scales: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # factor, offset
    sampling: Sampling | None = None
    spans: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # factor, offset of raw values


def property_of(text: str) -> str:
    """Return the property that a label names, such as ``unit`` (``x unit`` for the time axis), else ""."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", text)
    words = re.sub(r"[\W_\d]+", " ", apart).lower().split()
    has_value = re.search(r"[:=]\s*\w", text) is not None
    if not 0 < len(words) <= 3 or words == ["full", "scale"] or has_value:
        return ""
    for name, form in _WORDS.items():
        # The "vertical scale" of an oscilloscope applies to the screen, not to the samples.
        is_of_screen = words[0] == "vertical" and name in {"factor", "offset"}
        if not is_of_screen and (form.fullmatch(words[-1]) or form.fullmatch(words[0])):
            return f"x {name}" if words[0] in _OF_TIME else name
    return ""


def names_quantity(name: str) -> bool:
    """Return True if a name, without its unit, is the name of a quantity."""
    return bool(parse_header(name)) or any(speaks_of(word_and_unit(name)[0], role) for role in QUANTITIES)


def name_in(lines: Sequence[str]) -> str:
    """Return the name of the only channel, from a line that is not an entry and names a quantity, else ""."""
    words = [re.split(r"[,;(]", line)[0].strip(" #%/!") for line in lines if not re.search("[:=]", line)]
    names = [word for word in words if len(word.split()) <= 6 and names_quantity(word)]
    return names[0] if len(names) == 1 else ""


def find_properties(
    rows: Sequence[Sequence[str]], lines: Sequence[str], first: Sequence[str]
) -> Header | None:
    """Return names, factors and time step of the channels, None if the lines do not state the names.

    At least one more property must be stated.

    Parameters
    ----------
    rows, lines : the lines above the table, divided into cells and as text
    first : cells of the first row of the table
    """
    leads = bool(first) and not first[0]  # The column below the labels has no samples.
    count = len(first) - leads
    equation = _equation_in(lines)
    shift = equation["offset"] if equation else None  # The offset of the equation may have any label.
    divided = (_without_keyword(row, line, count) for row, line in zip(rows, lines, strict=True))
    rows = [["offset" if cell == shift else cell for cell in row] for row in divided]
    lines = [f"{row[0]} = {row[1]}" if len(row) == 2 else line for row, line in zip(rows, lines, strict=True)]
    stated: dict[str, list[list[str]]] = {name: [] for name in (*_WORDS, "unknown")}
    labelled = (*_by_rows(rows), *_by_channels(rows), *_by_numbers(lines), *_by_axes(lines))
    for name, values in (*labelled, *_by_units(rows, count)):
        if name in stated and not (name == "name" and any(map(is_number, values))):
            stated[name].append([*values])
    if count == 1 and not stated["name"]:
        stated["name"] = [[name] for name in [name_in(lines)] if name]
    found: dict[str, list[str]] = {}
    for size in range(count, max(count - 3, 0), -1):
        fitting = {name: [each for each in lists if len(each) == size] for name, lists in stated.items()}
        found = {name: lists[0] for name, lists in fitting.items() if lists}
        if "name" in found and (size == count or all(map(is_any_unit, found.get("unit", [])))):
            # Several rows may have names, such as "CH1" and "Force". The row with most quantities is used.
            found["name"] = max(fitting["name"], key=lambda each: sum(map(names_quantity, each)))
            if len(found) > 1 or all(word_and_unit(name)[1] for name in found["name"]):
                break
    else:
        return None
    names = found["name"]
    # Whole numbers in the table may be counts. Numbers without a known label may then be factors of counts.
    are_counts = sum(cell.lstrip("+-").isdecimal() for cell in first) >= min(2, len(names))
    is_unclear = are_counts and any(len(each) == len(names) for each in stated["unknown"])
    if equation is not None:  # Each term of the equation requires one list of values.
        counts = [len({*map(tuple, fitting[name])}) for name in ("factor", "offset")]
        is_unclear = counts != [1, shift is not None]
    elif "factor" in found:
        is_unclear = any(map(_OTHER_EQUATION.search, lines))
    if is_unclear:
        return None
    settings: dict[str, str] = {}
    for label, values in _settings(rows, lines):
        if len({*values}) == 1:  # The only channel of a file has no other step than the time step.
            settings.setdefault(f"sampling {label}" if count == 1 else label, values[0])
    labels = [label for label in settings if property_of(label.removeprefix("sampling ")) == "x unit"]
    units_of_time = [settings[label] for label in labels]
    settings |= {f"{label}_unit": unit for unit in units_of_time[:1] for label in settings}
    units = [unit.strip("[]()") for unit in found.get("unit", [""] * len(names))]
    names = [names[0] or "time", *names[1:]] if len({*names}) == len(names) > 2 else names
    spelled = [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]
    both = zip(spelled, _scales(found, equation), strict=True)
    scales = {name: scale for name, scale in both if scale != (1.0, 0.0)}
    time = [f"time [{units_of_time[0]}]" if units_of_time else "time"]
    before = ["number", *time][2 - (count - len(names)) :] if len(names) < count else []
    above = rows[-1] if rows else ()
    if before and len(above) == count and all(_NUMBERED.fullmatch(cell) for cell in above[len(before) :]):
        before = [*above[: len(before)]]  # names in the row of channel numbers
    scales, spans = ({}, scales) if equation else (scales, {})
    columns = (*[""] * leads, *before, *spelled)
    return Header(columns, (), scales=scales, sampling=stated_sampling(settings), spans=spans)


def _equation_in(lines: Sequence[str]) -> re.Match[str] | None:
    """Return the only equation of the values above a table: ``value = factor * (raw - offset)``."""
    plain = {re.sub("[×·]", "*", line).replace("−", "-") for line in lines if "=" in line and len(line) < 200}
    matches = (form.fullmatch(line) for line in plain if "*" in line for form in _EQUATIONS)
    found = [match for match in matches if match and property_of(match["factor"]) == "factor"]
    is_done = any(re.search("already|applied|bereits|déjà", line, re.IGNORECASE) for line in lines)
    return None if is_done or len(found) != 1 else found[0]


def _without_keyword(row: Sequence[str], line: str, count: int) -> Sequence[str]:
    """Return [keyword, value of each channel] of a line ``UNITS mm,N,A``, or [keyword, setting of time]."""
    found = _KEYWORD.fullmatch(line) if count > 1 else None
    if found is None or None not in map(_channel_number, row):
        return row
    name, text = "name" if _CHANNELS.fullmatch(found[1]) else property_of(found[1]), found[2].strip()
    lists = (re.split(rf"\s*{sign}\s*", text) for sign in (";", "\t", ",", r"\s"))
    values = next((each for each in lists if len(each) == count), [])
    if values and name in _WORDS:
        return [name, *values]
    is_setting = len(row) == 1 and (name == "x unit" or is_setting_of_time(found[1]))
    return [found[1], text] if is_setting else row


def _numbers(found: Mapping[str, list[str]], name: str, otherwise: float) -> list[float]:
    values = [number_in(cell, "," if "," in cell else ".") for cell in found.get(name, [])]
    return [otherwise if value is None else value for value in values] or [otherwise] * len(found["name"])


def _scales(found: Mapping[str, list[str]], equation: re.Match[str] | None) -> Iterator[tuple[float, float]]:
    """Generate the factor and the offset of each channel, with the sign and the brackets of the equation."""
    is_inside = equation is not None and "(" in equation.string.rpartition("=")[2]
    sign = -1.0 if equation is not None and equation["sign"] == "-" else 1.0
    for factor, offset in zip(_numbers(found, "factor", 1.0), _numbers(found, "offset", 0.0), strict=True):
        yield factor, sign * offset * (factor if is_inside else 1.0)


def _by_rows(rows: Sequence[Sequence[str]]) -> Iterator[tuple[str, list[str]]]:
    """Generate (property, values) from rows that begin with a property; the next row may have the values."""
    for row, below in zip_longest(rows, rows[1:], fillvalue=()):
        if row and (name := property_of(row[0])):
            yield name, [*(row[1:] if any(row[1:]) else below)]


def _by_channels(rows: Sequence[Sequence[str]]) -> Iterator[tuple[str, list[str]]]:
    """Generate (property, values) from the columns of a table with one row for each channel.

    If the names of the table's columns are channel numbers, the rows are in the order of these numbers.
    """
    order = [*map(_channel_number, rows[-1] if rows else ())]
    for k, row in enumerate(rows):
        named = {at: name for at, cell in enumerate(row) if (name := property_of(cell))}
        below = [*rows[k + 1 :]]
        end = next((n for n, other in enumerate(below) if len(other) != len(row)), len(below))
        if len({*named.values()} & {"name", "unit", "factor"}) > 1:
            channels = {_channel_number(other[0]): other for other in below[:end]}
            is_numbered = len(channels) == end < len(below) and {*order} <= channels.keys() - {None}
            chosen = [channels[number] for number in order] if order and is_numbered else below[:end]
            for at, label in enumerate(row):
                yield named.get(at, label), [other[at] for other in chosen]


def _channel_number(cell: str) -> int | None:
    """Return the number in a name such as ``1``, ``CH1`` or ``Canale 1``, None for any other cell."""
    found = _NUMBERED.fullmatch(cell)
    return int(found[2]) if found and _CHANNEL.fullmatch(found[1]) and not found[3] else None


def _by_numbers(lines: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Generate (property, values) from entries with the channel number in their key or section."""
    found: dict[str, dict[int, str]] = {}
    section: int | None = None
    for line in lines:
        entry = _ENTRY.fullmatch(line)
        key = entry[1] if entry else line
        numbered = _NUMBERED.fullmatch(key)
        if numbered is not None and not (_CHANNEL.fullmatch(numbered[1]) or property_of(numbered[1])):
            numbered = None
        if entry is None:
            section = int(numbered[2]) if numbered and line.strip().startswith("[") else None
            continue
        number = int(numbered[2]) if numbered else section
        name = property_of(f"{numbered[1]} {numbered[3]}" if numbered else key)
        if number is not None and name:
            found.setdefault(name, {})[number] = entry[2].strip("\"'")
    for name, values in found.items():
        yield name, [values[number] for number in sorted(values)]


def _by_units(rows: Sequence[Sequence[str]], count: int) -> Iterator[tuple[str, list[str]]]:
    """Generate (property, values) from rows or columns of units without a known label.

    The nearest row (or column) of words has the names of the channels. Numbers with decimals and without a
    known label have the property "unknown". A row has a label in front of its values.
    """
    labelled = [row for row in rows if len(row) == count + 1 and row[0] and not is_any_unit(row[0])]
    tables = [[(property_of(row[0]), [*row[1:]]) for row in labelled]]
    around: list[Sequence[Sequence[str]]] = [()]  # The rows next to each table.
    for k in range(len(rows) - count + 1 if count > 1 else 0):
        above, below = rows[max(k - 1, 0) : k], rows[k + count : k + count + 1]
        labels = itertools.chain(map(property_of, *above or [()]), itertools.repeat(""))
        columns = zip_longest(*rows[k : k + count], fillvalue="")
        tables.append([(label, [*cells]) for label, cells in zip(labels, columns, strict=False)])
        around.append([*above, *below])
    for table, others in zip(tables, around, strict=True):
        are_units = [
            all(is_any_unit(cell) and not is_number(cell) for cell in cells)
            and any(map(roles_of_unit, cells))
            for _, cells in table
        ]
        unit = are_units.index(True) if any(are_units) else None
        if unit is None or any(roles_of_unit(row[unit]) for row in others if len(row) > unit):
            continue  # A row next to the table has a unit: the table has more than ``count`` rows.
        yield "unit", table[unit][1]
        for _, (label, cells) in sorted(enumerate(table), key=lambda each: abs(each[0] - unit)):
            if all(map(_is_word, cells)) and len({*cells}) == len(cells):
                yield "name", cells
            elif not label and all(map(is_number, cells)) and re.search("[.,eE]", "".join(cells)):
                yield "unknown", cells


def _is_word(cell: str) -> bool:
    return cell[:1].isalpha() and not roles_of_unit(cell) and not property_of(cell).endswith("unit")


def _by_axes(lines: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Generate the units of the values, and the step of the time axis, from scales of Igor waves."""
    axes = [found for line in lines for found in _AXIS.findall(line)]
    yield "unit", [unit for axis, _, unit, _ in axes if axis == "y"]
    for axis, step, unit, _ in axes:
        if axis == "x":
            yield from (("x increment", [step]), ("x unit", [unit]))


def _settings(rows: Sequence[Sequence[str]], lines: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Generate (label, values) from rows, columns and entries, whose labels may include their section."""
    yield from (*_by_channels(rows), *_by_axes(lines))
    for row, below in zip_longest(rows, rows[1:], fillvalue=()):
        if row and row[0]:
            yield row[0], [cell for cell in row[1:] if cell] or [*below[:1]]
    section = ""
    for line in lines:
        section = line.strip(" []") if line.lstrip().startswith("[") else section
        if entry := _ENTRY.fullmatch(line):
            yield from ((label, [entry[2].strip("\"'")]) for label in (entry[1], f"{section} {entry[1]}"))
