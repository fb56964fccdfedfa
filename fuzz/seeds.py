"""Sound inputs that fuzzing starts from: small, and written by the formats' own libraries."""

from __future__ import annotations

import io
import json
import tempfile
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.models.card_schema import card_text
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.damper import PRESETS, damper_to_toml
from tests.data.rig_files import WRITERS, titled

__all__ = [
    "binary",
    "card_documents",
    "lvm",
    "rows_of",
    "sheet",
    "text",
    "toml_texts",
    "workbook",
]

_ROOT = Path(__file__).parents[1]
_SAMPLES = 12


def _small() -> dict[str, np.ndarray]:
    return {name: values[:_SAMPLES] for name, values in titled().items()}


def rows_of(header: str, rows: list[str]) -> bytes:
    """Return a text of a header and rows."""
    return "\n".join([header, *rows, ""]).encode()


@cache
def _written(name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        WRITERS[name](path)
        return path.read_bytes()


def text(name: str, lines: int = 16) -> bytes:
    """Return the first lines of a text that ``WRITERS`` writes, its sample count as it then is."""
    kept = _written(name).splitlines(keepends=True)[:lines]
    return b"".join(b"Sample Count:  9\n" if line.startswith(b"Sample Count") else line for line in kept)


def lvm(clocks: str, *, segments: int = 1) -> bytes:
    """Return a LabVIEW measurement text with one column of x, none, or one for each channel."""
    at = {"One": "{0}\t1\t2\t", "No": "\t1\t2\t", "Multi": "{0}\t1\t{0}\t2\t"}[clocks]
    labels = "X_Value\tForce (N)\tX_Value\tx" if clocks == "Multi" else "X_Value\tForce (N)\tx"
    tags = ["LabVIEW Measurement", "Separator\tTab", "Decimal_Separator\t.", f"X_Columns\t{clocks}"]
    end = "***End_of_Header***"
    segment = ["Channels\t2", "Y_Unit_Label\tN\tmm", "X_Dimension\tTime\tTime", "Delta_X\t0.5\t0.5"]
    rows = [at.format(0.5 * k) for k in range(5)]
    one = [*segment, end, f"{labels}\tComment", *rows, ""]
    return "\n".join([*tags, end, "", *one * segments]).encode()


def binary(name: str) -> list[bytes]:
    """Return files of a binary format: one from ``WRITERS``, and a small one without compression."""
    if name == "run.xlsx":
        return [workbook()]
    if name == "v5.mat":
        return [_written(name), *(_small_mat(nested=nested) for nested in (False, True))]
    small = {
        "v73.mat": _small_mat73,
        "run.h5": _small_hdf5,
        "run.tdms": _small_tdms,
        "run.parquet": _small_parquet,
        "run.mf4": _small_mdf,
    }
    return [_written(name), *([small[name]()] if name in small else [])]


def _small_mat(*, nested: bool) -> bytes:
    from scipy.io import savemat

    made: Any = io.BytesIO()  # savemat takes a stream, which its type leaves out
    matrix: dict[str, Any] = {"data": np.column_stack(list(_small().values())), "text": "oil"}
    savemat(made, {"run": {**_small(), "more": matrix}} if nested else {**_small(), "n": np.int16(3)})
    return bytes(made.getvalue())


def _small_mat73() -> bytes:
    from tests.data.rig_files import save_mat73

    signals = np.zeros(3, dtype=[("Name", object), ("Data", object), ("Unit", object)])
    for k, (name, values) in enumerate(_small().items()):
        signals[k % 3] = (name, values, "s")
    cells = np.array([signals[:1], {"more": np.eye(3)}], dtype=object)
    with tempfile.TemporaryDirectory() as folder:
        save_mat73(Path(folder) / "run.mat", {"rec": {"Y": signals}, "cells": cells, "note": ""})
        return (Path(folder) / "run.mat").read_bytes()


def _small_hdf5() -> bytes:
    import h5py

    made = io.BytesIO()
    with h5py.File(made, "w") as file:
        for name, values in _small().items():
            file.create_dataset(f"run/{name}", data=values)
        file.create_dataset("table", data=np.array([(1.0, 2)] * 4, dtype=[("a", "f8"), ("b", "i4")]))
    return made.getvalue()


def _small_tdms() -> bytes:
    from nptdms import ChannelObject, TdmsWriter

    made = io.BytesIO()
    with TdmsWriter(made) as writer:
        for _ in range(2):
            writer.write_segment(
                [
                    ChannelObject(
                        "run", name, values, properties={"unit_string": "mm", "wf_increment": 0.005}
                    )
                    for name, values in _small().items()
                ]
            )
    return made.getvalue()


def _small_parquet() -> bytes:
    import polars as pl

    made = io.BytesIO()
    pl.DataFrame(_small()).write_parquet(made, compression="uncompressed", statistics=False)
    return made.getvalue()


def _small_mdf() -> bytes:
    from asammdf import MDF, Signal

    given = _small()
    with tempfile.TemporaryDirectory() as folder, MDF(version="4.10") as file:
        time = given.pop("time_s")
        file.append([Signal(values, time, "mm", name) for name, values in given.items()])
        path = Path(folder) / "run.mf4"
        file.save(path, overwrite=True)
        return path.read_bytes()


@cache
def workbook() -> bytes:
    """Return a workbook of one small sheet."""
    from openpyxl import Workbook

    book, made = Workbook(), io.BytesIO()
    sheet = book.active
    assert sheet is not None
    sheet.append([*_small(), "Remark"])
    for row in zip(*(values.tolist() for values in _small().values()), strict=True):
        sheet.append([*row, "fine"])
    book.save(made)
    return made.getvalue()


@cache
def card_documents() -> list[dict[str, Any]]:
    """Return sound cards as documents: one of every law, and one of an old schema."""
    from tests.control.dampers import DAMPERS, SERIES
    from tests.export.exports import card_of

    old = json.loads((_ROOT / "tests/models/card_version_1.json").read_text(encoding="utf-8"))
    return [json.loads(card_text(card_of(each))) for each in (*DAMPERS.values(), SERIES)] + [old]


_CHANNEL_MAP = """
[channel.force]
name = "force_kN"
unit = "V"
gain = 980.665
offset = 0.1
sign = -1
[channel.displacement]
pattern = "disp*"
unit = "in"
[channel.time]
index = 1
unit = "ms"
[constant]
voltage_V = 3.2
temperature_degC = 25.0
[session]
name = "13 May"
[file]
delimiter = ","
decimal = "."
"""
_SEGMENTS = """
[channel.force]
index = 3
[constant]
rate_Hz = 200
[segments]
split = "Resume"
current_A = [0, 0.25, 0.5]
"""
_SWEEPS = (
    'kind = "fit"\nseed = 3\n[fit]\ncampaigns = ["a", "b*"]\nlaw = "bouc-wen"\n'
    'hold_out = ["*2Hz*"]\nstarts = 2\n',
    'kind = "tolerance"\n[tolerance]\ncard = "card.json"\nplant = "hard"\ndraws = 5\nspread_percent = 5\n'
    'targets = ["sine-900N-1Hz"]\ntemperatures_degC = [20, 80]\nrate_Hz = 1000\n',
    'kind = "heatsink"\n[heatsink]\ncard = "card.json"\ndampers = ["paper"]\n'
    'duties = ["sine:15mm:1Hz:2A:1800s"]\n'
    'method = "grid"\n',
)
_SCENARIO = """
name = "own"
motion = "sine3mm2Hz"
duration_s = 3.0
temperature_degC = 60
seed = 2
[target]
kind = "sine"
amplitude_N = 900.0
frequency_Hz = 1.0
[disturbance]
force_gain = 1.1
"""


@cache
def toml_texts(name: str) -> tuple[str, ...]:
    """Return sound documents of a kind."""
    examples = _ROOT / "examples"
    if name == "channel_map":
        maps = ("matrix_mat", "mts_793", "tdms_volts", "utfpr_mat", "utfsm_logger")
        kept = [(examples / f"{each}.toml").read_text(encoding="utf-8") for each in maps]
        return (_CHANNEL_MAP, _SEGMENTS, *kept)
    if name == "drawing":
        return ((examples / "paper_damper.toml").read_text(encoding="utf-8"),)
    if name == "fluid":
        fluids = sorted((_ROOT / "src/mrdamper/models/fluids").glob("*.toml"))
        return tuple(each.read_text(encoding="utf-8") for each in fluids)
    if name == "campaign":
        kept = [
            (examples / f"{each}_campaign.toml").read_text(encoding="utf-8") for each in ("short", "vehicle")
        ]
        return (*kept, Campaign().to_toml())
    if name == "virtual_damper":
        return tuple(damper_to_toml(each) for each in PRESETS.values())
    return {"scenario": (_SCENARIO,), "sweep": _SWEEPS}[name]


@cache
def sheet() -> bytes:
    """Return the XML of the workbook's sheet."""
    with zipfile.ZipFile(io.BytesIO(workbook())) as archive:
        return archive.read("xl/worksheets/sheet1.xml")
