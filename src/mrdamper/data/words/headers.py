"""Headers of columns: word, unit, and the roles that word and unit may mean.

The unit determines the column of a role if only one column has a unit of the role. Otherwise the words of
the headers determine the column. Words also distinguish a measured quantity from its set point.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from typing import Literal

from mrdamper.quantities import QUANTITIES, is_any_unit, roles_of_unit

_NOTED = re.compile(r"(.+?)\s*[\[({].*[\])}]\s*[\[({]([^\[({]*)[\])}]")  # remark, unit: "Force (raw) [N]"
_BRACKETS = re.compile(r"(.+?)\s*[\[({](.*)[\])}]")
_SLASH, _LINE = re.compile(r"(.+?)\s+/\s*(.+)"), re.compile(r"([^_]+)_(.+)")
_FORMS = (_NOTED, _BRACKETS, _SLASH, _LINE, re.compile(r"(.+)()"))
_FORMS_WITH_UNIT = (
    *(_BRACKETS, re.compile(r"(.+?)\s*/\s*(.+)"), _LINE),
    *(re.compile(r"(.+?)\s*,\s*(.+)"), re.compile(r"(.+?)\s+in\s+(.+)", re.IGNORECASE)),
)
_LAST = re.compile(r"(.+)_([^_]+)")
_BLANK = re.compile(r"(.+?)\s+([^\s\d]+)")  # "Force N", if N is a unit of force
_NO_UNITS = frozenset({"in", "kp", "min"})  # A header "in" means input, "kp" a gain, "min" a minimum.
_WEIGHTS = {"lb": "lbf", "lbs": "lbf", "kg": "kgf", "kgs": "kgf", "кг": "kgf"}
_NUMBERED = re.compile(r"^(.+_[^\W\d]+)[_ ]\d+$")  # number after the unit: "force_N_2"
_CHUNKS = re.compile(r"(?:[,;:|.](?:\s+|$)|\t|\s+(?:and|und|et|y)\s+)+")
_IN = re.compile(r"(.+?)\s+in\s+(\S+)", re.IGNORECASE)
_NUMBERED_CHUNK = re.compile(r"[-*#\s]*(?:[^\W\d]+ ?)?(\d{1,2}) (\D.*)")
# The number of a column or row with the sign behind it: "2: ", "Zeile 2 = ", "2nd row - ", "第2列: ".
_POSITION = re.compile(
    r"(?<![\d.,])(\d{1,2})(?:(?:[.ªº]|-?[^\W\d_]{1,3})\s[^\W\d]+|[行列]目?)?\s*(?:=|(?:[.:)]|->|→|[-–])\s)\s*"
)
_VALUE = re.compile(r"\S\s*[:=]\s*[+-]?\d[\d.,]*\s*$")
_REMARK = re.compile(r"\([^()]* [^()]*\)\s*$")  # "(tension positive)" is no unit.
_ALL_CHANNELS = re.compile(
    r"\b(all|channels|values|data|signals|columns|samples|readings|alle|werte|kanäle|signale|daten|valeurs|valor[ei]s?)\b",
    re.IGNORECASE,
)
_ACCELERATION = re.compile("加速度|가속도")  # These words contain the words of velocity.
# Path of a signal in a block diagram, whose last part may be a port: "Model Root/ADC/F [N]/Out1".
_PORT = r"/(?:out|in|output|input|value|signal|port)[ _]?\d*"
_PATH = re.compile(rf"(?:\w+\(\)://)?((?:[^/\[({{]{{2,}}/)+?)((?:[^/]|//)+?)({_PORT})?", re.IGNORECASE)
_NARROW = str.maketrans({**dict(zip("（）［］／", "()[]/", strict=True)), "：": ": ", "，": ", ", "；": "; "})

Kind = Literal[
    "set point", "sensor output", "statistic", "model", "filtered", "ambient", "fluid", "damper", "other"
]
# A statistic is a result of a run. The volts of a sensor output represent another quantity.
_KINDS: Mapping[Kind, re.Pattern[str]] = {
    "set point": re.compile(
        r"\b(set|setpoint|soll\w*|cmd|command\w*|target|demand\w*|ref|reference|desired|consign\w*|zadan\w*"
        r"|alapjel\w*|asetus\w*|ohjearvo|börvärde|riferimento|impostat\w*|istenen|уставк\w*|задан\w*)\b"
        r"|目标|設定|设定|指令|给定|목표|지령"
    ),
    "sensor output": re.compile(r"monitor|\bimon\b|\bmon\b|shunt|clamp|probe|transducer|sensor"),
    "statistic": re.compile(
        r"\b(f?max|f?min|maximum|minimum|peak|mean|avg|average|rms|amplitude|mittelwert)\b"
    ),
    "model": re.compile(r"\b(sim|simul\w*|model|modell|predict\w*)\b"),
    "filtered": re.compile(r"\b(filter\w*|filt|smooth\w*|gefiltert|gegl[äa]tt\w*|lowpass|lp)\b"),
    "ambient": re.compile(
        r"\b(amb\w*|room|air|\w*raum\w*|umgebung\w*|lab|labor\w*|(?<!controlled )chamber|halle?|hal[ay]?"
        r"|sal[al]e?|otoczeni\w*|powietrz\w*|pokoj\w*|okol\w*|vzduch\w*|környez\w*|luft\w*|ortam|oda|kamer|rumm?\w*)\b"
        r"|室温|环境|環境|комнат|воздух|окруж|помещ|실온|\b(tank|reservoir|sump|hpu|pump\w*|hydraul\w*)\b"
    ),
    "other": re.compile(
        r"acceler|beschleun|freq|shear|viscos|viskos|induct|induktiv|impedan|resistan|widerstand|flux|humid"
        r"|频率|周波数|주파수"
    ),
    "damper": re.compile(
        r"damper|d(ä|ae)mpfer|t[lł]umi[kč]|am+orti[sz]|amorte[cç]|demper|lengéscs|амортиз|демпф|阻尼|ダンパ|댐퍼"
    ),
    "fluid": re.compile(
        r"\b(fluid|oil|öl|huile|aceite|olio|óleo|(olej|olaj|öljy|масл|жидк)\w*)\b|油|流体|오일"
    ),
}
_COMMAND = re.compile(
    r"\b(c(o|ó)m(m)?and\w*|cmd|drive\w*|control\w*|steuer\w*|consign\w*)\b|volt|spannung|tens[iã]|ten[cs]i[oó]n|nap[ie]"
    r"|电压|電圧|전압|指令"
)
_COIL = re.compile(r"\b(coil|magnet\w*|solenoid|spule\w*|bobin[ae]|cewk\w*)\b|线圈|コイル")
_EPOCH = re.compile(r"\b(epoch|posix|unix)\b")  # seconds since 1970
_DUTY = re.compile(r"\b(pwm|duty\w*|tastgrad|tastverh\w*|control|drive\w*|steuer\w*)\b|占空比|듀티")
_PER_CENT = re.compile(r"(?<!\d)(?<!\d )(?:%|\b(?:pct|percent|per cent|prozent)\b)[^\d%]*$", re.IGNORECASE)
# Per cent or a scale in place of the unit: "displacement in %, 100 % = 25 mm", "force, 500 N/V".
_RAW = re.compile(
    r"([^\W\d][^,([%\d]*?)[\s,([]+(?:in )?(?:V[\]),\s]+)?(?:(%)|\d[\d.,]*\s?[^\W\d]+(?:/| per )(V)(?!\w)).*"
)


def word_and_unit(header: str) -> tuple[str, str]:
    """Return the word and the unit of a header, "" if missing. The word is all text except the unit."""
    text = _plain(header)
    for form in (_NOTED, *_FORMS_WITH_UNIT, _LAST, _BLANK):
        match = form.fullmatch(text)
        word, unit = (match[1].strip(), match[2].strip()) if match else ("", "")
        unit = weight_unit(word, unit)
        is_unit_alone = form in {_NOTED, _BRACKETS} or (len(unit) > 1 and form is not _BLANK)
        if (roles := roles_of_unit(unit)) and (is_unit_alone or _means(word, roles)):
            return word, unit
    if len(text) > 1 and text.lower() not in _NO_UNITS and roles_of_unit(text):  # "millis" has no word.
        return "", text
    return text, ""


def _plain(header: str) -> str:
    """Return a header with ASCII brackets, without the path of a signal in a block diagram."""
    path = _PATH.fullmatch(text := header.translate(_NARROW).strip())
    return path[2].strip() if path and (path[3] or path[1].count("/") > 1) else text


def weight_unit(word: str, unit: str) -> str:
    """Return the unit next to a word. The weight lb or kg next to the name of a force is lbf or kgf."""
    weight = _WEIGHTS.get(unit.strip("[]() .").lower())
    return weight if weight and _means(word, ["force"]) else unit


@lru_cache(maxsize=10_000)  # Documents of a folder are parsed for each of its files.
def legend_in(line: str, words_max: int = 3) -> list[tuple[int | None, str, str]]:
    """Return (number or None, word, unit) of the columns that a line explains; "" without a unit.

    Examples: ``Columns: disp in mm, force in kN``, ``2: force [N]``, and the row ``force | kN``. A text
    of more than ``words_max`` words is a sentence.
    """
    line = line.translate(_NARROW)
    cells = [cell.strip(" `*\"'") for cell in re.split(r"[|\t;]|(?<!\d),(?=\S)", line.strip().strip("|"))]
    units = [cell for cell in cells[1:] if roles_of_unit(cell)]
    if len(units) == 1 and cells[0]:
        if re.fullmatch(r"\d{1,2}", cells[0]):
            return [(int(cells[0]), cells[1], units[0])]
        return [(None, cell, units[0]) for cell in cells if cell not in {"", units[0]}]
    if _VALUE.search(line):
        return []
    line = _POSITION.sub(r"\1 ", line)
    # A numbered line is no sentence even if it has more words: "3: current in the coil [A]".
    whole = _NUMBERED_CHUNK.fullmatch(" ".join(line.split()))
    word, unit = raw_signal(whole[2]) or word_and_unit(_REMARK.sub("", whole[2])) if whole else ("", "")
    if whole and unit and 0 < len(word.split()) <= 2 * words_max and not re.search("[:,0-9]", word):
        return [(int(whole[1]), word, unit)]
    found: list[tuple[int | None, str, str]] = []
    for chunk in _CHUNKS.split(line):
        numbered = _NUMBERED_CHUNK.fullmatch(chunk.strip())
        text = numbered[2] if numbered else chunk.strip(" -*#`")
        text = text if word_and_unit(text)[1] else _REMARK.sub("", text).strip()
        word, unit = word_and_unit(text)
        if not unit and (match := _IN.fullmatch(text)) and roles_of_unit(match[2]):
            word, unit = match[1], match[2]
        other = unit_in_brackets(text)  # of a quantity without a role: "table acceleration (g)"
        if not unit and is_any_unit(other) and not other.isdigit():
            word, unit = re.split(r"\s*[\[({]", text)[0], other
        if word and unit and len(word.split()) <= words_max:
            found.append((int(numbered[1]) if numbered else None, word, unit))
    whole = whole or _NUMBERED_CHUNK.fullmatch(" ".join(" ".join(cells).split()))
    is_entry = whole is not None and len(whole[2].split()) <= 2 * words_max
    return found or ([(int(whole[1]), whole[2], "")] if whole and is_entry else [])


def raw_signal(text: str) -> tuple[str, str] | None:
    """Return the word, and "%" or "V", of an explanation in per cent of a range or with a scale per volt."""
    match = _RAW.fullmatch(text)
    return (match[1], match[2] or match[3]) if match else None


def _means(word: str, roles: Sequence[str]) -> bool:
    """Return True if a word means one of the roles: ``coil current_A`` is a current, ``sensor_A`` is not."""
    for role, words in (("current", _COIL), ("time", _EPOCH)):
        if role in roles and words.search(_split_words(word)):
            return True
    return any(begins_with_symbol(word, role) or speaks_of(word, role) for role in roles)


def speaks_of(word: str, role: str) -> bool:
    """Return True if a word contains a name of a role, such as ``rodforce``."""
    plain = _without_accents(_split_words(word))
    tokens = plain.split()
    for known in _names_of(role):
        if (len(known) == 1 and known.isascii()) or known == "力":
            continue
        if known in tokens or (not known.isascii() and known in plain):
            return True
        begin, end = known if len(known) > 3 else " ", known if len(known) > 2 else " "
        if any(token.startswith(begin) or token.endswith(end) for token in tokens):
            return True
    return False


@cache
def _names_of(role: str) -> tuple[str, ...]:
    return tuple(map(_without_accents, QUANTITIES[role].headers))


def _without_accents(text: str) -> str:
    """Return a text without accents, which many instruments cannot write: ``forca``, ``sila``."""
    apart = unicodedata.normalize("NFD", text.replace("ł", "l"))
    return unicodedata.normalize("NFC", re.sub("[\u0300-\u036f]", "", apart))


def means(name: str, role: str) -> bool:
    """Return True if a channel is named after a role, as ``Force``, ``rod_force`` or ``F_N``."""
    if header := parse_header(name):
        return header[0] == role
    word, unit = word_and_unit(name)
    return word == QUANTITIES[role].symbol or role in roles_of_unit(unit) or speaks_of(word, role)


def begins_with_symbol(word: str, role: str) -> bool:
    """Return True if a header's word begins with the symbol of a role, as in ``i_cmd`` or ``Fmeas``."""
    symbol, first = QUANTITIES[role].symbol, word.strip()[:1]
    is_alone = (
        re.match(r"\S(?:set|soll|ist|cmd|ref|meas|mess|coil|max|min)?(?!\S)", _split_words(word)) is not None
    )
    is_symbol = first == symbol or (first.lower() == symbol.lower() and symbol not in {"t", "T"})
    return is_alone and is_symbol


def has_word(header: str, kind: Kind) -> bool:
    """Return True if a header has a word for columns of a kind, such as set points."""
    return _KINDS[kind].search(_split_words(_plain(header) if kind == "model" else header)) is not None


def says_command(word: str) -> bool:
    """Return True if a header in volts names a command, and not a sensor output."""
    return _COMMAND.search(_split_words(word)) is not None and not has_word(word, "sensor output")


def is_command_share(name: str, unit: str) -> bool:
    """Return True if a header names a command relative to its maximum, such as a duty cycle in per cent."""
    if not (is_per_cent(name) or is_per_cent(unit)):
        return False
    return bool(_DUTY.search(_split_words(name))) or has_word(name, "set point") or speaks_of(name, "current")


def is_per_cent(text: str) -> bool:
    """Return True if a header, a line or a unit ends with per cent, and perhaps words on the reference."""
    return _PER_CENT.search(text.replace("_", " ")) is not None


def are_all_per_cent(line: str) -> bool:
    """Return True if a line states that all channels are in per cent, as in ``All values in % of range``."""
    found = _PER_CENT.search(line)
    before = line[: found.start()] if found else ""
    return bool(_ALL_CHANNELS.search(line) and re.search(r"(\b(in|as|en)|[:=])\s*$", before, re.IGNORECASE))


def _split_words(word: str) -> str:
    """Return the words of a header (``coil_current``, ``CoilCurrent``) in lower case, separated by blanks."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", _ACCELERATION.sub("acceleration", word))
    return re.sub(r"[\W_\d]+", " ", apart).strip().lower()


def parse_header(header: str) -> tuple[str, str] | None:
    """Return (role, unit) of a header with a unique meaning, else None. The unit is "" if missing.

    A unit of the word's role needs no brackets: ``Force, N``, ``Kraft in N``, ``Force N``, ``Force
    (filtered) [N]``. Instead of a word, a symbol with a unit of its role is sufficient (``F [N]``). A suffix
    that is not a unit, as in ``velocity_5`` or ``Force (raw)``, and a number after a unit, as in
    ``force_N_2``, are ignored.
    """
    text = _NUMBERED.sub(r"\1", _plain(header))
    word, unit = word_and_unit(text)
    for role in roles_of_unit(unit):
        if word == QUANTITIES[role].symbol or _role_of(word) == role:
            return role, unit
    for match in (form.fullmatch(text) for form in _FORMS):
        if match and (role_of_word := _role_of(match[1])) is not None:
            unit, roles = match[2].strip(), roles_of_unit(match[2].strip())
            # A single letter may number the sensors: "force_A", "force_B".
            is_unit_of = {role_of_word, "voltage"} & {*roles} or (roles and len(unit.strip("[]() ")) > 1)
            return role_of_word, unit if is_unit_of else ""
    return None


@cache
def strip_channel(stem: str) -> str:
    """Return the name of a file without its channel words, such as ``force``, ``F`` or ``coil``."""
    words = re.split(r"(?:[^\w.,]|_|(?<!\d)[.,]|[.,](?!\d))+", stem)  # "0.5A" is one word.
    symbols = {quantity.symbol for quantity in QUANTITIES.values()} | {""}
    channels = {word for word in words if parse_header(word) or _COIL.fullmatch(word.lower())} | symbols
    return "_".join(word for word in words if word not in channels)


def names_by_symbol(header: str) -> bool:
    """Return True if a header names its role by one letter."""
    return re.match(r"\s*[A-Za-z](?![^\W\d_])", header) is not None


def unit_in_brackets(header: str) -> str:
    """Return the text in brackets at the end of a header, which may be a unit; "" without brackets."""
    match = re.fullmatch(r".*[\[({]([^\[({]*)[\])}]\s*", header.translate(_NARROW))
    return match[1].strip() if match else ""


def _role_of(word: str) -> str | None:
    word = word.strip() if len(word.strip()) == 1 else _without_accents(word.strip().lower())
    return next((role for role in QUANTITIES if word in _names_of(role)), None)
