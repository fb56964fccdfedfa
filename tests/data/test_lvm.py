"""LabVIEW measurement text, after its specification: tags, clocks, segments."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.data.readers import read_run
from mrdamper.data.tables import read_table
from mrdamper.errors import InputError
from tests.data.rig_files import RUN

CHANNELS = ("Displacement (mm)", "Force (N)", "Current (A)")
STEP = float(RUN.time[1] - RUN.time[0])
END = "***End_of_Header***"


def lvm(*, x="One", comma=False, dimension="Time", segments=1, units=None, labels=CHANNELS):
    sign, point = ("\t", ",") if comma else ("\t", ".")
    tags = [
        "LabVIEW Measurement", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab",
        f"Decimal_Separator\t{point}", "Multi_Headings\tNo", f"X_Columns\t{x}", "Time_Pref\tRelative",
        "Operator\tlab", "Date\t2026/11/21", "Time\t10:15:02.1234567", END, "",
    ]  # fmt: skip
    values = (RUN.displacement * 1e3, RUN.force, RUN.command)
    for _ in range(segments):
        tags += [f"Channels\t{len(values)}", "Samples" + f"\t{len(RUN)}" * 3, "Date" + "\t2026/11/21" * 3]
        tags += ["Time" + "\t10:15:02.12" * 3, "X_Dimension" + f"\t{dimension}" * 3]
        if units:
            tags.append("\t".join(["Y_Unit_Label", *units]))
        tags += ["X0" + "\t0.0E+0" * 3, "Delta_X" + f"\t{STEP!r}".replace(".", point) * 3, END]
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
        for k in range(len(RUN)):
            at = "" if x == "No" else f"{k * STEP!r}"
            cells = [
                at,
                *(f"{sign}{at}{sign}" if wide else sign).join(f"{v[k]!r}" for v in values).split(sign),
                "",
            ]
            tags.append(sign.join(cells).replace("np.float64(", "").replace(")", "").replace(".", point))
    return "\r\n".join([*tags, ""])


@pytest.mark.parametrize("x", ["One", "No", "Multi"])
@pytest.mark.parametrize("comma", [False, True])
def test_a_run_is_read_with_its_clock(tmp_path, x, comma):
    (tmp_path / "run.lvm").write_text(lvm(x=x, comma=comma), encoding="utf-8", newline="")
    (run,) = read_run(tmp_path / "run.lvm")
    assert np.allclose(run.time, RUN.time - RUN.time[0], atol=1e-12)
    assert np.allclose(run.displacement, RUN.displacement, atol=1e-15)
    assert np.array_equal(run.force, RUN.force)
    assert np.array_equal(run.command, RUN.command)


def test_units_of_the_header_hold_where_the_labels_state_none(tmp_path):
    given = lvm(units=("mm", "N", "Volts"), labels=("Displacement", "Force", "Current (A)"))
    (tmp_path / "run.lvm").write_text(given, encoding="utf-8", newline="")
    table = read_table(tmp_path / "run.lvm")
    assert table.units == {"Displacement": "mm", "Force": "N", "time": "s"}
    (run,) = read_run(tmp_path / "run.lvm")
    assert np.allclose(run.displacement, RUN.displacement, atol=1e-15)


def test_an_x_that_is_no_time_is_a_column_like_others(tmp_path):
    (tmp_path / "run.lvm").write_text(lvm(dimension="Frequency"), encoding="utf-8", newline="")
    with pytest.raises(InputError, match=r"run\.lvm: no time column; the columns are: X_Value, Displacement"):
        read_run(tmp_path / "run.lvm")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (lvm(segments=2), r"run\.lvm"),
        (lvm()[:200], r"no \*\*\*End_of_Header\*\*\* in the first \d+ lines; it was cut off"),
        (lvm()[: lvm().rindex("X_Value") + 8], r"no rows after its header"),
        (
            lvm().replace("Separator\tTab", "Separator\tComma", 1).replace("rator\t.", "rator\t,"),
            r"commas separate",
        ),
        (lvm(x="Multi").replace("\t1.995\t", "\t9.5\t", 1), r"clocks of their own"),
    ],
)
def test_what_cannot_be_read_says_why(tmp_path, content, said):
    (tmp_path / "run.lvm").write_text(content, encoding="utf-8", newline="")
    with pytest.raises(InputError, match=said):
        read_run(tmp_path / "run.lvm")
