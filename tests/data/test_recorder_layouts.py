"""Layouts of recorders: several rates, matrices of runs, channel blocks, spans, pages, endings."""

from __future__ import annotations

import io
import tarfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mrdamper.data.readers import read_runs
from mrdamper.errors import InputError
from tests.data.test_laboratories import CURRENTS, RUNS, N, assert_read
from tests.data.test_unseen_layouts import BARE, columns, each, table, write

SLOW = 4  # The slow channels have a sample in each fourth row.


def rates(folder: Path, *, lost: int = 0) -> None:
    """Write displacement in each row, current in each fourth row; remove samples of the displacement."""
    for k, run in enumerate(RUNS):
        t, x, f, i = columns(run)
        rows = [
            f"{t[n]:.6f},{'' if 10 < n <= 10 + lost else f'{x[n]:.6f}'},{f[n]:.6f},"
            f"{'' if n % SLOW else f'{i[n]:.3f}'},{'' if n % (2 * SLOW) else '30.0'}\n"
            for n in range(N - 1 - (N - 1) % (2 * SLOW) + 1)
        ]
        write(folder, f"rec {k}.csv", "Time (s),Stroke (mm),Load (N),Coil (A),Oil (°C)\n" + "".join(rows))


def archive(folder: Path, **others: np.ndarray) -> None:
    """Write one matrix per channel with a run in each row."""
    values = {
        "stroke_mm": np.array([1e3 * run.displacement for run in RUNS]),
        "force_N": np.array([run.force for run in RUNS]),
        "sampling_rate_Hz": np.array(200.0),
    }
    np.savez(folder / "series.npz", **(values | others))  # type: ignore[arg-type]


def matlab(folder: Path) -> None:
    """Write one matrix per channel with a run in each column, and the common times."""
    from scipy.io import savemat

    values = {
        "time_s": RUNS[0].time,
        "stroke_mm": np.array([1e3 * run.displacement for run in RUNS]).T,
        "force_kN": np.array([1e-3 * run.force for run in RUNS]).T,
        "current_A": np.array(CURRENTS),
    }
    savemat(folder / "series.mat", values)


def pairs(folder: Path, row: str = "Coil current (A);0;;0.75;;1.5;\n") -> None:
    """Write one time column, then displacement and force of each run."""
    names = "Time;" + "Stroke;Load;" * 3 + "\ns;" + "mm;N;" * 3 + "\n"
    values = [value for run in RUNS for value in columns(run)[1:3]]
    write(folder, "pairs.csv", row + names.replace(";\n", "\n") + table(RUNS[0].time, *values, sign=";"))


def blocks(folder: Path) -> None:
    for k, run in enumerate(RUNS):
        head = f'[TEST]\nCOIL="{run.command[0]} A"\n[TIMEBASE]\nINTERVAL=5 ms\n'
        head += '[CHANNEL_1]\nLABEL="Load; top, static"\nUNIT="N"\nGAIN=0.001\nOFFSET=50\n'
        head += "[CHANNEL_2]\nLABEL='Stroke'\nUNIT='mm'\nGAIN=1e-6\nOFFSET=0\n[DATA]\n"
        raw = ((run.force - 50.0) / 1e-3, 1e3 * run.displacement / 1e-6)
        write(folder, f"rec_{k}.txt", head + table(*raw, form="%.0f"))


SPANS = (
    "Stroke: 0 % = -40 mm ; 100 % = +40 mm\nForce: 0 % = -3000 N; 100 % = +3000 N\n"
    "Coil current: 0 % = 0 A; 100 % = 4 A\n"
)


def spans(folder: Path, head: str = "All values in % of span\n", raw: str = "") -> None:
    for k, run in enumerate(RUNS):
        _, x, f, i = columns(run)
        text = f"Cadence : 200 Hz\n{head}{SPANS}\nStroke{raw};Force{raw};Coil current{raw}\n"
        values = ((x + 40.0) / 0.8, (f + 3000.0) / 60.0, i / 0.04)
        write(folder, f"essai{k}.acq", text + table(*values, sign=";", form="%.9f"))


def volts(folder: Path) -> None:
    for k, run in enumerate(RUNS):
        t, x, f, i = columns(run)
        text = "Stroke: 0 V = -40 mm; 10 V = 40 mm\nForce: -10 V = -3000 N; 10 V = 3000 N\n"
        text += "time [s];Stroke [V];Force [V];current [A]\n"
        write(folder, f"run{k}.csv", text + table(t, (x + 40) / 8, f / 300, i, sign=";", form="%.9f"))


def listing(folder: Path, word: str = "PAGE") -> None:
    """Write pages of 60 rows with Fortran's exponents and a blank after each minus sign."""
    lines = []
    for k, run in enumerate(RUNS, 1):
        rows = table(*columns(run)[:3], sign=" ", form="%16.9E").replace("E", "D").replace("-", "- ")
        samples = rows.replace("D- ", "D-").splitlines()
        for n in range(0, N, 60):
            head = [
                f"\fMR DAMPER  TEST {k}  {word} {n // 60 + 1}",
                f" COIL CURRENT {run.command[0]:.5E} A",
                "",
            ]
            lines += [*head, "      TIME (S)     STROKE (MM)     FORCE (N)", *samples[n : n + 60]]
    write(folder, "run.lst", "\n".join(lines) + "\n")


def endings(folder: Path, kind: str = "w:gz", name: str = "day.tar.gz") -> None:
    """Write an archive of files whose ending names the channel."""
    with tarfile.open(folder / name, kind) as tape:  # type: ignore[call-overload]
        for k, run in enumerate(RUNS):
            channels = (
                ("dsp", "rod displacement", "mm", 1e3 * run.displacement, 1),
                ("frc", "rod force", "N", run.force, 1),
                ("cur", "coil current", "A", run.command, 10),
            )
            for end, word, unit, values, every in channels:
                head = f"# {word}\n# unit: {unit}\n# step: {0.005 * every:g} s\n"
                text = (head + table(values[::every])).encode()
                member = tarfile.TarInfo(f"day/m{k}.{end}")
                member.size = len(text)
                tape.addfile(member, io.BytesIO(text))


LAYOUTS: dict[str, Callable[[Path], None]] = {
    "row_of_a_matrix": lambda folder: archive(folder, coil_current_A=np.array(CURRENTS)),
    "matrix_of_currents": lambda folder: archive(folder, coil_A=np.array([run.command for run in RUNS])),
    "column_of_a_matrix": matlab,
    "pairs_below_numbers": pairs,
    "pairs_below_currents": lambda folder: pairs(folder, "Coil;0 A;;0.75 A;;1.5 A;\n"),
    "sections_of_channels": blocks,
    "spans_in_a_sentence": spans,
    "spans_of_columns": lambda folder: spans(folder, "", " [%]"),
    "spans_in_volts": volts,
    "pages": listing,
    "blätter": lambda folder: listing(folder, "Blatt"),
    "endings": endings,
    "plain_tape": lambda folder: endings(folder, "w", "day.tar"),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layout_of_recorder_is_read(tmp_path, layout):
    LAYOUTS[layout](tmp_path)
    assert_read(read_runs(tmp_path))


def test_blanks_between_slow_samples_are_interpolated(tmp_path):
    rates(tmp_path)
    for run, true in zip(read_runs(tmp_path), RUNS, strict=True):
        assert np.allclose(run.force, true.force[: len(run)], atol=2e-6)
        assert abs(run.command - true.command[0]).max() < 1e-9
        assert np.allclose(run.temperature, 303.15)  # type: ignore[arg-type]


QUESTIONS: dict[str, Callable[[Path], None]] = {
    "lost_samples": lambda folder: rates(folder, lost=200),
    "matrices_without_currents": archive,
    "pairs_without_currents": lambda folder: pairs(folder, ""),
    "pairs_below_names": lambda folder: pairs(folder, "Damper;A;;B;;C;\n"),
    "spans_of_unclear_values": lambda folder: spans(folder, ""),
}


@pytest.mark.parametrize("layout", QUESTIONS)
def test_unclear_layout_of_recorder_is_rejected(tmp_path, layout):
    QUESTIONS[layout](tmp_path)
    with pytest.raises(InputError):
        read_runs(tmp_path)


def test_column_of_missing_marks_keeps_its_place(tmp_path):
    """A lone minus sign is a missing value if all rows then have the same number of cells."""
    for k, run in enumerate(RUNS):
        rows = table(*columns(run)[:3], sign=" ").replace("\n", f" - {run.command[0]}\n")
        write(tmp_path, f"run{k}.txt", BARE.replace(",", " ")[:-1] + " spare_V current_A\n" + rows)
    assert_read(read_runs(tmp_path))


def test_files_of_one_ending_are_no_channels(tmp_path):
    each(lambda run: BARE + table(*columns(run)[:3]), "run_{}_1.5A.csv")(tmp_path)
    write(tmp_path, "peaks.lim", "1.0\n2.0\n3.0\n")
    assert len(read_runs(tmp_path)) == len(RUNS)
