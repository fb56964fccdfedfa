"""Commands, temperatures, sampling rates and scales in sheet titles, lines above a table, and file names.

Examples: ``0.5 A``, ``0,5A``, ``500mA``, ``1p5A``, ``T20C``, ``60 °C``, ``Current [A]: 0.5``, ``10 mm/V``. A
number requires a unit. Two different numbers are ambiguous, and the ``Label`` contains both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mrdamper.data.words.headers import has_word, speaks_of
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, ZERO_CELSIUS_K, to_si

# Fortran writes 5.0D-01. Without a decimal point, an exponent needs a sign: "3E2" may be a name.
_NUMBER = r"(?:\d+|(?=\.\d))(?:[.,p]\d+(?:[eEdD]\d{1,3})?)?(?:[eEdD][-+]\d{1,3})?"
_END = r"(?![A-Za-z0-9/²^*·])"
_UNITS = {
    "current": r"m?A(?:mp(?:ere)?s?)?|[mM]A|(?i:amps|amperes?)|AMP|(?<=\d )amp",
    "voltage": r"m?V(?:olts?)?|(?i:volts?)",
    "temperature": r"(?i:(?:°|º|deg(?:\.|rees?)?|grad)?\s?(?:[CF]|celsius|fahrenheit))|K|℃|℉",
}
_SYMBOLS = {"current": "iI", "voltage": "uUvV", "temperature": "tT"}
# A number begins a word or follows its sign or symbol: "rev2A" is not a current and "0-1.5A" is a range. The
# minus in "I-2A" is a dash, but the minus in "T-5C" may be the sign of the temperature.
# The name of the quantity, or any word in a script without blanks, may precede the number directly. In
# "Strom1 A", the 1 is the number of the channel. Therefore the number needs decimals or a unit without blank.
_NAMES = "|".join(word for role in _UNITS for word in QUANTITIES[role].headers)
_GLUED = re.compile(rf"((?i:{_NAMES})|[\u3040-\u9fff\uac00-\ud7af])(?=\d+(?:[.,]\d|[^\W\d_]|[°℃]))")
_BEGIN = r"(?:(?<![\w.,+%-])|(?<=_)|(?<=(?<![^\W_])[{symbol}])|(?<=(?:(?<=[\s_=:(])|(?<![\s\S]))[+-]){dash})"
_DASHES = dict.fromkeys(("current", "voltage"), r"|(?<=(?<![\d.])[^\W\d]-)") | {"temperature": ""}
_RANGE = r"(?:(?<=\bset to )|(?<!\bto ))(?<!\bbis )(?<![-–…~] )(?<!\d[eEdD] [+-])"
_FORMS = {
    role: re.compile(
        rf"((?<![^\s_=:(])[+-])?{_BEGIN.format(symbol=_SYMBOLS[role], dash=_DASHES[role])}{_RANGE}"
        rf"({_NUMBER})[\s_]?({unit}){_END}"
    )
    for role, unit in _UNITS.items()
}
_AFTER_UNIT = {
    role: re.compile(rf"[\[(]\s*({unit})\s*[\])]\s*[\"']?\s*[:=;,\t ]\s*[\"']?\s*([+-]?{_NUMBER})(?![\w.%/])")
    for role, unit in _UNITS.items()
}
_NOT_SET = re.compile(
    r"m[aá][xk]s?(?!\d{4})|min\b|l[ií]mit|range|rated|nominal|fuse|peak|full.?scale|100 ?%|bereich|grenz"
    r"|capacity|excitation|sensitiv|heater|heiz|\bpump|\bmotor|bridge|br[üu]cke|макс|номинал|предел|диапазон|最大|额定|量程",
    re.IGNORECASE,
)
_SUPPLY = re.compile(r"(?i)supply|\bpsu\b|netzteil|alimentat(?:ion|ore)|zasilacz|zdroj|fuente|电源")
_SET = re.compile(
    rf"\bset\b|curr|strom|(?:coil|magnet|damper|spul|bobin).*[:=]\s*[+-]?{_NUMBER}\s?m?A\s*(?:\(.*\))?$",
    re.IGNORECASE,
)
_OF_COMMAND = re.compile(r"command|volt|control|drive|coil|spule|spannung|ten[sz]", re.IGNORECASE)
_OF_TEMPERATURE = re.compile(
    r"temp|темп|\bT\b|°|℃|deg|温度|온도"
    # A sensor with its value: "DS18B20: 21.3 C". In "Type K 1200 C" the number is the range of the sensor.
    r"|\b(?:DS18[BS]20|PT[ -]?1000?|NTC|thermo(?:couple|element)|type [JKT]|TC ?\d*|LM35|TMP\d+|MAX\d{4,5})"
    r"(?: \d| ?\([^()]*\))?(?:\s*[:=]\s*[+-]?\d|\s+[+-]?\d+[.,]\d)",
    re.IGNORECASE,
)
# The temperature of a room is the temperature of the tests if the tests were made at it.
_TESTED_AT = re.compile(
    r"(?i)\b(?:test|experiment|run|measure|record|versuch|mess|gemess|geprüft|essai|mesur|ensa[yi]o|prueba|prove?\b"
    r"|bada|pomiar|испыт|опыт).*\b(?:at|bei|à|a|w|przy|при) (?:an? )?(?:room|ambi|raum|zimm|umgeb|temp|комн)"
    r"|室温.*(?:下|で)"
)
_TOLERANCE = re.compile(r"\s*(?:±|\+/?-)\s*\d+(?:[.,]\d+)?")
_MODEL = re.compile(r"(?<![A-Za-z])[A-Z]{2,}-\d{2,}[AV]\b")  # type of an instrument, such as "DCS-100A"
CONDITIONS = ("current", "voltage", "temperature")
DOCUMENT = "document"  # The source of a value from a document begins with this word.
# Cyrillic units are mapped to Latin units. Any other Cyrillic letter ends a unit: "Вт" is not a volt.
_CYRILLIC = dict.fromkeys(range(0x400, 0x500), "x") | str.maketrans("АВСм", "AVCm")
_PER_VOLT = {"V": 1.0, "mV": 1e3}
_VOLTS = re.compile(r"\b(milli)?volt\w{0,2}\b", re.IGNORECASE)
_PER = r"\s*(?:/|\b(?:per|pro|je|par|por|na|на)\b|每)\s*"
_IS = (  # "1 V = 10 mm", "1 V entspricht 10 mm"
    r"\s*(?:=|≙|->|→|:|对应|相当于|\b(?:is|means|equals|represents|entspr\w+|odpow\w+|соотв\w+"
    r"|corresponds? to|(?:[ée]quiv|corr[ei]sp)\w+ [àa]l?))\s*"
)
_UNIT = r"([^\W\d_]{1,3}(?:/s)?)"
_NUMBER_HERE = rf"(?<![\d.,])({_NUMBER})\s*"
_QUANTITY = rf"{_NUMBER_HERE}[;|,]?\s*{_UNIT}"  # perhaps in two cells of a table
_SCALE = re.compile(rf"{_QUANTITY}{_PER}{_UNIT}(?![\w/])")  # "10 mm/V", "100 mV/A"
_SCALE_BEFORE = re.compile(
    rf"(?<![^\W_]){_UNIT}(?:/|_per_)(m?V)\W?[\s:=]+({_NUMBER})(?![\w/])"  # "[N/V] 500"
)
_SCALE_OF_VOLTS = re.compile(rf"{_NUMBER_HERE}(m?V){_IS}±?{_QUANTITY}(?![\w/])")
_ZERO_VOLTS = re.compile(rf"(?<![\d.,])0\s*m?V{_IS}[+-]?\s?{_QUANTITY}")
_SCALE_PER_VOLTS = re.compile(rf"{_QUANTITY}(?:{_PER}|(?!\s*:){_IS})([1-9]\d?)\s*(m?V)(?![\w/])")
_POINT_OF_SPAN = re.compile(
    rf"(?<![\w.,])([+-]?\s?{_NUMBER})\s*(%|m?V|mA)\s*(?:=|≙|->|→|:)\s*([+-]?\s?{_NUMBER})\s*([°º]?[^\W\d_]{{1,3}}(?:/s)?)(?![\w/])"
)
_RANGE_WORDS = (
    r"range|full.?scale|\bf\.?s\b|100 ?%|bereich|endwert|plage|rango|escala|scala|échelle|étendue|zakres"
    r"|rozsah|bereik|диапазон|предел|шкал|量程|レンジ|フルスケール|범위"
)
# In "10 to 60 mm", the number with the unit is not the span of the range.
_FROM_TO = re.compile(
    rf"[1-9][\d.,]*\s*(?:k?N|[cm]?m)?\s*(?:-|–|\.\.+|to|bis)\s*\+?\s*{_NUMBER}\s*(?:k?N|[cm]?m)\b"
)
_RANGE_OF = re.compile(rf"(?<![\w.,])({_NUMBER})\s*(m?A|m?V|k?N|[cm]?m|[cm]?m/s)(?![\w/])", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Place:
    """A text that may state conditions, and the name of the text in messages."""

    source: str  # Examples are "title", "header", "file name", "folder".
    text: str


@dataclass(frozen=True, slots=True)
class Label:
    """The values of a role (such as a current) that a text states. Different values are ambiguous."""

    role: str
    values: tuple[float, ...]  # SI
    source: str
    text: str
    others: tuple[Label, ...] = ()  # Labels of other sources that contradict this label.

    def in_words(self, unit: str) -> str:
        """Return the sources with their texts and values. Temperatures are in degC."""
        shift = ZERO_CELSIUS_K if self.role == "temperature" else 0.0
        values = " and ".join(f"{value - shift:g} {unit}" for value in self.values)
        words = f"the {self.source} {self.text!r} says {values}"
        return ", and ".join([words, *(each.in_words(unit) for each in self.others)])


def labels_in(text: str, role: str) -> tuple[float, ...]:
    """Return the different values of a role [SI] in a text."""
    text = _GLUED.sub(r"\1 ", _MODEL.sub("", _TOLERANCE.sub("", text.translate(_CYRILLIC))))
    found = [(sign + number, unit) for sign, number, unit in _FORMS[role].findall(text)]
    found += [(number, unit) for unit, number in _AFTER_UNIT[role].findall(text)]
    values: dict[float, None] = {}
    for number, unit in found:
        spelled = "mA" if unit == "MA" else unit
        if role == "temperature" and unit != "K":
            if unit in {"c", "f"} and not _OF_TEMPERATURE.search(text):
                continue
            spelled = "degF" if re.search("[f℉]", unit.lower()) else "degC"
        try:
            value = float(to_si(_to_float(number), spelled, role))
        except InputError:
            continue
        if QUANTITIES[role].low <= value <= QUANTITIES[role].high:
            values[round(value, 9)] = None
    return tuple(values)


def _to_float(number: str) -> float:
    """Return the number in a text such as ``1.5``, ``1,5``, ``1p5`` or ``1.5D+00``."""
    return float(re.sub("[,p]", ".", re.sub("[dD]", "e", number)))


def find_label(places: Sequence[Place], role: str) -> Label | None:
    """Return the label of the nearest text with a value of the role, None if no text has a value.

    A text with a single value has priority over texts with several values. If other texts about the file
    state different values, the label is ambiguous, and ``others`` has the labels of these texts. Only a
    document can contradict a temperature, because file names state nominal temperatures.
    """
    texts: dict[str, dict[float, str]] = {}  # source: value: text
    for place in places:
        for value in labels_in(place.text, role) if _may_say(place, role) else ():
            texts.setdefault(place.source, {}).setdefault(value, place.text)
    found = [Label(role, tuple(each), source, next(iter(each.values()))) for source, each in texts.items()]
    label = next((each for each in found if len(each.values) == 1), next(iter(found), None))
    if label is None:
        return None
    compared = DOCUMENT if role == "temperature" else (DOCUMENT, "title", "header", "file name")
    others = [each for each in found if each is not label and each.source.startswith(compared)]
    return replace(label, others=tuple(each for each in others if not {*label.values} & {*each.values}))


def places_of(title: str, said: Iterable[str], path: Path) -> tuple[Place, ...]:
    """Return the texts about a table: title, lines above it, file and folder names."""
    found = [Place("title", title)] if title else []
    found += [Place("header", line) for line in said]
    # The text after the point in "run1_0.5A" is not the suffix of a file.
    found += [Place("file name", path.name if path.suffix[1:2].isdigit() else path.stem)]
    folders = [path.parent, path.parent.parent]
    return (*found, *(Place(f"folder {each.name!r}", each.name) for each in folders if each.name))


def scales_in(line: str) -> tuple[tuple[float, str], ...]:
    """Return the scales in a line as (number per volt, unit): ``10 mm/V``, ``5 V = 50 mm``, ``100 mV/A``."""
    if (span := span_in(line)) is not None and span[2] != 0.0:
        return ()
    line = _VOLTS.sub(lambda match: "mV" if match[1] else "V", line)
    if (zero := _ZERO_VOLTS.search(line)) and _to_float(zero[1]) != 0.0:
        return ((math.nan, zero[2]),)  # An offset contradicts every scale.
    stated = [(number, unit, "1", per) for number, unit, per in _SCALE.findall(line)]
    stated += [(number, unit, "1", per) for unit, per, number in _SCALE_BEFORE.findall(line)]
    stated += [(number, unit, volts, per) for volts, per, number, unit in _SCALE_OF_VOLTS.findall(line)]
    stated += _SCALE_PER_VOLTS.findall(line)
    ratios = [(_to_float(number), unit, _to_float(volts), per) for number, unit, volts, per in stated]
    ratios += [(per, raw, number, unit) for number, unit, per, raw in ratios if raw not in {"V", "s"}]
    return tuple(
        (a / b * _PER_VOLT[raw], unit) for a, unit, b, raw in ratios if raw in _PER_VOLT and a * b > 0.0
    )


def span_in(line: str) -> tuple[str, float, float, str, str] | None:
    """Return text, factor, offset, raw unit and unit of a span such as ``x: 0 % = -40 mm; 100 % = 40 mm``."""
    points = [*_POINT_OF_SPAN.finditer(line)]
    if len(points) != 2 or len({(point[2], point[4]) for point in points}) != 1:
        return None
    (low, high), (begin, end) = ([_to_float(point[k].replace(" ", "")) for point in points] for k in (1, 3))
    if low == high or begin == end:
        return None
    factor = (end - begin) / (high - low)
    before = line[: points[0].start()].strip(" ;,:([")
    return before, factor, begin - factor * low, points[0][2], points[0][4]


def ranges_in(line: str) -> tuple[tuple[float, str], ...]:
    """Return the ranges in a line as (number, unit), such as ``Range force: 5 kN`` or ``100 % = 2 A``."""
    if (span := span_in(line)) is not None:
        return ((100.0 * span[1], span[4]),) if span[2:4] == (0.0, "%") else ()
    if _FROM_TO.search(line):
        return ()
    found = _RANGE_OF.findall(line) if re.search(_RANGE_WORDS, line, re.IGNORECASE) else []
    return tuple((_to_float(number), unit) for number, unit in found)


def _may_say(place: Place, role: str) -> bool:
    """Return True if a text may state a condition of the damper, and not a limit, range or ambient value."""
    text = place.text
    if place.source != "header" and not place.source.startswith(DOCUMENT):
        return True
    if _NOT_SET.search(text):
        return False
    if role == "temperature":
        is_of_damper = _TESTED_AT.search(text) or not has_word(text, "ambient")
        return bool(is_of_damper and (_OF_TEMPERATURE.search(text) or speaks_of(text, role)))
    # A line about a power supply states its rating, such as 24 V and 5 A, or a set current, which is used.
    is_set = role == "current" and _SET.search(text) and not labels_in(text, "voltage")
    is_rating = _SUPPLY.search(text) and not is_set
    return not is_rating and (role == "current" or bool(_OF_COMMAND.search(text)))


_SAMPLING = re.compile(
    r"sampl|\bcadence\b|(?<![^\W_])fs(?![^\W_])|\brate\b|messrate|abtast|acqui|échant|echant|muestr|campion|amostr|próbk|vzork|mintav|örnek|дискрет|опрос|采样|サンプ|샘플",
    re.IGNORECASE,
)
_RATE = re.compile(
    rf"({_NUMBER})\s*([kкK]?)(?:Hz|HZ|hz|Гц|S/s|Sa/s|samples/s|sps)\b|\(?([kкK]?)(?:Hz|HZ|hz|Гц)\)?\W+({_NUMBER})\b"
)
_FILTER = r"(?i:filter\w*|low.?pass|tiefpass|cut.?off|bandwidth|grenzfrequenz)"
_OF_FILTER = re.compile(  # "a 100 Hz anti-aliasing filter", "filtered at 100 Hz"
    rf"{_NUMBER}\s*k?Hz[ -](?i:(?:anti|alias\w*|analog\w*|bessel|butterworth)[ -])*{_FILTER}"
    rf"|{_FILTER}[\s:=(]+(?i:(?:at|of|with|bei|frequency)[\s:=]+)*{_NUMBER}\s*k?Hz"
)
_INTERVAL = re.compile(
    r"(?:delta_?x|sampl\w*[ _]?(?:interval|period|time)|x_?incr\w*|increment|\bdt\b|\bdx\b"
    r"|abtast\w*(?:intervall|zeit))"
    rf"\W*(?:\(?(ms|us|s)\)?)?\W+(?<![.,])({_NUMBER})\s*(?:(ms|us|µs|s)(?:ec(?:onds?)?)?)?\b",
    re.IGNORECASE,
)
_IN_SECONDS = re.compile(r"horizontal units?\W+s(ec\w*)?\W*$", re.IGNORECASE)
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}


def rates_in(lines: Iterable[str]) -> tuple[float, ...]:
    """Return the different sampling rates [Hz] in the lines above a table.

    A line must contain a word about sampling because other frequencies may be frequencies of the motion. An
    interval requires a unit, except ``Delta_X``, which LabVIEW writes in seconds.
    """
    rates: dict[float, None] = {}
    lines = list(lines)
    in_seconds = any(_IN_SECONDS.search(line) for line in lines)
    for line in lines:
        interval = _INTERVAL.search(line)
        if interval is not None:
            unit = interval[1] or interval[3] or ("s" if in_seconds or "delta" in interval[0].lower() else "")
            step = _to_float(interval[2]) * _SECONDS.get(unit.lower(), 0.0)
            if step > 0.0:
                rates[float(f"{1.0 / step:.9g}")] = None
        stated = _RATE.findall(_OF_FILTER.sub("", line)) if _SAMPLING.search(line) else ()
        for number, kilo, thousand, other in stated:
            rates[_to_float(number or other) * (1e3 if kilo or thousand else 1.0)] = None
    return tuple(filter(None, rates))


_DAMPER = r"(?:d[äa]mp|demp|am+ort|tłum)"
_REJECTED = re.compile(
    r"(?i)(?:\b(?:(?:do not|don.t|not to|not (?:to )?be) (?:use|evaluate|analy)|(?:is|are|was|were) not used"
    r"|not (?:a |for )(?:run|measurement|test|use|evaluation|analysis)\b(?! of)"
    r"|for (?:the )?records? only|unusable"
    r"|(?:discard|reject|abort|spoil)(?:ed|t)\b|invalid\b|nicht (?:zu )?(?:verw|auswert|benutz|brauchb|gült)"
    r"|not an? MR\b|kein MR\b"
    r"|unbrauchbar|ungültig|verworfen|fehlversuch|abgebrochen|ne pas (?:exploit|utilis|d[ée]pouill)|raté"
    r"|inexploitable|inutilisable|pour information|n(?:o|ão) (?:usar|utili[sz])|non (?:usare|utilizz)"
    r"|descartad|scartat|inv[áa]lid[aoe]|anulad|annullat|nie (?:używa|bra)|odrzucon|nieważn|nepouží|neplatn"
    r"|ne használ|érvénytelen|geçersiz|не использ|брак\b|недейств|kassera|ogiltig|ugyldig|hylätty|ongeldig"
    rf"|(?:without|ohne|sans|sin|sem|senza|bez|zonder|utan|uten) (?:\w{{1,3}}\W)?{_DAMPER}"
    rf"|{_DAMPER}\w* (?:\w{{2,3}} )?(?:(?:not|nicht|non|pas) (?:fitted|mounted|installed|attached"
    r"|eingebaut|monté|montiert)|removed|dismounted|ausgebaut|démonté)(?=\s*(?:$|[,;.()]))"
    r"|\bno damper(?! (?!fit|mou|inst)\w))"
    r"|作废|废弃|无效|不使用|不是\s?MR|MR\w*ではない|ノイズ確認用|無効|破棄|使用しない|무효|폐기)(?!\w*\s*[:=]\s*(?:0|no|none|false)\b)"
    r"|\b(?:valid|ok|usable|gültig|valide|válid[oa])\s*[:=]\s*(?:no|n|0|false|nein|non|nie|não)\b"
)
# The run is valid if a part of it or a correction is meant, or a spoiled run that it replaces.
_NOT_RUN = re.compile(r"(?i)\b(?:cycle|period|zykl|sample|channel|[ck]anal|signal|above|subtract)|\d ?m?s\b")
_REPLACES = re.compile(r"(?i)repe[at]|repl|instead|wiederh|ersat?z|rempl|répét|s[uo]stit|ripet|powt|повтор")


def rejection_in(line: str) -> re.Match[str] | None:
    """Return the words of a line that call a run spoiled or no measurement, None without such words."""
    found = _REJECTED.search(line)
    before, after = (line[: found.start()], line[found.end() :]) if found else ("", "")
    own, rest = (re.split(r"[,;()]|\.\s|\s[-\u2013\u2014]\s", text) for text in (before, after))
    subject = own[-1].rstrip(" :").split(":")[-1]
    of_channel = len(subject.split()) <= 2 and any(speaks_of(subject, role) for role in QUANTITIES)
    return None if of_channel or _NOT_RUN.search(own[-1] + rest[0]) or _REPLACES.search(before) else found
