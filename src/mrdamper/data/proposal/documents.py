"""Documents next to the runs that state test conditions: run lists, notes and settings.

A document is a small text or sheet. It applies to a file if it contains the name or the number of the file,
has the same name as the file, or is in a folder with a single run. The lines of a document are read like the
lines above a table (``words.labels``).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from mrdamper.data.finding import Finding
from mrdamper.data.formats.excel import WORKBOOK_SIGNATURES, sheet_lines
from mrdamper.data.formats.lines.cells import is_number
from mrdamper.data.formats.lines.encodings import read_lines
from mrdamper.data.formats.lines.header import DELIMITERS, holds_samples, line_of, split_line, with_unit
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import Table
from mrdamper.data.formats.text import is_text
from mrdamper.data.formats.timestamps import date_in, start_in
from mrdamper.data.proposal.folders import GENERIC_SUFFIXES, is_small_file, own_name
from mrdamper.data.proposal.notation import NOTATIONS, SCRIPTS, entries_of
from mrdamper.data.records import LEAST_SAMPLES
from mrdamper.data.tables import decoding
from mrdamper.data.words.headers import speaks_of, strip_channel
from mrdamper.data.words.labels import CONDITIONS, Place, labels_in, rejection_in
from mrdamper.errors import InputError
from mrdamper.files import MAP_SUFFIX
from mrdamper.quantities import is_any_unit

_RUN = (
    r"run|test|file|rec|record|versuch|lauf|messung|essai|prueba|ensayo|ensaio|prova|próba|pomiar|zkouška|měření"
    r"|meting|proef|mätning|körning|mittaus|mérés|încercare|deney|опыт|испытание|замер"
)
_SPECIMEN = r"specimen|probe|prüfling|éprouvette|échantillon|provino|muestra|probeta|amostra|próbka|试样|试件"
_NUMBER_WORDS = re.compile(rf"^$|\b(no|nr|num|number|id|{_RUN})\b|^({_SPECIMEN})\b|#", re.IGNORECASE)
_NUMBER_IN_LINE = re.compile(  # The number of a run, as in "run 7", but no value, as in "test 2 A".
    rf"\b(?:{_RUN})s?[\s_.#-]{{0,2}}(\d{{1,9}})\b(?![.,]\d|\s?(?:m?[AV]|°|deg|[CK]|mm|k?Hz|s|k?N|%)\b)"
    r"(?!\s?(?:[,&+–-]|and|und|et|to|bis)\s?\d)",  # A list of runs is not one run.
    re.IGNORECASE,
)
_CLOCK_OF_LIST = re.compile(r"(?<![\d:.,])(\d{1,2}:\d{2})(?![\d:.,])")  # time of day without seconds
_WHOLE = re.compile(r"\d{1,9}(\.0)?")
_HEADING = re.compile(r"\s*(\[.*\]|#+ .*|[^:=]*:)\s*")
_ALL_RUNS = re.compile(
    r"\b(?:all|every|alle[nr]?|alla|tou(?:te)?s|tod[ao]s|tutt[ei]|wszystki\w*|vše\w*|kaik\w*|minden"
    r"|összes|toate|tüm|bütün|все\w?)(?: \w{2,3})? "
    rf"(?:{_RUN}|meas|mess|mesure|prove|prób|zkouš|mittau|încerc|испыт|измер)"
    r"|(?:全|全部|所有|すべて|各|모든)\s?(?:的|の)?(?:试验|实验|测试|試験|測定|実験|시험|실험|측정)"
    r"|^\W*(?:general|common|global|allgemein)\W*$",
    re.IGNORECASE,
)
_PACKED = re.compile(r"\.(?:gz|bz2|xz)$")
_CODE = r"(?:^|(?<=[,;:(|])(?!(?<=\d,)\d))[\s*`'\"-]*({})[`'\"]*\s*(?:=|:|->|→|[-–]\s)"
_CODE_OR_NAME = rf"{_CODE[:-1]}|(?<=\s)(?=[+-]?\d))"  # A value after the name of a file needs no sign.
_VALUE = r"\d+(?:[.,p]\d+)?\s?m?[AV](?![^\W_])"  # A current in the names of files is a code too.
_ANY_CODE = re.compile(_CODE.format(rf"[^\W\d_]\w{{0,3}}|\d{{1,2}}(?=\s*=)|{_VALUE}"))
_SENTENCE_END = re.compile(r"(?<=[^\W\d_][.;!])\s+(?=[`'\"]?[^\W\d_])")
_LINK = r"(?:\s*[,&+]\s*|\s+(?:and|und|et|y|e|i|og|och|ja|и)\s+)"  # between the names of a list
_ENTRY = re.compile(r"\s*[-*]?\s*([^\s:=][^:=]*?)\s*[:=]\s*([^\s:=][^:=]*?)\s*")


@dataclass(frozen=True, slots=True)
class Document:
    """Document next to the runs, with the lines that state conditions of each file."""

    path: Path
    lines: Mapping[Path, tuple[str, ...]]
    whole: tuple[str, ...] = ()  # All lines; they may explain columns, signs and the sampling rate.
    owners: tuple[Path, ...] = ()  # The files of the only described run, () if any run may be described.
    rejected: Mapping[Path, str] = field(default_factory=dict)  # Reasons to omit files, such as spoiled runs.

    def places(self, file: Path) -> tuple[Place, ...]:
        """Return the lines about a file, each with the document as its source."""
        return tuple(Place(f"document {self.path.name!r}", line) for line in self.lines.get(file, ()))

    def notes(self, file: Path) -> tuple[str, ...]:
        """Return the lines that may explain the columns of a file in the folder of the document or below."""
        return self.whole if file in (self.owners or (file,)) and self.path.parent in file.parents else ()

    @property
    def finding(self) -> Finding:
        """Return the finding that this document states conditions of runs, such as the current."""
        found = f"states current, voltage, temperature or start of {len(self.lines)} files"
        effect = "The values are used if a file does not state its own"
        return Finding("index", found, effect, "Check these values", severity="note", run=self.path.name)


class _Files:
    """Files of a folder by the names that a document may use for the files.

    Such a name is the name of a file, the name of a run with one file per channel, or the name of a folder.
    The name of a folder means all files in the folder.
    """

    def __init__(self, files: Sequence[Path], root: Path) -> None:
        owners: dict[str, dict[Path, list[Path]]] = {}
        above = {
            parent: {each.name: each for each in (parent, *parent.parents) if root in each.parents}
            for parent in {path.parent for path in files}
        }
        for path in files:
            names = dict.fromkeys((path.stem, path.name, strip_channel(path.stem)), path.parent)
            for name, owner in {**names, **above[path.parent]}.items():
                owners.setdefault(name.lower(), {}).setdefault(owner, []).append(path)
        owners.pop("", None)
        # Equal names in different folders are ambiguous.
        self.names = {name: tuple(*found.values()) for name, found in owners.items() if len(found) == 1}
        self.suffixes = {path.suffix.lower() for path in files} - {""}
        # Files by the last number in the name of the run or folder, if these numbers are different.
        self.numbers: dict[int, tuple[Path, ...]] = {}
        for keys in (
            {path: path.parent / strip_channel(own_name(path)) for path in files},
            {path: path.parent for path in files},
        ):
            groups: dict[Path, list[Path]] = {}
            for path, key in keys.items():
                groups.setdefault(key, []).append(path)
            last = {key: found[-1] for key in groups if (found := re.findall(r"\d{1,9}", key.name))}
            numbers = {int(number): tuple(groups[key]) for key, number in last.items()}
            # A file without a number, such as a table of results, may be next to one series of files.
            is_series = len({re.sub(r"\d+", "#", key.name) for key in last}) == 1
            if not self.numbers and len(numbers) == len(last if is_series else groups) > 1:
                self.numbers = numbers

    def in_cell(self, cell: str) -> tuple[Path, ...]:
        name = re.split(r"[\\/]", cell)[-1].strip(" `*\"'").lower()
        return self.names.get(name) or self.names.get(_PACKED.sub("", name), ())

    def by_number(self, cell: str) -> tuple[Path, ...]:
        return self.numbers.get(int(float(cell)), ()) if _WHOLE.fullmatch(cell) else ()

    def in_row(self, cells: Sequence[str]) -> list[tuple[Path, ...]]:
        """Return the files that each cell names, [] unless the cells name different runs."""
        found = [self.in_cell(cell) for cell in cells]
        if not any(found) and _NUMBER_WORDS.search(cells[0]) and all(map(_WHOLE.fullmatch, cells[1:])):
            found = [(), *map(self.by_number, cells[1:])]
        return found if len({*found} - {()}) > 1 else []

    def in_list(self, text: str) -> tuple[list[Path], str, str]:
        """Return the files of the only list or name ("runs 3, 5 and 7"), and the text before and after it."""
        names = "|".join(map(re.escape, sorted(self.names, key=len, reverse=True))) or "(?!)"
        named = ("", rf"[`'\"]?(?:{names})[`'\"/]*", self.in_cell)
        for before, item, owners in (named, (rf"(?:{_RUN})s?[\s_.#-]{{0,2}}", r"\d{1,9}", self.by_number)):
            form = rf"(?<!\w){before}({item}(?:{_LINK}{item})*)(?!\w|\s?(?:[–-]|to|bis)\s?\d)"
            found = [*re.finditer(form, text, re.IGNORECASE)]
            if len(found) == 1 and re.search(r"[\W\d_]", found[0][0]):
                clause = re.split(r"[,;:|\t(]", text[: found[0].start()])[-1]
                words = re.split(_LINK, found[0][1]) if len(clause.split()) <= 3 else []
                listed = [file for word in words for file in owners(word.strip("`'\"/"))]
                return listed, text[: found[0].start()], text[found[0].end() :]
        return [], "", ""

    def are_others(self, words: Sequence[str]) -> bool:
        """Return True if a word is the name of a file that is not in the folder, such as a deleted run."""
        return any(Path(word).suffix in self.suffixes and word not in self.names for word in words)

    def in_line(self, line: str) -> tuple[Path, ...]:
        """Return the files named in a sentence: by name, by a stem with letters and digits, or by number."""
        words = [_PACKED.sub("", word) for word in re.findall(r"[\w.+-]*\w", line.lower())]
        names = [word for word in words if word in self.names and re.search(r"\.|[^\W\d_].*\d", word)]
        if not names and self.numbers and not self.are_others(words):
            found = {self.numbers.get(int(number), ()) for number in _NUMBER_IN_LINE.findall(line)}
            return found.pop() if len(found) == 1 else ()
        return self.names[names[0]] if len({self.names[name] for name in names}) == 1 else ()


def read_documents(files: Sequence[Path], folders: Sequence[Path]) -> tuple[Document, ...]:
    """Return the documents that state conditions of files, among the files and in ``folders``."""
    inside = {
        each
        for folder in folders
        for each in sorted(folder.iterdir())
        if not each.name.startswith((".", "~$")) and not f".{each.name}".endswith(MAP_SUFFIX)
    }
    suffixes = {file.suffix for file in files}
    texts: dict[Path, list[str]] = {}
    for path in (*files, *sorted(inside - {*files})):
        with suppress(InputError, OSError, ValueError, RecursionError):  # damaged text, JSON or workbook
            texts[path] = _lines_of(path)
    sampled = {path for path in texts if any(holds_samples(texts[path], sign) for sign in DELIMITERS)}
    found = []
    for path, lines in texts.items():
        is_run = path in files and path.suffix.lower() not in NOTATIONS
        is_run |= path in sampled and path.suffix in suffixes
        is_list = bool(lines) and not (is_run and _is_long_table(lines))
        others = [file for file in files if file != path] if is_list else []
        siblings = [file for file in others if file.parent == path.parent]
        below = [file for file in others if path.parent in file.parents]
        # A short text without samples is no run. Runs that the user did not choose are counted as well.
        runs = [
            file
            for file in (() if is_run else texts)
            if path.parent in file.parents and file != path and file.suffix in suffixes
            if file in sampled or not texts[file] or file.suffix.lower() in GENERIC_SUFFIXES
        ]
        owners = () if is_run else _owners(path, lines, siblings, runs if {*runs} <= {*files} else ())
        stating: Mapping[Path, tuple[str, ...]] = {}
        for group in (siblings, below):
            if group and not stating:
                stating = _stating(_matrix_lines(path, lines, group))
                stating = stating or _stating(_lines_by_file(path, lines, group, is_run=is_run))
        for file in owners:
            own = [with_unit(line_of(re.split("[\t;]", _strip_name(line, file)))) for line in lines]
            stating = {**stating, **_stating({file: [*stating.get(file, ()), *own]})}
        whole = () if path in sampled else tuple(lines)
        rejected = rejected_in(path, lines, below, is_run=is_run) if is_list else {}
        if stating or whole or rejected:
            found.append(Document(path, stating, whole, owners, rejected))
    return tuple(found)


def rejected_in(path: Path, lines: Sequence[str], files: Sequence[Path], *, is_run: bool) -> dict[Path, str]:
    """Return the files that a document calls spoiled or no run, with the reason; {} if it means all files."""
    sentences = [part for line in lines for part in _SENTENCE_END.split(line)]
    known = _Files(files, path.parent)
    rejections = {line: found for line in sentences if (found := rejection_in(line))}
    listed: dict[str, list[Path]] = {}
    for line, found in rejections.items():
        # "run_2 was aborted": the name is at most two words before the rejection, or in another clause.
        subject, _, gap = known.in_list(line[: found.start()])
        is_near = len(re.findall(r"\w+", gap)) <= 2 - (":" in gap) or re.search(r"[-–,;(]\s*$", gap)
        is_said = is_near and not re.search(r"\d|\b(?:not?|nicht|kein\w*|ne|pas)\b", gap)
        # "Do not use run_2, pump failure": the sentence consists of the rejection, the name and a remark.
        others, before, after = known.in_list(re.sub(r"^\w+", "", line[found.end() :]))
        is_asked = not re.search(r"\w", line[: found.start()] + before) and not re.match(r"\s*\w", after)
        listed[line] = (subject if is_said else []) or (others if is_asked else [])
    # A sentence may name a run that it does not reject: "`sim` is a model of run_3, not a measurement".
    rows = {line for line in rejections if len(_cells(line)) > 2 and any(map(known.in_cell, _cells(line)))}
    clear = [line for line in sentences if line in rows or listed.get(line, True) or not known.in_line(line)]
    about = _lines_by_file(path, clear, files, is_run=is_run)
    for line, own in listed.items():
        about |= {file: [*about.get(file, []), line] for file in own}
    lines_of = {file: line.strip() for file, own in about.items() for line in own if rejection_in(line)}
    rejected = {file: f"is rejected by {path.name!r} ({line})" for file, line in lines_of.items()}
    return rejected if len(rejected) < len(files) else {}


def spoiled_tables(tables: Sequence[Table], notes: Sequence[str], file: str) -> dict[int, str]:
    """Return the reason by index of each table that a line calls spoiled or no run; {} if it means all."""
    lines = [line for table in tables[:1] for each in table.lists.values() for line in each]
    lines += [line for line in notes if file in line or not re.search(r"[\w*-]\.[A-Za-z]\w{1,4}\b", line)]
    titles = [Path(f"{table.title}.sheet") for table in tables]
    named = rejected_in(Path("a document"), lines, titles, is_run=False) if len(tables) > 1 else {}
    found = {k: named[title] for k, title in enumerate(titles) if title in named}
    own = {k: line.strip() for k, table in enumerate(tables) for line in table.said if rejection_in(line)}
    found |= {k: f"is rejected by its line {line!r}" for k, line in own.items()}
    return found if len(found) < len(tables) else {}


def _owners(
    path: Path, lines: Sequence[str], siblings: Sequence[Path], runs: Sequence[Path]
) -> tuple[Path, ...]:
    """Return the files of the only run that a document describes, () if it may describe several runs.

    The document has the name of the run, perhaps with further words, or the folder has only one run. A script
    must have the name of the run, because other scripts may process any data.
    """
    names, stem = _Files(siblings, path.parent).names, path.stem.lower()
    while stem and (stem not in names or not (stem == path.stem.lower() or re.search(r"\d", stem))):
        stem = re.sub(r"[\W_]*[^\W_]*$", "", stem)  # The last word is removed.
    others = {file.name.lower() for file in siblings if file not in names.get(stem, ())}
    if stem and not any(other in line.lower() for other in others for line in lines):
        return names[stem]
    return (*runs,) if len(runs) == 1 and path.suffix.lower() not in SCRIPTS else ()


def lines_by_title(tables: Sequence[Table], notes: Sequence[str]) -> dict[str, list[str]]:
    """Return the lines on each title of a run in a file from a list of runs.

    The list of runs is on a different sheet or in a document. A title is the name of a table, or a word in a
    column that divides a table into runs.
    """
    words = [({*texts}, table) for table in tables for texts in table.texts.values()]
    # A column with more words than runs of minimum length are possible contains remarks on single samples.
    cells = {cell for each, table in words if len(each) * LEAST_SAMPLES <= table.rows for cell in each}
    titles = [Path(f"{title}.sheet") for title in {*(table.title for table in tables), *cells} if title]
    found: dict[str, list[str]] = {}
    for sheet, lines in {**tables[0].lists, "": notes}.items() if titles else ():
        about = _lines_by_file(Path(f"{sheet}.sheet"), lines, titles, is_run=False)
        for title, each in _stating(about).items():
            found.setdefault(title.stem, []).extend(each)
    stated = [line for lines in (*(table.said for table in tables), *found.values()) for line in lines]
    if not any(labels_in(line, "temperature") for line in stated):
        # An entry such as "Oil temperature: 25 °C" applies to all runs of the workbook.
        rows = (line.split("\t") for lines in tables[0].lists.values() for line in lines)
        named = [row for row in rows if speaks_of(row[0], "temperature") and not re.search(r"\d", row[0])]
        warm = [with_unit(line_of(row)) for row in named if sum(map(is_number, row)) < 2]
        for title in titles:
            found.setdefault(title.stem, []).extend(warm)
    return found


def _stating(about: Mapping[Path, Sequence[str]]) -> dict[Path, tuple[str, ...]]:
    """Return the lines that state conditions or the start of a run, by file."""
    found = {
        file: tuple(
            line
            for line in (_CLOCK_OF_LIST.sub(r"\1:00", line) for line in each)
            if start_in([line]) or date_in([line]) or any(labels_in(line, role) for role in CONDITIONS)
        )
        for file, each in about.items()
    }
    return {file: each for file, each in found.items() if each}


def _lines_of(path: Path) -> list[str]:
    """Return the lines of a small text or sheet, with tabs between cells, or the entries of a notation.

    Raise InputError, OSError, ValueError or RecursionError if the file is damaged or not readable.
    """
    if not is_small_file(path):
        return []
    with path.open("rb") as stream:
        head = stream.read(512)
    if head.startswith(WORKBOOK_SIGNATURES):
        with decoding(path, "Excel"):
            return sheet_lines(path)[: SETTINGS.document_lines_max]
    if not is_text(head):
        return []
    lines, suffix = read_lines(path).lines, path.suffix.lower()
    lines = entries_of("\n".join(lines), suffix) if suffix in NOTATIONS else lines
    return lines[: SETTINGS.document_lines_max]


def _is_long_table(lines: Sequence[str]) -> bool:
    """Return True if the lines are a long table of numbers, which is not a list of runs."""
    if len(lines) <= SETTINGS.run_list_lines_max:
        return False
    worded = [line.lstrip("# ") for line in lines if re.search(r"[^\W\d_]{2}", line)]
    return 2 * len(worded) < len(lines) and not any(map(_NUMBER_WORDS.search, worded))


def _lines_by_file(
    path: Path, lines: Sequence[str], files: Sequence[Path], *, is_run: bool
) -> dict[Path, list[str]]:
    """Return the lines of a document about each file. A table in it is used if most rows name files."""
    known = _Files(files, path.parent)
    text = "\n".join(lines).lower()
    names_a_file = bool(known.numbers) or any(name in text for name in known.names)
    if is_run and not names_a_file:
        return {}  # The file is a run that names no other file.
    codes = _codes(lines, files)
    found = _lines_by_code(lines, codes, known.names)
    now: tuple[Path, ...] = ()  # The files to which the next entries apply.
    header: list[str] = []
    mentions = 0
    in_section = False
    across: list[tuple[Path, ...]] = []  # The files of each column, if the columns of a table are runs.
    for line in (entry for whole in lines for entry in _entries_of_runs(whole)):
        cells = _cells(line)
        across = known.in_row(cells) or (across if len(cells) == len(across) else [])
        for owners, cell in zip(across, cells, strict=False):
            for file in owners:
                found.setdefault(file, []).append(with_unit(f"{cells[0]}: {_strip_name(cell, file)}"))
        if across:
            mentions += 1
            continue
        named = next((named for cell in cells if (named := known.in_cell(cell))), ())
        named = named or codes.get(_code(cells[0]), ())
        if not named and len(cells) == len(header):
            counts = [cell for name, cell in zip(header, cells, strict=True) if _NUMBER_WORDS.search(name)]
            if not known.are_others([cell.lower() for cell in cells]):
                named = next(filter(None, map(known.by_number, counts)), ())
        if named and len(cells) > 1 and len(cells) == len(header):
            stated = [pair for pair in zip(header, cells, strict=True) if not known.in_cell(pair[1])]
            for file in named:
                found.setdefault(file, []).extend(with_unit(f"{name}: {value}") for name, value in stated)
            mentions += 1
            continue
        is_header = len(cells) > 1 and not named and not any(is_number(cell) for cell in cells)
        if is_header and re.search(r"[^\W\d_]", line):
            units = [cell.strip("[]()") for cell in cells]
            is_units = len(cells) == len(header) and all(
                not unit or _NUMBER_WORDS.search(unit) or is_any_unit(unit) for unit in units
            )
            both = zip(header, units, strict=False)
            header = [f"{h} [{u}]" if u else h for h, u in both] if is_units else cells
        named = named or known.in_line(line)
        mentions += bool(named)
        is_heading = _HEADING.fullmatch(line) is not None
        goes_on = bool(now) and (in_section or line[:1] in {" ", "\t"}) and _ENTRY.fullmatch(line)
        if named or is_heading or not goes_on:
            now = named or (tuple(files) if _ALL_RUNS.search(line) else ())
            in_section = is_heading or (in_section and bool(named))
        for file in now:
            found.setdefault(file, []).append(with_unit(_strip_name(line, file)))
    return found if 2 * mentions > sum(bool(line.strip()) for line in lines[1:]) or not is_run else {}


def _entries_of_runs(line: str) -> list[str]:
    """Return a line for each run in a line such as ``Temperature: run 1: 20 °C; run 2: 23 °C``."""
    numbers = _NUMBER_IN_LINE.finditer(line)
    starts = [each.start() for each in numbers if line[each.end() :].lstrip()[:1] in {":", "="}]
    entries = [f"{line[: starts[0]]} {line[a:b]}" for a, b in pairwise([*starts, len(line)])]
    return entries if len(entries) > 1 else [line]


def _codes(lines: Sequence[str], files: Sequence[Path]) -> dict[str, tuple[Path, ...]]:
    """Return the files by a code in their names that a document explains, such as B in "MR3-B1.csv".

    A code is a word, a number or a letter. The codes at one index of the names differ, and the document
    explains all of them.
    """
    explained = {_code(cell) for line in lines for cell in _ANY_CODE.findall(line)}
    explained |= {cell for line in lines if not (cell := _code(_cells(line)[0])).isdigit()}
    found: dict[str, set[tuple[Path, ...]]] = {}
    for part in (r"[^\W_]+", r"\d+|[^\W\d_]+", r"[^\W_]", _VALUE):
        parts = {file: [*map(_code, re.findall(part, file.stem))] for file in files}
        for kind in {(file.suffix, len(each)) for file, each in parts.items()}:
            names = {file: each for file, each in parts.items() if (file.suffix, len(each)) == kind}
            for column in zip(*names.values(), strict=True):
                for code in {*column} if len({*column}) > 1 and {*column} <= explained else ():
                    owners = tuple(file for file, own in zip(names, column, strict=True) if own == code)
                    found.setdefault(code, set()).add(owners)
    return {code: owners.pop() for code, owners in found.items() if len(owners) == 1}


def _code(text: str) -> str:
    """Return a code in lower case, without marks around it. A current has one spelling: ``0.3a``."""
    code = text.strip(" `*\"'-").lower()
    value = re.fullmatch(r"(\d+)(?:[.,p](\d+))?\s?(m?[av])", code)
    return f"{float(f'{value[1]}.{value[2] or 0}'):g}{value[3]}" if value else code


def _lines_by_code(
    lines: Sequence[str], codes: Mapping[str, Sequence[Path]], names: Mapping[str, Sequence[Path]]
) -> dict[Path, list[str]]:
    """Return the entries about each file in lines such as ``Current: A = 0 A, B = 0.5 A``.

    Instead of codes, a line may have at least two names of files: ``Oil: run_a 24 degC, run_b 25 degC``.
    """
    found: dict[Path, list[str]] = {}
    for known, form, others, count_min in ((codes, _CODE, [_VALUE], 1), (names, _CODE_OR_NAME, [], 2)):
        words = [*others, *map(re.escape, sorted(known, key=len, reverse=True))]
        entry = re.compile(form.format("|".join(words)), re.IGNORECASE)
        for line in lines if known else ():
            before, *entries = entry.split(line)
            pairs = [*zip(entries[::2], entries[1::2], strict=True)]
            for name, value in pairs if len(pairs) >= count_min else ():
                for file in known.get(_code(name) if known is codes else name.lower(), ()):
                    found.setdefault(file, []).append(f"{before.strip()} {value.strip(' ,;)')}")
    return found


def _matrix_lines(path: Path, lines: Sequence[str], files: Sequence[Path]) -> dict[Path, list[str]]:
    """Return the headings of row and column of each file in a table whose cells name or number the files.

    The table must contain each file exactly once, because its cells may be counts or results.
    """
    found: dict[Path, list[str]] = {}
    heads: Sequence[str] = ()
    known = _Files(files, path.parent)
    for cells in map(_cells, lines):
        named = [known.by_number(cell) or known.in_cell(cell) for cell in cells[1:] if cell]
        if len(cells) != len(heads) or not named or not all(named):
            heads = cells
            continue
        for head, cell in zip(heads[1:], cells[1:], strict=True):
            column = f"{heads[0]}: {head}" if is_number(head) else head
            for file in (known.by_number(cell) or known.in_cell(cell)) if cell else ():
                found.setdefault(file, []).extend(map(with_unit, (column, f"{heads[0]}: {cells[0]}")))
    is_whole = found.keys() == {*files} and all(len(each) == 2 for each in found.values())
    return found if is_whole else {}


def _strip_name(line: str, file: Path) -> str:
    """Return a line without the name of the file, because the name may contain other values."""
    stem = rf"|\b{re.escape(file.stem)}\b" if len(file.stem) > 2 else ""
    return re.sub(rf"{re.escape(file.name)}{stem}", "", line)


def _cells(line: str) -> list[str]:
    """Return the cells of a row, split at tabs, else at the sign that gives most cells, else at blanks."""
    apart = re.split(r"\s{2,}|\u3000", line.strip())
    # Commas are in numbers or in a remark of several words.
    if len(apart) > 1 + (", " in line) and not re.search(r"[\t;|]|(?<!\d),(?! \w)|,(?!\d| \w)", line):
        return apart
    signs = DELIMITERS[:1] if "\t" in line else DELIMITERS[:-1]
    cells = max((split_line(line.strip(" \r\n").strip("|"), sign) for sign in signs), key=len)
    return cells if len(cells) > 1 else apart
