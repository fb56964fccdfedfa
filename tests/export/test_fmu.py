"""FMUs run in independent simulation masters, and their outputs are bit-identical to Python."""

from __future__ import annotations

import hashlib
import math
import re
import subprocess
import zipfile
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from mrdamper.codegen.c_code import c_files
from mrdamper.codegen.fmu import fmu_files, write_fmu
from mrdamper.codegen.target import target_of
from mrdamper.codegen.verify import FLAGS, WARNINGS
from mrdamper.errors import InputError
from mrdamper.excitation import MOTIONS
from mrdamper.models.card_schema import read_card
from tests.export.masters import (
    FmiError,
    FmuController,
    Library,
    Slave,
    fmpy,
    passed_verification,
    table_of,
    written,
)
from tests.support.cards import changed, write_card_of
from tests.support.tiers import one_by_day

VALIDATION = import_module("fmpy.validation")

PERIOD = 1e-3
PRECISIONS = pytest.mark.parametrize("precision", ["float", "double"])
CONTENTS = pytest.mark.parametrize("content", ["model", "controller", "both"])


@pytest.fixture(scope="session")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("fmu")


@pytest.fixture(scope="session")
def card(place):
    return read_card(write_card_of(place / "card.json"))


@pytest.fixture(scope="session")
def made(place, card, tool):
    """Return a function that writes the FMU for given options once, and returns its target and path."""
    tool("gcc")
    known = {}

    def make(content="controller", precision="float"):
        choice = (content, precision)
        if choice not in known:
            target = target_of(card, content=content, precision=precision)
            known[choice] = target, written(target, place / ("-".join(choice) + ".fmu"))
        return known[choice]

    return make


@pytest.fixture(scope="session")
def loaded(made, place):
    """Return a function that loads the FMU for given options once, and returns its target and library."""
    known = {}

    def load(content="controller", precision="float"):
        target, path = made(content, precision)
        if path not in known:
            known[path] = Library(path, place / path.stem)
        return target, known[path]

    return load


def motion(count=1500, seed=1):
    """Return time, displacement and velocity of a motion with reversals."""
    t = PERIOD * np.arange(count)
    x = 8e-3 * np.sin(2 * np.pi * 1.3 * t) + 2e-3 * np.sin(2 * np.pi * 4.1 * t + seed)
    return t, x, np.gradient(x, PERIOD)


def controller_inputs(count=1500, seed=1):
    t, x, v = motion(count, seed)
    wanted = 600.0 * np.tanh(v / 0.02)
    ahead = np.roll(wanted, -15)
    warm = 320.0 + 30.0 * t / t[-1]
    return table_of(time=t, wanted_force=wanted, wanted_force_ahead=ahead, displacement=x, temperature=warm)


def model_inputs(count=1500, seed=1):
    t, x, v = motion(count, seed)
    current = 1.0 + np.sin(2 * np.pi * 0.7 * t + seed)
    warm = 320.0 + 30.0 * t / t[-1]
    return table_of(time=t, displacement=x, velocity=v, current=current, temperature=warm)


def commands(target, table):
    """Return commands and flags of the controller in Python for a table of inputs."""
    names = ("wanted_force", "wanted_force_ahead", "displacement", "temperature")
    inputs = np.column_stack([*(table[name] for name in names), np.full(len(table), np.nan)])
    _, current, flags = target.controller.run(target.controller.start(), inputs)
    return current, flags


def forces(target, table):
    """Return forces and flags of the damper model in Python for a table of inputs."""
    names = ("displacement", "velocity", "current", "temperature")
    _, force, flags = target.model.run(target.model.start(), np.column_stack([table[name] for name in names]))
    return force, flags


def simulated(path, table, outputs, **start_values):
    """Return the outputs of the FMU in the master FMPy, one row per step."""
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=table["time"][-1] + PERIOD,
        output_interval=PERIOD,
        start_values=start_values,
        input=table,
        output=list(outputs),
    )
    return [found[name][1:] for name in outputs]


# ----------------------------------------------------------------------------------------- content of the FMU


@pytest.mark.parametrize("content", one_by_day(["both", "model", "controller"]))
def test_fmpy_finds_no_error_in_fmu(made, content):
    assert VALIDATION.validate_fmu(str(made(content)[1])) == []


def test_fmu_variables_have_units(made):
    description = fmpy.read_model_description(str(made("both")[1]))
    reals = [each for each in description.modelVariables if each.type == "Real"]
    assert all(each.unit for each in reals)
    (kelvin,) = [unit for unit in description.unitDefinitions if unit.name == "K"]
    (celsius,) = kelvin.displayUnits
    assert float(celsius.factor) * 293.15 + float(celsius.offset) == pytest.approx(20.0)
    assert {each.displayUnit for each in reals if each.unit == "K"} == {"degC"}


@pytest.mark.system
def test_same_target_gives_identical_fmu_file(made, place, card):
    """FMUs of different sample periods or cards have different tokens (GUID)."""
    target, path = made()
    again = written(target, place / "again.fmu")
    assert hashlib.sha256(path.read_bytes()).digest() == hashlib.sha256(again.read_bytes()).digest()
    others = (
        target,
        target_of(card, content="controller", period_s=2e-3),
        replace(target, fingerprint="sha256:0123456"),
    )
    tokens = [re.search(r'FMU_TOKEN "(.*)"', fmu_files(each)["sources/fmi2.c"]) for each in others]
    assert len({token[1] for token in tokens if token}) == 3


def test_fmu_contains_verified_sources(made):
    target, path = made("both")
    with zipfile.ZipFile(path) as archive:
        inside = {
            Path(name).name: archive.read(name) for name in archive.namelist() if name[:8] == "sources/"
        }
    kernel = {name: text for name, text in c_files(target).items() if name.endswith((".c", ".h"))}
    del kernel["main.c"]
    assert {name: inside[name].decode() for name in kernel} == kernel


def write_sources(target, folder):
    for name, text in fmu_files(target).items():
        (folder / Path(name).name).write_text(text, encoding="utf-8")


@pytest.mark.nightly
@CONTENTS
@PRECISIONS
def test_fmu_wrapper_compiles_without_warning(tmp_path, card, tool, content, precision):
    write_sources(target_of(card, content=content, precision=precision), tmp_path)
    command = [tool("gcc"), *FLAGS, *WARNINGS, "-O0", "-c", "fmi2.c", "-o", "entry.o"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.system
def test_function_prefix_allows_several_fmus(tmp_path, card, tool):
    """Every function has the prefix, and no variable exists outside an instance."""
    write_sources(target_of(card, content="controller"), tmp_path)
    prefix = "-DFMI2_FUNCTION_PREFIX=damper_"
    command = [tool("gcc"), *FLAGS, "-O0", "-fno-pie", prefix, "-c", "fmi2.c", "-o", "o.o"]
    subprocess.run(command, cwd=tmp_path, check=True)
    listed = subprocess.run([tool("nm"), "o.o"], cwd=tmp_path, capture_output=True, text=True, check=True)
    lines = listed.stdout.splitlines()
    outside = [line.split()[-1] for line in lines if " T " in line]
    assert "damper_fmi2DoStep" in outside
    assert all(name.startswith("damper_") for name in outside)
    assert [line for line in lines if line.split()[-2] in "bBdDC"] == []


# -------------------------------------------------------------------------------- comparison with Python


@PRECISIONS
def test_controller_fmu_equals_python_bitwise(made, precision):
    target, path = made("controller", precision)
    table = controller_inputs()
    found, flags = simulated(path, table, ("current", "flags"), use_wanted_force_ahead=True)
    expected, expected_flags = commands(target, table)
    assert np.array_equal(found, expected)
    assert np.array_equal(flags, expected_flags)
    assert expected.max() > 0.5


@PRECISIONS
def test_model_fmu_equals_python_bitwise(made, precision):
    target, path = made("model", precision)
    table = model_inputs()
    found, flags = simulated(path, table, ("force", "flags"), use_velocity=True)
    expected, expected_flags = forces(target, table)
    assert np.array_equal(found, expected)
    assert np.array_equal(flags, expected_flags)
    assert np.abs(expected).max() > 500.0


def test_combined_fmu_matches_controller_and_model(loaded):
    """At each sample, the damper model applies the command that the controller returned one sample before."""
    target, library = loaded("both")
    table = controller_inputs()
    current, _ = commands(target, table)
    velocity = motion()[2]
    _, force, _ = target.model.run(
        target.model.start(),
        np.column_stack(
            [table["displacement"], velocity, np.concatenate([[0.0], current[:-1]]), table["temperature"]]
        ),
    )
    inputs = table_of(velocity=velocity, **{name: table[name] for name in table.dtype.names})
    with library.slave() as slave:
        slave.set(use_velocity=True, use_wanted_force_ahead=True)
        found = slave.begin().run(inputs, ("current", "force"))
    assert np.array_equal(found, np.column_stack([current, force]))


@pytest.mark.nightly
def test_rebuilt_fmu_gives_identical_commands(made, place, tool):
    tool("cmake")
    target, path = made()
    folder = place / "built"
    fmpy.extract(str(path), unzipdir=str(folder))
    (binary,) = folder.glob("binaries/*/damper.so")
    binary.unlink()
    (place / "objects").mkdir()
    import_module("fmpy.build").build_platform_binary(folder, build_dir=place / "objects")
    assert binary.exists()
    table = controller_inputs()
    (found,) = simulated(folder, table, ("current",), use_wanted_force_ahead=True)
    assert np.array_equal(found, commands(target, table)[0])


def test_second_fmu_master_gets_same_commands(made):
    """The master of the Open Simulation Platform is written in C++ and is independent of FMPy."""
    cosim = {
        name: getattr(pytest.importorskip(f"libcosimpy.Cosim{name}"), kind)
        for name, kind in (
            ("Execution", "CosimExecution"), ("Manipulator", "CosimManipulator"),
            ("Observer", "CosimObserver"), ("Slave", "CosimLocalSlave"),
        )
    }  # fmt: skip
    target, path = made()
    references = {
        each.name: each.valueReference for each in fmpy.read_model_description(str(path)).modelVariables
    }
    execution = cosim["Execution"].from_step_size(round(1e9 * PERIOD))
    slave = execution.add_local_slave(cosim["Slave"](fmu_path=str(path), instance_name="one"))
    setter, observer = cosim["Manipulator"].create_override(), cosim["Observer"].create_last_value()
    execution.add_manipulator(setter)
    execution.add_observer(observer)
    execution.boolean_initial_value(slave, references["use_wanted_force_ahead"], value=True)
    table = controller_inputs(1000)
    inputs = table.dtype.names[1:]
    found = []
    for row in table:
        setter.slave_real_values(slave, [references[name] for name in inputs], [row[name] for name in inputs])
        execution.step()
        found.append(observer.last_real_values(slave, [references["current"]])[0])
    assert np.array(found) == pytest.approx(commands(target, table)[0], abs=1e-12)


@pytest.mark.system
def test_fmu_tracks_target_like_controller(loaded, place, monkeypatch):
    """The job ``track`` computes the same errors with the exported FMU as with the controller in Python."""
    from mrdamper.jobs import track
    from mrdamper.jobs.options import TrackOptions
    from mrdamper.registry import JOBS

    options = TrackOptions(temperatures_degC=(60.0,), controllers=("recommended",))
    inputs = {"card": place / "card.json", "targets": ["sine-900N-1Hz"]}

    def row_of(controller):
        with monkeypatch.context() as patch:
            patch.setattr(track, "controllers_for", lambda *_, **__: {"recommended": controller})
            (row,) = cast(list[dict[str, object]], JOBS["track"].perform(inputs, options)[1]["rows"])
        return row

    target, library = loaded()
    with library.slave() as slave:
        assert row_of(FmuController(slave, target.controller)) == row_of(target.controller)


# -------------------------------------------------------------------------------- start values and parameters


@CONTENTS
def test_fmu_uses_start_values_of_xml_file(loaded, content):
    """If a master sets no start values, the FMU uses the values of its XML file, also after a reset."""
    _, library = loaded(content)
    texts = {each.name: each.start for each in library.variables.values() if each.start is not None}
    starts = {name: float({"true": 1, "false": 0}.get(text, text)) for name, text in texts.items()}
    settable = [
        each
        for each in library.variables.values()
        if each.causality in {"input", "parameter"} and each.type == "Real"
    ]
    with library.slave() as slave:
        assert {name: slave.get(name)[0] for name in starts} == starts
        for each in settable:
            ends = [float(bound) for bound in (each.min, each.max) if bound is not None]
            slave.set(**{each.name: next(end for end in (*ends, 1.0) if end != starts[each.name])})
        slave.fmu.reset()
        assert {name: slave.get(name)[0] for name in starts} == starts


@pytest.mark.parametrize(
    ("parameter", "config"),
    [
        ({"fall_back": 0.7}, {"faults__fall_back": 0.7}),
        ({"held_temperature": 301.0}, {"thermometer__fixed": 301.0}),
    ],
)
def test_fmu_parameter_changes_controller_setting(loaded, parameter, config):
    target, library = loaded("controller", "double")
    table = controller_inputs(1200)
    table["displacement"][1000:1150] = np.nan  # The missing displacement activates the fall-back command.
    with library.slave() as slave:
        slave.begin().set(use_wanted_force_ahead=True, **parameter)
        found = slave.run(table, ("current",))[:, 0]
    expected, _ = commands(replace(target, controller=changed(target.controller, **config)), table)
    assert np.array_equal(found, expected)
    assert not np.array_equal(expected, commands(target, table)[0])


@pytest.mark.parametrize("name", ["yield_gain", "viscous_gain", "friction_gain"])
def test_fmu_gain_scales_part_of_force(loaded, name):
    target, library = loaded("controller", "double")
    table = controller_inputs(1200)
    with library.slave() as slave:
        slave.begin().set(use_wanted_force_ahead=True, **{name: 0.7})
        found = slave.run(table, ("current",))[:, 0]
    aged = replace(target, controller=target.controller.scaled(**{name: 0.7}))
    assert found == pytest.approx(commands(aged, table)[0], abs=1e-9)


def test_invalid_fmu_parameters_keep_previous_values(loaded):
    _, library = loaded()
    with library.slave() as slave:
        for value in (-0.1, 2.5, math.nan):
            with pytest.raises(FmiError):
                slave.set(fall_back=value)
        assert slave.get("fall_back") == [0.0]
        with pytest.raises(FmiError):
            slave.set(current=1.0)
        assert "current cannot be set" in slave.messages[-1]


# ----------------------------------------------------------------------------- communication steps, instances


@pytest.mark.parametrize("length", [PERIOD, 10.0005 * PERIOD])
def test_communication_step_may_have_several_periods(loaded, length):
    """The length of a communication step may deviate from whole periods by a thousandth of a period."""
    _, library = loaded()
    with library.slave() as slave:
        slave.begin().step(0.0, length)
        assert slave.get("time") == [length]


@pytest.mark.parametrize("length", [0.0, -PERIOD, 1.01 * PERIOD, 40 * PERIOD, math.nan, math.inf, 1e30])
def test_invalid_communication_steps_are_rejected(loaded, length):
    _, library = loaded()
    with library.slave() as slave:
        slave.begin()
        with pytest.raises(FmiError):
            slave.step(0.0, length)
        assert "expected a whole multiple of 0.001 s" in slave.messages[-1]
        slave.step(0.0, PERIOD)


SINE = MOTIONS["sine5mm1Hz"]


def stepped_forces(library, lengths, motion=SINE, **switches):
    """Return times [ms] and forces [N] at the ends of communication steps [ms] for a motion."""
    ends = np.cumsum(lengths)
    found = []
    with library.slave() as slave:
        slave.set(current=1.0, temperature=313.15, **switches)
        slave.begin()
        for end, length in zip(ends, lengths, strict=True):
            now = np.array([PERIOD * (end - length)])
            slave.set(displacement=motion.displacement(now)[0], velocity=motion.velocity(now)[0])
            slave.step(PERIOD * (end - length), PERIOD * length)
            found += slave.get("force")
    return ends, np.array(found)


@pytest.mark.parametrize("use_velocity", [False, True])
@pytest.mark.parametrize(
    "lengths", [[2] * 1000, [5] * 400, [10] * 200, [1, 5] * 330, [10, 1, 1, 3, 7, 2] * 80]
)
def test_long_communication_steps_give_similar_force(loaded, lengths, use_velocity):
    """Communication steps of several periods change the force by less than 1 % of the peak force."""
    _, library = loaded("model")
    _, fine = stepped_forces(library, [1] * 2000, use_velocity=use_velocity)
    ends, coarse = stepped_forces(library, lengths, use_velocity=use_velocity)
    settled = ends > 50  # The velocity at the start is unknown to the FMU.
    error = np.abs(coarse - fine[ends - 1])[settled].max()
    assert error < 0.01 * np.abs(fine).max()


class Ramp:
    """A motion of 50 mm/s for 0.2 s, followed by rest."""

    def displacement(self, t):
        return 0.05 * np.clip(t - 0.2033, 0.0, 0.2)

    def velocity(self, t):
        return 0.05 * ((t > 0.2033) & (t < 0.4033))


@pytest.mark.parametrize("length", [2, 5, 10])
def test_long_communication_steps_keep_final_force(loaded, length):
    """The force after a stop is independent of the step, although the FMU extrapolates the motion."""
    _, library = loaded("model")
    fine, coarse = (
        stepped_forces(library, [step] * (1000 // step), Ramp(), use_velocity=True)[1][-1]
        for step in (1, length)
    )
    assert coarse == pytest.approx(fine, rel=1e-3)


def test_fmu_calls_in_wrong_order_fail(loaded):
    """A step before initialisation, a second initialisation, a step after the end and a wrong GUID fail."""
    _, library = loaded()
    with library.slave() as slave:
        with pytest.raises(FmiError):
            slave.step(0.0, PERIOD)
        slave.begin()
        with pytest.raises(FmiError):
            slave.begin()
        slave.fmu.terminate()
        with pytest.raises(FmiError):
            slave.step(0.0, PERIOD)
    with pytest.raises(Exception, match="instantiate"):
        Slave(library, "one", guid="{00000000-0000-0000-0000-000000000000}")


def test_two_fmu_instances_are_independent(loaded):
    _, library = loaded("both")
    tables = controller_inputs(300, 1), controller_inputs(300, 2)
    gains = (1.0, 0.6)
    alone = []
    for table, gain in zip(tables, gains, strict=True):
        with library.slave() as slave:
            slave.begin().set(damper_yield_gain=gain)
            alone.append(slave.run(table, ("current", "force")))
    with library.slave("one") as one, library.slave("two") as two:
        for slave, gain in zip((one, two), gains, strict=True):
            slave.begin().set(damper_yield_gain=gain)
        for k in range(300):
            for slave, table, expected in zip((one, two), tables, alone, strict=True):
                found = slave.run(table[k : k + 1], ("current", "force"), first=k)[0]
                assert np.array_equal(found, expected[k])
    assert not np.array_equal(alone[0], alone[1])


def test_restored_fmu_state_repeats_outputs(loaded):
    _, library = loaded("both")
    table = controller_inputs(400)
    outputs = ("current", "force", "flags", "time")
    with library.slave() as slave:
        slave.set(damper_yield_gain=0.8, controller_fall_back=0.5)
        slave.begin().run(table[:200], outputs)
        held = slave.fmu.getFMUState()
        expected = slave.run(table[200:], outputs, first=200)
        slave.set(damper_yield_gain=1.3, controller_fall_back=0.0)
        slave.fmu.setFMUState(held)
        slave.fmu.freeFMUState(held)
        assert slave.get("damper_yield_gain")[0] == pytest.approx(0.8, rel=1e-7)
        assert np.array_equal(slave.run(table[200:], outputs, first=200), expected)


LIVES = r"""
#include "fmi2.c"

static int messages;

static void count(fmi2ComponentEnvironment e, fmi2String n, fmi2Status s, fmi2String c, fmi2String m, ...)
{
    (void)e, (void)n, (void)s, (void)c, (void)m;
    messages++;
}

int main(void)
{
    const fmi2CallbackFunctions functions = {count, NULL, NULL, NULL, NULL};
    const fmi2ValueReference inputs[] = {VR_WANTED_FORCE, VR_DISPLACEMENT, VR_TEMPERATURE};
    const double odd[] = {1e300, -1e300, (double)NAN, (double)INFINITY, 0.0, 1e-310};
    for (int life = 0; life < 2000; life++) {
        fmi2Component one = fmi2Instantiate("one", fmi2CoSimulation, FMU_TOKEN, NULL, &functions, 0, 0);
        if (one == NULL) return 1;
        if (fmi2Instantiate("no", fmi2CoSimulation, "another", NULL, &functions, 0, 0) != NULL) return 1;
        if (fmi2EnterInitializationMode(one) || fmi2ExitInitializationMode(one)) return 2;
        for (int k = 0; k < 8; k++) {
            const double values[] = {odd[(life + k) % 6], odd[(life / 6 + k) % 6], odd[(life / 36 + k) % 6]};
            if (fmi2SetReal(one, inputs, 3, values) || fmi2DoStep(one, 1e-3 * k, 1e-3, 0)) return 3;
        }
        fmi2FMUstate state = NULL;
        if (fmi2GetFMUstate(one, &state) || fmi2SetFMUstate(one, state)) return 4;
        if (fmi2FreeFMUstate(one, &state) || fmi2Reset(one)) return 5;
        fmi2FreeInstance(one);
    }
    fmi2FreeInstance(NULL);
    return messages == 2000 ? 0 : 6;
}
"""


@pytest.mark.nightly
@pytest.mark.parametrize("precision", one_by_day(["float", "double"]))
def test_sanitizers_find_no_error_in_fmu_wrapper(tmp_path, card, tool, precision):
    """Extreme inputs to 2000 FMU instances cause no memory leak, invalid access or undefined conversion."""
    write_sources(target_of(card, precision=precision), tmp_path)
    (tmp_path / "lives.c").write_text(LIVES, encoding="ascii")
    sanitized = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-g"]
    command = [tool("gcc"), "-std=c99", "-O1", *sanitized, "lives.c", "damper_tables.c", "-o", "lives"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "lives"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


# ------------------------------------------------------------------------------------------ verification


def test_fmu_requires_verified_sources(tmp_path, card):
    target = target_of(card, content="controller")
    failed = replace(passed_verification(target), passed=False, problems=("current is not finite",))
    with pytest.raises(InputError, match=r"\(current is not finite\)"):
        write_fmu(target, tmp_path / "damper.fmu", verification=failed)
    other = passed_verification(target_of(card, content="controller", period_s=2e-3))
    with pytest.raises(InputError, match="the verification is of other sources"):
        write_fmu(target, tmp_path / "damper.fmu", verification=other)
    assert list(tmp_path.iterdir()) == []
