"""LabVIEW measurement text (LVM) is read as its specification defines tags, clocks and segments."""

from __future__ import annotations

from datetime import datetime, timedelta
from itertools import pairwise

import numpy as np
import pytest

from mrdamper.data.readers import read_runs
from mrdamper.data.tables import read_table
from mrdamper.errors import InputError
from tests.data.rig_files import RUN, read_run

CHANNELS = ("Displacement (mm)", "Force (N)", "Current (A)")
STEP = float(RUN.time[1] - RUN.time[0])
END = "***End_of_Header***"


def lvm(
    *, x="One", comma=False, dimension="Time", units=None, labels=CHANNELS, cuts=(), anew=False, late_s=0.0
):
    """Return LVM text with segments that start at rows ``cuts``. Optionally, each clock starts at zero."""
    sign, point = ("\t", ",") if comma else ("\t", ".")
    tags = [
        "LabVIEW Measurement", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab",
        f"Decimal_Separator\t{point}", "Multi_Headings\tNo", f"X_Columns\t{x}", "Time_Pref\tRelative",
        "Operator\tlab", "Date\t2026/11/21", "Time\t10:15:02.1234567", END, "",
    ]  # fmt: skip
    values = (RUN.displacement * 1e3, RUN.force, RUN.command)
    for start, stop in pairwise((0, *cuts, len(RUN))):
        begun = datetime(2026, 11, 21, 10, 15, 2) + timedelta(seconds=start * STEP + late_s * (start > 0))
        shift = start if anew else 0
        tags += [f"Channels\t{len(values)}", "Samples" + f"\t{len(RUN)}" * 3, "Date" + "\t2026/11/21" * 3]
        clock = f"{begun:%H:%M:%S}{point}{begun:%f}0" if anew else f"10:15:02{point}12"
        tags += ["Time" + f"\t{clock}" * 3, "X_Dimension" + f"\t{dimension}" * 3]
        if units:
            tags.append(
                "\t".join(["Y_Unit_Label", *("\t\t" if x == "Multi" else "\t").join(units).split("\t")])
            )
        tags += [
            "X0" + f"\t{(start - shift) * STEP!r}".replace(".", point) * 3,
            "Delta_X" + f"\t{STEP!r}".replace(".", point) * 3,
            END,
        ]
        wide = x == "Multi"
        tags.append(
            sign.join(
                [
                    "X_Value",
                    *(f"{sign}X_Value{sign}".join(labels) if wide else sign.join(labels)).split(sign),
                    "Comment",
                ]
            )
        )
        for k in range(start, stop):
            at = "" if x == "No" else f"{(k - shift) * STEP!r}"
            cells = [
                at,
                *(f"{sign}{at}{sign}" if wide else sign).join(f"{v[k]!r}" for v in values).split(sign),
                "",
            ]
            tags.append(sign.join(cells).replace("np.float64(", "").replace(")", "").replace(".", point))
        tags.append("")
    return "\r\n".join([*tags, ""])


@pytest.mark.parametrize("forgotten", ["", "Time\t10:15", "Date\t2026"])
@pytest.mark.parametrize("x", ["One", "No"])
def test_later_lvm_segment_is_separate_run(tmp_path, x, forgotten):
    content = lvm(x=x, cuts=(100,), anew=True, late_s=7.5)
    if forgotten:
        content = "\r\n".join(line for line in content.splitlines() if not line.startswith(forgotten))
    (tmp_path / "run.lvm").write_text(content, encoding="utf-8", newline="")
    runs = read_run(tmp_path / "run.lvm")
    assert [len(run) for run in runs] == [100, len(RUN) - 100]
    assert np.array_equal(np.concatenate([run.force for run in runs]), RUN.force)
    assert np.allclose(np.diff(runs[1].time), STEP)


@pytest.mark.parametrize("x", ["One", "No", "Multi"])
@pytest.mark.parametrize("comma", [False, True])
def test_lvm_run_keeps_its_times(tmp_path, x, comma):
    (tmp_path / "run.lvm").write_text(lvm(x=x, comma=comma), encoding="utf-8", newline="")
    (run,) = read_run(tmp_path / "run.lvm")
    assert np.allclose(run.time, RUN.time - RUN.time[0], atol=1e-12)
    assert np.allclose(run.displacement, RUN.displacement, atol=1e-15)
    assert np.array_equal(run.force, RUN.force)
    assert np.array_equal(run.command, RUN.command)


@pytest.mark.parametrize("x", ["One", "No", "Multi"])
@pytest.mark.parametrize("force", ["Force", "Force (Trigger)"])
def test_lvm_header_units_complete_column_names(tmp_path, x, force):
    given = lvm(x=x, units=("mm", "N", "Volts"), labels=("Displacement", force, "Current (A)"))
    (tmp_path / "run.lvm").write_text(given, encoding="utf-8", newline="")
    table = read_table(tmp_path / "run.lvm")
    assert table.units == {"Displacement": "mm", force: "N", "time": "s"}
    (run,) = read_run(tmp_path / "run.lvm")
    assert np.allclose(run.displacement, RUN.displacement, atol=1e-15)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (lvm(cuts=(9,)).replace("Force (N)", "Force (kN)", 1), r"line 41: the columns differ from"),
        (lvm()[:200], r"no \*\*\*End_of_Header\*\*\*; it was cut off"),
        (lvm()[: lvm().rindex("X_Value") + 8], r"no rows after its header"),
        (
            lvm().replace("Separator\tTab", "Separator\tComma", 1).replace("rator\t.", "rator\t,"),
            r"commas separate",
        ),
    ],
)
def test_unreadable_lvm_is_rejected_with_reason(tmp_path, content, said):
    (tmp_path / "run.lvm").write_text(content, encoding="utf-8", newline="")
    with pytest.raises(InputError, match=said):
        read_run(tmp_path / "run.lvm")


def test_lvm_file_of_each_channel_is_joined(tmp_path):
    """The empty column of comments is not a channel."""
    head = f"LabVIEW Measurement\nSeparator\tTab\n{END}\n\nChannels\t1\nX_Dimension\tTime\nY_Unit_Label\t"
    channels = {"mm": RUN.displacement * 1e3, "N": RUN.force, "A": RUN.command}
    for (unit, values), name in zip(channels.items(), ("Position", "Force", "Coil"), strict=True):
        rows = (f"{t!r}\t{value!r}\t\n" for t, value in zip(RUN.time.tolist(), values.tolist(), strict=True))
        text = f"{head}{unit}\n{END}\nX_Value\t{name}\tComment\n{''.join(rows)}"
        (tmp_path / f"{name}.lvm").write_text(text, encoding="utf-8")
    (run,) = read_runs(tmp_path)
    assert np.array_equal(run.force, RUN.force)
    assert np.array_equal(run.command, RUN.command)
