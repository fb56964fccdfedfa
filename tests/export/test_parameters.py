"""The block of parameters, and the examples that use it: a bare Cortex-M at 1 kHz in QEMU, and C++."""

from __future__ import annotations

import csv
import io
import struct
from dataclasses import replace
from pathlib import Path

import pytest

from mrdamper.codegen.parameters import parameter_block, parameter_table, parameters_of
from mrdamper.codegen.target import Target, target_of
from mrdamper.models.actuation import Actuation
from mrdamper.thermal.compact.model import compact_model
from mrdamper.thermal.drawing_file import read_drawing
from tests.control.dampers import DAMPERS
from tests.export.exports import STRICT, a_target, card_of, ran, write
from tests.export.injected import inject, predictive_target
from tests.support.tiers import one_by_day

pytestmark = pytest.mark.system

EXAMPLES = Path(__file__).parents[2] / "examples"
CORTEX = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
UNITS = ["damper.c", "damper_tables.c", "damper_parameters.c"]

PROGRAM = """
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "damper_parameters.h"
static double total(const mrd_track *data, damper_controller_state state)
{
    double sum = 0.0;
    for (int i = 0; i < 1500; i++) {
        const mrd_real t = (mrd_real)i * (mrd_real)1e-3, x = (mrd_real)8e-3 * (mrd_real)sin((double)(7 * t));
        const mrd_real wanted = (mrd_real)(600.0 * cos((double)(7 * t)));
        const mrd_real none = (mrd_real)NAN;
        const damper_controller_input in = {wanted, none, x, (mrd_real)320, none, none};
        damper_controller_output out;
        if (data) damper_controller_step_with(data, &state, &in, &out);
        else damper_controller_step(&state, &in, &out);
        sum += (double)out.current;
    }
    return sum;
}
int main(void)
{
    damper_controller_state state, again;
    damper_parameters block, other;
    mrd_track data;
    unsigned accepted = 0;
    damper_controller_start(&state);
    damper_parameters_default(&block);
    fwrite(&block, sizeof block, 1, stderr);
    printf("%u ", damper_controller_restore(&data, &state, &block));
    printf("%.17g %.17g ", total(NULL, state), total(&data, state));
    for (size_t bit = 0; bit < 8 * sizeof block; bit++) { /* every bit of it */
        memcpy(&other, &block, sizeof block);
        ((unsigned char *)&other)[bit / 8] ^= (unsigned char)(1u << (bit % 8));
        if (bit / 8 >= offsetof(damper_parameters, crc) + 4) continue; /* filling */
        if (damper_parameters_check(&other) == 0) accepted++;
    }
    printf("%u ", accepted);
    state.gain[0] = (mrd_real)0.8; /* learnt */
    printf("%u ", damper_controller_save(&block, &state));
    damper_controller_start(&again);
    printf("%u ", damper_controller_restore(&data, &again, &block));
    printf("%.9g ", (double)again.gain[0]);
    other = block;
    other.value[DAMPER_CONTROLLER_REACH] = 2;
    damper_parameters_seal(&other);
    printf("%u ", damper_parameters_check(&other));
    other.value[DAMPER_CONTROLLER_REACH] = (mrd_real)NAN;
    damper_parameters_seal(&other);
    printf("%u ", damper_controller_restore(&data, &again, &other));
    printf("%d ", memcmp(&data, &damper_controller_data, sizeof data));
    block.value[DAMPER_CONTROLLER_FALL_BACK] = 1;
    damper_parameters_seal(&block);
    printf("%u ", damper_controller_restore(&data, &again, &block));
    printf("%.3f\\n", (double)data.faults.fall_back);
    fwrite(&block, sizeof block, 1, stderr);
    return 0;
}
"""


@pytest.fixture(scope="module")
def target() -> Target:
    damper = replace(DAMPERS["double-bouc-wen"], actuation=Actuation(0.004, 0.004))
    return replace(target_of(card_of(damper)), thermal=compact_model(read_drawing("paper")))


@pytest.fixture(scope="module")
def folder(target: Target, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(target, tmp_path_factory.mktemp("parameters"))


@pytest.mark.parametrize("precision", one_by_day(["float", "double"]))
def test_a_block_is_kept_whole_or_refused_and_what_it_holds_is_used(tool, tmp_path, precision):
    target = a_target(precision=precision)
    place = write(target, tmp_path)
    (place / "user.c").write_text(PROGRAM, encoding="ascii")
    ran(tool("gcc"), *STRICT, "user.c", *UNITS, "-lm", "-o", "user", cwd=place)
    said = ran("sh", "-c", "./user 2> block.bin", cwd=place).split()
    restored, plain, with_data, accepted, saved, back, gain, outside, refused, same, taken, fall_back = said
    assert (restored, accepted, saved, back, taken) == ("0",) * 5
    assert plain == with_data != "0"
    assert float(gain) == pytest.approx(0.8)
    assert (outside, refused, same) == ("8", "8", "0")
    assert float(fall_back) == 1.0
    written, real = (place / "block.bin").read_bytes(), "f" if precision == "float" else "d"
    default, block = written[: len(written) // 2], written[len(written) // 2 :]
    assert default == parameter_block(target)
    rows = {row["name"]: row for row in csv.DictReader(io.StringIO(parameter_table(target)))}
    assert len(block) == int(rows["length"]["as_identified"])
    assert struct.unpack_from("<I", block, 0)[0] == int(rows["version"]["as_identified"], 16)
    for name, expected in (("controller_fall_back", 1.0), ("controller_yield_gain", 0.8)):
        offset = int(rows[name]["offset_bytes"])
        assert struct.unpack_from("<" + real, block, offset)[0] == pytest.approx(expected)


def test_no_fault_in_memory_leaves_a_command_that_is_none_and_it_controls_again_at_once(tool, tmp_path):
    """30 faults each of state, data in RAM and block: bits changed, NaN, infinity; 20 ms are allowed."""
    tool("gcc")
    for each in inject(predictive_target(), tmp_path, 30):
        assert each.not_finite == 0
        assert each.restarts_ms[-1] <= 20


THERMAL_PROGRAM = """
#include <math.h>
#include <stdio.h>
#include "damper_parameters.h"
static float time_left(const mrd_thermal *data)
{
    damper_thermal_state state;
    damper_thermal_output out;
    const damper_thermal_input in = {6000.0f, 0.05f, 1.0f, 293.15f, 0.0f, NAN, NAN};
    damper_thermal_start(&state, 293.15f);
    for (int i = 0; i < 60000; i++) damper_thermal_step_with(data, &state, &in, &out);
    return out.time_to_limit;
}
int main(void)
{
    damper_parameters block;
    mrd_thermal data;
    damper_parameters_default(&block);
    printf("%u ", damper_thermal_restore(&data, &block));
    printf("%g ", (double)time_left(&data));
    for (int i = DAMPER_THERMAL_LIMIT_GAP; i <= DAMPER_THERMAL_LIMIT_SEAL; i++) block.value[i] -= 20.0f;
    printf("%u ", damper_thermal_restore(&data, &block));
    damper_parameters_seal(&block);
    printf("%u ", damper_thermal_restore(&data, &block));
    printf("%g", (double)time_left(&data));
    return 0;
}
"""


@pytest.mark.nightly
def test_the_thermal_limits_are_in_the_block(folder: Path, tool):
    """A damper that bears 20 K less is at its limit sooner; a change that is not sealed is refused."""
    (folder / "warm.c").write_text(THERMAL_PROGRAM, encoding="ascii")
    ran(tool("gcc"), *STRICT, "warm.c", *UNITS, "damper_thermal.c", "-o", "warm", cwd=folder)
    taken, usual, refused, again, sooner = map(float, ran("./warm", cwd=folder).split())
    assert (taken, refused, again) == (0.0, 4.0, 0.0)
    assert sooner < usual


def test_every_value_of_the_table_has_limits_that_hold_what_was_identified(target: Target):
    found = parameters_of(target)
    assert len({each.offset for each in found}) == len(found) > 8
    for each in found:
        assert each.variable.start is not None
        assert each.lowest <= each.variable.start <= each.variable.high
        assert each.variable.unit


def test_a_bare_cortex_runs_at_a_kilohertz_and_has_the_bits_of_this_machine(folder: Path, tool, tmp_path):
    """In QEMU: an interrupt every millisecond, none of them late, and the same bits as here."""
    place = EXAMPLES / "cortex_m"
    units = [str(folder / name) for name in (*UNITS, "damper_thermal.c")]
    flags = [*STRICT, f"-I{folder}", f"-I{place}"]
    ran(
        tool("arm-none-eabi-gcc"), *CORTEX, *flags, "-nostartfiles", "-T", place / "board.ld",
        "-Wl,--gc-sections", place / "board.c", place / "loop.c", *units, "-o", tmp_path / "board",
    )  # fmt: skip
    done = [
        tool("qemu-system-arm"), "-M", "mps2-an386", "-nographic", "-icount", "shift=6,sleep=off",
        "-semihosting-config", "enable=on,target=native", "-kernel", str(tmp_path / "board"),
    ]  # fmt: skip
    board = ran("sh", "-c", '"$@" 2>&1', "sh", *done)
    ran(tool("gcc"), *flags, place / "host.c", place / "loop.c", *units, "-o", tmp_path / "host")
    assert board == ran(tmp_path / "host")
    steps, late, *_, wrong = (int(each, 16) for each in board.split())
    assert (steps, late, wrong) == (3000, 0, 0)


@pytest.mark.nightly
def test_two_compilers_make_the_same_bits(folder: Path, tool, tmp_path):
    """GCC and Clang, with and without optimisation: single precision leaves no freedom that they use."""
    place = EXAMPLES / "cortex_m"
    sources = [
        place / "host.c",
        place / "loop.c",
        *(folder / name for name in UNITS),
        folder / "damper_thermal.c",
    ]
    said = set()
    for compiler in ("gcc", "clang"):
        for level in ("-O0", "-O2"):
            ran(
                tool(compiler), *STRICT, level, f"-I{folder}", f"-I{place}", *sources, "-o", tmp_path / "host"
            )
            said.add(ran(tmp_path / "host"))
    assert len(said) == 1


@pytest.mark.parametrize("compiler", one_by_day(["g++", "clang++"]))
def test_the_example_in_cpp_changes_a_parameter_and_controls(folder: Path, tool, tmp_path, compiler):
    units = [*UNITS, "damper_thermal.c"]
    ran(tool("gcc"), "-std=c99", "-O2", "-c", *(folder / name for name in units), cwd=tmp_path)
    warnings = ["-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-pedantic", "-Werror"]
    objects = [name.replace(".c", ".o") for name in units]
    source = EXAMPLES / "controller.cpp"
    ran(tool(compiler), "-std=c++17", *warnings, f"-I{folder}", source, *objects, "-o", "user", cwd=tmp_path)
    said = ran("./user", cwd=tmp_path)
    assert said.startswith("refused 1, taken 1, largest command ")
    assert 0.1 < float(said.split()[-1]) <= 2.0
