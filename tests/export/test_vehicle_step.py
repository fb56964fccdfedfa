"""From a vehicle's readings to the command in one exported step: the bits of the ride's own code."""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from mrdamper.control.vehicle.car import DEMANDS, QuarterCar, demand_named
from mrdamper.control.vehicle.drive import RoadSegment, Vehicle, drive_car
from mrdamper.control.vehicle.mount import TopMount
from mrdamper.control.vehicle.observer import DemandStep, VehicleFlag, VehicleSensors
from mrdamper.control.vehicle.quarter_car import FASTEST_M_S
from mrdamper.errors import InputError
from mrdamper.excitation import Road
from mrdamper.export.c_code import c_files
from mrdamper.export.parameters import layout_version, parameter_block, parameters_of
from mrdamper.export.target import Target, with_vehicle
from mrdamper.export.verification_rows import ACCELERATIONS, envelope_rows
from mrdamper.export.verify import verify_c
from mrdamper.jobs.export import export
from mrdamper.jobs.options import ExportOptions
from mrdamper.rig.plant import PRESETS, Plant
from tests.control.test_vehicle import car_card
from tests.export.exports import STRICT, a_target, ran, write
from tests.export.masters import Library, written
from tests.support.tiers import one_by_day

pytestmark = pytest.mark.system

CAR = QuarterCar()
OTHER = QuarterCar(body_kg=450.0, wheel_kg=30.0, spring_N_m=35e3, tyre_N_m=250e3)
MOUNT = TopMount(stiffness_N_m=3e5)
EXAMPLES = Path(__file__).parents[2] / "examples" / "cortex_m"
CORTEX = ["-mthumb", "-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
UNITS = ["damper.c", "damper_tables.c", "damper_parameters.c", "damper_vehicle.c"]


@cache
def a_car(demand="skyhook", *, wheel=False, mount=None, **options) -> Target:
    """Return a target with a car's demand."""
    plain = a_target(speed_m_s=FASTEST_M_S, **options)
    asked = demand_named(demand, CAR, 2500.0)
    return with_vehicle(plain, CAR, asked, VehicleSensors(wheel_accelerometer=wheel), mount)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write(a_car(wheel=True, content="controller"), tmp_path_factory.mktemp("car"))


@pytest.mark.parametrize("demand", one_by_day(DEMANDS))
@pytest.mark.parametrize(
    ("precision", "content", "wheel", "mount"),
    [("float", "controller", False, None), ("double", "both", True, MOUNT)],
    ids=["float", "double"],
)
def test_every_demand_has_the_same_bits_in_c_as_in_python(tool, demand, precision, content, wheel, mount):
    tool("gcc")
    target = a_car(demand, precision=precision, content=content, wheel=wheel, mount=mount)
    record = verify_c(target, samples=6000)
    assert record.passed, record.problems
    assert record.worst_ulp == 0
    outputs = ("current", "wanted", "wanted_ahead", "flags", "car.flags")
    assert {f"vehicle.{output}" for output in outputs} <= set(record.outputs)
    assert set(ACCELERATIONS[: 1 + wheel]) <= set(record.covered)
    assert 0 < record.sizes_bytes["state"] < record.sizes_bytes["vehicle_state"]
    assert record.sizes_bytes["vehicle_code"] > 0


def test_the_rows_of_the_check_have_seen_every_flag_and_a_force_that_is_wanted():
    target = a_car(wheel=True)
    rows = envelope_rows(target, 20_000)
    assert target.vehicle is not None
    names = (*ACCELERATIONS, "displacement")
    _, wanted, flags = target.vehicle.run(
        target.vehicle.start(), np.column_stack([rows[name] for name in names])
    )
    seen = {flag for flag in VehicleFlag if (flags & flag).any()}
    assert seen == set(VehicleFlag) - {VehicleFlag.FAULT}
    assert np.mean(wanted[:, 0] != 0.0) > 0.1


@pytest.mark.nightly
def test_a_bit_that_differs_is_found(tool, monkeypatch):
    """A gain of Python's observer that is off by a ten millionth: the check does not pass."""
    tool("gcc")
    target = a_car(content="controller")
    ours = DemandStep.run

    def off(self, state, rows):
        rows = rows.copy()
        rows[:, 0] *= 1.0 + 2e-7
        return ours(self, state, rows)

    monkeypatch.setattr(DemandStep, "run", off)
    record = verify_c(target, samples=2000)
    assert not record.passed
    assert any(problem.startswith("vehicle.wanted is not Python's") for problem in record.problems)


def test_a_ride_goes_by_the_step_that_is_exported(monkeypatch):
    """What a ride's demand read, run through the exported step's host: the wanted forces and the commands."""
    target = a_car(precision="double", content="controller")
    controller, asked = target.controller, target.vehicle
    assert controller is not None
    assert asked is not None
    read, given = [], []
    step, answer = DemandStep.step, type(controller).step

    def spy(self, state, *readings):
        read.append(readings)
        return step(self, state, *readings)

    def told(self, state, reference, measurement):
        state, current = answer(self, state, reference, measurement)
        given.append(
            (reference.now, reference.ahead, measurement.displacement, measurement.temperature, current)
        )
        return state, current

    monkeypatch.setattr(DemandStep, "step", spy)
    monkeypatch.setattr(type(controller), "step", told)
    vehicle = Vehicle(CAR, asked.demand, Plant(PRESETS["vehicle"]), controller, sensors=asked.sensors)
    drive_car(vehicle, RoadSegment(road=Road("C", 20.0, 4), duration_s=1.0, unscored_s=0.0))
    _, wanted, _ = asked.run(asked.stand(), np.array(read))
    told_of = np.array(given)
    np.testing.assert_array_equal(wanted, told_of[:, :2])
    nothing = np.full((len(wanted), 2), np.nan)
    _, currents, _ = controller.run(controller.start(), np.column_stack([wanted, told_of[:, 2:4], nothing]))
    np.testing.assert_array_equal(currents, told_of[:, 4])
    assert currents.any()


BLOCK = """
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "damper_parameters.h"
int main(int count, char **argument)
{
    damper_parameters block;
    damper_vehicle_state state;
    damper_vehicle_output out;
    mrd_vehicle car, next;
    mrd_track data;
    damper_parameters_default(&block);
    if (count > 1 && fread(&block, sizeof block, 1, fopen(argument[1], "rb")) != 1) return 1;
    damper_vehicle_start(&state);
    if (damper_controller_restore(&data, &state.controller, &block) != 0u) return 2;
    if (damper_vehicle_restore(&car, &block) != 0u) return 2;
    for (int i = 0; i < 400; i++) {
        const mrd_real s = (mrd_real)sin(0.05 * i), c = (mrd_real)cos(0.05 * i), none = (mrd_real)NAN;
        const mrd_real body = (mrd_real)2.5 * s, wheel = (mrd_real)-40 * c * s, stroke = (mrd_real)0.02 * c;
        const damper_vehicle_input in = {body, wheel, stroke, 330, none, none};
        if (count > 1) damper_vehicle_step_with(&car, &data, &state, &in, &out);
        else damper_vehicle_step(&state, &in, &out);
        printf("%a %a %a\\n", (double)out.wanted, (double)out.wanted_ahead, (double)out.current);
    }
    for (int i = 0; i < 4; i++) { /* what is refused leaves the car that was exported */
        damper_parameters wrong = block;
        wrong.value[DAMPER_DEMAND_BY_BODY] = (mrd_real)1e8; /* beyond its limits */
        damper_parameters_seal(&wrong);
        if (i < 3) wrong = block;
        if (i == 0) wrong.version++;
        if (i == 1) wrong.length++;
        if (i == 2) wrong.crc++;
        printf("%u ", damper_vehicle_restore(&next, &wrong));
        if (memcmp(&next, &damper_vehicle_data, sizeof next) != 0) return 3;
    }
    return 0;
}
"""


def another(*, wheel=True, **options) -> Target:
    """Return a target for a car with other masses, springs, sensors, top mount and demand."""
    sensors = VehicleSensors(wheel_accelerometer=wheel, body_noise_m_s2=0.2, stroke_noise_m=5e-5)
    plain = a_target(speed_m_s=FASTEST_M_S, displacement_noise_m=5e-5, content="controller", **options)
    return with_vehicle(plain, OTHER, demand_named("linear-quadratic", OTHER, 0.0), sensors, MOUNT)


@pytest.mark.parametrize(
    ("precision", "wheel"), [("float", False), pytest.param("double", True, marks=pytest.mark.nightly)]
)
def test_a_block_of_another_car_has_the_bits_of_that_car_s_own_export(tool, tmp_path, precision, wheel):
    first = a_car(precision=precision, wheel=wheel, content="controller")
    second = another(precision=precision, wheel=wheel)
    programs = []
    for name, target in (("first", first), ("other", second)):
        place = write(target, tmp_path / name)
        (place / "block.c").write_text(BLOCK, encoding="ascii")
        ran(tool("gcc"), *STRICT, "block.c", *UNITS, "-lm", "-o", "block", cwd=place)
        programs.append(place / "block")
    (tmp_path / "other.bin").write_bytes(parameter_block(second))
    plain, other, loaded = ran(programs[0]), ran(programs[1]), ran(programs[0], tmp_path / "other.bin")
    assert loaded == other != plain
    *rows, refused = loaded.splitlines()
    assert len(set(rows)) > 200
    assert refused == "5 6 4 8 "  # a version or a length that is another has another sum, too


def test_a_block_is_for_one_kind_of_car_and_its_values_are_within_their_limits():
    alone: dict[str, object] = {"content": "controller"}
    noisy = {"controller": "predictive", "displacement_noise_m": 5e-5}  # its horizon follows the noise
    changes: list[dict[str, object]] = [{}, {"wheel": True}, {"period_s": 2e-3}, {"largest": 1.5}, noisy]
    changes.append({"controller": "predictive"})
    made = [a_car(**alone, **changed) for changed in changes]
    made.append(a_car("acceleration-driven", **alone))
    assert len({layout_version(each) for each in made}) == len(made)
    assert layout_version(another()) == layout_version(made[1])
    for each in parameters_of(another()):
        assert each.lowest <= (each.variable.start or 0.0) <= each.variable.high
        assert each.variable.unit


@pytest.mark.parametrize(("version", "precision"), [("2.0", "float"), ("3.0", "double")])
def test_an_fmu_has_the_car_and_its_parameters_make_another_of_it(tool, tmp_path, version, precision):
    """Accelerations, stroke and temperature in, the command out: the bits of Python, of either car."""
    tool("gcc")
    target = a_car(precision=precision, wheel=True, content="controller")
    path = written(target, tmp_path / "car.fmu", version)
    assert import_module("fmpy.validation").validate_fmu(str(path)) == []
    library = Library(path, tmp_path / "car")
    angle = 0.05 * np.arange(400)
    inputs = (*ACCELERATIONS, "displacement", "temperature")
    told = np.zeros(len(angle), dtype=[(name, float) for name in inputs])
    told["body_acceleration"], told["wheel_acceleration"] = 2.5 * np.sin(angle), -20.0 * np.sin(2.0 * angle)
    told["displacement"], told["temperature"] = 0.02 * np.cos(angle), 330.0
    for car in (target, another(precision=precision)):
        assert car.vehicle is not None
        assert car.controller is not None
        rows = np.column_stack([told[name] for name in inputs])
        _, wanted, flags = car.vehicle.run(car.vehicle.start(), rows[:, :3])
        nothing = np.full((len(rows), 2), np.nan)
        _, current, _ = car.controller.run(
            car.controller.start(), np.column_stack([wanted, rows[:, 2:], nothing])
        )
        parameters = {each.variable.name: each.variable.start or 0.0 for each in parameters_of(car)}
        with library.slave() as slave:
            slave.set(use_vehicle_demand=True, **parameters)
            shown = ("demanded_force", "demanded_force_ahead", "current", "vehicle_flags")
            found = slave.begin().run(told, shown)
        np.testing.assert_array_equal(found, np.column_stack([wanted, current, flags]))
        assert len(set(wanted[:, 0])) > 100
        assert current.any()


LOOP = """#include "loop.h"
#include <math.h>
#include <string.h>
#include "block.h"
#include "damper_parameters.h"
static damper_parameters block;
static damper_vehicle_state car;
static mrd_vehicle numbers;
static mrd_track data;
static mrd_real cosine, sine, sum, wanted;
static uint32_t flags;
void loop_begin(void)
{
    (void)memcpy(&block, other, sizeof block);
    damper_vehicle_start(&car);
    flags = damper_controller_restore(&data, &car.controller, &block);
    flags |= damper_vehicle_restore(&numbers, &block);
    cosine = (mrd_real)1.0;
}
void loop_step(void)
{
    const mrd_real turn = (mrd_real)8e-3, c = cosine - turn * sine, s = sine + turn * c;
    const damper_vehicle_input in = {(mrd_real)2.5 * s, (mrd_real)-40.0 * c * s, (mrd_real)0.02 * c,
                                     (mrd_real)330.0, (mrd_real)NAN, (mrd_real)NAN};
    damper_vehicle_output out;
    cosine = c;
    sine = s;
    damper_vehicle_step_with(&numbers, &data, &car, &in, &out);
    sum = (mrd_real)0.999 * sum + out.current;
    wanted = (mrd_real)0.999 * wanted + out.wanted_ahead;
    flags |= out.vehicle_flags;
}
void loop_end(uint32_t shown[LOOP_SHOWN])
{
    const mrd_real values[3] = {sum, wanted, car.car.z[1]};
    for (int i = 0; i < 3; i++) (void)memcpy(&shown[i], &values[i], sizeof shown[i]);
    shown[3] = flags;
    shown[4] = 0u;
}
"""


@pytest.mark.nightly
def test_a_bare_cortex_has_the_bits_of_this_machine_and_is_never_late(folder, tool, tmp_path):
    """At 1 kHz of a core at 25 MHz, in QEMU; the car is of a block, and here it is that car's own export."""
    other = another()
    (tmp_path / "loop.c").write_text(LOOP, encoding="ascii")
    numbers = ", ".join(map(str, parameter_block(other)))
    (tmp_path / "block.h").write_text(
        f"static const unsigned char other[] = {{{numbers}}};\n", encoding="ascii"
    )
    units = [str(folder / name) for name in UNITS]
    flags = [*STRICT, f"-I{folder}", f"-I{EXAMPLES}"]
    ran(
        tool("arm-none-eabi-gcc"), *CORTEX, *flags, "-nostartfiles", "-T", EXAMPLES / "board.ld",
        "-Wl,--gc-sections", EXAMPLES / "board.c", "loop.c", *units, "-o", "board", cwd=tmp_path,
    )  # fmt: skip
    done = [
        tool("qemu-system-arm"), "-M", "mps2-an386", "-nographic", "-icount", "shift=6,sleep=off",
        "-semihosting-config", "enable=on,target=native", "-kernel", str(tmp_path / "board"),
    ]  # fmt: skip
    board = ran("sh", "-c", '"$@" 2>&1', "sh", *done)
    here = write(other, tmp_path / "other")
    flags[-2:], units = [f"-I{here}", f"-I{EXAMPLES}", f"-I{tmp_path}"], [str(here / name) for name in UNITS]
    ran(tool("gcc"), *flags, EXAMPLES / "host.c", "loop.c", *units, "-o", "host", cwd=tmp_path)
    assert board == ran(tmp_path / "host")
    steps, late, total, wanted, _, flags_raised, _ = (int(each, 16) for each in board.split())
    assert (steps, late, flags_raised) == (3000, 0, 0)
    assert total
    assert wanted


def test_compilers_find_nothing_and_nothing_can_be_written_to(folder, tool):
    ran(tool("gcc"), "-std=c99", "-c", *(each.name for each in folder.glob("*.c")), cwd=folder)
    ran(tool("gcc"), *STRICT, "-fno-pie", "-c", "damper_vehicle.c", cwd=folder)
    symbols = re.findall(
        r"^\S*\s+([A-Za-z])\s+(\S+)$", ran(tool("nm"), "damper_vehicle.o", cwd=folder), re.MULTILINE
    )
    assert {kind for kind, _ in symbols} <= set("UTtRrd") - {"D", "B", "b"}
    mine = {"damper_controller_start", "damper_controller_step_with", "damper_controller_data"}
    assert {name for kind, name in symbols if kind == "U"} <= {"memcpy", "memset", "__stack_chk_fail"} | mine
    (folder / "user.cpp").write_text('#include "damper_vehicle.h"\n', encoding="ascii")
    ran(tool("g++"), "-std=c++11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "user.cpp", cwd=folder)


def test_the_example_in_the_readme_compiles(folder, tool):
    readme = (folder / "README.md").read_text(encoding="utf-8")
    example = next(
        each for each in re.findall(r"```c\n(.*?)```", readme, re.DOTALL) if "vehicle_step" in each
    )
    (folder / "example.c").write_text(example, encoding="ascii")
    ran(tool("gcc"), *STRICT, "-Wno-missing-prototypes", "-fsyntax-only", "example.c", cwd=folder)


def test_an_export_holds_no_mode_that_it_does_not_use(tool, tmp_path):
    """Without the wheel's accelerometer and the demand by acceleration their code is not there."""
    sizes = {}
    for demand, wheel in (("skyhook", False), ("skyhook", True), ("acceleration-driven", True)):
        target = a_car(demand, wheel=wheel, content="controller")
        place = write(target, tmp_path / f"{demand}{wheel}")
        text = c_files(target)["damper_vehicle.c"]
        assert f"MRD_WITH_WHEEL_ACCELEROMETER {'MRD_ALWAYS' if wheel else 'MRD_NEVER'}" in text
        ran(tool("gcc"), *STRICT, "-Os", "-c", "damper_vehicle.c", cwd=place)
        listed = ran(tool("size"), "damper_vehicle.o", cwd=place).splitlines()[1].split()
        sizes[demand, wheel] = int(listed[0])
    assert sizes["skyhook", False] < sizes["skyhook", True] < sizes["acceleration-driven", True]
    plain = c_files(a_target(content="controller"))
    assert not any("vehicle" in name for name in plain)


def test_a_demand_without_a_controller_is_refused():
    with pytest.raises(InputError, match="a demand, and nothing that follows it"):
        with_vehicle(a_target(content="model"), CAR, demand_named("skyhook", CAR, 1.0), VehicleSensors())


@pytest.mark.nightly
def test_the_job_writes_it_with_the_sizes_of_this_very_export(tool):
    tool("gcc")
    options = ExportOptions(
        what=("c",), content="controller", demand="linear-quadratic", body_kg=400.0, mount_N_m=5e5
    )
    found = export(car_card(), options)
    assert found.code is not None
    asked = found.code.target.vehicle
    assert asked is not None
    assert asked.car.body_kg == 400.0
    assert asked.mount == TopMount(stiffness_N_m=5e5)
    assert asked.preview_s == found.code.target.controller.preview_s > 0.0  # type: ignore[union-attr]
    readme = c_files(found.code.target, found.code.record)["README.md"]
    size = found.code.record.sizes_bytes["vehicle_state"]
    assert f"| a state of the vehicle's step, the controller's in it | {size} bytes |" in readme
    assert "| body, wheel; spring, tyre; top mount | 400, 40 kg; 20000, 200000; 500000 N/m |" in readme
