"""Work folder of the server, and the check of file names in requests. The command line reads the same files.

    runs/         measured files; a mapped file has a map NAME.channels.toml
    records/      long records for cycle counting; the user copies them there
    inputs/       geometry, sinks, fluids, targets, campaigns (TOML), load cycles (CSV)
    cards/NAME/   output of ``mrdamper fit --out``
    results/ID/   one job: job.json, progress.json, answer.json and output files
    dampers/NAME/ another damper: a folder with the same structure
    .trash/ID/    removed items, in subfolders with the names of their original folders
    .cache/       samples of runs for plots; may be deleted at any time

Only this module turns the name in a request into a path. The item must be directly in the folder of its kind,
and must not be a link that leads out of this folder. New names contain only common characters.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import time
import unicodedata
from collections.abc import AsyncIterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TextIO

from mrdamper.errors import InputError, MrdamperError
from mrdamper.files import MAP_SUFFIX
from mrdamper.runtime.outputs import lock, recover_staging

FAULT = "internal fault: this is a fault of mrdamper; the server's terminal shows the traceback"
"""Message of an internal error, without details."""

_SIGNS = frozenset(" ._-+=,()[]@#%&")
_NAME_MAX_BYTES = 150  # Most file systems allow 255 bytes.
INPUT_SUFFIXES = (".toml", ".csv", ".json")
_ESCAPED = re.compile(r"%[0-9a-fA-F]{2}")  # Some programs would decode %41 in a name to A.
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


class NotThereError(InputError):
    """The folder contains no item of this name."""

    status = 404


class ConflictError(InputError):
    """A request conflicts with an existing item."""

    status = 409


class TooLargeError(InputError):
    """A request exceeds its size limit."""

    status = 413


class NoSpaceError(MrdamperError):
    """The disk or the user's quota is full."""

    status = 507

    def __init__(self, what: str) -> None:
        remedy = "Free space on the disk of the folder, then try again"
        super().__init__(f"the disk is full: {what}", remedy=remedy)


def is_full(fault: BaseException) -> bool:
    """Return True if a write failed because the disk is full."""
    return isinstance(fault, OSError) and fault.errno in {errno.ENOSPC, errno.EDQUOT}


def is_text(name: str) -> bool:
    """Return True if a name can be encoded in UTF-8."""
    return not re.search("[\ud800-\udfff]", name)


def _is_plain(sign: str) -> bool:
    """Return True if a character is allowed in a new name."""
    # Letters, accents and digits of all scripts are allowed. Special characters of ASCII must be in
    # ``_SIGNS``.
    return sign in _SIGNS or unicodedata.category(sign)[0] in ("LMN" if sign.isascii() else "LMNPS")


class WorkFolder:
    """The folder of one damper."""

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()
        self.runs, self.records, self.inputs = (self.root / part for part in ("runs", "records", "inputs"))
        self.cards, self.results = self.root / "cards", self.root / "results"
        self.trash, self.cache = self.root / ".trash", self.root / ".cache"
        self.dampers = self.root / "dampers"  # created with the first damper
        own = (self.runs, self.records, self.inputs, self.cards, self.results, self.trash, self.cache)
        try:
            for place in own:
                place.mkdir(parents=True, exist_ok=True)
                if not place.resolve().is_relative_to(self.root):
                    raise InputError("is a link that leads out of the folder; remove it", place=place)
        except OSError as fault:
            words = f"cannot be worked in: {fault.strerror}; choose another --folder"
            raise InputError(words, place=root) from fault

    def claim(self) -> TextIO:
        """Lock the folder for this server until the returned file is closed."""
        file = (self.cache / "server.lock").open("w")
        if lock(file.fileno()) is False:
            file.close()
            words = "another server works in this folder; stop it, or choose another"
            raise InputError(place=self.root, found=words)
        return file

    def clear(self) -> None:
        """Delete unfinished files of a server that was killed. No other process may use the folder."""
        for place in (self.runs, self.inputs, self.cards):
            recover_staging(place)
            for left in place.glob(".upload-*"):
                left.unlink(missing_ok=True)

    def new(self, place: Path, name: str, suffixes: tuple[str, ...] = ()) -> Path:
        """Return the path for a new file or folder; raise InputError if the name is invalid."""
        shown = name[:60]
        if (
            not all(map(_is_plain, name or "/"))
            or name.startswith((".", " "))
            or name.endswith((".", " "))
            or len(name.encode()) > _NAME_MAX_BYTES
            or _RESERVED.fullmatch(name)
            or _ESCAPED.search(name)
        ):
            raise InputError(
                place=f"name {shown!r}",
                found="cannot be used",
                expected=(
                    "letters and digits of any script, blanks, signs such as ° and ._-+=,()[]@#%&, not "
                    f"beginning with a dot, at most {_NAME_MAX_BYTES} bytes"
                ),
                remedy="Rename the file",
            )
        if suffixes and (Path(name).suffix.lower() not in suffixes or name.endswith(MAP_SUFFIX)):
            raise InputError(
                place=f"name {shown!r}",
                found="this kind of file does not belong there",
                expected=f"one of {', '.join(suffixes)}",
            )
        return place / name

    def there(self, place: Path, *names: str, folder: bool = False) -> Path:
        """Return the path of an existing file or folder below ``place``.

        Raise NotThereError if the path is missing, or is a link that leads out of ``place``.
        """
        for name in names:
            if not name or name in {".", ".."} or re.search(r"[/\\\x00]", name):
                raise NotThereError(place=f"{name[:60]!r}", found="no such name here")
        path = place.joinpath(*names)
        try:
            real = path.resolve(strict=True)
        except (OSError, ValueError, RuntimeError):
            real = None
        is_kind = real is not None and (real.is_dir() if folder else real.is_file())
        if real is None or not is_kind or not real.is_relative_to(place.resolve()):
            raise NotThereError(place=f"{names[-1][:60]!r}", found="nothing of that name here")
        return path

    def run_file(self, name: str) -> Path:
        """Return the path of a measured file."""
        if name.endswith(MAP_SUFFIX) or name.startswith("."):
            raise NotThereError(place=f"{name[:60]!r}", found="no run's file")
        return self.there(self.runs, name)

    def record(self, name: str) -> Path:
        """Return the path of a long record or of a measured file."""
        if self.has(self.records, name) and not name.endswith(MAP_SUFFIX):
            return self.there(self.records, name)
        return self.run_file(name)

    def channel_map(self, name: str) -> Path:
        """Return the path of a channel map in ``inputs/`` or of a measured file."""
        if name.endswith(".toml"):
            return self.input(name)
        path = self.map_of(self.record(name))
        return self.there(path.parent, path.name)

    def map_of(self, file: Path) -> Path:
        """Return the path of the channel map of a measured file, whether or not it exists."""
        return file.with_name(file.name + MAP_SUFFIX)

    def card(self, name: str) -> Path:
        """Return the path of the file card.json of a card."""
        return self.there(self.cards, name, "card.json")

    def input(self, name: str) -> Path:
        """Return the path of a file in ``inputs/``."""
        return self.there(self.inputs, name)

    def run_files(self, formats: tuple[str, ...]) -> list[Path]:
        """Return the measured files, sorted by name."""
        return self.listed(self.runs, formats)

    def listed(self, place: Path, suffixes: tuple[str, ...]) -> list[Path]:
        """Return the files in a subfolder with one of the suffixes, sorted by name."""
        paths = [path for path in place.iterdir() if path.suffix.lower() in suffixes]
        return sorted(path for path in paths if path.name[0] != "." and self.has(place, path.name))

    def card_names(self) -> list[str]:
        names = sorted(path.name for path in self.cards.glob("[!.]*"))
        return [name for name in names if self.has(self.cards, name, "card.json")]

    def unnamed(self) -> list[str]:
        """Return names that are not UTF-8, escaped. These files cannot be requested."""
        places = (self.runs, self.records, self.inputs, self.cards)
        found = [path.name for place in places for path in place.iterdir() if not is_text(path.name)]
        return sorted(os.fsencode(name).decode(errors="backslashreplace") for name in found)

    def has(self, place: Path, *names: str, folder: bool = False) -> bool:
        """Return True if a file or folder exists; see ``there``."""
        with suppress(NotThereError):
            return all(map(is_text, names)) and bool(self.there(place, *names, folder=folder))
        return False

    async def store(self, path: Path, body: AsyncIterator[bytes], most_bytes: int) -> int:
        """Write an upload to a temporary file and move it to its path; return its size [bytes]."""
        unfinished = path.with_name(f".upload-{secrets.token_hex(8)}")
        size = 0
        try:
            with unfinished.open("xb") as file:
                async for piece in body:
                    size += len(piece)
                    if size > most_bytes:
                        raise TooLargeError(
                            place=path.name,
                            found=f"is larger than {most_bytes / 1e6:g} MB",
                            remedy="split the file, or put it into the folder by hand",
                        )
                    file.write(piece)
            unfinished.replace(path)  # If the path is a link, the link is replaced, not its target.
        finally:
            unfinished.unlink(missing_ok=True)
        return size

    def discard(self, *paths: Path) -> str:
        """Move files or folders into the trash as one entry; return the name of the entry."""
        name = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{secrets.token_hex(4)}"
        for path in paths:
            place = self.trash / name / path.parent.relative_to(self.root)
            with suppress(FileNotFoundError):
                path.lstat()
                place.mkdir(parents=True, exist_ok=True)
                path.rename(place / path.name)
        return name

    def discarded(self) -> dict[str, list[Path]]:
        """Return the original paths of each entry of the trash, newest entry first."""
        names = sorted((path.name for path in self.trash.iterdir() if path.is_dir()), reverse=True)
        return {name: [path.relative_to(self.trash / name) for path in self._thrown(name)] for name in names}

    def restore(self, name: str) -> list[Path]:
        """Move an entry of the trash to its original paths; return these paths.

        Raise InputError if a different item now has one of these paths.
        """
        entry = self.there(self.trash, name, folder=True)
        places = {path: self.root / path.relative_to(entry) for path in self._thrown(name)}
        for place in places.values():
            if os.path.lexists(place):
                words = "something of this name is there again"
                raise InputError(place=place.name, found=words, remedy="Remove it first")
        for path, place in places.items():
            path.rename(place)
        shutil.rmtree(entry, ignore_errors=True)
        return list(places.values())

    def _thrown(self, name: str) -> list[Path]:
        places = ("runs", "inputs", "cards", "results", "dampers")
        return [path for each in places for path in sorted((self.trash / name / each).glob("*"))]


def write_whole(path: Path, text: str) -> None:
    """Write a text file atomically. If the path is a link, the link is replaced, not its target."""
    unfinished = path.with_name(f".upload-{secrets.token_hex(8)}")
    try:
        unfinished.write_text(text, encoding="utf-8")
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def now() -> str:
    """Return the present time in UTC and ISO 8601 format."""
    return timestamp(time.time())


def timestamp(seconds: float) -> str:
    """Convert a time in seconds since 1970 to UTC and ISO 8601 format."""
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
