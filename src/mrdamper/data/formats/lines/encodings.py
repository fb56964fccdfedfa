"""Encodings of texts: UTF-8, UTF-16, East Asian encodings, Windows-1250 to Windows-1252.

A wrong choice damages only words: numbers and their units are ASCII in each of these encodings.
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import NoTableError
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES

UTF8 = "utf-8-sig"
_WINDOWS, _CENTRAL, _CYRILLIC = "cp1252", "cp1250", "cp1251"
_CHINESE, _JAPANESE, _KOREAN = "gb18030", "cp932", "cp949"
READ_AS = {
    _WINDOWS: "Windows-1252",
    _CENTRAL: "Windows-1250 (Central Europe)",
    _CYRILLIC: "Windows-1251 (Cyrillic)",
    _CHINESE: "GB 18030",
    _JAPANESE: "Shift JIS",
    _KOREAN: "Korean (CP949)",
}
"""Names of the encodings, for remarks on a text that is not UTF-8."""

_NO_TEXT = re.compile(rb"[\x00-\x08\x0b\x0e-\x19\x1b-\x1f\x7f]")  # not form feed and Ctrl-Z
_NO_WINDOWS = re.compile(rb"[\x81\x8d\x8f\x90\x9d]")  # Bytes that Windows-1252 does not define.
_NO_CYRILLIC = b"\x98"  # The byte that Windows-1251 does not define.
_POLISH = re.compile(rb"[a-z][\xb3\xb9\xbf][a-z]")  # These letters are signs in Windows-1252.
_WORDS = re.compile(rb"[A-Za-z\x80-\xff]{3,}")
_CYRILLIC_WORD = re.compile(rb"[\xa8\xb8\xc0-\xff]+")
# Two kana in sequence have no other encoding. One Chinese character may be an accented letter and the next.
_JAPANESE_TEXT = re.compile(
    r"(?s)(?=.*[\u3041-\u30fe]{2}).*|(?=.*[^\x00-\x7f]{2})"
    r"[\u3000-\u30ff\u4e00-\u9fff\uff01-\uff5e\u2103\u2460-\u2473\u3395-\u33df±×Ωμ\x00-\x7f]*"
)
_ROW = re.compile(rb"(?m)^\W*\d[\d.,eE+-]*[\t;, ]+[+-]?\d[\d.,eE+-]*\s")
_MARKS = (b"\xff\xfe", b"\xfe\xff")


def utf16_of(head: bytes) -> str:
    """Return the UTF-16 variant of the first bytes, with or without byte order mark; "" if not UTF-16."""
    if head.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):  # marks of UTF-32
        return ""
    if head.startswith(_MARKS):
        return "utf-16"
    half = len(head) // 2
    first, second = head[0::2].count(0), head[1::2].count(0)
    for name, high, low in (("utf-16-le", second, first), ("utf-16-be", first, second)):
        if half > 8 and high > 0.9 * half and low < 0.3 * half:  # Every second byte is zero.
            return name
    return ""


@dataclass(frozen=True, slots=True)
class Text:
    """The lines of a text, its name in messages, and remarks on how it was read."""

    place: str
    lines: list[str]
    notes: tuple[str, ...] = ()


def read_lines(source: Path | Text, size: int = -1) -> Text:
    """Return the lines of a text, or of its first ``size`` bytes. Line ends are LF, CR LF, CR or form feeds.

    Raise InputError if the text is damaged, larger than 512 MB, or in no supported encoding.
    """
    if isinstance(source, Text):
        return source
    if size < 0 and source.stat().st_size > SETTINGS.whole_file_max_bytes:
        found = f"a text of more than {SETTINGS.whole_file_max_bytes >> 20} MB"
        raise InputError(place=source, found=found, remedy="Split the file")
    with source.open("rb") as stream:
        content = stream.read(size)
    encoding = utf16_of(content[:512])
    notes = ("read from UTF-16",) if encoding else ()
    if not encoding:
        # The last of ``size`` bytes may be a part of a letter.
        encoding = encoding_of(f"{source}", content if size < 0 else content[: content.rfind(b"\n") + 1])
        notes = (f"not UTF-8: read as {READ_AS[encoding]}",) if encoding in READ_AS else ()
    try:
        text = content.decode(encoding, "strict" if size < 0 else "replace")
    except UnicodeError as error:
        found = f"the text is UTF-16 and damaged ({error})"
        raise InputError(place=source, found=found, remedy="Save the file as UTF-8") from error
    if (zero := text.find("\0")) >= 0:
        found = f"holds zero bytes after about line {text.count(chr(10), 0, zero) + 1}"
        remedy = "The file was cut off while it was written: cut the rest off, or record again"
        raise InputError(place=source, found=found, remedy=remedy)
    lines = re.sub("\r\n?|\f", "\n", text).removesuffix("\n").split("\n")
    return Text(f"{source}", lines, notes)


def encoding_of(place: str, content: bytes) -> str:
    """Return the encoding of a text that is not UTF-16.

    Raise InputError if the bytes are not a text in a supported encoding, NoTableError if they also contain no
    row of numbers.
    """
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        is_plain = _NO_TEXT.search(content) is None
        if is_plain and (encoding := _eastern(content) or _western(content)):
            return encoding
        with suppress(UnicodeDecodeError):  # A further encoding with pairs of bytes, such as Big5.
            if is_plain and content.decode(_CHINESE):
                return _CHINESE
        found = f"byte {error.start} is not UTF-8 text (0x{content[error.start]:02x})"
        fault = InputError if _ROW.search(content) else NoTableError
        raise fault(place=place, found=found, remedy="Save the file as UTF-8") from error
    return UTF8


def _western(content: bytes) -> str:
    """Return the encoding of a text in Cyrillic or Latin script, "" if it is not valid."""
    # Cyrillic words have no ASCII letters. Words in Latin script have letters of both kinds.
    words = [word for word in _WORDS.findall(content) if not word.isascii()]
    if len(words) >= 2 and all(map(_CYRILLIC_WORD.fullmatch, words)) and _NO_CYRILLIC not in content:
        return _CYRILLIC
    # In texts of European languages, up to one letter in seven is not ASCII, in single words up to a half.
    letters = len(content) - len(content.translate(None, bytes(range(128, 256))))
    letters_max = max(8, 0.15 * len(content), 0.5 * sum(map(len, words)))
    is_windows = _NO_WINDOWS.search(content) is None and letters <= letters_max
    return "" if not is_windows else _CENTRAL if _POLISH.search(content) else _WINDOWS


def _eastern(content: bytes) -> str:
    """Return the East Asian encoding of a text, preferably with names of channels; "" if none is valid."""
    fitting: dict[str, str] = {}
    for narrow, encoding in (("gb2312", _CHINESE), (_JAPANESE, _JAPANESE), ("euc_kr", _KOREAN)):
        with suppress(UnicodeDecodeError):
            text = content.decode(narrow)
            # All non-ASCII characters, at least two, are pairs of bytes. An umlaut is one byte.
            is_other = encoding == _JAPANESE and not _JAPANESE_TEXT.fullmatch(text)
            if len(content) - len(text) > 1 and not is_other:
                fitting[encoding] = text
    words = [word for each in QUANTITIES.values() for word in each.headers if len(word) > 1]
    named = [key for key, text in fitting.items() if any(w in text for w in words if not w.isascii())]
    return next(iter((*named, *fitting)), "")
