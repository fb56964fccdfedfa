"""Targets: texts of rigs, rheometers and duties, each through the reader that a user's file meets."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from fuzz.contract import promised, sound_table, taking, written
from mrdamper.data.diagnosis.diagnose import diagnose
from mrdamper.data.formats.logger import read_logger
from mrdamper.data.formats.lvm import read_lvm
from mrdamper.data.formats.mts import read_mts
from mrdamper.data.formats.table import FileOptions
from mrdamper.data.formats.text import read_text
from mrdamper.data.readers import read_file
from mrdamper.data.rheometer import read_rheometer
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.estimation.measured_curve import read_curve

__all__ = ["curve", "delimited", "duty", "duty_table", "logger", "lvm", "mts", "rheometer", "run"]

_LONGEST_DUTY = 200
_OPTIONS = (
    FileOptions(),
    FileOptions(delimiter=";", decimal=","),
    FileOptions(delimiter="\t"),
    FileOptions(delimiter=" ", decimal="."),
)


def delimited(content: bytes) -> None:
    """Delimited text; a first byte below 4 stands for what a channel map says about the file."""
    options = _OPTIONS[content[0]] if content[:1] and content[0] < len(_OPTIONS) else None
    path = written("input.csv", content if options is None else content[1:])
    with promised("input.csv"):
        sound_table(read_text(path, options or FileOptions()))


mts = taking("input.dat", read_mts)
logger = taking("input.txt", read_logger)
lvm = taking("input.lvm", read_lvm)


def run(content: bytes) -> None:
    """A whole file to recordings, what is wrong with them, and runs."""
    if b"\0" in content[:512]:
        return  # a binary format: another target's
    path = written("input.csv", content)
    with promised("input"):
        for recording in read_file(path).recordings:
            for finding in diagnose(recording):
                finding.in_words()
            recording.checked()


def _reading(name: str, read: Callable[[Path], object], *, place: str = "") -> Callable[[bytes], None]:
    """Return the target of a table that is read and no more; a message must name ``place``."""

    def take(content: bytes) -> None:
        path = written(name, content)
        with promised(place):
            read(path)

    return take


rheometer = _reading("input.csv", read_rheometer, place="input.csv")
curve = _reading("input.csv", read_curve)
duty_table = _reading("duty.csv", read_duty)


def duty(content: bytes) -> None:
    """A duty in words, as on the command line."""
    text = content[:_LONGEST_DUTY].decode("utf-8", "replace").replace("/", ":")
    if not text.lower().endswith(".csv"):
        with promised("duty"):
            read_duty(text)
