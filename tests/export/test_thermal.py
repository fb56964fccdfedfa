"""The exported thermal model in compiled C matches the Python simulation and uses thermometers correctly."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.codegen.target import Target, target_of
from mrdamper.codegen.verify import verify_c
from mrdamper.thermal.compact import CompactLoad, CompactModel, compact_model, simulate_compact
from mrdamper.thermal.drawing_file import read_drawing
from tests.export.exports import STRICT, card_of, ran, write
from tests.export.masters import Library, table_of, written
from tests.support.cards import DAMPERS
from tests.support.tiers import one_by_day
from tests.thermal.bodies import draw_body

pytestmark = pytest.mark.system

PERIOD_S = 10e-3
EVERY = 50
UPDATE_S = EVERY * PERIOD_S
ROOM_K = 293.15
NO_POWER, NO_THERMOMETER, FROZEN, WRONG = 1, 8, 16, 32

PROGRAM = """
#include <math.h>
#include <stdio.h>
#include "damper_thermal.h"
int main(void)
{
    damper_thermal_state state;
    damper_thermal_output out;
    double v[6];
    int count = 1;
    damper_thermal_start(&state, (mrd_real)NAN);
    while (scanf("%lf %lf %lf %lf %lf %lf", v, v + 1, v + 2, v + 3, v + 4, v + 5) == 6) {
        const damper_thermal_input in = {(mrd_real)v[0], (mrd_real)1, (mrd_real)v[1], (mrd_real)v[2],
                                         (mrd_real)v[3], (mrd_real)v[4], (mrd_real)v[5]};
        for (int i = 0; i < count; i++) damper_thermal_step(&state, &in, &out);
        count = 50;
        printf("%.9g %.9g ", (double)out.fluid, (double)out.gap);
        printf("%.9g %.9g ", (double)out.coil, (double)out.seal);
        printf("%.9g %d\\n", (double)out.time_to_limit, (int)state.flags);
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def target() -> Target:
    plain = target_of(card_of(DAMPERS["double-bouc-wen"]), period_s=PERIOD_S)
    return replace(plain, thermal=compact_model(read_drawing("paper")))


@pytest.fixture(scope="module")
def model(target: Target) -> CompactModel:
    assert target.thermal is not None
    return target.thermal


@pytest.fixture(scope="module")
def folder(target, tmp_path_factory, tool) -> Path:
    place = write(target, tmp_path_factory.mktemp("thermal"))
    (place / "user.c").write_text(PROGRAM, encoding="ascii")
    ran(tool("gcc"), *STRICT, "user.c", "damper_thermal.c", "-o", "user", cwd=place)
    return place


def stepped(folder: Path, load: CompactLoad, *, command=1.0, thermometer=np.nan, ohm=np.nan):
    """Return temperatures and time to the limit, and flags, of the compiled model every 0.5 s."""
    columns = [load.power, command, load.ambient, load.air_speed, thermometer, ohm]
    np.savetxt(folder / "rows.txt", np.column_stack(np.broadcast_arrays(*columns)), fmt="%.9g")
    out = np.array(ran("sh", "-c", "./user < rows.txt", cwd=folder).split(), dtype=float).reshape(-1, 6)
    return out[:, :5], out[:, 5].astype(int)


def even(
    updates: int, power: float | FloatArray, coil_W: float = 4.2, ambient: float = ROOM_K
) -> CompactLoad:
    return CompactLoad(*(np.full(updates, each) for each in (power, coil_W, ambient, 0.0)))


@pytest.fixture(scope="module")
def library(model, tmp_path_factory, tool) -> Library:
    """Return the loaded FMU of a damper with its thermal model."""
    tool("gcc")
    place = tmp_path_factory.mktemp("fmu")
    one = replace(target_of(card_of(DAMPERS["double-bouc-wen"]), content="model"), thermal=model)
    return Library(written(one, place / "one.fmu"), place / "one")


@pytest.mark.parametrize("precision", one_by_day(["float", "double"]))
def test_compiled_thermal_model_matches_python(tool, precision):
    tool("cc")
    plain = target_of(card_of(DAMPERS["double-bouc-wen"]), precision=precision)
    record = verify_c(replace(plain, thermal=compact_model(draw_body(5).drawing)), samples=1000)
    assert record.passed
    assert 0.0 < max(record.thermal_K.values()) < (1e-3 if precision == "float" else 1e-9)


def test_exported_thermal_model_requires_no_library(folder, tool):
    cortex = ["-mthumb", "-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
    ran(tool("arm-none-eabi-gcc"), *cortex, *STRICT, "-c", "damper_thermal.c", cwd=folder)
    ran(tool("gcc"), *STRICT, "-fno-pie", "-c", "damper_thermal.c", cwd=folder)
    listed = ran(tool("nm"), "damper_thermal.o", cwd=folder)
    symbols = re.findall(r"^\S*\s+([A-Za-z])\s+(\S+)$", listed, re.MULTILINE)
    assert {kind for kind, _ in symbols} <= set("UTtRrd")
    assert {name for kind, name in symbols if kind == "U"} <= {"memcpy", "memset", "__stack_chk_fail"}


@pytest.mark.nightly
def test_predicted_time_to_temperature_limit_matches_simulation(folder, model):
    load = even(1200, 160.0)
    found, _ = stepped(folder, load)
    host = simulate_compact(model, even(6000, 160.0), start_K=ROOM_K)
    reached = UPDATE_S * np.argmax((host.hot >= model.limits).any(axis=1))
    at = UPDATE_S * np.arange(1, 1201)
    late = at > 300.0  # The prediction uses a mean power, which requires minutes of data.
    assert (found[late, 4] + at[late]) == pytest.approx(np.full(late.sum(), reached), rel=0.03)
    rest, _ = stepped(folder, even(300, 0.0, 0.0), command=0.0)
    assert rest[-1, 4] == 7200.0


def test_thermometers_correct_error_of_wrong_power(folder, model):
    """The true power of the damper is 20 % higher than the power in the model."""
    load = even(3600, 100.0)
    truth = simulate_compact(model, even(3600, 120.0), start_K=ROOM_K)
    alone, _ = stepped(folder, load)
    helped, flags = stepped(folder, load, thermometer=truth.fluid)
    coil = model.reference + truth.state @ model.coil + model.coil_feedthrough @ [120.0, truth.coil_W[-1]]
    ohm = model.resistance * (1.0 + 0.00393 * (coil - ROOM_K))
    by_coil, _ = stepped(folder, load, ohm=ohm)
    missed = [float(np.abs(each[-1, 0] - truth.fluid[-1])) for each in (alone, helped, by_coil)]
    assert missed[0] > 8.0
    assert missed[1] < 1.0
    assert missed[2] < 0.3 * missed[0]
    assert not (flags & (FROZEN | WRONG)).any()
    assert np.abs(helped[-1, 1:4] - truth.hot[-1]).max() < 1.5


def test_only_stuck_thermometer_is_flagged(folder, model):
    """The damper warms, then rests. One sensor works, one gets stuck at rest, and one is always stuck."""
    load = even(3600, np.where(np.arange(3600) < 1800, 110.0, 0.0), 0.0)
    truth = simulate_compact(model, load, start_K=ROOM_K)
    good = truth.fluid + np.random.default_rng(1).normal(0.0, 0.1, 3600)
    alive, flags = stepped(folder, load, command=0.0, thermometer=good)
    assert not (flags & (FROZEN | WRONG)).any()
    stuck, flags = stepped(
        folder, load, command=0.0, thermometer=np.where(np.arange(3600) < 2000, good, good[2000])
    )
    assert flags[-1] & FROZEN
    assert np.abs(stuck[-1, 0] - truth.fluid[-1]) < 2.0
    dead, flags = stepped(folder, load, command=0.0, thermometer=np.full(3600, ROOM_K))
    first = int(np.argmax(flags & FROZEN > 0))
    assert 0 < first * UPDATE_S < 240.0
    assert np.abs(dead[first + 1 :, 0] - truth.fluid[first + 1 :]).max() < 2.0
    assert np.abs(alive[:, 0] - truth.fluid).max() < 0.5


def test_constant_temperature_in_thermal_balance_is_valid(folder):
    still, flags = stepped(folder, even(3600, 0.0, 0.0), command=0.0, thermometer=np.full(3600, ROOM_K))
    assert not (flags & (FROZEN | WRONG)).any()
    assert still[-1, 0] == pytest.approx(ROOM_K, abs=0.1)


def test_missing_thermal_inputs_set_flags(folder):
    power = np.full(400, 100.0)
    power[200:300] = np.nan
    found, flags = stepped(folder, even(400, power))
    assert np.isfinite(found).all()
    assert ((flags & NO_POWER) > 0).tolist() == (np.isnan(power)).tolist()
    assert (flags & NO_THERMOMETER).all()
    worst, _ = stepped(folder, CompactLoad(*(np.full(50, each) for each in (np.inf, 0.0, np.nan, -1.0))))
    assert np.isfinite(worst).all()


def test_fmu_temperature_rises_by_damper_work(library, model):
    count = 20_000
    t = 1e-3 * np.arange(1, count + 1)
    x, v = 8e-3 * np.sin(6.0 * t), 48e-3 * np.cos(6.0 * t)
    rows = table_of(time=t - 1e-3, displacement=x, velocity=v, current=1.5)
    with library.slave() as slave:
        slave.set(use_velocity=True, use_thermal_model=True, air_temperature=300.0)
        slave.begin()
        table = slave.run(rows, ("force", "fluid_temperature", "hottest_gap_temperature", "applied_current"))
    force, fluid, gap, _ = np.asarray(table).T
    power = (force * v)[: count // 500 * 500].reshape(-1, 500).mean(axis=1)
    load = CompactLoad(power, model.resistance * 1.5**2 + 0 * power, 300.0 + 0 * power, 0 * power)
    host = simulate_compact(model, load, start_K=300.0)
    assert fluid[-1] == pytest.approx(host.fluid[-1], abs=0.05)
    assert gap[-1] > fluid[-1] > 300.3


@pytest.mark.nightly
def test_fmu_has_temperature_limits_as_parameters(library, model):
    """A lower temperature limit is reached earlier, and a coil with twice the resistance is warmer."""
    count = 20_000
    t = 1e-3 * np.arange(count)
    rows = table_of(time=t, displacement=10e-3 * np.sin(40.0 * t), current=1.5)
    shown = ("time_to_limit", "hottest_coil_temperature")

    def left(**parameters: float) -> tuple[float, float]:
        with library.slave() as slave:
            slave.set(**parameters)
            slave.begin()
            time, coil = np.asarray(slave.run(rows, shown))[-1]
        return float(time), float(coil)

    usual, coil = left()
    limits = {f"thermal_limit_{part}": 320.0 for part in ("gap", "coil", "seal")}
    assert 0.0 < left(**limits)[0] < 0.5 * usual
    assert left(thermal_resistance=2.0 * model.resistance)[1] > coil + 0.5
