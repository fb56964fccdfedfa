"""Checks of input files; reading and writing of TOML documents.

Pipes, folders and documents of gigabytes are rejected with a message before reading. The callers interpret
the content.
"""

from __future__ import annotations

import json
import math
import stat
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from mrdamper.errors import InputError

PathLike = str | Path

_MOST_BYTES = 1 << 22  # max size of a document that users write by hand
_PAST_INTEGERS = 1 << 63


MAP_SUFFIX = ".channels.toml"
"""Suffix of a channel map. It follows the full name of the data file in the same folder."""


def printable(name: str) -> str:
    """Return a file name as printable text; bytes that are not UTF-8 are escaped."""
    return name.encode("utf-8", "backslashreplace").decode("utf-8")


def is_there(path: str | Path) -> bool:
    """Return True if the path exists; a name that is too long does not exist."""
    return _mode(path) != 0


def is_file(path: str | Path) -> bool:
    """Return True if the path is a regular file."""
    return stat.S_ISREG(_mode(path))


def is_folder(path: str | Path) -> bool:
    """Return True if the path is a folder."""
    return stat.S_ISDIR(_mode(path))


def _mode(path: str | Path) -> int:
    """Return the file mode, or 0 if the path cannot be read."""
    try:
        return Path(path).stat().st_mode
    except (OSError, ValueError):
        return 0


def require_file(path: str | Path, what: str = "file") -> int:
    """Return the size [bytes] of a regular file; anything else is an ``InputError``."""
    try:
        found = Path(path).stat()
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or error
        raise InputError(place=path, found=f"cannot read the {what}: {said}") from error
    if stat.S_ISDIR(found.st_mode):
        raise InputError(place=path, found=f"cannot read the {what}: is a folder", expected="a file")
    if not stat.S_ISREG(found.st_mode):
        raise InputError(
            place=path,
            found="is a pipe or a device",
            expected="a file",
            remedy="Save what it gives to a file first",
        )
    return found.st_size


def read_small(path: str | Path, what: str, most_bytes: int = _MOST_BYTES) -> bytes:
    """Return the bytes of a file; a file larger than ``most_bytes`` is an ``InputError``."""
    size = require_file(path, what)
    if size > most_bytes:
        raise InputError(
            place=path,
            found=f"has {size / 1e6:.3g} MB",
            expected=f"a {what} of at most {most_bytes / 1e6:.3g} MB",
            remedy="Check that this is the file you mean",
        )
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise InputError(place=path, found=f"cannot read the {what}: {error.strerror}") from error


def read_text(path: str | Path, what: str, most_bytes: int = _MOST_BYTES) -> str:
    """Return the UTF-8 text of a file; a file larger than ``most_bytes`` is an ``InputError``."""
    try:
        return read_small(path, what, most_bytes).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            place=path,
            found=f"not UTF-8 text at byte {error.start}",
            expected=f"a {what}",
            remedy="Save it as UTF-8",
        ) from error


def read_toml(path: str | Path, what: str) -> dict[str, Any]:
    """Read a TOML document from a file; ``what`` describes its expected content in messages."""
    content = read_small(path, what)
    try:
        return parse_toml(content.decode("utf-8-sig"))
    except (InputError, UnicodeDecodeError) as error:
        raise InputError(place=path, found=f"not a TOML file: {error}") from error


def parse_toml(text: str) -> dict[str, Any]:
    """Return the document in a TOML text. The caller adds the file name to errors."""
    try:
        document = tomllib.loads(text)
        _require_whole_numbers(document)
        return document
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(error)) from error
    except (
        RecursionError,
        ValueError,
        OverflowError,
    ) as error:  # The document is nested too deeply or has a number with too many digits.
        raise InputError(f"nested too deep, or a number too long ({type(error).__name__})") from error


def _require_whole_numbers(value: object) -> None:
    """Raise an error for integers outside 64 bits, which TOML excludes and a float may not represent."""
    if isinstance(value, dict | list):
        for each in value.values() if isinstance(value, dict) else value:
            _require_whole_numbers(each)
    elif isinstance(value, int) and not -_PAST_INTEGERS <= value < _PAST_INTEGERS:
        raise OverflowError


def toml_text(document: Mapping[str, Any], title: str = "") -> str:
    """Return a document as TOML: plain values first, then tables, lists of tables last."""
    lines = [*(f"# {line}" for line in title.splitlines()), *_toml_lines(document, "")]
    return "\n".join(lines).strip("\n") + "\n"


def _toml_lines(table: Mapping[str, Any], path: str) -> Iterator[str]:
    for key, value in table.items():
        if _is_plain(value):
            yield f"{_toml_key(key)} = {_toml_value(value)}"
    for many in (False, True):
        for key, value in table.items():
            if _is_plain(value) or isinstance(value, Mapping) is many:
                continue
            place = f"{path}{_toml_key(key)}"
            for row in value if many else [value]:
                if many or not row or any(map(_is_plain, row.values())):
                    yield from ("", f"[[{place}]]" if many else f"[{place}]")
                yield from _toml_lines(row, f"{place}.")


def _is_plain(value: object) -> bool:
    """Return False if a value is a table or a list of tables."""
    rows = value if isinstance(value, list | tuple) else [value]
    return not (rows and all(isinstance(each, Mapping) for each in rows))


def _toml_key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else json.dumps(key)


def _toml_value(value: object) -> str:
    """Return the TOML text of a number, text, boolean or list, which equals JSON for these types."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml_value, value))}]"
    if isinstance(value, float):
        if not math.isfinite(value):
            return "nan" if math.isnan(value) else f"{value:+}"
        short = f"{value + 0.0:.12g}"  # "-0" would be read as the integer 0
        return short if float(short) == value else repr(value)  # Reading the text must return the same value.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # DEL is invalid in TOML.
