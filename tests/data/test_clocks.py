"""Channels of one file with different start times or sample rates are read at the correct times."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.data.proposal.questions import AskingError, parse_answers
from mrdamper.data.readers import read_file
from mrdamper.errors import InputError
from tests.data.rig_files import read_run, save_mat73

pytestmark = pytest.mark.system

STARTED = datetime(2026, 3, 4, 10, 0, 0, tzinfo=UTC)


def displacement_mm(time: FloatArray) -> FloatArray:
    """Return a motion that does not repeat, so that a time shift causes an error at every sample."""
    return np.asarray(10.0 * np.sin(2.0 * np.pi * time) + 3.0 * np.sin(1.9 * time + 1.0))


def force_N(time: FloatArray) -> FloatArray:
    return np.asarray(300.0 * np.cos(2.0 * np.pi * time) + 50.0 * np.cos(1.9 * time + 1.0))


@dataclass(frozen=True)
class Channel:
    """Hold the samples of a channel with their unit, start time [s] and time step [s]."""

    unit: str
    start_s: float
    step_s: float
    values: FloatArray

    @property
    def time(self) -> FloatArray:
        return np.asarray(self.start_s + self.step_s * np.arange(len(self.values)))

    @property
    def moment(self) -> datetime:
        return STARTED + timedelta(seconds=self.start_s)


Channels = Mapping[str, Channel]


def recording(late_s: float = 0.0, force_step_s: float = 0.002, seconds: float = 4.0) -> dict[str, Channel]:
    """Return displacement and force of a damper. The force starts later and may have a different rate."""
    time = np.asarray(0.002 * np.arange(round(seconds / 0.002)))
    later = np.asarray(late_s + force_step_s * np.arange(round(seconds / force_step_s)))
    return {
        "Displacement": Channel("mm", 0.0, 0.002, displacement_mm(time)),
        "Force": Channel("N", late_s, force_step_s, force_N(later)),
        "Current": Channel("A", 0.0, 0.5, np.full(round(seconds / 0.5), 2.0)),
    }


def assert_on_one_clock(
    path: Path, late_s: float, answers: tuple[str, ...] = (), *, is_reported: bool = True
) -> None:
    """Check that displacement and force belong to the times at which they were measured."""
    read = read_file(path, answers=parse_answers(answers))
    (run,) = (each.checked() for each in read.recordings)
    assert np.allclose(1e3 * run.displacement, displacement_mm(run.time), atol=1e-3)
    assert np.allclose(run.force, force_N(run.time), atol=0.05)
    assert run.constant_command == 2.0
    assert run.time[0] == pytest.approx(late_s, abs=1e-6)
    assert [each.kind for each in read.findings] == ["common_time"] * is_reported


# ------------------------------------------------------------------------------------------- writers of files


def write_tdms(path: Path, channels: Channels, state: Callable[[Channel], dict[str, Any]]) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [
                ChannelObject(
                    "Rig", name, each.values,
                    properties={"unit_string": each.unit, "wf_increment": each.step_s, **state(each)},
                )
                for name, each in channels.items()
            ]
        )  # fmt: skip


def tdms_start(path: Path, channels: Channels) -> None:
    """Write a TDMS file with the start time of each channel."""
    write_tdms(path, channels, lambda each: {"wf_start_time": each.moment.replace(tzinfo=None)})


def tdms_offset(path: Path, channels: Channels) -> None:
    """Write a TDMS file with a time offset for each channel. Only the force has a start time."""

    def state(each: Channel) -> dict[str, Any]:
        began = {"wf_start_time": STARTED.replace(tzinfo=None)} if each.unit == "N" else {}
        return {"wf_start_offset": each.start_s, **began}

    write_tdms(path, channels, state)


def universal(path: Path, channels: Channels) -> None:
    """Write a universal file whose abscissae start at different times."""
    text = ""
    for name, each in channels.items():
        count = len(each.values)
        head = [name, "Damper", "today", "NONE", "NONE", "    1" + 75 * " "]
        head.append(f"{4:10d}{count:10d}{1:10d}{each.start_s:13.5E}{each.step_s:13.5E}{0.0:13.5E}")
        for code, label, unit in ((17, "Time", "s"), (8, name, each.unit), *[(0, "NONE", "NONE")] * 2):
            head.append(f"{code:10d}    0    0    0 {label:20s} {unit:20s}")
        cells = [f"{value:20.11E}" for value in each.values]
        lines = ["".join(cells[k : k + 4]) for k in range(0, count, 4)]
        text += "\n".join(["    -1", "    58", *head, *lines, "    -1", ""])
    path.write_text(text, encoding="ascii")


def write_hdf5(path: Path, channels: Channels, state: Callable[[Channel], dict[str, Any]]) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, each in channels.items():
            item = file.create_dataset(name, data=each.values)
            item.attrs.update({"unit": each.unit, **state(each)})


def hdf5_step(path: Path, channels: Channels) -> None:
    write_hdf5(path, channels, lambda each: {"dt": each.step_s, "t0": each.start_s})


def hdf5_rate(path: Path, channels: Channels) -> None:
    write_hdf5(
        path,
        channels,
        lambda each: {"sample_rate_Hz": 1.0 / each.step_s, "start_time": each.moment.isoformat()},
    )


def hdf5_groups(path: Path, channels: Channels) -> None:
    """Write an HDF5 file with a group for each channel. A group contains samples and times [ms]."""
    import h5py

    with h5py.File(path, "w") as file:
        for name, each in channels.items():
            file.create_dataset(f"rig/{name}/v", data=each.values).attrs["unit"] = each.unit
            file.create_dataset(f"rig/{name}/t", data=1e3 * each.time).attrs["unit"] = "ms"


def write_labview(path: Path, channels: Channels, *, wide: bool, moments: bool) -> None:
    """Write a LabVIEW text file.

    If ``wide``, each channel has its own x column. Otherwise there is no x column. The start of a channel is
    given by its date and time if ``moments``, and otherwise by the tag ``X0``.
    """
    gap = "\t\t" if wide else "\t"
    x0 = [0.0 if moments else each.start_s for each in channels.values()]
    begun = [each.moment if moments else STARTED for each in channels.values()]
    tags = {
        "Channels": [str(len(channels))],
        "Samples": [str(len(each.values)) for each in channels.values()],
        "Date": [f"{each:%Y/%m/%d}" for each in begun],
        "Time": [f"{each:%H:%M:%S.%f}" for each in begun],
        "Y_Unit_Label": [each.unit for each in channels.values()],
        "X_Dimension": ["Time"] * len(channels),
        "X0": [f"{each:.7E}" for each in x0],
        "Delta_X": [f"{each.step_s:.7E}" for each in channels.values()],
    }
    kind = "Multi" if wide else "No"
    head = ["LabVIEW Measurement", "Separator\tTab", f"X_Columns\t{kind}", "***End_of_Header***", ""]
    head += [*(f"{name}\t{gap.join(cells)}" for name, cells in tags.items()), "***End_of_Header***"]
    if wide:
        head.append("\t".join(f"X_Value\t{name}" for name in channels) + "\tComment")
        columns = [
            column
            for first, each in zip(x0, channels.values(), strict=True)
            for column in (first + each.time - each.start_s, each.values)
        ]
    else:
        head.append("\t".join(["X_Value", *channels, "Comment"]))
        columns = [np.empty(0), *(each.values for each in channels.values())]
    cells = ([f"{value:.6f}" for value in column] for column in columns)
    rows = itertools.zip_longest(*cells, fillvalue="")
    path.write_text("\r\n".join([*head, *map("\t".join, rows), ""]), encoding="utf-8", newline="")


def labview_offsets(path: Path, channels: Channels) -> None:
    write_labview(path, channels, wide=False, moments=False)


def labview_moments(path: Path, channels: Channels) -> None:
    write_labview(path, channels, wide=False, moments=True)


def labview_times(path: Path, channels: Channels) -> None:
    write_labview(path, channels, wide=True, moments=False)


def time_series(channels: Channels) -> dict[str, Any]:
    """Return a structure of samples and times for each channel, as a MATLAB time series is saved."""
    return {
        f"channel_{k}": {"Name": name, "Time": each.time, "Data": each.values, "Unit": each.unit}
        for k, (name, each) in enumerate(channels.items())
    }


def mat(path: Path, channels: Channels) -> None:
    from scipy.io import savemat

    savemat(path, time_series(channels))


def mat73(path: Path, channels: Channels) -> None:
    save_mat73(path, time_series(channels))


def mat_rates(path: Path, channels: Channels) -> None:
    """Write MAT structures with samples, sample rate and start time."""
    from scipy.io import savemat

    savemat(
        path,
        {
            name: {"data": each.values, "fs": 1.0 / each.step_s, "t0": each.start_s, "unit": each.unit}
            for name, each in channels.items()
        },
    )


def mat_prefix(path: Path, channels: Channels) -> None:
    """Write arrays with a common prefix, as Dewesoft exports them. The times have no unit."""
    from scipy.io import savemat

    variables: dict[str, Any] = {"Sample_rate": 500.0}
    for name, each in channels.items():
        variables |= {f"Data1_{name}_{each.unit}": each.values, f"Data1_time_{name}": each.time}
    savemat(path, variables)


def npz_times(path: Path, channels: Channels) -> None:
    """Write times named after their channel. The time of the force is in milliseconds."""
    times = {"t_disp": channels["Displacement"], "current time [s]": channels["Current"]}
    arrays = {name: each.time for name, each in times.items()} | {"force_t_ms": 1e3 * channels["Force"].time}
    names = {"disp_mm": "Displacement", "force_N": "Force", "Current [A]": "Current"}
    np.savez(path, **arrays, **{name: channels[key].values for name, key in names.items()})  # type: ignore[arg-type]


def objects(path: Path, channels: Channels) -> None:
    document = {
        name: {"unit": each.unit, "dt_ms": 1e3 * each.step_s, "start_s": each.start_s, "y": [*each.values]}
        for name, each in channels.items()
    }
    path.write_text(json.dumps(document), encoding="utf-8")


def mdf(path: Path, channels: Channels) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        for name, each in channels.items():
            file.append([Signal(each.values, each.time, each.unit, name)])
        file.save(path, overwrite=True)


def columns_apart(path: Path, channels: Channels) -> None:
    """Write each channel after its own time column. The time of the force is in milliseconds."""
    head, columns = [], []
    for name, each in channels.items():
        unit, factor = ("ms", 1e3) if name == "Force" else ("s", 1.0)
        head += [f"Time {name} [{unit}]", f"{name} [{each.unit}]"]
        columns += [factor * each.time, each.values]
    cells = ([f"{value:.6f}" for value in column] for column in columns)
    rows = itertools.zip_longest(*cells, fillvalue="")
    path.write_text("\n".join(map(";".join, [head, *rows])) + "\n", encoding="utf-8")


WRITERS: Mapping[Callable[[Path, Channels], None], str] = {
    tdms_start: "run.tdms",
    tdms_offset: "run.tdms",
    universal: "run.unv",
    hdf5_step: "run.h5",
    hdf5_rate: "run.h5",
    hdf5_groups: "run.h5",
    labview_offsets: "run.lvm",
    labview_moments: "run.lvm",
    labview_times: "run.lvm",
    mat: "run.mat",
    mat73: "run.mat",
    mat_rates: "run.mat",
    mat_prefix: "run.mat",
    npz_times: "run.npz",
    objects: "run.json",
    mdf: "run.mf4",
    columns_apart: "run.csv",
}


# --------------------------------------------------------------------------------------------- tests


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
@pytest.mark.parametrize(
    ("late_s", "force_step_s"), [(0.002, 0.002), (0.05, 0.002), (0.05, 0.001), (0.0, 0.001)]
)
def test_channels_keep_their_own_times(tmp_path, write, late_s, force_step_s):
    """The force starts later than the displacement or has another sample rate."""
    path = tmp_path / WRITERS[write]
    write(path, recording(late_s, force_step_s))
    is_reported = late_s > (
        0.01 if write in {mdf, columns_apart} else 0.0
    )  # A shift of up to 10 ms may be jitter of the times in these two formats.
    assert_on_one_clock(path, late_s, is_reported=is_reported)


@pytest.mark.parametrize(
    "write", [tdms_start, universal, hdf5_rate, labview_moments, mat], ids=lambda write: write.__name__
)
def test_short_overlap_of_channels_is_reported(tmp_path, write):
    path = tmp_path / WRITERS[write]
    write(path, recording(3.0))
    assert_on_one_clock(path, 3.0)
    (finding,) = read_file(path).findings
    assert finding.severity == "warning"
    assert finding.size == pytest.approx(3.0, abs=0.01)


@pytest.mark.parametrize("write", [tdms_start, universal, mdf], ids=lambda write: write.__name__)
def test_channels_without_overlap_are_rejected(tmp_path, write):
    path = tmp_path / WRITERS[write]
    write(path, recording(60.0))
    with pytest.raises(InputError, match="no time in common"):
        read_run(path)


def test_channel_covering_half_record_requires_answer(tmp_path):
    """If one channel covers only half of the record, the user decides whether the other half is omitted."""
    path = tmp_path / "run.mf4"
    mdf(path, recording(2.0))
    with pytest.raises(AskingError, match=r"time\.part=common") as fault:
        read_run(path)
    assert [(each.key, each.candidates) for each in fault.value.questions] == [("time.part", ("common",))]
    assert_on_one_clock(path, 2.0, ("time.part=common",))
    (tmp_path / "map.toml").write_text("[file]\ncommon_time = true\n", encoding="utf-8")
    (run,) = read_run(path, tmp_path / "map.toml")
    assert run.time[0] == pytest.approx(2.0)


def test_times_of_channels_without_unit_are_questioned(tmp_path):
    """Steps of 2 cannot be in seconds, and milliseconds are not assumed."""
    times = {f"time_{name}": 1e3 * each.time for name, each in recording().items()}
    arrays = {f"{name} [{each.unit}]": each.values for name, each in recording().items()}
    np.savez(tmp_path / "run.npz", **arrays, **times)  # type: ignore[arg-type]
    with pytest.raises(AskingError) as fault:
        read_run(tmp_path / "run.npz")
    assert [each.key for each in fault.value.questions] == ["time.unit"]


@pytest.mark.parametrize("value", [0.02, 2.0, 25.0])
def test_implausible_time_step_requires_unit(tmp_path, value):
    """A time step of 2 without unit cannot be in seconds, and milliseconds are not assumed."""
    path = tmp_path / "run.h5"
    write_hdf5(path, recording(), lambda each: {"dt": 1.5 * value})
    with pytest.raises(AskingError) as fault:
        read_run(path)
    assert [each.key for each in fault.value.questions] == ["time.rate"]


def test_varying_channel_without_clock_is_rejected(tmp_path):
    path = tmp_path / "run.h5"
    channels = recording(0.05) | {"Current": Channel("A", 0.0, 0.002, np.linspace(0.0, 2.0, 2000))}
    write_hdf5(
        path, channels, lambda each: {} if each.unit == "A" else {"dt": each.step_s, "t0": each.start_s}
    )
    with pytest.raises(InputError, match=r"'Current'.*states no start and no step"):
        read_run(path)


def test_words_with_time_unit_are_no_times(tmp_path):
    """A column of words is no time column, even if its header has a unit of time."""
    time = np.asarray(0.005 * np.arange(800))
    samples = zip(time, displacement_mm(time), force_N(time), strict=True)
    rows = [f"{'run' if t > 1.0 else 'wait'},{x:.4f},{f:.3f},0.5" for t, x, f in samples]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(["state [s],x [mm],F [N],I [A]", *rows]), encoding="utf-8")
    with pytest.raises(InputError, match="no time column"):
        read_run(path)
