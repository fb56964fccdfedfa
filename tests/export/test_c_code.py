"""The generated C: what compilers say to it, what is in its objects, and that two of them do not meet."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper import core
from mrdamper.codegen.c_code import (
    banner,
    c_files,
    environment,
    literal,
    tables_bytes,
)
from mrdamper.codegen.kernel_files import flag_texts, kernel_files
from mrdamper.codegen.target import target_of
from mrdamper.control.config import config_values
from mrdamper.control.stepper import Flag
from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation
from tests.control.dampers import DAMPERS, DOUBLE
from tests.export.exports import STRICT, a_target, card_of, motion, ran, read_csv, run, write, write_csv

CORTEX = ["-mthumb", "-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
ALLOWED = {"memcpy", "memset", "memmove", "__stack_chk_fail"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return the C folder of a target with both parts in single precision."""
    return write(a_target(), tmp_path_factory.mktemp("export") / "both")


@pytest.fixture(scope="module")
def replay(folder, tool):
    ran(tool("gcc"), *STRICT, "-O0", "-o", "replay", "damper.c", "damper_tables.c", "main.c", cwd=folder)
    return folder / "replay"


# ------------------------------------------------------------------------------------------ compilers


@pytest.mark.system
def test_nor_has_the_compiler_of_a_cortex_in_double_precision(tool, tmp_path):
    """Single precision: where its tables are looked for in flash."""
    place = write(a_target(precision="double"), tmp_path)
    ran(tool("arm-none-eabi-gcc"), *CORTEX, *STRICT, "-c", "damper.c", "damper_tables.c", cwd=place)


@pytest.mark.system
def test_every_source_file_compiles_by_itself(folder, tool, tmp_path):
    """As a build system that takes all ``.c`` of a folder does."""
    sources = sorted(folder.glob("*.c"))
    assert len(sources) == 4
    ran(tool("gcc"), "-std=c99", "-c", *map(str, sources), cwd=tmp_path)


@pytest.mark.system
def test_the_header_is_cpp_as_well(folder, tool, tmp_path):
    (tmp_path / "user.cpp").write_text('#include "damper.h"\ndamper_model_state state;\n', encoding="ascii")
    ran(
        tool("g++"),
        "-std=c++11",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-fsyntax-only",
        f"-I{folder}",
        tmp_path / "user.cpp",
    )


@pytest.mark.system
def test_fast_math_is_refused_as_it_takes_failed_readings_for_impossible(folder, tool, tmp_path):
    done = run(tool("gcc"), "-std=c99", "-ffast-math", "-c", folder / "damper.c", "-o", tmp_path / "x.o")
    assert done.returncode != 0
    assert "-ffast-math takes not-a-number for impossible" in done.stderr


@pytest.mark.nightly
def test_cmake_builds_the_library_and_the_replay(folder, tool, tmp_path):
    ran(tool("cmake"), "-S", folder, "-B", tmp_path)
    ran(tool("cmake"), "--build", tmp_path)
    assert (tmp_path / "libdamper.a").is_file()
    assert (tmp_path / "damper_replay").is_file()


@pytest.mark.system
def test_what_the_readme_shows_compiles(folder, tool, tmp_path):
    blocks = re.findall(r"```c\n(.*?)```", (folder / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 3
    for block in blocks:
        named = re.match(r"/\* (damper_block\.[ch]) \*/", block)
        (tmp_path / (named[1] if named else "user.c")).write_text(block, encoding="ascii")
    for unit in ("user.c", "damper_block.c"):
        ran(tool("gcc"), *STRICT, f"-I{folder}", "-c", unit, cwd=tmp_path)


# -------------------------------------------------------------------------------------------- objects


@pytest.mark.system
@pytest.mark.parametrize("content", ["model", "controller", "both"])
def test_the_library_needs_no_heap_and_no_mathematical_library(content, tool, tmp_path):
    place = write(a_target(content=content), tmp_path)
    ran(tool("gcc"), *STRICT, "-fno-pie", "-c", "damper.c", "damper_tables.c", cwd=place)
    listed = ran(tool("nm"), "damper.o", "damper_tables.o", cwd=place)
    symbols = re.findall(r"^\S*\s+([A-Za-z])\s+(\S+)$", listed, re.MULTILINE)
    wanted = {name for kind, name in symbols if kind == "U"}
    assert wanted - ALLOWED <= {f"damper_{part}_data" for part in ("model", "controller")}
    # Nothing can be written to: no data, no bss, no common symbol.
    assert {kind for kind, _ in symbols} <= set("UTtRr")
    # The kernel's own names stay inside.
    assert all(name.startswith("damper_") for kind, name in symbols if kind in "TR")


LAWS_AND_METHODS = {"series_answer", "follow_chain", "horizon_step"}


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("law", "controller", "has"),
    [
        ("double-bouc-wen", "recommended", set()),
        ("double-bouc-wen", "predictive", {"horizon_step"}),
        ("series-valve", "recommended", {"series_answer"}),
    ],
)
def test_unused_laws_are_not_in_code(tool, tmp_path, law, controller, has):
    """The compiler does not need the numbers, which are in another file."""
    place = write(a_target(law, controller=controller, content="controller"), tmp_path)
    apart = ["-fno-inline-functions", "-fno-inline-small-functions", "-fno-inline-functions-called-once"]
    ran(tool("gcc"), *STRICT, *apart, "-c", "damper.c", cwd=place)
    listed = set(re.findall(r" t (\w+?)(?:\.\w+)*$", ran(tool("nm"), "damper.o", cwd=place), re.MULTILINE))
    assert listed & LAWS_AND_METHODS == has


@pytest.mark.system
def test_on_a_cortex_all_tables_are_in_flash(tool, tmp_path):
    target = a_target()
    place = write(target, tmp_path)
    ran(tool("arm-none-eabi-gcc"), *CORTEX, *STRICT, "-c", "damper.c", "damper_tables.c", cwd=place)
    sizes = {}
    for unit in ("damper", "damper_tables"):
        listed = ran(tool("arm-none-eabi-size"), "-A", f"{unit}.o", cwd=place)
        sizes[unit] = {
            name: int(size) for name, size in re.findall(r"^(\.\w+)\S*\s+(\d+)", listed, re.MULTILINE)
        }
        assert sizes[unit].get(".data", 0) == sizes[unit].get(".bss", 0) == 0
    data = sum(size for name, size in sizes["damper_tables"].items() if name == ".rodata")
    values = sum(map(len, config_values(target.any_part.config).values()))
    structs = 2 * 4 * (values + 30 + 9 * 5)
    assert tables_bytes(target) <= data <= tables_bytes(target) + structs + 64
    listed = ran(tool("arm-none-eabi-nm"), "-u", "damper.o", cwd=place)
    assert set(re.findall(r"U (\S+)", listed)) - ALLOWED == {"damper_model_data", "damper_controller_data"}


@pytest.mark.system
def test_two_exports_side_by_side_do_not_touch_each_other(tool, tmp_path):
    """Two dampers in one program, stepped in turn, each as if it were alone."""
    names = {"front": "double-bouc-wen", "rear": "bouc-wen"}
    targets = {name: a_target(law, name=name, content="model") for name, law in names.items()}
    for name, target in targets.items():
        write(target, tmp_path / name)
    (tmp_path / "both.c").write_text(
        """
#include "front/front.h"
#include "rear/rear.h"
#include <math.h>
#include <stdio.h>
int main(void)
{
    front_model_state a, b;
    rear_model_state c;
    float x, i, t;
    front_model_start(&a); front_model_start(&b); rear_model_start(&c);
    while (scanf("%f,%f,%f", &x, &i, &t) == 3) {
        const front_model_input in = {x, NAN, i, t}, mirrored = {-x, NAN, i, t};
        const rear_model_input also = {x, NAN, i, t};
        front_model_output p, q;
        rear_model_output r;
        front_model_step(&a, &in, &p); rear_model_step(&c, &also, &r); front_model_step(&b, &mirrored, &q);
        printf("%.9g %.9g %.9g\\n", (double)p.force, (double)q.force, (double)r.force);
    }
    return 0;
}
""",
        encoding="ascii",
    )
    units = ["both.c", *(f"{name}/{name}{part}.c" for name in names for part in ("", "_tables"))]
    ran(tool("gcc"), *STRICT, "-O0", *units, "-o", "both", cwd=tmp_path)
    columns = motion(2000)
    drive = np.column_stack([columns[name] for name in ("displacement_m", "current_A", "temperature_K")])
    np.savetxt(tmp_path / "drive.csv", drive, delimiter=",", fmt="%.9g")
    out = ran("sh", "-c", f"'{tmp_path}/both' < '{tmp_path}/drive.csv'")
    given = np.array(out.split(), dtype=np.float64).reshape(-1, 3).astype(np.float32)
    rows = np.column_stack([drive[:, 0], np.full(len(drive), np.nan), drive[:, 1:]])
    mirrored = rows * [-1.0, 1.0, 1.0, 1.0]
    for column, (name, told) in enumerate([("front", rows), ("front", mirrored), ("rear", rows)]):
        model = targets[name].model
        assert model is not None
        _, force, _ = model.run(model.start(), told)
        assert np.array_equal(given[:, column], force.astype(np.float32)), name
    assert np.abs(given[:, 0] - given[:, 2]).max() > 50.0


@pytest.mark.system
def test_exports_of_two_number_types_in_one_file_are_refused(tool, tmp_path):
    for precision in ("float", "double"):
        write(a_target(name=precision[:3], precision=precision), tmp_path / precision)
    text = '#include "float/flo.h"\n#include "double/dou.h"\n'
    (tmp_path / "user.c").write_text(text, encoding="ascii")
    done = run(tool("gcc"), "-std=c99", "-fsyntax-only", "user.c", cwd=tmp_path)
    assert done.returncode != 0
    assert "two exports of different kernels or number types" in done.stderr


# ----------------------------------------------------------------------------------------------- text


@pytest.mark.system
def test_the_kernel_is_copied_byte_for_byte():
    folder = Path(core.__file__).parent / "kernel"
    files = c_files(a_target())
    assert {"controller.h", "controller.c", "track_tables.h", "track_estimate.h", "track_model.h"} <= set(
        files
    )
    for name in kernel_files():
        assert files[name].encode() == (folder / name).read_bytes()


def test_every_generated_file_says_whose_it_is():
    target = a_target()
    for name, text in c_files(target).items():
        if name in kernel_files() or name == "misra.md":  # copied
            continue
        for line in banner(target).splitlines():
            assert line in text, name
    assert target.fingerprint in banner(target)
    assert "double-bouc-wen" in banner(target)


def test_every_field_of_the_header_has_its_unit():
    header = c_files(a_target())["damper.h"]
    structs = re.findall(r"typedef struct \{\n(.*?)\} (\w+);", header, re.DOTALL)
    assert [name for _, name in structs] == [
        "damper_model_input", "damper_model_output", "damper_controller_input", "damper_controller_output",
    ]  # fmt: skip
    for body, _ in structs:
        for line in body.strip().splitlines():
            assert re.search(r"\[(m|m/s|A|K|N)\]|MRD_\.\.\.", line), line


@pytest.mark.system
def test_a_command_in_volts_has_volts_everywhere(tool, tmp_path):
    target = target_of(card_of(replace(DOUBLE, command_unit="V")))
    files = c_files(target)
    assert "[V]" in files["damper.h"]
    assert "[A]" not in files["damper.h"]
    assert "voltage_V" in files["main.c"]
    ran(tool("gcc"), *STRICT, "-c", "main.c", cwd=write(target, tmp_path))


@pytest.mark.system
@pytest.mark.parametrize("title", ["*/ int intruder; /*", "what??/", "ends with \\", "Stoßdämpfer\nNr. 1"])
def test_no_title_gets_out_of_its_comment(title, tool, tmp_path):
    place = write(target_of(card_of(DOUBLE, title=title), content="model"), tmp_path)
    ran(tool("gcc"), *STRICT, "-fsyntax-only", "damper.c", "main.c", cwd=place)
    assert (place / "damper.h").read_bytes().isascii()


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_float_s_literal_reads_back_as_the_same_bits(value):
    text = literal(value, "float")
    assert text.endswith("f")
    assert np.float32(text[:-1]).tobytes() == np.float32(value).tobytes()
    assert len(text) <= 17


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_and_so_does_a_double_s(value):
    text = literal(value, "double")
    assert re.fullmatch(r"-?\d+\.\d+(e[+-]\d+)?", text)
    assert np.float64(text).tobytes() == np.float64(value).tobytes()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e39])
def test_a_number_that_a_float_cannot_hold_is_refused(value):
    with pytest.raises(InputError, match="expected one that a float holds"):
        literal(value, "float")


def test_the_flags_of_the_readme_are_those_of_python():
    assert {text.name: text.value for text in flag_texts()} == {f"MRD_{f.name}": f.value for f in Flag}


# --------------------------------------------------------------------------------------------- replay


@pytest.mark.system
def test_the_replay_gives_what_python_gives(replay, tmp_path):
    columns = motion(3000)
    ran(replay, write_csv(tmp_path / "in.csv", columns), tmp_path / "out.csv")
    out = read_csv(tmp_path / "out.csv")
    assert list(out) == [
        "time_s", "force_N", "applied_A", "model_flags", "current_A", "controller_force_N",
        "controller_flags",
    ]  # fmt: skip
    target, nothing = a_target(), np.full(3000, np.nan)
    assert target.model is not None
    assert target.controller is not None
    x, kelvin = columns["displacement_m"], columns["temperature_K"]
    driven = np.column_stack([x, nothing, columns["current_A"], kelvin])
    _, force, flags = target.model.run(target.model.start(), driven)
    assert np.array_equal(out["force_N"].astype(np.float32), force.astype(np.float32))
    assert np.array_equal(out["model_flags"], flags)
    asked = np.column_stack([columns["wanted_N"], nothing, x, kelvin, nothing])
    _, current, flags = target.controller.run(target.controller.start(), asked)
    assert np.array_equal(out["current_A"].astype(np.float32), current.astype(np.float32))
    assert np.array_equal(out["controller_flags"], flags)
    assert np.abs(force).max() > 200.0
    assert current.max() > 0.5


@pytest.mark.system
def test_without_a_current_the_model_gets_the_controller_s(replay, tmp_path):
    columns = motion(1500)
    del columns["current_A"]
    ran(replay, write_csv(tmp_path / "in.csv", columns), tmp_path / "closed.csv")
    closed = read_csv(tmp_path / "closed.csv")
    ran(
        replay,
        write_csv(tmp_path / "in.csv", columns | {"current_A": closed["current_A"]}),
        tmp_path / "open.csv",
    )
    assert np.array_equal(read_csv(tmp_path / "open.csv")["force_N"], closed["force_N"])


@pytest.mark.system
def test_columns_are_found_by_name_and_celsius_is_kelvin(replay, tmp_path):
    columns = motion(300)
    ran(replay, write_csv(tmp_path / "in.csv", columns), tmp_path / "kelvin.csv")
    kelvin = columns.pop("temperature_K")
    shuffled = {"remark": kelvin, "temperature_degC": kelvin - 273.15, **dict(reversed(columns.items()))}
    table = np.column_stack(list(shuffled.values()))
    np.savetxt(
        tmp_path / "in.csv",
        table,
        delimiter=" , ",
        header=" , ".join(shuffled),
        comments="\ufeff",
        fmt="%.17g",
    )
    ran(replay, tmp_path / "in.csv", tmp_path / "celsius.csv")
    assert (tmp_path / "celsius.csv").read_text() == (tmp_path / "kelvin.csv").read_text()


@pytest.mark.system
def test_an_empty_cell_is_a_reading_that_failed(replay, tmp_path):
    (tmp_path / "in.csv").write_text(
        "displacement_m,temperature_K,current_A\n0.001,300,1\n\n# a remark\n,300,1\n0.001,nan,inf\n",
        encoding="ascii",
    )
    ran(replay, tmp_path / "in.csv", tmp_path / "out.csv")
    flags = read_csv(tmp_path / "out.csv")["model_flags"].astype(int)
    assert len(flags) == 3
    assert flags[0] & 1 == 0
    assert flags[1] & 1
    assert flags[2] & 8
    assert flags[2] & 8192


@pytest.mark.system
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "in.csv: is empty; expected a header and rows"),
        ("temperature_K,current_A\n300,1\n", "there is no column displacement_m"),
        ("displacement_m,current_A\n0,1\n", "expected one of the columns temperature_K and temperature_degC"),
        ("displacement_m,temperature_K\n0,300\n", "expected the column current_A, wanted_N or both"),
        ("displacement_m,temperature_K,current_A\n0,300\n", "line 2 does not have as many cells"),
        (
            "displacement_m,temperature_K,current_A\n0,300,much\n",
            "line 2: current_A is 'much'; expected a number",
        ),
        ("time_s,displacement_m,temperature_K,current_A\n0,0,300,1\n0.01,0,300,1\n", "rows are 0.01 s apart"),
    ],
)
def test_a_file_that_cannot_be_replayed_ends_in_one_message(text, said, replay, tmp_path):
    (tmp_path / "in.csv").write_text(text, encoding="ascii")
    done = run(replay, tmp_path / "in.csv", tmp_path / "out.csv")
    assert done.returncode == 3
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1


# ------------------------------------------------------------------------------------- what cannot be


@pytest.mark.parametrize(
    "name", ["2front", "front-left", "", "größe", "a b", "main", "int", "controller", "mrd_x"]
)
def test_a_name_that_c_does_not_take_is_refused(name):
    with pytest.raises(InputError, match=r"^name is .*Pass another --name"):
        target_of(card_of(DOUBLE), name=name)


@pytest.mark.system
@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"content": "all"}, "content is 'all'; expected one of model, controller, both"),
        ({"precision": "half"}, "precision is 'half'; expected one of float, double"),
        ({"controller": "recomended"}, "there is no controller 'recomended'; did you mean recommended"),
        ({"period_s": 0.02}, "step is 20 ms; expected 0.05 to 10 ms"),
        ({"period_s": float("nan")}, "step is nan ms"),
    ],
)
def test_a_choice_that_is_not_there_is_refused(options, said):
    with pytest.raises(InputError, match=re.escape(said)):
        target_of(card_of(DOUBLE), **options)


def test_a_step_longer_than_the_lags_allow_says_which():
    quick = replace(DOUBLE, actuation=Actuation(0.001, 0.001, largest_command=2.0))
    with pytest.raises(InputError, match=r"the period is 5 ms, and the force follows a command within 3 ms"):
        target_of(card_of(quick), period_s=5e-3)


def test_steps_so_short_that_the_dead_time_does_not_fit_are_refused():
    late = replace(DOUBLE, actuation=Actuation(0.008, 0.008, delay_s=0.02, largest_command=2.0))
    with pytest.raises(InputError, match=r"the dead time of 20 ms is \d+ periods"):
        target_of(card_of(late), period_s=1e-4)


@pytest.mark.system
def test_all_laws_with_tables_are_exported():
    for law in (*DAMPERS, "series-valve"):
        assert a_target(law).law == law


@pytest.mark.parametrize("title", ["???/", "a*/b", "what??/", "????", "tail\\"])
def test_no_title_ends_a_comment_or_makes_a_trigraph(title):
    plain = environment().filters["plain"](title)
    assert not re.search(r"\?\?|\*/|/\*|\\$", plain)
