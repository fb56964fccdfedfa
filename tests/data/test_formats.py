"""Every format of a rig gives the same run, says how it was understood, and what it lacks."""

from __future__ import annotations

import builtins
import os
import resource
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mrdamper.data.formats.decoder import Decoder
from mrdamper.runtime.worker import Worker

from mrdamper.data.channels import ChannelMap
from mrdamper.data.diagnosis.diagnose import diagnose
from mrdamper.data.formats import sandbox
from mrdamper.data.formats.mdf import read_mdf
from mrdamper.data.formats.table import FileOptions
from mrdamper.data.readers import read_file, read_run, read_runs
from mrdamper.data.tables import read_table
from mrdamper.errors import InputError, MissingExtraError
from tests.data.rig_files import (
    RUN,
    WRITERS,
    in_rig_units,
    titled,
    write_csv,
    write_mts,
)

pytestmark = pytest.mark.system

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("name", WRITERS)
def test_a_run_is_the_same_in_every_format(tmp_path, name):
    WRITERS[name](tmp_path / name)
    (run,) = read_run(tmp_path / name)
    assert run.time == pytest.approx(RUN.time, abs=1e-12)
    assert run.displacement == pytest.approx(RUN.displacement, abs=1e-15)
    assert run.force == pytest.approx(RUN.force, abs=1e-9)
    assert run.constant_command == 0.5
    assert run.command_unit == "A"


def test_a_folder_of_all_formats_is_read_at_once(tmp_path):
    for name, write in WRITERS.items():
        write(tmp_path / f"{len(list(tmp_path.iterdir()))}-{name}")
    assert len(read_runs(tmp_path)) == len(WRITERS)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("run.csv", "delimited text, separated by comma, decimal point, 1 header line"),
        ("semicolons.csv", "delimited text, separated by semicolon, decimal comma, 2 header lines"),
        ("mts.dat", "MTS 793 text, separated by tab, decimal point, 5 header lines"),
        ("logger.txt", "logger text, separated by comma, decimal point, 7 header lines"),
        ("v5.mat", "MAT file"),
        ("v73.mat", "MAT v7.3 file"),
        ("run.h5", "HDF5 file"),
        ("run.tdms", "TDMS file"),
        ("run.mf4", "MDF file"),
        ("run.npz", "NumPy archive"),
        ("run.json", "JSON file"),
        ("run.parquet", "Parquet file"),
        ("run.xlsx", "Excel file, 3 header lines, part 'Data'"),
    ],
)
def test_how_a_file_was_understood_is_told(tmp_path, name, words):
    WRITERS[name](tmp_path / name)
    file = read_file(tmp_path / name)
    assert file.layout.in_words() == words
    assert [column.role for column in file.columns][-3:] == ["displacement", "force", "current"]
    assert {column.role: column.unit for column in file.columns}["force"] == "kN"


@pytest.mark.parametrize(
    ("name", "module", "package"),
    [
        ("run.h5", "h5py", "h5py"),
        ("v73.mat", "h5py", "h5py"),
        ("run.tdms", "nptdms", "npTDMS"),
        ("run.mf4", "asammdf", "asammdf"),
        ("run.xlsx", "python_calamine", "python-calamine"),
    ],
)
def test_a_missing_extra_names_the_install_command(tmp_path, monkeypatch, name, module, package):
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


# ------------------------------------------------------------------------------------------- text


def test_a_thousand_in_a_file_of_decimal_commas_is_no_decimal(tmp_path, monkeypatch):
    """Found after the lines that are looked at first."""
    rows = [f"{0.005 * k:.3f};{k % 7},0;{k % 5},5;0,0".replace(".", ",") for k in range(500)]
    rows[450] = "2,250;2,0;1.200,5;0,0"
    (tmp_path / "run.csv").write_text("\n".join(["time_s;displacement_mm;force_N;current_A", *rows]))
    with pytest.raises(InputError, match=r"line 452: column 'force_N' holds '1\.200,5'"):
        read_run(tmp_path / "run.csv")


def test_a_channel_map_may_say_what_looking_does_not_tell(tmp_path):
    """Whole numbers separated by blanks and commas are columns either way."""
    write_csv(tmp_path / "run.csv")
    channels = ChannelMap.from_dict({"file": {"delimiter": ",", "decimal": "."}})
    (run,) = read_run(tmp_path / "run.csv", channels)
    assert len(run) == len(RUN)
    for given, message in (
        ({"delimiter": "/"}, r"file: delimiter is '/'; expected a comma, a semicolon"),
        ({"decimal": ";"}, r"file: decimal is ';'; expected '\.' or ','"),
        ({"decimal": ",", "delimiter": ","}, "a comma is delimiter and decimal sign"),
        ({"sheet": "a"}, "file has no key 'sheet'; expected one of: part, delimiter, decimal"),
        ({"part": 3}, r"file\.part is 3; expected a text"),
    ):
        with pytest.raises(InputError, match=message):
            ChannelMap.from_dict({"file": given})


@pytest.fixture
def with_force(tmp_path):
    """Return a function that writes a TDMS file whose force has a header, and a unit beside it."""
    from nptdms import ChannelObject, TdmsWriter

    def write(header, unit):
        path = tmp_path / "run.tdms"
        with TdmsWriter(str(path)) as writer:
            writer.write_segment(
                [
                    ChannelObject("run", header, values, properties={"unit_string": unit})
                    if "force" in name
                    else ChannelObject("run", name, values)
                    for name, values in titled().items()
                ]
            )
        return path

    return write


def test_a_unit_beside_the_name_and_another_in_it_are_refused(with_force):
    for header, unit in (("force_kN", "N"), ("Force (kN)", "V")):
        with pytest.raises(InputError, match=f"states '{unit}' as its unit beside the name"):
            read_run(with_force(header, unit))


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("Force (kN)", "kilonewton"),
        ("Force (Trigger)", "kN"),
        ("Force (filtered, 50 Hz)", "kN"),
        ("Force (kN)", "-"),
        ("Force", "kN"),
    ],
)
def test_what_is_no_unit_does_not_speak_against_one_that_is(with_force, header, unit):
    (run,) = read_run(with_force(header, unit))
    assert np.allclose(run.force, RUN.force)


# ------------------------------------------------------------------------------------------- damage


@pytest.mark.parametrize("name", WRITERS)
def test_a_damaged_file_is_read_or_refused_and_nothing_else(tmp_path, name, capfd):
    """Whatever a decoder does on garbage ends in one error of ours, and in no word on standard error."""
    file = tmp_path / name
    WRITERS[name](file)
    content = file.read_bytes()
    rng = np.random.default_rng(11)
    for _ in range(60):
        kept = len(content) if rng.random() < 0.5 else int(rng.integers(1, len(content)))
        damaged = bytearray(content[:kept])
        for _ in range(4):
            damaged[rng.integers(min(len(damaged), 4096 if rng.random() < 0.5 else len(damaged)))] = (
                rng.integers(256)
            )
        file.write_bytes(bytes(damaged))
        with suppress(InputError):
            for recording in read_file(file).recordings:
                diagnose(recording)
    assert capfd.readouterr() == ("", "")


@pytest.fixture
def decoder(monkeypatch):
    """Return a function that puts other code in place of the decoder's."""

    def replaced(code):
        sandbox.stop()
        monkeypatch.setattr("mrdamper.runtime.worker._COMMAND", (sys.executable, "-c", code))

    yield replaced
    sandbox.stop()


@pytest.mark.parametrize("code", ["import os; os.abort()", "print('no answer')", "pass"])
@pytest.mark.parametrize("name", ["run.mf4", "run.h5", "v5.mat", "run.parquet"])
def test_a_decoder_that_crashes_is_a_message(tmp_path, decoder, name, code):
    """Compiled libraries can end the process that they run in; ours goes on."""
    WRITERS[name](tmp_path / name)
    decoder(code)
    with pytest.raises(InputError, match=rf"{name}: not a readable file: its decoder has crashed"):
        read_run(tmp_path / name)


@pytest.mark.nightly
def test_a_decoder_that_loops_ends_where_nobody_waits(tmp_path):
    """Its user was killed meanwhile: the loop would go on for ever; and it leaves no core."""
    code = """if True:
        from mrdamper.data.formats import decoder
        from mrdamper.runtime.worker_process import WorkerOptions, run
        def circle(path, options):
            while True:
                pass
        decoder.READERS = {"odd": circle}
        run(WorkerOptions(handler="mrdamper.data.formats.decoder:decoder"))
    """
    question = b'{"question": {"open": "x", "format": "odd", "options": {}}, "seconds": 0.1}\n'
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, cwd=tmp_path) as process:
        assert process.stdin is not None
        process.stdin.write(question)
        process.stdin.flush()
        assert process.wait(60) == -signal.SIGXCPU
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", sorted(WRITERS))
def test_reading_leaves_nothing_behind(tmp_path, monkeypatch, name):
    """Libraries put files aside, and the decoder's process is ended, not asked to end."""
    (aside := tmp_path / "aside").mkdir()
    (runs := tmp_path / "runs").mkdir()
    monkeypatch.setenv("TMPDIR", str(aside))
    WRITERS[name](runs / name)
    sandbox.stop()
    read_file(runs / name)
    sandbox.stop()
    assert [*aside.iterdir()] == []
    assert [each.name for each in runs.iterdir()] == [name]


def test_a_decoder_that_loops_is_ended_and_told(tmp_path, decoder, monkeypatch):
    """Damaged links lead libhdf5 in a circle; a file that is good is read by the next process."""
    WRITERS["v5.mat"](tmp_path / "v5.mat")
    monkeypatch.setattr(sandbox, "_DEADLINE_s", 0.5)
    decoder("import time; time.sleep(60)")
    with pytest.raises(
        InputError, match=r"v5\.mat: not a readable file: its decoder has not come to an end in \d s"
    ):
        read_run(tmp_path / "v5.mat")
    monkeypatch.undo()
    sandbox.stop()
    assert read_table(tmp_path / "v5.mat").rows > 1


def test_a_crash_costs_one_file_and_not_the_next(tmp_path):
    for name in ("a.h5", "b.mf4", "c.h5"):
        WRITERS["run" + name[1:]](tmp_path / name)
    (first,) = read_run(tmp_path / "a.h5")
    sandbox._DECODER.worker.kill()
    assert len(read_runs([tmp_path / "b.mf4", tmp_path / "c.h5"])) == 2
    assert np.array_equal(first.force, read_run(tmp_path / "c.h5")[0].force)


def test_what_a_small_file_unpacks_to_is_bounded_by_the_memory_of_its_process(tmp_path, monkeypatch):
    """A MAT file of 0.2 MB that unpacks to 128 MB, where the decoder may have 220 MB, itself included."""
    from scipy.io import savemat

    savemat(tmp_path / "bomb.mat", {"run": {"force": np.zeros(16_000_000)}}, do_compression=True)
    assert (tmp_path / "bomb.mat").stat().st_size < 300_000
    WRITERS["v5.mat"](tmp_path / "v5.mat")
    small = Worker(replace(sandbox.DECODER, memory_bytes=220 << 20))
    monkeypatch.setattr(sandbox._DECODER, "worker", small)
    with pytest.raises(InputError, match=r"bomb\.mat: not a readable MAT file"):
        read_table(tmp_path / "bomb.mat")
    assert read_table(tmp_path / "v5.mat").rows > 1
    small.stop()


def test_the_decoder_holds_its_memory(tmp_path):
    """As it is started for users: not more than three quarters of the machine's, and 12 GB."""
    WRITERS["v5.mat"](tmp_path / "v5.mat")
    read_table(tmp_path / "v5.mat")
    pid = sandbox._DECODER.worker.pid
    assert pid is not None
    soft, _ = resource.prlimit(pid, resource.RLIMIT_DATA)
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    assert 0 < soft <= min(12 << 30, 0.75 * machine)


def test_files_read_in_turn_are_not_mixed_up(tmp_path):
    """One process serves all files: a column comes from the file that was asked."""
    import h5py

    for k in (1, 2):
        with h5py.File(tmp_path / f"{k}.h5", "w") as file:
            for name, values in titled().items():
                file[name] = k * values if "force" in name else values
    tables = [read_table(tmp_path / f"{k}.h5") for k in (1, 2)]
    for k, table in ((1, tables[0]), (2, tables[1]), (1, tables[0])):
        assert table.columns["force_kN"] == pytest.approx(k * titled()["force_kN"])


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("run.xlsx", "excel"), ("run.h5", "hdf5"), ("v73.mat", "hdf5"), ("v5.mat", "mat"), ("run.mf4", "mdf"),
        ("run.parquet", "parquet"),
    ],
)  # fmt: skip
def test_a_decoder_of_its_own_process_gives_what_the_library_gives_here(tmp_path, name, form):
    """All that is handed over, name by name and bit by bit, however often it is asked for."""
    WRITERS[name](tmp_path / name)
    asked = Decoder()
    beside = asked({"open": str(tmp_path / name), "format": form, "options": {}}).answer
    table = read_table(tmp_path / name)
    assert (beside["names"], beside["rows"], beside["title"]) == (table.names, table.rows, table.title)
    assert beside["texts"] == list(table.texts)
    assert beside["layout"] == table.layout.to_dict()
    assert (beside["units"], beside["clocks"]) == (dict(table.units), dict(table.clocks))
    assert beside["by_rows"] == (form not in {"excel", "mat"})
    names = list(table.columns)
    for start, count in ((0, 1), (3, 4), (table.rows - 2, 9)) if beside["by_rows"] else ():
        parts = asked({"rows": names, "start": start, "count": count}).parts
        for column, part in zip(names, parts, strict=True):
            assert np.array_equal(np.frombuffer(part), table.columns[column][start : start + count])
    for column in table.columns:
        for _ in range(2):
            (part,) = asked({"columns": [column]}).parts
            np.testing.assert_array_equal(np.frombuffer(part), table.columns[column])
    for column in table.texts:
        assert asked({"text": column}).answer["cells"] == list(table.texts[column])


# ------------------------------------------------------------------------------------------- MTS


def _mts(path, shift):
    """Write two acquisitions, the second ``shift`` seconds after the first has ended."""
    write_mts(path)
    head, *rows = path.read_text().split("\nSec\tmm\tkN\tA\n")
    later = float(RUN.time[-1]) + shift
    moved = [
        f"{float(t) + later!r}\t{rest}" for t, rest in (row.split("\t", 1) for row in rows[0].splitlines())
    ]
    block = head.split("\n\n")[1] + "\nSec\tmm\tkN\tA\n"
    path.write_text(f"{head}\nSec\tmm\tkN\tA\n{rows[0]}\n{block}" + "\n".join(moved) + "\n")


def test_acquisitions_that_go_on_are_one_run_and_others_are_not(tmp_path):
    _mts(tmp_path / "on.dat", 0.005)
    _mts(tmp_path / "apart.dat", 7.0)
    (whole,) = read_run(tmp_path / "on.dat")
    assert len(whole) == 2 * len(RUN)
    first, second = read_run(tmp_path / "apart.dat")
    assert (first.name, second.name) == ("apart_1", "apart_2")
    assert second.time == pytest.approx(RUN.time, abs=1e-9)
    assert np.array_equal(first.force, second.force)
    assert read_file(tmp_path / "apart.dat").layout.notes == ("2 acquisitions",)


def test_acquisitions_can_be_told_their_currents(tmp_path):
    _mts(tmp_path / "two.dat", 7.0)
    text = (tmp_path / "two.dat").read_text().replace("Current\n", "Valve\n")
    (tmp_path / "two.dat").write_text(text)
    channels = {"segments": {"split": "Data Acquisition", "current_A": [0.5, 1.0]}}
    runs = read_run(tmp_path / "two.dat", ChannelMap.from_dict(channels))
    assert [run.constant_command for run in runs] == [0.5, 1.0]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("MTS793|MPT|ENU|1", r"line 1 is 'MTS793\|MPT\|ENU\|1'; expected MTS793"),
        ("MTS793|MPT|ENU|1|7|.|/", "line 1 is"),
        ("MTS793|MPT|ENU|1|1|,|/", "commas separate columns and decimals"),
    ],
)
def test_a_first_line_that_does_not_describe_the_file_is_refused(tmp_path, line, message):
    write_mts(tmp_path / "run.dat")
    _, rest = (tmp_path / "run.dat").read_text().split("\n", 1)
    (tmp_path / "run.dat").write_text(f"{line}\n{rest}")
    with pytest.raises(InputError, match=message):
        read_run(tmp_path / "run.dat")


def test_a_german_mts_text_has_decimal_commas(tmp_path):
    write_mts(tmp_path / "run.dat")
    first, rest = (tmp_path / "run.dat").read_text().split("\n", 1)
    (tmp_path / "run.dat").write_text(f"{first.replace('|.|', '|,|')}\n{rest.replace('.', ',')}")
    (run,) = read_run(tmp_path / "run.dat")
    assert run.force == pytest.approx(RUN.force, abs=1e-9)


# ------------------------------------------------------------------------------------------- groups


def test_groups_of_a_tdms_file_are_chosen_by_name(tmp_path):
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(tmp_path / "run.tdms")) as writer:
        for group, factor in (("first", 1.0), ("second", 2.0)):
            writer.write_segment(
                [
                    ChannelObject(group, name, factor * values if "force" in name else values)
                    for name, values in titled().items()
                ]
            )
    both = read_run(tmp_path / "run.tdms")
    assert [run.name for run in both] == ["run_first", "run_second"]
    assert both[1].force == pytest.approx(2.0 * both[0].force, abs=1e-9)
    (run,) = read_run(tmp_path / "run.tdms", ChannelMap.from_dict({"file": {"part": "second"}}))
    assert run.force == pytest.approx(2.0 * RUN.force, abs=1e-9)


def test_a_tdms_file_may_state_its_sampling_interval(tmp_path):
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(tmp_path / "run.tdms")) as writer:
        writer.write_segment(
            [
                ChannelObject("run", name, values, properties={"wf_increment": 0.005})
                for name, values in titled().items()
                if name != "time_s"
            ]
        )
    (run,) = read_run(tmp_path / "run.tdms")
    assert run.time == pytest.approx(RUN.time)


@pytest.mark.parametrize("last_s", [None, 1.0])
def test_mdf_groups_of_other_clocks_are_interpolated_to_the_fastest(tmp_path, last_s):
    """But not beyond their own time: a channel that covers half of the record is refused."""
    from asammdf import MDF, Signal

    given = in_rig_units()
    kept = RUN.time <= (last_s or RUN.time[-1])
    with MDF(version="4.10") as file:
        for role, step in (("displacement", 1), ("force", 2), ("current", 1)):
            rows = np.flatnonzero(kept)[::step] if role == "force" else slice(None)
            file.append(
                [
                    Signal(
                        given[role][rows],
                        RUN.time[rows],
                        {"displacement": "mm", "force": "kN", "current": "A"}[role],
                        role,
                    )
                ]
            )
        file.save(tmp_path / "run.mf4", overwrite=True)
    if last_s:
        with pytest.raises(InputError, match=r"column 'force' has a clock of its own, from 0 s to 1 s"):
            read_run(tmp_path / "run.mf4")
        return
    read = read_file(tmp_path / "run.mf4")
    assert "force interpolated to the fastest clock" in read.layout.in_words()
    (run,) = read.recordings
    assert run.time == pytest.approx(RUN.time)
    assert run.force[::2] == pytest.approx(RUN.force[::2], abs=1e-6)


def test_samples_that_an_mdf_file_calls_invalid_are_not_numbers(tmp_path):
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
        assert table.read_rows is not None
        (part,) = table.read_rows([name], 4, 3)
        assert np.array_equal(part, [4.0, np.nan, 6.0], equal_nan=True)


def test_records_that_an_mdf_file_cannot_hold_get_no_memory(tmp_path):
    """Damaged counts of some kB once made gigabytes of zeros, and took most of a minute."""
    WRITERS["run.mf4"](tmp_path / "run.mf4")
    content = bytearray((tmp_path / "run.mf4").read_bytes())
    count = content.index(b"##CG") + 80  # after the head of the block, its six links and its number
    assert int.from_bytes(content[count : count + 8], "little") == len(RUN)
    content[count : count + 8] = (1 << 26).to_bytes(8, "little")
    (tmp_path / "run.mf4").write_bytes(content)
    with pytest.raises(InputError, match=r"states 67108864 samples of 32 bytes, which a file of"):
        read_table(tmp_path / "run.mf4")


def test_the_blocks_of_an_mdf_file_are_parsed_once(tmp_path, monkeypatch):
    import asammdf

    WRITERS["run.mf4"](tmp_path / "run.mf4")
    opened = []
    usual = asammdf.MDF

    def noted(*given, **how):
        opened.append(given)
        return usual(*given, **how)

    monkeypatch.setattr(asammdf, "MDF", noted)
    table = read_mdf(tmp_path / "run.mf4", FileOptions())
    for name in table.names:
        assert len(table.columns[name]) == table.rows
    assert len(opened) == 1
    held = Path(f"/proc/{os.getpid()}/fd")
    assert any(each.resolve() == tmp_path / "run.mf4" for each in held.iterdir())
    del table
    assert not any(each.resolve() == tmp_path / "run.mf4" for each in held.iterdir())


@pytest.mark.parametrize(("version", "nested"), [("3.30", False), ("4.10", False), ("4.10", True)])
def test_a_formula_in_an_mdf_file_is_not_run(tmp_path, monkeypatch, version, nested):
    """The library would give its text to an evaluator, which is Python's own in the end."""
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


def test_a_matrix_of_columns_is_read_by_index(tmp_path):
    """The most usual MAT file of all: one matrix, and the order in somebody's head."""
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", {"data": np.column_stack(list(in_rig_units().values()))})
    channels = {
        role: {"index": k, "unit": unit}
        for k, (role, unit) in enumerate(
            (("time", "s"), ("displacement", "mm"), ("force", "kN"), ("current", "A")), 1
        )
    }
    (run,) = read_run(tmp_path / "run.mat", ChannelMap.from_dict({"channel": channels}))
    assert run.force == pytest.approx(RUN.force, abs=1e-9)


def test_hdf5_never_leads_to_another_file(tmp_path):
    """External storage, links and virtual data sets are not followed."""
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


def test_only_the_channels_of_a_run_are_read(tmp_path, monkeypatch):
    """A file of a hundred channels costs the four that a run needs."""
    import polars as pl

    wide = {**titled(), **{f"CH{k}": RUN.force for k in range(40)}}
    pl.DataFrame(wide).write_parquet(tmp_path / "run.parquet")
    asked: list[str] = []
    usual = sandbox._Decoder.ask

    def noted(decoder, path, file, question):
        asked.extend(question["columns"])
        return usual(decoder, path, file, question)

    monkeypatch.setattr(sandbox._Decoder, "ask", noted)
    read_run(tmp_path / "run.parquet")
    assert sorted(asked) == sorted(titled())


def test_events_in_a_text_column_of_parquet_split_it(tmp_path):
    import polars as pl

    events = ["Start", *[""] * (len(RUN) - 1), "Resume", *[""] * (len(RUN) - 1)]
    twice = {name: np.concatenate([c, c]) for name, c in titled().items() if name != "current_A"}
    pl.DataFrame({**twice, "events": events}).write_parquet(tmp_path / "run.parquet")
    channels = {"segments": {"split": "Resume", "current_A": [0.5, 1.0]}}
    runs = read_run(tmp_path / "run.parquet", ChannelMap.from_dict(channels))
    assert [run.constant_command for run in runs] == [0.5, 1.0]
    assert np.array_equal(runs[0].force, runs[1].force)


def test_times_of_day_are_seconds_from_the_first(tmp_path):
    import polars as pl

    stamps = np.datetime64("2024-05-13T10:00:00", "ns") + np.round(RUN.time * 1e9).astype("timedelta64[ns]")
    columns = {"time": stamps, **{name: c for name, c in titled().items() if name != "time_s"}}
    pl.DataFrame(columns).write_parquet(tmp_path / "run.parquet")
    (run,) = read_run(tmp_path / "run.parquet")
    assert run.time == pytest.approx(RUN.time, abs=1e-9)


# ------------------------------------------------------------------------------------------- examples


def test_the_example_map_of_an_mts_text_reads_one(tmp_path):
    """Three acquisitions, their currents in the map; the cell counts compression as positive."""
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


def test_the_example_map_of_volts_in_a_tdms_file_reads_one(tmp_path):
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


def test_the_example_map_of_a_matrix_reads_one(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", {"data": np.column_stack(list(in_rig_units().values()))})
    (run,) = read_run(tmp_path / "run.mat", EXAMPLES / "matrix_mat.toml")
    assert run.force == pytest.approx(RUN.force, abs=1e-9)
