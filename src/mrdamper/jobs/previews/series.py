"""Write and read *series* files, which store the samples of one run as float32 in display units for plots.

The format is::

    uint32 H, H bytes of JSON (padded with blanks, so that 4 + H is a multiple of 4), then the columns, one
    after another, as float32; all little-endian

The JSON header has the names and units of the columns and the number of samples. ``keep_window`` reduces the
number of samples. In each of several equal intervals, it keeps the samples with minimum and maximum force and
displacement, so that loops and peaks remain visible. A server sends the files unchanged.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import Preparation, PreparedRun, prepare_run
from mrdamper.data.readers import read_file
from mrdamper.data.records import Recording
from mrdamper.errors import InputError
from mrdamper.identify.evaluate import outside_envelope
from mrdamper.identify.scores import score_run
from mrdamper.jobs.previews.runs import look_into, run_row
from mrdamper.models.card_schema import read_card
from mrdamper.models.simulate import simulate
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K
from mrdamper.schema import Json, finite_or_none

Columns = Mapping[str, tuple[str, NDArray[Any]]]


def keep_runs(path: Path, place: Path) -> Json:
    """Write each run of a file as a series file into a folder (``0.series``, ...); return the preview.

    The preview has the format of ``look``. If the file is not readable, ``error`` in the preview has the
    reason.
    """
    place.mkdir(parents=True, exist_ok=True)
    try:
        view, read = look_into(path)
    except InputError as fault:  # The channel map is invalid.
        return {"runs": [], "columns": [], "error": str(fault).replace(f"{path.parent}/", "")}
    if read is None:
        return vars(view)
    rows = []
    for k, recording in enumerate(read.recordings):
        row, prepared = run_row(read, recording)
        rows.append({**row, "file": path.name})
        lengths = {len(getattr(recording, name)) for name in ("time", "displacement", "force", "command")}
        if len(lengths) == 1 and len(recording):
            _write(place / f"{k}.series", _header(recording, path.name), _columns(recording, prepared))
    return vars(view) | {"runs": rows}


def keep_window(
    series: Path,
    place: Path,
    *,
    most: int | None = None,
    from_s: float | None = None,
    to_s: float | None = None,
    samples_of: Path | None = None,
) -> None:
    """Write a time range of a series file as a new series file, with fewer samples if requested.

    Parameters
    ----------
    most : maximum number of samples, at least 64; None: all samples
    from_s, to_s : time range [s], counted from the first sample of the run; None: no limit
    samples_of : series file that decides which sample indices are kept, such as the measured run of a
        simulated series; None: ``series``
    """
    header, columns = read_series(series)
    deciding = columns if samples_of is None else read_series(samples_of)[1]
    time = deciding["time_s"]
    low = 0 if from_s is None else int(np.searchsorted(time, from_s, side="left"))
    high = len(time) if to_s is None else int(np.searchsorted(time, to_s, side="right"))
    if high <= low:
        raise InputError(
            f"no sample from {from_s} to {to_s} s",
            place=header["name"],
            expected=f"a part of 0 to {time[-1]:g} s",
        )
    kept = np.arange(low, high)
    if most is not None and len(kept) > most:
        chosen = [deciding[name][low:high] for name in ("force_N", "displacement_mm")]
        kept = low + _extreme_indices(chosen, max(most, 64))
    units = _units(header)
    _write(place, header, {name: (units[name], values[kept]) for name, values in columns.items()})


def keep_model(card: Path, path: Path, number: int, place: Path, shown: str) -> None:
    """Write a series file with motion, measured force, and the force of a card at the samples of a run.

    Parameters
    ----------
    number : number of the run in the file ``path``, counted from 0
    place : path of the new series file
    shown : displayed name of the card
    """
    model = read_card(card)
    recordings = read_file(path).recordings
    if not 0 <= number < len(recordings):
        raise InputError(
            f"holds {len(recordings)} runs", place=path.name, expected=f"number 0 to {len(recordings) - 1}"
        )
    recording = recordings[number]
    prepared = prepare_run(recording.checked(), Preparation.from_dict(model.preparation))
    damper = model.damper
    if damper.assumed and prepared.trajectory.temperature is None:
        warm = np.full(len(prepared), REFERENCE_K)
        prepared = replace(prepared, trajectory=replace(prepared.trajectory, temperature=warm))
    error = score_run(damper, prepared)
    header = _header(recording, path.name) | {
        "card": shown,
        "rmse_N": finite_or_none(error.rmse_N),
        "nrmse_percent": finite_or_none(error.nrmse_percent),
        "notes": outside_envelope(model, [prepared]),
        "scored_from_s": prepared.scored_from * prepared.trajectory.step,
    }
    run = recording
    force = _on_samples(run, prepared, simulate(damper.on_limits(), prepared.trajectory))
    velocity = _on_samples(run, prepared, prepared.trajectory.velocity)
    columns: Columns = {
        "time_s": ("s", run.time - run.time[0]),
        "displacement_mm": ("mm", 1e3 * run.displacement),
        "velocity_mm_s": ("mm/s", 1e3 * velocity),
        "force_N": ("N", force),
        "measured_N": ("N", run.force),
    }
    _write(place, header, columns)


def read_series(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[np.float32]]]:
    """Return the header and the columns of a series file; the columns are memory-mapped and not loaded."""
    with path.open("rb") as file:
        length = int.from_bytes(file.read(4), "little")
        header = json.loads(file.read(length))
    names = list(_units(header))
    shape = (len(names), header["n"])
    found = np.memmap(path, dtype="<f4", mode="r", offset=4 + length, shape=shape)
    return header, dict(zip(names, found, strict=True))


def _units(header: Mapping[str, Any]) -> dict[str, str]:
    """Return the units of the columns of a series file, by name of the column."""
    return {column["name"]: column["unit"] for column in header["columns"]}


def _columns(recording: Recording, prepared: PreparedRun | None) -> Columns:
    x, time = recording.displacement, recording.time
    if prepared is not None:
        velocity = _on_samples(recording, prepared, prepared.trajectory.velocity)
    elif recording.velocity is not None and len(recording.velocity) == len(x):
        velocity = recording.velocity
    elif len(x) > 1:
        with np.errstate(all="ignore"):
            velocity = np.gradient(x, time)
    else:
        velocity = np.zeros_like(x)
    unit = recording.command_unit
    columns = {
        "time_s": ("s", time - time[0]),
        "displacement_mm": ("mm", 1e3 * x),
        "velocity_mm_s": ("mm/s", 1e3 * velocity),
        "force_N": ("N", recording.force),
        f"command_{unit}": (str(unit), recording.command),
    }
    warm = recording.temperature
    if warm is not None and len(warm) == len(x):
        columns |= {"temperature_degC": ("degC", warm - ZERO_CELSIUS_K)}
    return columns


def _on_samples(recording: Recording, prepared: PreparedRun, values: FloatArray) -> FloatArray:
    """Interpolate values from the uniform time grid to the times of the recording."""
    time = recording.time - recording.time[0]
    step = prepared.trajectory.step
    if len(values) == len(time) and abs(float(time[-1]) - step * (len(time) - 1)) < 0.5 * step:
        return values
    return np.asarray(np.interp(time, step * np.arange(len(values)), values))


def _header(recording: Recording, file: str) -> dict[str, Any]:
    step_tolerance_ratio = 1e-3  # max deviation of a time step from the mean step, divided by the mean step
    time = recording.time
    steps = np.diff(time)
    step = float(np.mean(steps)) if len(steps) else 0.0
    uniform = step > 0.0 and float(np.abs(steps - step).max()) <= step_tolerance_ratio * step
    return {
        "name": recording.name,
        "file": file,
        "samples": len(recording),
        "t0_s": finite_or_none(float(time[0])),
        "step_s": step if uniform else None,
    }


def _write(path: Path, header: Mapping[str, Any], columns: Columns) -> None:
    """Write a series file atomically: a temporary file is renamed when it is complete."""
    count = len(next(iter(columns.values()))[1])
    told = {
        **header,
        "n": count,
        "columns": [{"name": name, "unit": unit} for name, (unit, _) in columns.items()],
    }
    text = json.dumps(told, ensure_ascii=False, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    beside = path.with_name(f".{path.name}-{os.getpid()}")
    with beside.open("wb") as file:
        file.write(len(text).to_bytes(4, "little") + text)
        with np.errstate(over="ignore"):
            for _, values in columns.values():
                np.ascontiguousarray(values, dtype="<f4").tofile(file)
    beside.replace(path)


def _extreme_indices(columns: list[NDArray[np.float32]], most: int) -> NDArray[np.int64]:
    """Return at most ``most`` sample indices: the extremes of each column in equal intervals.

    The first and the last sample are always included.
    """
    count = len(columns[0])
    stretches = (most - 2) // (2 * len(columns))
    wide = -(-count // stretches)
    found = [np.array([0, count - 1])]
    begins = np.arange(0, count, wide)
    for values in columns:
        # Fill a short last interval with its last value.
        padded = np.full(len(begins) * wide, values[-1], dtype=np.float32)
        padded[:count] = values
        rows = np.nan_to_num(padded).reshape(len(begins), wide)
        found += [begins + rows.argmin(axis=1), begins + rows.argmax(axis=1)]
    return np.unique(np.minimum(np.concatenate(found), count - 1))
