"""Encodings of texts: UTF-8, UTF-16, else an East Asian one, Windows-1251 or -1252 where it may well be that.

A wrong one spoils words alone: numbers and the units that decide are ASCII in every one of them.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mrdamper.data.formats.table import MOST_WHOLE
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES

UTF8 = "utf-8-sig"
_WINDOWS, _CYRILLIC = "cp1252", "cp1251"
_CHINESE, _JAPANESE, _KOREAN = "gb18030", "cp932", "cp949"
READ_AS = {
    _WINDOWS: ("not UTF-8: read as Windows-1252",),
    _CYRILLIC: ("not UTF-8: read as Windows-1251 (Cyrillic)",),
    _CHINESE: ("not UTF-8: read as GB 18030",),
    _JAPANESE: ("not UTF-8: read as Shift JIS",),
    _KOREAN: ("not UTF-8: read as Korean (CP949)",),
}
"""What is told of a text in an encoding other than UTF-8."""

_NO_TEXT = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_NO_WINDOWS = re.compile(rb"[\x81\x8d\x8f\x90\x9d]")  # bytes that Windows-1252 leaves out;
_NO_CYRILLIC = b"\x98"  # the one that Windows-1251 does
_WORDS = re.compile(rb"[A-Za-z\x80-\xff]{3,}")
_CYRILLIC_WORD = re.compile(rb"[\xa8\xb8\xc0-\xff]+")  # of its letters alone
_FEWEST_WORDS = 2
_EAST = re.compile(r"[\u3000-\u30ff\u4e00-\u9fff\uff01-\uff5e\u2103\u3395-\u33df\x00-\x7f]*")
_MOST_LETTERS = 0.05  # beyond ASCII, of a text of numbers
_MARKS = (b"\xff\xfe", b"\xfe\xff")


def utf16_of(head: bytes) -> str:
    """Return the name of the UTF-16 that the first bytes are in, with or without a mark; "" for others."""
    if head.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):  # UTF-32
        return ""
    if head.startswith(_MARKS):
        return "utf-16"
    half = len(head) // 2
    first, second = head[0::2].count(0), head[1::2].count(0)
    for name, high, low in (("utf-16-le", second, first), ("utf-16-be", first, second)):
        if half > 8 and high > 0.9 * half and low < 0.3 * half:  # every other byte is zero
            return name
    return ""


@dataclass(frozen=True, slots=True)
class TextInMemory:
    """A text that a reader made of a part of a file, such as a sheet of a workbook."""

    place: str
    content: bytes  # UTF-8

    def __str__(self) -> str:
        return self.place


TextSource = Path | TextInMemory


def size_of(source: TextSource) -> int:
    """Return the bytes of a text."""
    return len(source.content) if isinstance(source, TextInMemory) else source.stat().st_size


def open_text_bytes(source: TextSource) -> BinaryIO:
    """Open a text for reading as bytes; one in UTF-16 gives those of UTF-8.

    Raises
    ------
    InputError
        A text in UTF-16 is damaged, or of more than 256 MB.
    """
    if isinstance(source, TextInMemory):
        return io.BytesIO(source.content)
    stream = source.open("rb")
    wide = utf16_of(stream.read(512))
    stream.seek(0)
    if not wide:
        return stream
    stream.close()
    if size_of(source) > MOST_WHOLE:
        raise InputError(
            place=source,
            found=f"the text is UTF-16 of more than {MOST_WHOLE >> 20} MB",
            remedy="Save the file as UTF-8",
        )
    try:
        return io.BytesIO(source.read_bytes().decode(wide).encode())
    except UnicodeError as error:
        raise InputError(
            place=source, found=f"the text is UTF-16 and damaged ({error})", remedy="Save the file as UTF-8"
        ) from error


def encoding_of(path: TextSource, content: bytes) -> str:
    """Return the encoding of a text that is not UTF-16.

    Raises
    ------
    InputError
        It is none that a text of numbers would have.
    """
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        if _NO_TEXT.search(content) is None:
            letters = len(content) - len(content.translate(None, bytes(range(128, 256))))
            eastern = _eastern(content)
            if eastern:
                return eastern
            if _NO_CYRILLIC not in content and _is_cyrillic(content):
                return _CYRILLIC
            if _NO_WINDOWS.search(content) is None and letters <= _MOST_LETTERS * len(content):
                return _WINDOWS
        raise InputError(
            place=f"{path}",
            found=(
                f"byte {error.start} is not UTF-8 text (0x{content[error.start]:02x}); save the file as UTF-8"
            ),
        ) from error
    return UTF8


def _is_cyrillic(content: bytes) -> bool:
    """Tell whether words beyond ASCII have none of its letters: those of a Latin script mix both."""
    words = [word for word in _WORDS.findall(content) if not word.isascii()]
    return len(words) >= _FEWEST_WORDS and all(_CYRILLIC_WORD.fullmatch(word) for word in words)


def _eastern(content: bytes) -> str:
    """Return the East Asian encoding of a text: one in which it names a channel, else the first that fits."""
    fitting = {
        encoding: content.decode(narrow)
        for narrow, encoding in (("gb2312", _CHINESE), (_JAPANESE, _JAPANESE), ("euc_kr", _KOREAN))
        if _is_pairs_of(narrow, content)
    }
    words = [word for each in QUANTITIES.values() for word in each.headers if len(word) > 1]
    named = [
        encoding
        for encoding, text in fitting.items()
        if any(word in text for word in words if not word.isascii())
    ]
    return next(iter((*named, *fitting)), "")


def _is_pairs_of(encoding: str, content: bytes) -> bool:
    """Tell whether all bytes beyond ASCII are pairs of an encoding, two at least: umlauts stand alone."""
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        return False
    return len(content) - len(text) > 1 and (encoding != _JAPANESE or _EAST.fullmatch(text) is not None)
