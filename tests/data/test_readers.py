"""Text files in many notations give the same run. An unreadable file gives a message."""

import re

import numpy as np
import pytest
from scipy.io import savemat

from mrdamper.data.channels import ChannelMap
from mrdamper.data.readers import read_runs
from mrdamper.errors import InputError
from tests.data.rig_files import read_run
from tests.support.campaigns import make_run

RUN = make_run(duration=2.0, rate_Hz=200.0)
ROWS = list(zip(RUN.time, RUN.displacement, RUN.force, RUN.command, strict=True))
SELF_DESCRIBING = "time_s,displacement_m,force_N,current_A"


def _text(header, delimiter=",", scales=(1.0, 1.0, 1.0, 1.0), comma=False):
    rows = (delimiter.join(repr(float(v * s)) for v, s in zip(row, scales, strict=True)) for row in ROWS)
    body = "\n".join(rows)
    return header + "\n" + (body.replace(".", ",") if comma else body) + "\n"


def _read(tmp_path, text, channels=None, name="run.csv"):
    file = tmp_path / name
    file.write_text(text, encoding="utf-8")
    (run,) = read_run(file, channels)
    return run


def _assert_same(run, *, exactly=False):
    tolerance = 0.0 if exactly else 1e-12
    for channel in ("time", "displacement", "force", "command"):
        expected = getattr(RUN, channel)
        assert np.max(np.abs(getattr(run, channel) - expected)) <= tolerance * np.max(np.abs(expected))
    assert run.command_unit == "A"


def test_self_describing_file_needs_no_map(tmp_path):
    run = _read(tmp_path, _text(SELF_DESCRIBING), name="sine_2Hz_0.5A.csv")
    _assert_same(run, exactly=True)
    assert run.name == "sine_2Hz_0.5A"
    assert run.session == "sine_2Hz_0.5A"
    assert run.source.endswith("sine_2Hz_0.5A.csv")
    assert run.motion == ""


@pytest.mark.parametrize(
    "text",
    [
        _text("time_s;displacement_m;force_N;current_A", ";"),
        _text("time_s\tdisplacement_m\tforce_N\tcurrent_A", "\t"),
        _text("time_s displacement_m force_N current_A", " "),
        _text("time_s;displacement_m;force_N;current_A", ";", comma=True),
        _text("time_s\tdisplacement_m\tforce_N\tcurrent_A", "\t", comma=True),
        _text("time_ms,displacement_mm,force_kN,current_mA", scales=(1e3, 1e3, 1e-3, 1e3)),
        _text("Time (Sec),Displacement [mm],Force (N),Current [A]", scales=(1.0, 1e3, 1.0, 1.0)),
        _text("Time,Displacement,Load,Current\nSec,mm,kN,A", scales=(1.0, 1e3, 1e-3, 1.0)),
        _text("Time,Position,Load,Current\nsec,in,lb,A", scales=(1.0, 1 / 0.0254, 1 / 4.4482216152605, 1.0)),
        _text("Time [s],Stroke [mm],Rod force [kg],Current [A]", scales=(1.0, 1e3, 1 / 9.80665, 1.0)),
        _text("Time [s]   Stroke [mm]   Force [N]   Current [A]", " ", scales=(1.0, 1e3, 1.0, 1.0)),
        _text("# rig 3, 13 May\n# operator: K.\n" + SELF_DESCRIBING),
        _text("# " + SELF_DESCRIBING),
        _text("Test report\nDate: 2022-05-13\n\n" + SELF_DESCRIBING),
        _text('"time_s","displacement_m","force_N","current_A"'),
        "\ufeff" + _text(SELF_DESCRIBING),
        _text(SELF_DESCRIBING).replace("\n", "\r\n"),
        _text(SELF_DESCRIBING) + "\n\n",
    ],
    ids=[
        "semicolon", "tab", "blanks", "decimal comma", "tab and decimal comma", "other units",
        "units in brackets",
        "row of units", "pounds of force", "kilograms of force",
        "blanks in headers", "comments", "header in a comment", "preamble", "quotes",
        "byte order mark", "Windows lines", "blank lines at the end",
    ],
)  # fmt: skip
def test_all_text_dialects_give_same_run(tmp_path, text):
    _assert_same(_read(tmp_path, text))


@pytest.mark.system
def test_mat_without_units_requires_map(tmp_path):
    millimetres = 1e3 * RUN.displacement[:, None]
    savemat(
        tmp_path / "run.mat", {"dist": millimetres, "forc": RUN.force, "Ts": 0.005, "x_F": np.zeros((5, 3))}
    )
    channels = ChannelMap.from_dict(
        {
            "channel": {
                "time": {"name": "Ts", "unit": "s"},
                "displacement": {"name": "dist", "unit": "mm"},
                "force": {"name": "forc", "unit": "N"},
            },
            "constant": {"current_A": 0.5},
        }
    )
    (run,) = read_run(tmp_path / "run.mat", channels)
    _assert_same(run)
    with pytest.raises(
        InputError, match=r"run\.mat: no displacement column; the columns are: dist, forc, Ts"
    ):
        read_run(tmp_path / "run.mat")


LOGGER_HEADER = """Header Size:  7
Version:  2
Sampling Interval:  0.005
Sampling Rate:  200
Sample Count:  {count}
Device Serial Number:  0
Sample Number, Date/Time, CHANNEL0, CHANNEL1, Events
"""


def _logger_text(tests):
    lines: list[str] = []
    for _ in range(tests):
        for k, (_time, x, force, _command) in enumerate(ROWS):
            event = ", DAQ Start" if not lines else ", DAQ Resume" if k == 0 else ""
            stamp = "05/13/2022 05:04:23.839 PM"
            lines.append(f"{len(lines) + 1:10d},   {stamp}, {x / 0.01:.9f}, {force / 980.665:.9f}{event}")
    return LOGGER_HEADER.format(count=len(lines)) + "\n".join(lines) + "\n"


LOGGER_MAP = {
    "channel": {
        "displacement": {"name": "CHANNEL0", "unit": "V", "gain": 0.01},
        "force": {"name": "CHANNEL1", "unit": "V", "gain": 980.665},
    },
    "segments": {"split": "Resume", "current_A": [0.0, 0.5, 0.5]},
}


def test_events_in_logger_text_separate_runs(tmp_path):
    (tmp_path / "ME10mm.txt").write_text(_logger_text(3))
    runs = read_run(tmp_path / "ME10mm.txt", ChannelMap.from_dict(LOGGER_MAP))
    assert [run.name for run in runs] == ["ME10mm_0.00A", "ME10mm_0.50A", "ME10mm_0.50A_2"]
    assert [run.constant_command for run in runs] == [0.0, 0.5, 0.5]
    assert {run.session for run in runs} == {"ME10mm"}
    for run in runs:
        assert run.time == pytest.approx(RUN.time)
        assert run.displacement == pytest.approx(RUN.displacement, abs=1e-10)
        assert run.force == pytest.approx(RUN.force, abs=1e-5)


def test_segment_count_must_equal_command_count(tmp_path):
    """Each event in the file begins a segment. The channel map must have one command for each segment."""
    (tmp_path / "log.txt").write_text(_logger_text(2))
    with pytest.raises(InputError, match=r"'Resume' splits the file into 2 tests, \[segments\] has 3"):
        read_run(tmp_path / "log.txt", ChannelMap.from_dict(LOGGER_MAP))


def test_channel_map_completes_header(tmp_path):
    """A channel map is required only for quantities that the header does not describe."""
    text = _text("time_s,CH1,Force,current_A", scales=(1.0, 1e3, 1.0, 1.0))
    channels = ChannelMap.from_dict(
        {"channel": {"displacement": {"name": "CH1", "unit": "mm"}, "force": {"unit": "N"}}}
    )
    _assert_same(_read(tmp_path, text, channels))


def test_column_without_header_is_selected_by_index(tmp_path):
    text = _text(SELF_DESCRIBING).split("\n", 1)[1]
    roles = (("time", "s"), ("displacement", "m"), ("force", "N"), ("current", "A"))
    channels = {role: {"index": k, "unit": unit} for k, (role, unit) in enumerate(roles, 1)}
    _assert_same(_read(tmp_path, text, ChannelMap.from_dict({"channel": channels})))


def test_sensor_volts_are_not_measured_quantity(tmp_path):
    """Of two force columns, the one in volts is the sensor signal. A sensor signal is no damper command."""
    rows = np.array(ROWS).tolist()
    lines = "\n".join(f"{t!r},{f / 198.4!r},{f!r},{x * 104.0!r},{1e3 * x!r}" for t, x, f, _ in rows)
    text = f"Time (s),Force (V),Force (N),Displacement (V),Displacement (mm)\n{lines}\n"
    run = _read(tmp_path, text, ChannelMap.from_dict({"constant": {"current_A": 0.5}}))
    assert np.array_equal(run.force, RUN.force)
    assert np.allclose(run.displacement, RUN.displacement, rtol=1e-15)
    with pytest.raises(InputError, match=r"no current or voltage; .* channel map \(--channels FILE\)$"):
        _read(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (_text("time_s,displacement_m,force_N,I"), r"no current or voltage; 'I' may hold it; expected"),
        (_text("time_s,force_N,force_N,current_A"), r"columns 'force_N', 'force_N \(3\)' all hold force"),
        (_text(SELF_DESCRIBING).replace("\n0.5,", "\n0.5x,"), r"line 102: column 'time_s' holds '0.5x'"),
        (
            re.sub(r"(?m)^(0\.5(?:05|1|15)?,.*),.*,", r"\1,,", _text(SELF_DESCRIBING)),
            r"force is nan at sample 100 \(4 such",
        ),
        (_text(SELF_DESCRIBING) + "2.005,,3.0,0.5\n", r"displacement is nan at sample 401"),
    ],
)  # fmt: skip
def test_unreadable_text_is_rejected_with_reason(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as error:
        _read(tmp_path, text)
    assert "run" in str(error.value)


def test_files_of_folder_are_read_once(tmp_path):
    for name in ("b.csv", "a.csv"):
        (tmp_path / name).write_text(_text(SELF_DESCRIBING))
    (tmp_path / "notes.md").write_text("not a run")
    assert read_runs(tmp_path).names == ("a", "b")
    assert read_runs([tmp_path / "b.csv", tmp_path]).names == ("b", "a")
    assert read_runs(str(tmp_path / "*.csv")).names == ("a", "b")
    assert read_runs(f"{tmp_path.parent}/**/{tmp_path.name}/**/*.csv").names == ("a", "b")
    with pytest.raises(InputError, match="is a folder; expected a file"):
        read_run(tmp_path)


def test_missing_paths_give_messages(tmp_path):
    with pytest.raises(InputError, match=r"missing\.csv: no such file or folder"):
        read_runs(tmp_path / "missing.csv")
    with pytest.raises(InputError, match="no file matches this pattern"):
        read_runs(f"{tmp_path}/*.csv")
    with pytest.raises(InputError, match="no runs in this folder"):
        read_runs(tmp_path)
    with pytest.raises(InputError, match="no paths given"):
        read_runs([])
    with pytest.raises(InputError, match="cannot read the file"):
        read_run(tmp_path / "missing.csv")
