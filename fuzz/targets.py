"""The fuzzing targets in Python: text reader, model card and channel map.

A target must either return a valid value, or raise an error of the package that names the file. Every other
result is a fault. A card that is accepted must be unchanged after it is written and read again.
"""

from __future__ import annotations

import copy
import json
import math
import tempfile
import tomllib
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.data.channels import read_channel_map
from mrdamper.data.formats.table import FileOptions, Table
from mrdamper.data.formats.text import read_text
from mrdamper.data.proposal.recordings import runs_in
from mrdamper.data.tables import read_tables
from mrdamper.errors import MrdamperError
from mrdamper.files import toml_text
from mrdamper.models.card_schema import card_from_json, card_text, read_card, signed
from tests.support.cards import DAMPERS, card_of

MESSAGE_MAX_CHARACTERS = 1_000_000
COLUMN_MAX_SAMPLES = 1 << 16  # Longer columns are not read here because that takes too long.
EDIT_MARK = b"\x01"  # An input with this first byte is a list of changes of a valid document.
ODD_VALUES: tuple[Any, ...] = (
    0, -1, 1, True, 0.0, -0.0, 1e-300, 1e300, math.inf, -math.inf, math.nan, 1 << 63, 10**400, 0.5, 293.15,
    "", "A", "\0", "é", "\ud800", "../..", "mm", "nan", "x" * 300, [], {}, [[]], {"a": 1}, [2.0, 1.0],
    [math.nan, 1.0], [0.0] * 70, None,
)  # fmt: skip
RUN_CSV = b"time_ms,force_kN,disp_in\n" + b"".join(
    b"%d,%d.5,0.%d\n" % (k, k % 7 - 3, k % 9) for k in range(40)
)
CHANNEL_MAP = """
[channel.force]
name = "force_kN"
unit = "V"
gain = 980.665
sign = -1
[channel.displacement]
pattern = "disp*"
unit = "in"
[channel.time]
index = 1
unit = "ms"
[constant]
voltage_V = 3.2
[file]
delimiter = ","
"""


def require(condition: object, fault: str) -> None:
    """Raise AssertionError if a condition is not met."""
    if not condition:
        raise AssertionError(fault)


@contextmanager
def expecting_named_error(name: str) -> Iterator[None]:
    """Accept an error of the package if the message is short and names the file."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            yield
        except MrdamperError as error:
            text = str(error)
            require(
                0 < len(text) <= MESSAGE_MAX_CHARACTERS, f"message of {len(text)} characters: {text[:200]!r}"
            )
            require(name in text, f"the message does not name {name}: {text[:200]!r}")


@cache
def _temporary_folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="mrdamper-fuzz-")


def write(name: str, content: bytes) -> Path:
    """Write a file into the temporary folder of this process; return its path."""
    path = Path(_temporary_folder().name) / name
    path.write_bytes(content)
    return path


def check_table(table: Table) -> None:
    """Check that the names of a table are distinct and that its columns are vectors of floats or text."""
    require(len(set(table.names)) == len(table.names), f"repeated names: {table.names}")
    require(set(table.columns) | set(table.texts) <= set(table.names), "a column has no name")
    require(not set(table.columns) & set(table.texts), "a column is both number and text")
    for name in table.columns if table.rows <= COLUMN_MAX_SAMPLES else ():
        values = table.columns[name]
        require(values.dtype == np.float64 and values.ndim == 1, f"{name}: {values.dtype}, {values.shape}")
        require(len(values) <= table.rows, f"{name} has {len(values)} samples of {table.rows}")


def take_text(content: bytes) -> None:
    """Read delimited text. A first byte below 3 selects one of three sets of reader options."""
    options = (FileOptions(), FileOptions(delimiter=";", decimal=","), FileOptions(delimiter="\t"))
    is_chosen = content[:1] != b"" and content[0] < len(options)
    path = write("input.csv", content[1:] if is_chosen else content)
    with expecting_named_error("input.csv"):
        check_table(read_text(path, options[content[0]] if is_chosen else FileOptions()))


def take_card(content: bytes) -> None:
    """Read a model card, write it and read it again."""
    if content.startswith(EDIT_MARK):
        # The hash is computed again, so that the input passes the hash check and reaches the other checks.
        content = json.dumps(signed(edited(card_documents(), content[1:]))).encode()
    path = write("card.json", content)
    with expecting_named_error("card.json"):
        text = card_text(read_card(path))
        require(card_text(card_from_json(json.loads(text))) == text, "the card changes when it is written")


def take_channel_map(content: bytes) -> None:
    """Read a channel map and apply it to a run."""
    if content.startswith(EDIT_MARK):
        document = edited([tomllib.loads(CHANNEL_MAP)], content[1:])
        content = toml_text(document).encode("utf-8", "surrogatepass")
    path = write("map.toml", content)
    with expecting_named_error("map.toml"):
        chosen = read_channel_map(path)
        run = write("run.csv", RUN_CSV)
        with expecting_named_error("run"):
            runs_in(read_tables(run, chosen.file), chosen, run)


@cache
def card_documents() -> list[dict[str, Any]]:
    """Return valid cards as JSON documents, one for each example damper."""
    return [json.loads(card_text(card_of(damper))) for damper in DAMPERS.values()]


def edited(documents: Sequence[dict[str, Any]], content: bytes) -> dict[str, Any]:
    """Change one of the valid documents; the bytes of an input encode the changes."""
    choices = iter(content)
    document = copy.deepcopy(documents[next(choices, 0) % len(documents)])
    for edit in choices:
        if not document:
            break
        node: Any = document
        keys = list(node)
        while True:
            key = keys[next(choices, 0) % len(keys)]
            if not isinstance(node[key], dict | list) or not node[key] or edit % 5 == 0:
                break
            node = node[key]
            keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        if edit % 7 == 0:
            del node[key]
        elif edit % 7 == 1 and isinstance(node, dict):
            node[f"x{edit}"] = node.pop(key)
        elif edit % 7 == 2 and isinstance(node[key], float):
            node[key] *= (-1.0, 0.0, 1e-3, 1e3, 1e12)[next(choices, 0) % 5]
        else:
            node[key] = copy.deepcopy(ODD_VALUES[next(choices, 0) % len(ODD_VALUES)])
    return document


def _edit_seeds(count: int) -> list[bytes]:
    return [EDIT_MARK + bytes([k, *edits]) for k in range(count) for edits in ((), (3, 1, 2, 3, 7, 9))]


def text_seeds() -> list[bytes]:
    """Return short example texts in the formats that test rigs write."""
    return [
        RUN_CSV,
        b"\x01time;x;force\n0;1,5;2\n0,1;2,5;3\n",
        b"# a remark\n\nTime\tForce\nSec\tkN\n0\t1\n0.1\t2\n\n0.2\t3\n",
        b"at,x,force\n2026-11-21T23:59:59.5,1,2\n2026-11-22T00:00:00,2,3\n",
        b"Uhr;x;T [\xb0C]\n11:59:59,5 pm;1;2\n12:00:00 am;2;3\n",
        "时间(s),位移（mm）,力(N),力(V),备注\n0,1,2,3,好的\n0.1,2,3,4,好\n".encode("gb18030"),
    ]


TARGETS: Mapping[str, tuple[Callable[[bytes], None], Callable[[], Sequence[bytes]]]] = {
    "text": (take_text, text_seeds),
    "card": (take_card, lambda: [*(json.dumps(d).encode() for d in card_documents()), *_edit_seeds(8)]),
    "channel-map": (take_channel_map, lambda: [CHANNEL_MAP.encode(), *_edit_seeds(1)]),
}
"""Targets by name: function that processes an input (bytes), and function that returns the first inputs."""
