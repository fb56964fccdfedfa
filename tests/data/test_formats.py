"""Every file format gives the same run. The interpretation and damage of a file are reported."""

from __future__ import annotations

import builtins
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from mrdamper.data.channels import ChannelMap
from mrdamper.data.diagnosis.diagnose import diagnose
from mrdamper.data.formats.mdf import read_mdf
from mrdamper.data.formats.table import FileOptions
from mrdamper.data.readers import read_file, read_runs
from mrdamper.data.tables import decoding, read_table
from mrdamper.errors import InputError, MissingExtraError
from mrdamper.interrupts import Interrupted
from tests.data.rig_files import (
    RUN,
    WRITERS,
    in_rig_units,
    read_run,
    titled,
    write_csv,
    write_mts,
)

pytestmark = pytest.mark.system

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("name", WRITERS)
def test_all_formats_give_same_run(tmp_path, name):
    WRITERS[name](tmp_path / name)
    (run,) = read_run(tmp_path / name)
    assert run.time == pytest.approx(RUN.time, abs=1e-12)
    assert run.displacement == pytest.approx(RUN.displacement, abs=1e-15)
    assert run.force == pytest.approx(RUN.force, abs=1e-9)
    assert run.constant_command == 0.5
    assert run.command_unit == "A"


def test_folder_with_all_formats_is_read(tmp_path):
    for name, write in WRITERS.items():
        write(tmp_path / f"{len(list(tmp_path.iterdir()))}-{name}")
    assert len(read_runs(tmp_path)) == len(WRITERS)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("run.csv", "delimited text, separated by comma, decimal point, 1 header line"),
        ("mts.dat", "delimited text, separated by tab, decimal point, 5 header lines"),
        ("v73.mat", "MAT v7.3 file"),
        ("run.xlsx", "Excel file, 3 header lines, part 'Data'"),
    ],
)
def test_interpretation_of_file_is_printed(tmp_path, name, words):
    WRITERS[name](tmp_path / name)
    file = read_file(tmp_path / name)
    assert file.layout.in_words() == words
    assert [column.role for column in file.columns][-3:] == ["displacement", "force", "current"]
    assert {column.role: column.unit for column in file.columns}["force"] == "kN"


@pytest.mark.parametrize(
    ("name", "module", "package"),
    [
        ("run.h5", "h5py", "h5py"),
        ("run.xlsx", "python_calamine", "python-calamine"),
    ],
)
def test_missing_library_names_install_command(tmp_path, monkeypatch, name, module, package):
    WRITERS[name](tmp_path / name)
    for loaded in [each for each in sys.modules if each.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, loaded)
    usual = builtins.__import__

    def without(wanted, *more, **how):
        if wanted.split(".")[0] == module:
            raise ImportError(wanted)
        return usual(wanted, *more, **how)

    monkeypatch.setattr(builtins, "__import__", without)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(
        MissingExtraError, match=rf": {package} is not installed; pip install 'mrdamper\[rig-files\]'"
    ):
        read_run(tmp_path / name)


# ------------------------------------------------------------------------------------------- text files


def test_channel_map_sets_delimiter_and_decimal(tmp_path):
    """A channel map may set delimiter and decimal sign. Invalid settings are rejected with a message."""
    write_csv(tmp_path / "run.csv")
    channels = ChannelMap.from_dict({"file": {"delimiter": ",", "decimal": "."}})
    (run,) = read_run(tmp_path / "run.csv", channels)
    assert len(run) == len(RUN)
    for given, message in (
        ({"delimiter": "/"}, r"file: delimiter is '/'; expected a comma, a semicolon"),
        ({"decimal": ";"}, r"file: decimal is ';' .*; expected '\.' or ','"),
        ({"decimal": ",", "delimiter": ","}, "decimal is ',' and delimiter is ','"),
        ({"sheet": "a"}, "file has no key 'sheet'; expected one of: part, delimiter, decimal"),
        ({"part": 3}, r"file\.part is 3; expected a text"),
    ):
        with pytest.raises(InputError, match=message):
            ChannelMap.from_dict({"file": given})


# ------------------------------------------------------------------------------------------- damaged files


# A damaged file can crash the compiled libraries of these formats. This limit is documented.
COMPILED = {"run.h5", "v73.mat", "v5.mat", "run.mf4", "run.parquet", "run.xlsx"}


@pytest.mark.parametrize("name", WRITERS)
def test_damaged_file_is_read_or_rejected(tmp_path, name, capfd):
    """A damaged file causes at most one error, and no output. Files of ``COMPILED`` are only truncated."""
    file = tmp_path / name
    WRITERS[name](file)
    content = file.read_bytes()
    rng = np.random.default_rng(11)
    for _ in range(15):
        kept = int(rng.integers(1, len(content)))
        damaged = bytearray(content[:kept])
        for _ in range(0 if name in COMPILED else 4):
            damaged[rng.integers(len(damaged))] = rng.integers(256)
        file.write_bytes(bytes(damaged))
        with suppress(InputError):
            for run in read_file(file).recordings:
                diagnose(run)
    assert capfd.readouterr() == ("", "")


# ------------------------------------------------------------------------------------------- MTS


def _mts(path, shift):
    """Write two acquisitions to an MTS file. The second starts ``shift`` seconds after the first ends."""
    write_mts(path)
    head, *rows = path.read_text().split("\nSec\tmm\tkN\tA\n")
    later = float(RUN.time[-1]) + shift
    moved = [
        f"{float(t) + later!r}\t{rest}" for t, rest in (row.split("\t", 1) for row in rows[0].splitlines())
    ]
    block = head.split("\n\n")[1] + "\nSec\tmm\tkN\tA\n"
    path.write_text(f"{head}\nSec\tmm\tkN\tA\n{rows[0]}\n{block}" + "\n".join(moved) + "\n")


def test_continued_mts_acquisitions_are_joined(tmp_path):
    _mts(tmp_path / "on.dat", 0.005)
    _mts(tmp_path / "apart.dat", 7.0)
    (whole,) = read_run(tmp_path / "on.dat")
    assert len(whole) == 2 * len(RUN)
    first, second = read_run(tmp_path / "apart.dat")
    assert (first.name, second.name) == ("apart_1", "apart_2")
    assert second.time == pytest.approx(RUN.time, abs=1e-9)
    assert np.array_equal(first.force, second.force)
    assert read_file(tmp_path / "apart.dat").layout.notes == ("2 blocks of rows",)


# ------------------------------------------------------------------------------------------- MDF and HDF5


def test_invalid_mdf_samples_are_nan(tmp_path):
    from asammdf import MDF, Signal

    time, values = np.arange(9) * 0.1, np.arange(9)
    for name, given in (("force", values.astype(float)), ("counts", values.astype("<i4"))):
        with MDF(version="4.10") as file:
            odd = values % 4 == 1
            file.append(
                [Signal(given, time, "N", name, invalidation_bits=odd), Signal(time.copy(), time, "mm", "x")]
            )
            file.save(tmp_path / f"{name}.mf4", overwrite=True)
        table = read_table(tmp_path / f"{name}.mf4")
        assert np.array_equal(table.columns[name], np.where(odd, np.nan, values), equal_nan=True)
        assert np.isfinite(table.columns["x"]).all()


def test_impossible_mdf_sample_count_is_rejected(tmp_path):
    """A damaged sample count in the file must not allocate gigabytes of zeros."""
    WRITERS["run.mf4"](tmp_path / "run.mf4")
    content = bytearray((tmp_path / "run.mf4").read_bytes())
    count = content.index(b"##CG") + 80  # The count follows 24 bytes of header, six links and an identifier.
    assert int.from_bytes(content[count : count + 8], "little") == len(RUN)
    content[count : count + 8] = (1 << 26).to_bytes(8, "little")
    (tmp_path / "run.mf4").write_bytes(content)
    with pytest.raises(InputError, match=r"states 67108864 samples of 32 bytes, more than its file"):
        read_table(tmp_path / "run.mf4")


@pytest.mark.parametrize(("version", "nested"), [("3.30", False), ("4.10", False), ("4.10", True)])
def test_mdf_formula_is_not_executed(tmp_path, monkeypatch, version, nested):
    """The library would pass the text of the formula to Python's ``eval``."""
    from asammdf import MDF, Signal
    from asammdf.blocks import v2_v3_blocks, v4_blocks

    for blocks in (v2_v3_blocks, v4_blocks):
        monkeypatch.setattr(blocks, "evaluate", lambda text: pytest.fail(f"{text} was run"))
    formula: dict[str, object] = {"formula": "2 * X + 1"}
    table: dict[str, object] = {"lower_0": 5.0, "upper_0": 6.0, "text_0": b"high", "default_addr": formula}
    time = np.arange(8) * 0.1
    with MDF(version=version) as file:
        file.append(
            [
                Signal(time.copy(), time, "N", "plain"),
                Signal(time.copy(), time, "N", "force", conversion=table if nested else formula),
            ]
        )
        file.save(tmp_path / "run", overwrite=True)
    (written,) = tmp_path.glob("run.*")
    with pytest.raises(InputError, match=r"'force' is scaled by the formula '2 \* X1? \+ 1'.*not run"):
        read_mdf(written, FileOptions())
    with pytest.raises(InputError, match=r"'force' is scaled by the formula"):
        read_table(written)


def test_hdf5_links_to_other_files_are_ignored(tmp_path):
    """External storage, external links and virtual data sets are not followed."""
    import h5py

    (tmp_path / "secret.bin").write_bytes(RUN.force.tobytes())
    with h5py.File(tmp_path / "run.h5", "w") as file:
        for name, values in titled().items():
            if "force" not in name:
                file.create_dataset(name, data=values)
        file.create_dataset(
            "force_kN", shape=RUN.force.shape, dtype="f8",
            external=[(str(tmp_path / "secret.bin"), 0, RUN.force.nbytes)],
        )  # fmt: skip
        file["other"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "/force_kN")
    with pytest.raises(
        InputError, match="no force column; the columns are: current_A, displacement_mm, time_s"
    ):
        read_run(tmp_path / "run.h5")


# --------------------------------------------------------------------------------------- example channel maps


def test_example_map_reads_mts_acquisitions(tmp_path):
    """The file has three acquisitions. The map gives their currents and the sign of the load cell."""
    write_mts(tmp_path / "run.dat")
    head, rows = (tmp_path / "run.dat").read_text().replace("\tCurrent", "").split("\nSec\tmm\tkN\tA\n")
    first, block = head.split("\n\n")
    kept = "\n".join(row.rsplit("\t", 1)[0] for row in rows.splitlines())
    turned = "\n".join(
        "\t".join([t, x, repr(-float(force))])
        for t, x, force in (row.split("\t") for row in kept.splitlines())
    )
    (tmp_path / "run.dat").write_text(f"{first}\n\n" + f"{block}\nSec\tmm\tkN\n{turned}\n" * 3)
    runs = read_run(tmp_path / "run.dat", EXAMPLES / "mts_793.toml")
    assert [run.constant_command for run in runs] == [0.0, 0.5, 1.0]
    assert runs[2].force == pytest.approx(RUN.force, abs=1e-9)


def test_example_map_converts_tdms_volts(tmp_path):
    from nptdms import ChannelObject, TdmsWriter

    volts = {"ai0": (RUN.displacement + 0.0625) / 0.0125, "ai1": RUN.force / 1000.0, "ai2": RUN.command / 2.0}
    with TdmsWriter(str(tmp_path / "run.tdms")) as writer:
        for group in ("Run 0", "Run 1"):
            writer.write_segment(
                [ChannelObject(group, n, v, properties={"wf_increment": 0.005}) for n, v in volts.items()]
            )
    (run,) = read_run(tmp_path / "run.tdms", EXAMPLES / "tdms_volts.toml")
    assert run.displacement == pytest.approx(RUN.displacement, abs=1e-12)
    assert run.force == pytest.approx(RUN.force, abs=1e-9)
    assert run.constant_command == 0.5


def test_example_map_reads_matrix_in_mat(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", {"data": np.column_stack(list(in_rig_units().values()))})
    (run,) = read_run(tmp_path / "run.mat", EXAMPLES / "matrix_mat.toml")
    assert run.force == pytest.approx(RUN.force, abs=1e-9)


@pytest.mark.parametrize("interrupt", [KeyboardInterrupt, Interrupted])
def test_interrupt_during_decoding_is_raised(tmp_path, interrupt):
    """An interrupt must not be reported as a damaged file."""
    with pytest.raises(interrupt), decoding(tmp_path, "MAT"):
        raise interrupt


def test_interrupt_hidden_by_library_is_raised(tmp_path):
    """A library may raise its own exception after an interrupt."""

    def replace_interrupt():
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise ValueError("callback failed") from error

    with pytest.raises(KeyboardInterrupt), decoding(tmp_path, "MAT"):
        replace_interrupt()
