"""Formats that are decoded in a process of their own, because a damaged file can crash their libraries.

On some damaged bytes libhdf5 and the compiled parts of SciPy's MAT reader, of asammdf and of calamine end
the process, and Polars prints a trace of its own; a run that cannot be read must end in one message instead.
The process (``decoder``) is started at the first such file and serves the next ones; when it crashes, the
file is at fault, and another is started for the next.
"""

from __future__ import annotations

import atexit
import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from threading import RLock
from typing import IO, Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import FileOptions, Layout, OnUse, Table, Texts, require_extra
from mrdamper.errors import InputError

__all__ = ["isolated", "stop"]

_PATIENCE_s = 60.0  # for one answer, and a second more for each megabyte of the file; some loop for ever
_MOST_PATIENCE_s = 600.0
_PIECE = 1 << 16  # bytes that are taken at once: what a pipe holds
_COMMAND = (sys.executable, "-P", "-m", "mrdamper.data.formats.decoder")


def isolated(
    format_name: str, package: str, what: str, module: str = ""
) -> Callable[[Path, FileOptions], Table]:
    """Return the reader of a format that asks the decoder; ``package`` is the library it needs there.

    ``module`` is what the library is imported as, where that is not its name.
    """

    def read(path: Path, options: FileOptions) -> Table:
        require_extra(module or package, package, what)
        asked = {
            "open": str(path.absolute()),
            "format": format_name,
            "options": {"part": options.part, "delimiter": options.delimiter, "decimal": options.decimal},
        }
        with _LOCK:
            given = _DECODER.ask(path, asked)
        layout = given["layout"]
        return Table(
            names=tuple(given["names"]),
            columns=OnUse(
                {
                    name: partial(_numbers, path, asked, name, int(given["rows"]))
                    for name in given["names"]
                    if name not in given["texts"]
                }
            ),
            texts=OnUse({name: partial(_words, path, asked, name) for name in given["texts"]}),
            layout=Layout(**{**layout, "notes": tuple(layout["notes"])}),
            rows=int(given["rows"]),
            units=given["units"],
            clocks=given["clocks"],
            stamps=frozenset(given["stamps"]),
            read_rows=partial(_rows, path, asked) if given["by_rows"] else None,
        )

    return read


def _numbers(path: Path, asked: Mapping[str, Any], name: str, rows: int) -> FloatArray:
    with _LOCK:
        if _DECODER.opened != asked:
            _DECODER.ask(path, asked)
        values = _DECODER.column(path, name)
    if len(values) > rows:
        raise InputError(
            f"{path}: column {name!r} holds {len(values)} numbers in {rows} rows; expected one in each. The "
            "file is damaged, or holds arrays: export the run as CSV"
        )
    return values


def _words(path: Path, asked: Mapping[str, Any], name: str) -> Texts:
    with _LOCK:
        if _DECODER.opened != asked:
            _DECODER.ask(path, asked)
        return list(_DECODER.ask(path, {"text": name})["cells"])


def _rows(
    path: Path, asked: Mapping[str, Any], names: Sequence[str], start: int, count: int
) -> list[FloatArray]:
    with _LOCK:
        if _DECODER.opened != asked:
            _DECODER.ask(path, asked)
        return _DECODER.rows(path, names, start, count)


def _start() -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        _COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )


def _patience_s(path: Path) -> float:
    try:
        size = path.stat().st_size
    except OSError:  # what cannot be looked at is the decoder's to tell
        size = 0
    return min(_PATIENCE_s + 1e-6 * size, _MOST_PATIENCE_s)


class _Answers:
    """What the process writes; what does not come in time, or at all, is told by its absence."""

    def __init__(self, stream: IO[bytes] | None = None) -> None:
        self._place = -1 if stream is None else stream.fileno()
        self._poll = select.poll()
        if stream is not None:
            self._poll.register(self._place, select.POLLIN)
        self._ahead = b""  # what came with the last answer, and belongs to the next
        self.late = False

    def line(self, patience_s: float) -> bytes:
        """Return the next line with its end, or what there is of it."""
        pieces, until = [self._ahead], time.monotonic() + patience_s
        while b"\n" not in pieces[-1] and self._waits(until):
            pieces.append(os.read(self._place, _PIECE))
            if not pieces[-1]:
                break
        line, end, self._ahead = b"".join(pieces).partition(b"\n")
        return line + end

    def fill(self, room: memoryview, patience_s: float) -> bool:
        """Take as many bytes as there is room for; tell whether they all came."""
        until, at = time.monotonic() + patience_s, min(len(self._ahead), len(room))
        room[:at], self._ahead = self._ahead[:at], self._ahead[at:]
        while at < len(room) and self._waits(until):
            count = os.readv(self._place, [room[at:]])
            if not count:
                break
            at += count
        return at == len(room)

    def _waits(self, until: float) -> bool:
        """Tell whether something comes before a time, be it the end."""
        self.late = not self._poll.poll(1e3 * max(until - time.monotonic(), 0.0))
        return not self.late


class _Decoder:
    """The process that decodes, started when it is needed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._started_by = 0
        self._answers = _Answers()
        self.opened: Mapping[str, Any] = {}  # the last file that it opened

    def ask(self, path: Path, question: Mapping[str, Any]) -> dict[str, Any]:
        """Return the answer to a question; one that does not come is the fault of the file.

        A decoder that has served other files may have been harmed by them: a new one is asked once more.
        """
        used = bool(self.opened)
        line = self._put(path, question)
        if line is None and used and "open" in question and not self._answers.late:
            line = self._put(path, question)
        if line is None:
            raise InputError(
                f"{path}: not a readable file: {self._fault(path)}. The file is damaged: copy it again, "
                "or export the run as CSV"
            )
        answer: dict[str, Any] = json.loads(line)
        if "open" in question and "error" not in answer:
            self.opened = question
        if "error" in answer:
            raise InputError(str(answer["error"]).replace(str(path.absolute()), str(path)))
        return answer

    def _fault(self, path: Path) -> str:
        if self._answers.late:
            return f"its decoder has not come to an end in {_patience_s(path):.0f} s"
        return "its decoder has crashed"

    def _put(self, path: Path, question: Mapping[str, Any]) -> bytes | None:
        """Return the line of an answer, None when the decoder has crashed."""
        process = self._running()
        assert process.stdin is not None
        try:
            patience_s = _patience_s(path)
            process.stdin.write(json.dumps({**question, "seconds": patience_s}).encode() + b"\n")
            process.stdin.flush()
            line = self._answers.line(patience_s)
        except OSError:
            line = b""
        if line[:1] + line[-1:] == b"{\n":
            return line
        self.stop()
        return None

    def column(self, path: Path, name: str) -> FloatArray:
        """Return a column of the open file."""
        return self._column(path, name, int(self.ask(path, {"column": name})["samples"]))

    def rows(self, path: Path, names: Sequence[str], start: int, count: int) -> list[FloatArray]:
        """Return some rows of columns of the open file."""
        asked = {"rows": list(names), "start": start, "count": count}
        samples = int(self.ask(path, asked)["samples"])
        return [self._column(path, name, samples) for name in names]

    def _column(self, path: Path, name: str, samples: int) -> FloatArray:
        """Return the numbers that follow an answer."""
        values = np.empty(samples)
        if not self._answers.fill(values.data.cast("B"), _patience_s(path)):
            self.stop()
            raise InputError(
                f"{path}: column {name!r}: {self._fault(path)}. The file is damaged: copy it again"
            )
        values.setflags(write=False)
        return values

    def stop(self) -> None:
        """End the process."""
        process, self._process, self.opened = self._process, None, {}
        if process is None or self._started_by != os.getpid():  # a fork's copy is not ours to end
            return
        process.kill()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:  # what was not yet written has nobody to read it
                    continue
        process.wait()

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is None or self._started_by != os.getpid() or self._process.poll() is not None:
            self.stop()
            self._process = _start()
            self._started_by = os.getpid()
            self._answers = _Answers(self._process.stdout)
        return self._process


_LOCK = RLock()
_DECODER = _Decoder()


def stop() -> None:
    """End the decoder's process; the next file starts another."""
    with _LOCK:
        _DECODER.stop()


atexit.register(stop)
