"""Files of two laboratories: raw and trimmed files agree, and smoothing matches the noise of each rig."""

from pathlib import Path

import numpy as np
import pytest

from mrdamper.data.diagnosis.campaign import compare
from mrdamper.data.diagnosis.diagnose import diagnose
from mrdamper.data.diagnosis.repeatability import repeatability
from mrdamper.data.prepare import decimate, prepare_run
from mrdamper.data.readers import read_runs
from tests.data.rig_files import read_run
from tests.data.test_diagnosis import size_of

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def dev(real_data):
    return read_runs(real_data / "dev")


def _position(short, long):
    """Return the index at which a short force signal begins in a longer one. Both are rounded to 0.1 N."""
    near = np.flatnonzero(np.abs(long[: len(long) - len(short) + 1] - short[0]) < 0.06)
    starts = [k for k in near if np.all(np.abs(long[k : k + len(short)] - short) < 0.06)]
    assert len(starts) == 1
    return starts[0]


@pytest.mark.system
def test_logger_file_matches_trimmed_runs(real_data, dev):
    """The logger file has tests at 0 to 1 A in succession. Trimmed runs begin at zero displacement."""
    runs = read_run(real_data / "raw" / "ME5mm3Hz.txt", EXAMPLES / "utfsm_logger.toml")
    assert [run.constant_command for run in runs] == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert len({run.session for run in runs}) == 1
    for run in runs:
        (trimmed,) = dev.select(f"utfsm_sine_5mm3Hz_{run.constant_command:.2f}A")
        k = _position(trimmed.force, run.force)
        moved = run.displacement[k : k + len(trimmed)] - run.displacement[k]
        assert moved == pytest.approx(trimmed.displacement - trimmed.displacement[0], abs=0.6e-6)
        assert np.median(run.displacement) == pytest.approx(-0.0299, abs=1e-4)


@pytest.mark.system
@pytest.mark.parametrize(
    ("raw", "trimmed"), [("ensaio.A.1.mat", "utfpr_3p21V_01"), ("ensaio.A.3.mat", "utfpr_3p21V_03")]
)
def test_mat_and_csv_files_are_equal(real_data, dev, raw, trimmed):
    (run,) = read_run(real_data / "raw" / raw, EXAMPLES / "utfpr_mat.toml")
    (other,) = dev.select(trimmed)
    assert run.command_unit == other.command_unit == "V"
    assert run.constant_command == other.constant_command == 3.212
    assert run.time == pytest.approx(other.time, abs=1e-9)
    assert run.displacement == pytest.approx(other.displacement, abs=1e-9)
    assert run.force == pytest.approx(other.force, abs=0.006)


def test_motion_label_ignores_current(dev):
    labels = {run.name: prepare_run(run).motion for run in dev.select("utfsm_*")}
    sines = {label for name, label in labels.items() if "sine" in name}
    assert sines == {"sine 25 mm 0.25 Hz", "sine 25 mm 0.5 Hz", "sine 9.6 mm 2 Hz", "sine 4.6 mm 3 Hz"}
    chirps = {label for name, label in labels.items() if "chirp" in name}
    assert chirps == {"chirp 2 mm 0.4-15 Hz"}


def test_smoothing_removes_only_sensor_noise(dev):
    """The removed signal is white noise of 1.5 to 2.3 um rms, as from a sensor with a resolution of 3 um."""
    for run in dev.select("utfsm_*"):
        prepared = prepare_run(run)
        taken = run.displacement - prepared.trajectory.displacement
        taken = taken - np.mean(taken)
        assert 1.2e-6 < np.std(taken) < 2.4e-6
        following = np.mean(taken[1:] * taken[:-1]) / np.var(taken)
        assert abs(following) < 0.25
        assert prepared.trajectory.dead_band < 5e-6


def test_smoothed_velocity_at_rest_is_quiet(dev):
    """Before the press moves, the rms velocity is below 0.2 mm/s. Without smoothing, it is 2 mm/s."""
    for run in dev.select("utfsm_sine_10mm2Hz_*", "utfsm_sine_5mm3Hz_*"):
        velocity = prepare_run(run).trajectory.velocity
        assert np.std(velocity[:80]) < 0.2e-3


def test_real_runs_have_expected_repeatability(dev):
    """The repeatability is about 0.5 to 4 % (UTFSM; 6 % for 25 mm, 0.25 Hz, 1 A) and 1 to 12 % (UTFPR)."""
    for pattern, low, high in (("utfsm_sine_*", 0.5, 4.2), ("utfpr_*", 1.0, 12.0)):
        for run in dev.select(pattern):
            found = repeatability(prepare_run(run))
            assert found is not None
            assert low < found < high


def test_runs_are_prepared_at_200_hertz(dev):
    for run in dev.select("utfsm_*"):
        assert decimate(prepare_run(run), 200.0).trajectory.rate_Hz == pytest.approx(200.0)
    (run,) = dev.select("utfpr_0V_01")
    assert decimate(prepare_run(run), 200.0).trajectory.rate_Hz == pytest.approx(100.0)


def test_real_runs_have_only_known_findings(dev):
    """The findings are the known properties of the two rigs. No channel is clipped, stuck or delayed.

    UTFSM: the force offset is 24 to 58 N. The force range of the run with 25 mm, 0.25 Hz and 1 A grows by 6
    %, and the force at 0 A falls. UTFPR: the gas preload is 100 to 140 N, the mean position drifts by up to
    3.5 mm, and the repeatability is 2 to 12 %.
    """
    found = [finding for run in dev for finding in diagnose(run)]
    assert {finding.severity for finding in found} <= {"warning", "note"}
    assert {finding.kind for finding in found} == {
        "force_offset", "force_level_changes", "position_drift", "poor_repeatability", "force_noise",
    }  # fmt: skip
    offsets = {f.run: size_of(f) for f in found if f.kind == "force_offset"}
    assert all(24.0 < size < 60.0 for run, size in offsets.items() if "utfsm" in run)
    assert all(98.0 < size < 140.0 for run, size in offsets.items() if "utfpr" in run)
    assert sum("utfpr" in run for run in offsets) == 26
    grows = {f.run: size_of(f) for f in found if f.kind == "force_level_changes"}
    assert grows.pop("utfsm_sine_25mm0p25Hz_1.00A") == pytest.approx(6.0, abs=0.6)
    assert all("0.00A" in run and size < 0.0 for run, size in grows.items())
    drifts = [f for f in found if f.kind == "position_drift"]
    assert {f.run[:5] for f in drifts} == {"utfpr"}
    assert all(abs(size_of(f)) < 3.5e-3 for f in drifts)
    assert all(5.0 < size_of(f) < 12.0 for f in found if f.kind == "poor_repeatability")
    assert list(compare(dev.runs)) == []
