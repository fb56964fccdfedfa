"""Write one run in every file format with the usual library of the format, for tests of the readers."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from itertools import count
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from mrdamper.data.channels import ChannelMap
from mrdamper.data.readers import read_file
from mrdamper.data.records import RigRun
from tests.support.campaigns import make_run

RUN = make_run(duration=2.0, rate_Hz=200.0)
UNITS: Mapping[str, str] = MappingProxyType(
    {"time": "s", "displacement": "mm", "force": "kN", "current": "A"}
)


def read_run(path: Path, channels: ChannelMap | Path | None = None) -> tuple[RigRun, ...]:
    """Return the runs in one file."""
    return tuple(recording.checked() for recording in read_file(path, channels).recordings)


def in_rig_units(run: RigRun = RUN) -> dict[str, np.ndarray]:
    """Return the channels of a run in the units of ``UNITS`` by role."""
    return {
        "time": run.time,
        "displacement": 1e3 * run.displacement,
        "force": 1e-3 * run.force,
        "current": run.command,
    }


def titled(run: RigRun = RUN) -> dict[str, np.ndarray]:
    """Return the channels of a run by header, which has name and unit (for example ``force_kN``)."""
    return {f"{role}_{UNITS[role]}": values for role, values in in_rig_units(run).items()}


def write_csv(path: Path) -> None:
    names = ",".join(titled())
    rows = (",".join(map(repr, row)) for row in zip(*(c.tolist() for c in titled().values()), strict=True))
    path.write_text("\n".join([names, *rows]) + "\n", encoding="utf-8")


def write_semicolons(path: Path) -> None:
    names = ";".join(f"{role} [{unit}]" for role, unit in UNITS.items())
    rows = (";".join(map(repr, row)) for row in zip(*(c.tolist() for c in titled().values()), strict=True))
    path.write_text("\n".join(["Bench 3", names, *rows]).replace(".", ",") + "\n", encoding="utf-8")


def write_mts(path: Path) -> None:
    names = ("Running Time", "Axial Displacement", "Axial Force", "Current")
    rows = ("\t".join(map(repr, row)) for row in zip(*(c.tolist() for c in titled().values()), strict=True))
    head = [
        "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A",
        "",
        "Data Acquisition\t\t\tTime:\t2.0\tSec\t3/29/2016 1:54:32 PM",
        "\t".join(names),
        "Sec\tmm\tkN\tA",
    ]
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")


def write_logger(path: Path) -> None:
    names = list(titled())[1:]
    columns = [c.tolist() for c in list(titled().values())[1:]]
    head = [
        "Header Size:  7", "Version:  2", "Sampling Interval:  0.005", "Sampling Rate:  200",
        f"Sample Count:  {len(RUN)}", "Device Serial Number:  0",
        "Sample Number, " + ", ".join(names) + ", Events",
    ]  # fmt: skip
    rows = [
        f"{k + 1:10d},   " + ", ".join(map(repr, row)) for k, row in enumerate(zip(*columns, strict=True))
    ]
    rows[0] += ", DAQ Start"
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")


def write_mat(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"bench": {"operator": "K.", "run": titled()}}, do_compression=True)


def write_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        group = file.create_group("bench/run")
        for role, values in in_rig_units().items():
            group.create_dataset(role, data=values, compression="gzip").attrs["unit"] = UNITS[role]
        group.create_dataset("remark", data="oil changed")


def write_mat73(path: Path) -> None:
    save_mat73(path, titled() | {"remark": "oil"})


def save_mat73(path: Path, variables: Mapping[str, Any]) -> None:
    """Save variables as MATLAB -v7.3: HDF5 after a MATLAB header, with structures and cells as references."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        apart, names = file.create_group("#refs#"), map(str, count())

        def refer(values: Iterable[Any]) -> np.ndarray:
            return np.array([[put(apart, next(names), value).ref] for value in values], h5py.ref_dtype)

        def put(place: Any, name: str, value: Any) -> Any:
            fields = getattr(getattr(value, "dtype", None), "names", None)
            if isinstance(value, dict) or (fields and value.size == 1):
                made = place.create_group(name)
                for field in fields or value:
                    put(made, field, value[0][field] if fields else value[field])
                kind = "struct"
            elif fields:
                made = place.create_group(name)
                for field in fields:
                    made.create_dataset(field, data=refer(value[field]))
                kind = "struct"
            elif isinstance(value, str):
                given = np.array([ord(letter) for letter in value] or [0, 0], np.uint16)
                made, kind = place.create_dataset(name, data=given[:, None] if value else given), "char"
                if not value:
                    made.attrs["MATLAB_empty"] = np.uint8(1)
            elif np.asarray(value).dtype == object:
                made, kind = place.create_dataset(name, data=refer(value)), "cell"
            else:
                made, kind = place.create_dataset(name, data=np.atleast_2d(value).T), "double"
            made.attrs["MATLAB_class"] = np.bytes_(kind)
            return made

        for name, value in variables.items():
            put(file, name, value)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\x02IM")


def write_tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [
                ChannelObject("run", role, values, properties={"unit_string": UNITS[role]})
                for role, values in in_rig_units().items()
            ]
        )


def write_mdf(path: Path) -> None:
    from asammdf import MDF, Signal

    given = in_rig_units()
    with MDF(version="4.10") as file:
        file.append(
            [Signal(values, RUN.time, UNITS[role], role) for role, values in given.items() if role != "time"]
        )
        file.save(path, overwrite=True)


def write_npz(path: Path) -> None:
    np.savez(path, **{"remark": np.array("fine"), **titled()})  # type: ignore[arg-type]


def write_json(path: Path) -> None:
    columns = titled()
    rows = np.column_stack(list(columns.values())).tolist()
    path.write_text(json.dumps({"rig": {"bench": 3, "columns": list(columns)}, "rows": rows}))


def write_parquet(path: Path) -> None:
    import polars as pl

    pl.DataFrame(titled()).with_columns(pl.lit("note").alias("remark")).write_parquet(path)


def write_excel(path: Path) -> None:
    from openpyxl import Workbook

    book = Workbook()
    notes = book.active
    assert notes is not None
    notes.title = "Notes"
    notes.append(["bench 3", "13 May"])
    sheet = book.create_sheet("Data")
    sheet.append(["Bench 3"])
    sheet.append(["Time", "Displacement", "Load", "Current", "Remark"])
    sheet.append(["Sec", "mm", "kN", "A"])
    for row in zip(*(column.tolist() for column in titled().values()), strict=True):
        sheet.append([*row, "fine"])
    book.save(path)


WRITERS: Mapping[str, Callable[[Path], None]] = MappingProxyType(
    {
        "run.csv": write_csv,
        "semicolons.csv": write_semicolons,
        "mts.dat": write_mts,
        "logger.txt": write_logger,
        "v5.mat": write_mat,
        "v73.mat": write_mat73,
        "run.h5": write_hdf5,
        "run.tdms": write_tdms,
        "run.mf4": write_mdf,
        "run.npz": write_npz,
        "run.json": write_json,
        "run.parquet": write_parquet,
        "run.xlsx": write_excel,
    }
)
"""File name -> function that writes the run to the file."""
