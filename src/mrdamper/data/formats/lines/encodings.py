"""Encodings of texts: UTF-8, UTF-16, East Asian encodings, Windows-1250 to Windows-1252.

A wrong choice damages only words: numbers and their units are ASCII in each of these encodings.
"""

from __future__ import annotations

import io
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mrdamper.data.formats.settings import SETTINGS
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

_NO_TEXT = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_NO_WINDOWS = re.compile(rb"[\x81\x8d\x8f\x90\x9d]")  # Bytes that Windows-1252 does not define.
_NO_CYRILLIC = b"\x98"  # The byte that Windows-1251 does not define.
_POLISH = re.compile(rb"[a-z][\xb3\xb9\xbf][a-z]")  # These letters are signs in Windows-1252.
_WORDS = re.compile(rb"[A-Za-z\x80-\xff]{3,}")
_CYRILLIC_WORD = re.compile(rb"[\xa8\xb8\xc0-\xff]+")
_EAST = re.compile(r"[\u3000-\u30ff\u4e00-\u9fff\uff01-\uff5e\u2103\u3395-\u33df\x00-\x7f]*")
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
class TextInMemory:
    """A text from a part of a file, such as a sheet of a workbook."""

    place: str
    content: bytes  # UTF-8

    def __str__(self) -> str:
        return self.place


TextSource = Path | TextInMemory


def open_text_bytes(source: TextSource) -> BinaryIO:
    """Open a text for reading as bytes. UTF-16 is converted to UTF-8, and line ends of CR alone to LF.

    Raise InputError if a text in UTF-16 is damaged, or if a text is larger than 512 MB.
    """
    if isinstance(source, TextInMemory):
        return io.BytesIO(source.content)
    if source.stat().st_size > SETTINGS.whole_file_max_bytes:
        found = f"a text of more than {SETTINGS.whole_file_max_bytes >> 20} MB"
        raise InputError(place=source, found=found, remedy="Split the file")
    with source.open("rb") as stream:
        head = stream.read(1 << 16)
    wide = utf16_of(head[:512])
    if not wide and (b"\n" in head or head.count(b"\r") < 2):
        return source.open("rb")
    try:
        content = source.read_bytes().decode(wide).encode() if wide else source.read_bytes()
    except UnicodeError as error:
        raise InputError(
            place=source, found=f"the text is UTF-16 and damaged ({error})", remedy="Save the file as UTF-8"
        ) from error
    return io.BytesIO(content if b"\n" in content else content.replace(b"\r", b"\n"))


def encoding_of(path: TextSource, content: bytes) -> str:
    """Return the encoding of a text that is not UTF-16.

    Raise InputError if the bytes are not a text of numbers in a supported encoding.
    """
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        is_plain = _NO_TEXT.search(content) is None
        if is_plain and (encoding := _eastern(content) or _western(content)):
            return encoding
        found = f"byte {error.start} is not UTF-8 text (0x{content[error.start]:02x})"
        raise InputError(place=f"{path}", found=found, remedy="Save the file as UTF-8") from error
    return UTF8


def _western(content: bytes) -> str:
    """Return the encoding of a text in Cyrillic or Latin script, "" if it is not valid."""
    # Cyrillic words have no ASCII letters. Words in Latin script have letters of both kinds.
    words = [word for word in _WORDS.findall(content) if not word.isascii()]
    if len(words) >= 2 and all(map(_CYRILLIC_WORD.fullmatch, words)) and _NO_CYRILLIC not in content:
        return _CYRILLIC
    # In texts of European languages, up to one letter in seven is not ASCII.
    letters = len(content) - len(content.translate(None, bytes(range(128, 256))))
    is_windows = _NO_WINDOWS.search(content) is None and letters <= 0.15 * len(content)
    return "" if not is_windows else _CENTRAL if _POLISH.search(content) else _WINDOWS


def _eastern(content: bytes) -> str:
    """Return the East Asian encoding of a text, "" if no encoding is valid.

    Of several valid encodings, an encoding is chosen that turns the bytes into the name of a channel.
    """
    fitting: dict[str, str] = {}
    for narrow, encoding in (("gb2312", _CHINESE), (_JAPANESE, _JAPANESE), ("euc_kr", _KOREAN)):
        with suppress(UnicodeDecodeError):
            text = content.decode(narrow)
            # All non-ASCII characters, at least two, are pairs of bytes. An umlaut is one byte.
            if len(content) - len(text) > 1 and (encoding != _JAPANESE or _EAST.fullmatch(text)):
                fitting[encoding] = text
    words = [word for each in QUANTITIES.values() for word in each.headers if len(word) > 1]
    named = [key for key, text in fitting.items() if any(w in text for w in words if not w.isascii())]
    return next(iter((*named, *fitting)), "")
