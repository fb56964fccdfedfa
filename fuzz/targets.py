"""All targets in Python by name: what takes the bytes, and what it starts from."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType

from fuzz import binaries, calls, documents, seeds, texts

__all__ = ["CORPUS", "TARGETS", "Target", "kept_inputs"]

CORPUS = Path(__file__).with_name("corpus")
"""Inputs that once broke a promise, a folder for each target; run again by every test run."""


@dataclass(frozen=True, slots=True)
class Target:
    """What is fuzzed."""

    take: Callable[[bytes], None]  # returns, or raises what is a finding
    seeds: Callable[[], Sequence[bytes]]
    longest: int = 2048  # bytes of an input
    library: str = ""  # which decodes in another process, whose branches are not seen


def _tables(*headers: str) -> Callable[[], Sequence[bytes]]:
    def made() -> Sequence[bytes]:
        return [
            seeds.rows_of(
                header, [sign.join(f"{k + 0.5 * c}" for c in range(header.count(sign) + 1)) for k in range(9)]
            )
            for header in headers
            for sign in (";" if ";" in header else ",",)
        ]

    return made


def _edits(count: int) -> list[bytes]:
    """Return seeds of edits: each kept document unedited, and with one."""
    return [bytes([1, k]) for k in range(count)] + [bytes([1, k, 3, 1, 2, 3, 7, 9]) for k in range(count)]


def _toml(name: str) -> Callable[[], Sequence[bytes]]:
    return lambda: [each.encode() for each in seeds.toml_texts(name)] + _edits(len(seeds.toml_texts(name)))


def _delimited() -> Sequence[bytes]:
    return [
        seeds.text("run.csv"),
        b"\x01" + seeds.text("semicolons.csv"),
        seeds.text("semicolons.csv"),
        b"# a remark\n\nTime\tForce\nSec\tkN\n0\t1\n0.1\t2\n\n0.2\t3\n",
        b"  time_s   force_N\n  0.0   1e3\n  0.1  -2.5e+2\n",
        b"\x00time_s,note\n0,a\n1,b\n",
        b"at,x,force\n2026-11-21T23:59:59.5,1,2\n2026-11-22T00:00:00,2,3\n",
        b"Uhr;x;T [\xb0C]\n11:59:59,5 pm;1;2\n12:00:00 am;2;3\n",
        "时间(s),位移（mm）,力(N),力(V),备注\n0,1,2,3,好的\n0.1,2,3,4,好\n".encode("gb18030"),
    ]


TARGETS: Mapping[str, Target] = MappingProxyType(
    {
        "delimited": Target(texts.delimited, _delimited),
        "mts": Target(
            texts.mts, lambda: [seeds.text("mts.dat"), seeds.text("mts.dat") + seeds.text("mts.dat")[30:]]
        ),
        "logger": Target(texts.logger, lambda: [seeds.text("logger.txt")]),
        "lvm": Target(
            texts.lvm,
            lambda: [*(seeds.lvm(clocks) for clocks in ("One", "No", "Multi")), seeds.lvm("One", segments=2)],
        ),
        "run": Target(
            texts.run,
            lambda: [
                seeds.text("run.csv", 60),
                seeds.text("logger.txt"),
                seeds.text("mts.dat"),
                seeds.lvm("One"),
                b"at,displacement_mm,force_N,current_A\n10:00:00,1,2,0\n10:00:01,2,3,0\n10:00:02,1,2,0\n",
            ],
        ),
        "rheometer": Target(
            texts.rheometer,
            _tables(
                "temperature_degC,viscosity_Pas",
                "field_mT;T [K];tau y [kPa]",
                "field_kA_m,temp_K,eta / mPa s",
            ),
        ),
        "curve": Target(texts.curve, _tables("time_s,fluid_degC", "time_min;wall_K;coil_degC")),
        "duty": Target(
            texts.duty,
            lambda: [
                b"sine:15mm:1Hz:2A:1800s",
                b"triangle:5mm:2Hz:0.5A:1min",
                b"chirp:5mm:0.1Hz:5Hz:1A:60s",
                b"sine5mm1Hz:1V:2h",
            ],
            longest=200,
        ),
        "duty-table": Target(
            texts.duty_table,
            _tables("time_s,amplitude_mm,frequency_Hz,current_A", "time_s,displacement_mm,current_A"),
        ),
        "channel-map": Target(documents.channel_map, _toml("channel_map")),
        "card": Target(
            documents.card,
            lambda: (
                [json.dumps(each).encode() for each in seeds.card_documents()]
                + _edits(len(seeds.card_documents()))
            ),
            longest=8192,
        ),
        "drawing": Target(documents.drawing, _toml("drawing")),
        "fluid": Target(documents.fluid, _toml("fluid")),
        "campaign": Target(documents.campaign, _toml("campaign")),
        "virtual-damper": Target(documents.virtual_damper, _toml("virtual_damper")),
        "scenario": Target(documents.scenario, _toml("scenario")),
        "binding": Target(calls.binding, lambda: [bytes(range(k, k + 60)) for k in range(8)]),
        "tdms": Target(binaries.tdms, lambda: seeds.binary("run.tdms")[1:], longest=8192),
        "isolated-excel-sheet": Target(
            binaries.excel_sheet, lambda: [seeds.sheet()], longest=8192, library="python_calamine"
        ),
        **{
            f"isolated-{name}": Target(
                partial(binaries.isolated, start), partial(seeds.binary, file), longest=32768, library=library
            )
            for name, file, library, start in (
                ("excel", "run.xlsx", "python_calamine", b"PK\x03\x04"),
                ("hdf5", "run.h5", "h5py", b"\x89HDF"),
                ("mat73", "v73.mat", "h5py", b"MATLAB 7.3"),
                ("mat", "v5.mat", "scipy.io", b"MATLAB 5.0"),
                ("mdf", "run.mf4", "asammdf", b"MDF     "),
                ("parquet", "run.parquet", "polars", b"PAR1"),
            )
        },
    }
)


def kept_inputs(name: str) -> list[Path]:
    """Return the files of a target's corpus."""
    return sorted(path for path in (CORPUS / name).glob("*") if path.is_file())
