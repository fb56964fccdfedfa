"""Generated C code compiles without warnings, requires no library, and can be linked with other exports."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper import core
from mrdamper.codegen.c_code import c_files, flag_texts, kernel_files, literal, tables_bytes
from mrdamper.codegen.target import target_of
from mrdamper.control.stepper import Flag
from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation
from tests.export.exports import STRICT, a_target, card_of, motion, ran, read_csv, run, write
from tests.support.cards import DOUBLE
from tests.support.tiers import one_by_day

CORTEX = ["-mthumb", "-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
ALLOWED = {"memcpy", "memset", "memmove", "__stack_chk_fail"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the C code of a target that has model and controller in single precision."""
    return write(a_target(), tmp_path_factory.mktemp("export") / "both")


@pytest.fixture(scope="module")
def replay(folder, tool):
    ran(tool("gcc"), *STRICT, "-O0", "-o", "replay", "damper.c", "damper_tables.c", "main.c", cwd=folder)
    return folder / "replay"


# ------------------------------------------------------------------------------------------ compilers


@pytest.mark.system
def test_double_precision_export_compiles_for_cortex(tool, tmp_path):
    place = write(a_target(precision="double"), tmp_path)
    ran(tool("arm-none-eabi-gcc"), *CORTEX, *STRICT, "-c", "damper.c", "damper_tables.c", cwd=place)


@pytest.mark.system
def test_c_header_is_valid_cpp(folder, tool, tmp_path):
    (tmp_path / "user.cpp").write_text('#include "damper.h"\ndamper_model_state state;\n', encoding="ascii")
    flags = ["-std=c++11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{folder}"]
    ran(tool("g++"), *flags, tmp_path / "user.cpp")


@pytest.mark.system
def test_fast_math_option_is_rejected(folder, tool, tmp_path):
    """The code rejects the option because it permits compilers to remove the checks for NaN."""
    done = run(tool("gcc"), "-std=c99", "-ffast-math", "-c", folder / "damper.c", "-o", tmp_path / "x.o")
    assert done.returncode != 0
    assert "-ffast-math" in done.stderr


@pytest.mark.nightly
def test_cmake_builds_exported_library_and_replay_program(folder, tool, tmp_path):
    ran(tool("cmake"), "-S", folder, "-B", tmp_path)
    ran(tool("cmake"), "--build", tmp_path)
    assert (tmp_path / "libdamper.a").is_file()
    assert (tmp_path / "damper_replay").is_file()


@pytest.mark.system
def test_c_code_in_exported_readme_compiles(folder, tool, tmp_path):
    (block,) = re.findall(r"```c\n(.*?)```", (folder / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "user.c").write_text(block, encoding="ascii")
    ran(tool("gcc"), *STRICT, f"-I{folder}", "-c", "user.c", cwd=tmp_path)


# -------------------------------------------------------------------------------------------- object files


@pytest.mark.system
@pytest.mark.parametrize("content", one_by_day(["both", "model", "controller"]))
def test_exported_library_is_free_standing(content, tool, tmp_path):
    place = write(a_target(content=content), tmp_path)
    ran(tool("gcc"), *STRICT, "-fno-pie", "-c", "damper.c", "damper_tables.c", cwd=place)
    listed = ran(tool("nm"), "damper.o", "damper_tables.o", cwd=place)
    symbols = re.findall(r"^\S*\s+([A-Za-z])\s+(\S+)$", listed, re.MULTILINE)
    wanted = {name for kind, name in symbols if kind == "U"}
    assert wanted - ALLOWED <= {f"damper_{part}_data" for part in ("model", "controller")}
    # There are no writable symbols: no data, no bss, no common symbols.
    assert {kind for kind, _ in symbols} <= set("UTtRr")
    # The names of kernel functions are local symbols.
    assert all(name.startswith("damper_") for kind, name in symbols if kind in "TR")


@pytest.mark.system
def test_exported_tables_are_in_flash(tool, tmp_path):
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
    members = (place / "damper_tables.c").read_text(encoding="utf-8").count(" = ")
    structs = 4 * (members + 2 * 30)
    assert tables_bytes(target) <= data <= tables_bytes(target) + structs + 64
    listed = ran(tool("arm-none-eabi-nm"), "-u", "damper.o", cwd=place)
    assert set(re.findall(r"U (\S+)", listed)) - ALLOWED == {"damper_model_data", "damper_controller_data"}


@pytest.mark.system
def test_two_linked_exports_are_independent(tool, tmp_path):
    """Each of three damper models in one program has the force of this model alone in Python."""
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
def test_mixed_export_precisions_are_rejected(tool, tmp_path):
    for precision in ("float", "double"):
        write(a_target(name=precision[:3], precision=precision), tmp_path / precision)
    text = '#include "float/flo.h"\n#include "double/dou.h"\n'
    (tmp_path / "user.c").write_text(text, encoding="ascii")
    done = run(tool("gcc"), "-std=c99", "-fsyntax-only", "user.c", cwd=tmp_path)
    assert done.returncode != 0
    assert "two exports with different kernels or number types" in done.stderr


# ------------------------------------------------------------------------------------------- text of the code


@pytest.mark.system
def test_export_contains_kernel_files_unchanged():
    folder = Path(core.__file__).parent / "kernel"
    files = c_files(a_target())
    assert {"controller.h", "controller.c", "track_tables.h", "track_estimate.h", "track_model.h"} <= set(
        files
    )
    for name in kernel_files():
        assert files[name].encode() == (folder / name).read_bytes()


@pytest.mark.system
def test_c_code_states_unit_of_command(tool, tmp_path):
    target = target_of(card_of(replace(DOUBLE, command_unit="V")))
    files = c_files(target)
    assert "[V]" in files["damper.h"]
    assert "[A]" not in files["damper.h"]
    assert "voltage_V" in files["main.c"]
    ran(tool("gcc"), *STRICT, "-c", "main.c", cwd=write(target, tmp_path))


@pytest.mark.system
@pytest.mark.parametrize("title", ["*/ int intruder; /*", "what??/", "ends with \\", "Stoßdämpfer\nNr. 1"])
def test_card_title_stays_inside_c_comment(title, tool, tmp_path):
    place = write(target_of(card_of(DOUBLE, title=title), content="model"), tmp_path)
    ran(tool("gcc"), *STRICT, "-fsyntax-only", "damper.c", "main.c", cwd=place)
    assert (place / "damper.h").read_bytes().isascii()


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_number_literals_in_c_are_exact(value):
    single, double = literal(value, "float"), literal(value, "double")
    assert np.float32(single.removesuffix("f")).tobytes() == np.float32(value).tobytes()
    assert np.float64(double).tobytes() == np.float64(value).tobytes()
    assert single.endswith("f")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e39])
def test_number_outside_float_range_is_rejected(value):
    with pytest.raises(InputError, match="expected one that a float holds"):
        literal(value, "float")


def test_exported_status_flags_match_python():
    assert {text.name: text.value for text in flag_texts()} == {f"MRD_{f.name}": f.value for f in Flag}


# --------------------------------------------------------------------------------------------- replay program


@pytest.mark.system
def test_replay_reads_empty_cells_as_nan(replay, tmp_path):
    header = "displacement_m,temperature_K,velocity_m_s,current_A,wanted_N,wanted_ahead_N,force_N\n"
    rows = "0.001,300,,1,,,\n,300,,1,,,\n0.001,nan,,inf,,,\n"
    (tmp_path / "in.csv").write_text(header + rows, encoding="ascii")
    ran(replay, tmp_path / "in.csv", tmp_path / "out.csv")
    flags = read_csv(tmp_path / "out.csv")["model_flags"].astype(int)
    assert [bool(flag & Flag.NO_DISPLACEMENT) for flag in flags] == [False, True, False]
    assert flags[2] & Flag.NO_TEMPERATURE
    assert flags[2] & Flag.NO_CURRENT


@pytest.mark.system
@pytest.mark.parametrize("text", ["", "temperature_K,current_A\n300,1\n"])
def test_replay_rejects_file_with_wrong_header(text, replay, tmp_path):
    (tmp_path / "in.csv").write_text(text or "0,1\n", encoding="ascii")
    done = run(replay, tmp_path / "in.csv", tmp_path / "out.csv")
    assert done.returncode == 3
    assert "expected the header displacement_m" in done.stderr


# -------------------------------------------------------------------------------------- invalid choices


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": "front-left"}, "name is 'front-left'"),
        ({"name": "int"}, "name is 'int'"),
        ({"content": "all"}, "content is 'all'"),
        ({"precision": "half"}, "precision is 'half'"),
        ({"controller": "recomended"}, "did you mean recommended"),
        ({"period_s": float("nan")}, "step is nan ms"),
    ],
)
def test_invalid_export_option_raises(options, message):
    with pytest.raises(InputError, match=re.escape(message)):
        target_of(card_of(DOUBLE), **options)


@pytest.mark.parametrize(
    ("lags", "period_s", "message"),
    [
        (Actuation(0.001, 0.001, largest_command=2.0), 5e-3, "the period is 5 ms"),
        (Actuation(0.008, 0.008, delay_s=0.02, largest_command=2.0), 1e-4, "the dead time of 20 ms"),
    ],
)
def test_export_rejects_period_unsuitable_for_lags_or_delay(lags, period_s, message):
    with pytest.raises(InputError, match=message):
        target_of(card_of(replace(DOUBLE, actuation=lags)), period_s=period_s)
