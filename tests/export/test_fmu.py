"""The FMUs: what masters make of them, and that they compute what Python computes."""

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
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.codegen.c_code import c_files
from mrdamper.codegen.fmu import fmu_files, write_fmu
from mrdamper.codegen.kernel_files import flag_texts
from mrdamper.codegen.target import target_of
from mrdamper.codegen.variables import _SAID, variables_of
from mrdamper.codegen.verify import FLAGS, WARNINGS, not_verified, verify_c
from mrdamper.control.stepper import Flag
from mrdamper.errors import InputError
from mrdamper.models.card_schema import read_card
from tests.control.dampers import changed
from tests.export.masters import (
    FmiRefusal,
    FmuController,
    Library,
    Slave,
    believed,
    fmpy,
    resident_bytes,
    table_of,
    written,
)
from tests.support.examples import examples
from tests.support.tiers import one_by_day
from tests.support.tracked import write_a_card

VALIDATION = import_module("fmpy.validation")

PERIOD = 1e-3
VERSIONS = ("2.0", "3.0")
BOTH = pytest.mark.parametrize("version", VERSIONS)
EACH = pytest.mark.parametrize(("version", "precision"), [("2.0", "float"), ("3.0", "double")])


@pytest.fixture(scope="session")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("fmu")


@pytest.fixture(scope="session")
def card(place):
    return read_card(write_a_card(place / "card.json"))


@pytest.fixture(scope="session")
def made(place, card, tool):
    """Return a function that gives the target and the FMU of a choice, each written once."""
    tool("gcc")
    known = {}

    def make(version="3.0", content="controller", precision="double", controller="recommended"):
        choice = (version, content, precision, controller)
        if choice not in known:
            target = target_of(card, content=content, precision=precision, controller=controller)
            path = written(target, place / ("-".join(choice) + ".fmu"), version)
            known[choice] = target, path
        return known[choice]

    return make


@pytest.fixture(scope="session")
def loaded(made, place):
    """Return a function that gives the target and the loaded FMU of a choice."""
    known = {}

    def load(*choice, **more):
        target, path = made(*choice, **more)
        if path not in known:
            known[path] = Library(path, place / path.stem)
        return target, known[path]

    return load


def motion(count=1500, seed=1):
    """Return a damper's motion: time, displacement, velocity, with reversals and a pause in it."""
    t = PERIOD * np.arange(count)
    x = 8e-3 * np.sin(2 * np.pi * 1.3 * t) + 2e-3 * np.sin(2 * np.pi * 4.1 * t + seed)
    v = np.gradient(x, PERIOD)
    return t, x, v


def of_controller(count=1500, seed=1):
    t, x, v = motion(count, seed)
    wanted = 600.0 * np.tanh(v / 0.02)
    warm = 320.0 + 30.0 * t / t[-1]
    ahead = np.roll(wanted, -15)
    return table_of(time=t, wanted_force=wanted, wanted_force_ahead=ahead, displacement=x, temperature=warm)


def of_model(count=1500, seed=1):
    t, x, v = motion(count, seed)
    current = 1.0 + np.sin(2 * np.pi * 0.7 * t + seed)
    warm = 320.0 + 30.0 * t / t[-1]
    return table_of(time=t, displacement=x, velocity=v, current=current, temperature=warm)


def commands(target, table):
    """Return what the controller gives in Python: commands and flags."""
    nothing = np.full(len(table), np.nan)
    told = [table[name] for name in ("wanted_force", "wanted_force_ahead", "displacement", "temperature")]
    controller = target.controller
    _, current, flags = controller.run(controller.start(), np.column_stack([*told, nothing]))
    return current, flags


def forces(target, table):
    told = [table[name] for name in ("displacement", "velocity", "current", "temperature")]
    _, force, flags = target.model.run(target.model.start(), np.column_stack(told))
    return force, flags


# ---------------------------------------------------------------------------------------- what is inside


@pytest.mark.nightly
@BOTH
@pytest.mark.parametrize("content", ["model", "controller", "both"])
@pytest.mark.parametrize("precision", ["float", "double"])
def test_fmpy_finds_nothing_wrong(made, version, content, precision):
    _, path = made(version, content, precision)
    assert VALIDATION.validate_fmu(str(path)) == []


@pytest.mark.system
@pytest.mark.parametrize(
    "controller", one_by_day(["recommended-causal", "recommended-observer", "paper", "pi"])
)
def test_fmpy_finds_nothing_wrong_with_any_controller(made, controller):
    _, path = made("3.0", controller=controller)
    assert VALIDATION.validate_fmu(str(path)) == []


@pytest.mark.system
def test_a_card_in_volts_has_a_voltage(place, card, tool):
    tool("gcc")
    damper = replace(card.damper, command_unit="V")
    target = target_of(replace(card, damper=damper), precision="double")
    path = written(target, place / "volts.fmu", "3.0")
    variables = {each.name: each for each in fmpy.read_model_description(str(path)).modelVariables}
    assert VALIDATION.validate_fmu(str(path)) == []
    assert variables["voltage"].unit == "V"
    assert "current" not in variables


@EACH
def test_every_real_variable_has_a_unit_and_a_temperature_is_shown_in_celsius(made, version, precision):
    _, path = made(version, "both", precision)
    description = fmpy.read_model_description(str(path))
    reals = [each for each in description.modelVariables if each.type in {"Real", "Float64"}]
    assert all(each.unit for each in reals)
    (kelvin,) = [unit for unit in description.unitDefinitions if unit.name == "K"]
    (celsius,) = kelvin.displayUnits
    assert celsius.name == "degC"
    assert float(celsius.factor) * 293.15 + float(celsius.offset) == pytest.approx(20.0)
    warm = [each for each in reals if each.unit == "K"]
    assert len(warm) >= 5
    assert {each.displayUnit for each in warm} == {"degC"}


@EACH
def test_it_says_what_it_can(made, version, precision):
    target, path = made(version, precision=precision)
    description = fmpy.read_model_description(str(path))
    can = description.coSimulation
    assert float(description.defaultExperiment.stepSize) == target.period_s
    assert not can.canBeInstantiatedOnlyOncePerProcess
    assert can.canGetAndSetFMUstate
    assert can.canSerializeFMUstate
    assert not can.canHandleVariableCommunicationStepSize
    if version == "3.0":
        assert float(can.fixedInternalStepSize) == target.period_s


@pytest.mark.system
@EACH
def test_the_same_target_gives_the_same_bytes_and_another_one_another_token(
    made, place, card, version, precision
):
    target, path = made(version, precision=precision)
    again = written(target, place / f"again-{version}.fmu", version)
    assert hashlib.sha256(path.read_bytes()).digest() == hashlib.sha256(again.read_bytes()).digest()
    others = (
        target_of(card, content="controller", period_s=2e-3),
        replace(target, fingerprint="sha256:0123456"),
    )
    tokens = {_token(each, version) for each in (target, *others)}
    assert len(tokens) == 3


def _token(target, version):
    found = re.search(r'FMU_TOKEN "(.*)"', fmu_files(target, version=version)["sources/fmu_variables.h"])
    assert found is not None
    return found[1]


@EACH
def test_the_sources_that_were_verified_are_the_sources_inside(made, version, precision):
    target, path = made(version, "both", precision)
    with zipfile.ZipFile(path) as archive:
        inside = {
            Path(name).name: archive.read(name) for name in archive.namelist() if name[:8] == "sources/"
        }
    kernel = {name: text for name, text in c_files(target).items() if name.endswith((".c", ".h"))}
    del kernel["main.c"]
    assert {name: inside[name].decode() for name in kernel} == kernel


@pytest.mark.nightly
@BOTH
@pytest.mark.parametrize("content", ["model", "controller", "both"])
@pytest.mark.parametrize("precision", ["float", "double"])
def test_the_wrapper_compiles_without_a_warning(tmp_path, card, tool, version, content, precision):
    target = target_of(card, content=content, precision=precision)
    for name, text in fmu_files(target, version=version).items():
        (tmp_path / Path(name).name).write_text(text, encoding="utf-8")
    entry = "fmi2.c" if version == "2.0" else "fmi3.c"
    command = [tool("gcc"), *FLAGS, *WARNINGS, "-c", entry, "-o", "entry.o"]
    if content != "both":  # that has all there is; optimising takes its time
        command.append("-O0")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.system
@BOTH
def test_with_a_prefix_every_function_has_it(tmp_path, card, tool, version):
    """Several FMUs can be linked into one program."""
    target = target_of(card, content="controller")
    for name, text in fmu_files(target, version=version).items():
        (tmp_path / Path(name).name).write_text(text, encoding="utf-8")
    fmi = f"fmi{version[0]}"
    prefix = f"-DFMI{version[0]}_FUNCTION_PREFIX=damper_"
    command = [tool("gcc"), *FLAGS, "-O0", "-fno-pie", prefix, "-c", f"{fmi}.c", "-o", "o.o"]
    subprocess.run(command, cwd=tmp_path, check=True)
    listed = subprocess.run([tool("nm"), "o.o"], cwd=tmp_path, capture_output=True, text=True, check=True)
    outside = [line.split()[-1] for line in listed.stdout.splitlines() if " T " in line]
    assert f"damper_{fmi}DoStep" in outside
    assert all(name.startswith("damper_") for name in outside)
    writable = [line for line in listed.stdout.splitlines() if line.split()[-2] in "bBdDC"]
    assert writable == []  # no state outside an instance


def test_every_flag_of_the_kernel_is_said_in_words():
    assert {each.name.removeprefix("MRD_") for each in flag_texts()} == set(_SAID)


# ------------------------------------------------------------------------------------------ what it computes


@EACH
def test_a_controller_in_simulate_fmu_is_the_direct_call_to_the_bit(made, version, precision):
    target, path = made(version, "controller", precision)
    table = of_controller()
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=table["time"][-1] + PERIOD,
        output_interval=PERIOD,
        start_values={"use_wanted_force_ahead": True},
        input=table,
        output=["current", "flags"],
    )
    current, flags = commands(target, table)
    assert np.array_equal(found["current"][1:], current)
    assert np.array_equal(found["flags"][1:], flags)
    assert current.max() > 0.5


@EACH
def test_a_damper_in_simulate_fmu_is_the_direct_call_to_the_bit(made, version, precision):
    target, path = made(version, "model", precision)
    table = of_model()
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=table["time"][-1] + PERIOD,
        output_interval=PERIOD,
        start_values={"use_velocity": True},
        input=table,
        output=["force", "flags", "applied_current"],
    )
    force, flags = forces(target, table)
    assert np.array_equal(found["force"][1:], force)
    assert np.array_equal(found["flags"][1:], flags)
    assert np.abs(force).max() > 500.0
    assert 1.5 < found["applied_current"].max() <= 2.0


@EACH
def test_both_in_one_is_the_controller_driving_the_damper(loaded, version, precision):
    """The damper feels, through a period, what the controller gave at its begin."""
    target, library = loaded(version, "both", precision)
    table = of_controller()
    current, _ = commands(target, table)
    _, _, velocity = motion()
    driven = np.column_stack(
        [table["displacement"], velocity, np.concatenate([[0.0], current[:-1]]), table["temperature"]]
    )
    _, force, _ = target.model.run(target.model.start(), driven)
    told = table_of(velocity=velocity, **{name: table[name] for name in table.dtype.names})
    with library.slave() as slave:
        slave.set(use_velocity=True, use_wanted_force_ahead=True)
        found = slave.begin().run(told, ("current", "force"))
    assert np.array_equal(found[:, 0], current)
    assert np.array_equal(found[:, 1], force)


def test_both_in_one_can_be_driven_by_a_current_that_is_given(loaded):
    target, library = loaded("3.0", "both")
    table = of_model(800)
    with library.slave() as slave:
        slave.set(use_velocity=True, use_given_current=True)
        slave.begin()
        given = {name.replace("current", "given_current"): table[name] for name in table.dtype.names}
        found = slave.run(table_of(**given), ("force",))
    assert np.array_equal(found[:, 0], forces(target, table)[0])


@pytest.mark.nightly
@EACH
def test_compiled_from_its_sources_it_is_the_same(made, place, tool, version, precision):
    tool("cmake")
    target, path = made(version, "controller", precision)
    folder = place / f"built-{version}-{precision}"
    fmpy.extract(str(path), unzipdir=str(folder))
    (binary,) = folder.glob("binaries/*/damper.so")
    shipped = binary.read_bytes()
    binary.unlink()
    (place / f"objects-{version}-{precision}").mkdir()
    import_module("fmpy.build").build_platform_binary(
        folder, build_dir=place / f"objects-{version}-{precision}"
    )
    assert binary.exists()
    assert binary.read_bytes() != shipped  # another compiler's options: it was built
    table = of_controller()
    found = fmpy.simulate_fmu(
        str(folder),
        stop_time=table["time"][-1] + PERIOD,
        output_interval=PERIOD,
        start_values={"use_wanted_force_ahead": True},
        input=table,
        output=["current"],
    )
    assert np.array_equal(found["current"][1:], commands(target, table)[0])


@pytest.mark.parametrize("precision", ["float", "double"])
def test_a_second_master_gets_the_same(made, precision):
    """The Open Simulation Platform's master, which is C++ and shares nothing with FMPy."""
    cosim = {
        name: getattr(pytest.importorskip(f"libcosimpy.Cosim{name}"), kind)
        for name, kind in (
            ("Execution", "CosimExecution"), ("Manipulator", "CosimManipulator"),
            ("Observer", "CosimObserver"), ("Slave", "CosimLocalSlave"),
        )
    }  # fmt: skip
    target, path = made("2.0", "controller", precision)
    references = {
        each.name: each.valueReference for each in fmpy.read_model_description(str(path)).modelVariables
    }
    execution = cosim["Execution"].from_step_size(round(1e9 * PERIOD))
    slave = execution.add_local_slave(cosim["Slave"](fmu_path=str(path), instance_name="one"))
    setter, observer = cosim["Manipulator"].create_override(), cosim["Observer"].create_last_value()
    execution.add_manipulator(setter)
    execution.add_observer(observer)
    execution.boolean_initial_value(slave, references["use_wanted_force_ahead"], value=True)
    table = of_controller(1000)
    inputs = table.dtype.names[1:]
    found = []
    for row in table:
        setter.slave_real_values(slave, [references[name] for name in inputs], [row[name] for name in inputs])
        execution.step()
        found.append(observer.last_real_values(slave, [references["current"]])[0])
    current, _ = commands(target, table)
    assert np.abs(np.array(found) - current).max() <= 1e-12
    assert current.max() > 0.5


# ------------------------------------------------------------------------------- start values and tuning


@EACH
@pytest.mark.parametrize("content", ["model", "controller", "both"])
def test_what_an_instance_starts_with_is_what_the_xml_says(loaded, version, content, precision):
    """A master that does not push the start values runs on the same ones."""
    _, library = loaded(version, content, precision)
    said = {each.name: each.start for each in library.variables.values() if each.start is not None}
    said |= {name: {"true": 1.0, "false": 0.0}.get(str(value), value) for name, value in said.items()}
    with library.slave() as slave:
        for name, value in said.items():
            assert slave.get(name) == [float(value)], name
        slave.set(**_moved(library))
        slave.fmu.reset()
        for name, value in said.items():
            assert slave.get(name) == [float(value)], name
    assert len(said) > 8


def _moved(library):
    """Return a value that is not its start for everything that can be set."""
    moved: dict[str, float] = {}
    for name, each in library.variables.items():
        if each.causality in {"input", "parameter"}:
            start = {"true": 1.0, "false": 0.0}.get(str(each.start))
            if start is not None:
                moved[name] = int(1.0 - start)
            else:
                most = float(each.max) if each.max is not None else math.inf
                moved[name] = min(float(each.start) + 0.125, most) if float(each.start) < most else most / 2.0
    return moved


@pytest.mark.parametrize(
    ("tuned", "number"),
    [
        ({"fall_back": 0.7}, {"faults__fall_back": 0.7}),
        ({"clamp_margin": -1.0}, {"inverse__margin": -1.0}),
        ({"reach": 0.25}, {"inverse__compensation": 0.25}),
        ({"held_temperature": 301.0}, {"thermometer__held": 301.0}),
    ],
)
def test_a_tuned_parameter_is_the_kernels_number(loaded, tuned, number):
    target, library = loaded("3.0")
    table = of_controller(1200)
    table["displacement"][1000:1150] = np.nan  # so that the fall-back is given, too
    altered = changed(target.controller, **number)
    with library.slave() as slave:
        slave.begin().set(use_wanted_force_ahead=True, **tuned)
        found = slave.run(table, ("current",))[:, 0]
    expected, _ = commands(replace(target, controller=altered), table)
    assert np.array_equal(found, expected)
    assert not np.array_equal(expected, commands(target, table)[0])


@pytest.mark.system
@pytest.mark.parametrize("reckons", one_by_day([True, False]))
def test_a_temperature_that_stands_still_is_carried_on_where_that_is_asked_for(made, place, reckons):
    """A damper that warms by two kelvin with every joule: soon a constant reading cannot be true."""
    light, _ = made("3.0")
    light = replace(
        light,
        controller=changed(
            light.controller, heating__capacity=0.5, heating__loss=0.0, heating__extrapolate=reckons
        ),
    )
    library = Library(written(light, place / f"light-{reckons}.fmu", "3.0"), place / f"light-{reckons}")
    table = of_controller(1500)
    table["temperature"] = 320.0
    for asked in (reckons, not reckons):
        expected, flags = commands(
            replace(light, controller=changed(light.controller, heating__extrapolate=asked)), table
        )
        with library.slave() as slave:
            assert slave.get("reckon_temperature") == [reckons]
            slave.set(reckon_temperature=asked)
            slave.begin().set(use_wanted_force_ahead=True)
            found = slave.run(table, ("current", "flag_frozen_temperature"))
        assert np.array_equal(found[:, 0], expected)
        assert np.array_equal(found[:, 1] > 0.5, (flags & Flag.FROZEN_TEMPERATURE) > 0)
        assert found[-1, 1] == 1.0


@pytest.mark.parametrize("name", ["yield_gain", "viscous_gain", "friction_gain"])
def test_a_gain_is_that_of_an_aged_damper(loaded, name):
    target, library = loaded("3.0")
    table = of_controller(1200)
    with library.slave() as slave:
        slave.begin().set(use_wanted_force_ahead=True, **{name: 0.7})
        found = slave.run(table, ("current",))[:, 0]
    aged = replace(target, controller=target.controller.scaled(**{name: 0.7}))
    expected, _ = commands(aged, table)
    assert found == pytest.approx(expected, abs=1e-9)
    assert np.abs(expected - commands(target, table)[0]).max() > 1e-3


@BOTH
def test_a_value_that_is_out_of_its_range_is_refused_and_the_old_one_kept(loaded, version):
    _, library = loaded(version, "controller", "float")
    with library.slave() as slave:
        for value in (-0.1, 2.5, math.nan):
            with pytest.raises(FmiRefusal):
                slave.set(fall_back=value)
        assert slave.get("fall_back") == [0.0]
        assert any("fall_back is 2.5; expected 0 to 2. The old value is kept" in text for text in slave.said)
        with pytest.raises(FmiRefusal):
            slave.set(current=1.0)
        assert "current cannot be set" in slave.said[-1]


@EACH
def test_readings_that_are_no_numbers_raise_the_flags_and_the_command_stays_inside(
    loaded, version, precision
):
    _, library = loaded(version, "controller", precision)
    rng = np.random.default_rng(3)
    table = of_controller(600)
    for name in table.dtype.names[1:]:
        for bad in (np.nan, np.inf, -np.inf, 1e300):
            table[name][rng.random(len(table)) < 0.04] = bad
    outputs = ("current", "flags", "fault", "flag_no_displacement", "flag_no_temperature", "flag_no_target")
    with library.slave() as slave:
        slave.begin().set(use_wanted_force_ahead=True)
        found = slave.run(table, outputs)
    assert np.isfinite(found).all()
    assert found[:, 0].min() >= 0.0
    assert found[:, 0].max() <= 2.0
    lost = ~(np.abs(table["displacement"]) < 1.0)
    assert np.array_equal(found[:, 3], lost)
    assert np.array_equal(found[:, 5], ~(np.abs(table["wanted_force"]) < 1e7))
    assert found[lost, 2].all()
    bits = found[:, 1].astype(int)
    assert np.array_equal(found[:, 3], (bits & Flag.NO_DISPLACEMENT) > 0)
    assert np.array_equal(found[:, 4], (bits & Flag.NO_TEMPERATURE) > 0)


# ------------------------------------------------------------------------------------ steps and instances


@BOTH
@examples(60)
@given(count=st.integers(1, 40), off=st.floats(-0.02, 0.02))
def test_a_step_is_taken_within_a_thousandth_and_else_refused(loaded, version, count, off):
    _, library = loaded(version)
    with library.slave() as slave:
        slave.begin()
        before = slave.state()
        if abs(off) < 0.999e-3:
            slave.step(0.0, (count + off) * PERIOD)
            assert slave.get("time") == [(count + off) * PERIOD]
        elif abs(off) > 1.001e-3:
            with pytest.raises(FmiRefusal):
                slave.step(0.0, (count + off) * PERIOD)
            assert "expected a whole multiple of 0.001 s" in slave.said[-1]
            assert slave.state() == before


@BOTH
@pytest.mark.parametrize("length", [0.0, -PERIOD, 1e-4, math.nan, math.inf, 1e30])
def test_a_step_that_is_none_is_refused(loaded, version, length):
    _, library = loaded(version)
    with library.slave() as slave:
        slave.begin()
        with pytest.raises(FmiRefusal):
            slave.step(0.0, length)
        slave.step(0.0, PERIOD)  # and the instance goes on


@BOTH
def test_a_long_step_is_so_many_short_ones_with_the_inputs_held(loaded, version):
    _, library = loaded(version)
    table = of_controller(60)
    with library.slave() as slave, library.slave("two") as other:
        for each in (slave, other):
            each.begin().set(use_wanted_force_ahead=True)
        slave.run(np.repeat(table[::10], 10), ("current",))
        for k in range(0, 60, 10):
            other.set(**{name: float(table[k][name]) for name in table.dtype.names[1:]})
            other.step(k * PERIOD, 10 * PERIOD)
        assert other.get("current", "model_force") == slave.get("current", "model_force")


@BOTH
def test_calls_out_of_order_are_refused(loaded, version):
    _, library = loaded(version)
    with library.slave() as slave:
        with pytest.raises(FmiRefusal):
            slave.step(0.0, PERIOD)
        assert slave.said == ["a step while instantiated; expected while stepping"]
        slave.begin()
        with pytest.raises(FmiRefusal):
            slave.begin()
        slave.fmu.terminate()
        with pytest.raises(FmiRefusal):
            slave.step(0.0, PERIOD)


@BOTH
def test_the_xml_of_another_fmu_makes_no_instance(loaded, version):
    _, library = loaded(version)
    with pytest.raises(Exception, match="instantiate"):
        Slave(library, "one", guid="{00000000-0000-0000-0000-000000000000}")


@BOTH
def test_two_instances_in_one_process_do_not_touch_each_other(loaded, version):
    _, library = loaded(version, "both", "float")
    tables = of_controller(300, 1), of_controller(300, 2)
    alone = []
    for table, gain in zip(tables, (1.0, 0.6), strict=True):
        with library.slave() as slave:
            slave.begin().set(damper_yield_gain=gain)
            alone.append(slave.run(table, ("current", "force")))
    with library.slave("one") as one, library.slave("two") as two:
        two.begin().set(damper_yield_gain=0.6)
        one.begin()
        together: tuple[list[object], list[object]] = ([], [])
        for k in range(300):
            for slave, table, found in zip((one, two), tables, together, strict=True):
                found.append(slave.run(table[k : k + 1], ("current", "force"), first=k)[0])
    for found, expected in zip(together, alone, strict=True):
        assert np.array_equal(np.array(found), expected)
    assert not np.array_equal(alone[0], alone[1])


@EACH
def test_a_state_that_is_set_back_or_carried_over_goes_on_the_same_way(loaded, version, precision):
    _, library = loaded(version, "both", precision)
    table = of_controller(400)
    outputs = ("current", "force", "flags", "time")
    with library.slave() as slave:
        slave.set(damper_yield_gain=0.8, controller_fall_back=0.5)
        slave.begin().run(table[:200], outputs)
        held, packed = slave.fmu.getFMUState(), slave.state()
        expected = slave.run(table[200:], outputs, first=200)
        slave.set(damper_yield_gain=1.3, controller_fall_back=0.0)
        slave.fmu.setFMUState(held)
        slave.fmu.freeFMUState(held)
        assert slave.get("damper_yield_gain")[0] == pytest.approx(0.8, rel=1e-7)
        assert np.array_equal(slave.run(table[200:], outputs, first=200), expected)
        with library.slave("two") as other:
            other.restore(packed)
            assert other.state() == packed
            assert np.array_equal(other.run(table[200:], outputs, first=200), expected)


@BOTH
def test_a_state_of_another_fmu_is_refused(loaded, version):
    _, library = loaded(version)
    _, foreign = loaded(version, "model")
    with foreign.slave() as other:
        stranger = other.state()
    with library.slave() as slave:
        own = slave.state()
        for state in (stranger, own[:-1], bytes([own[0] ^ 1]) + own[1:], b""):
            with pytest.raises(FmiRefusal):
                slave.restore(state)
            assert slave.said[-1] == "the serialised state is not one of this FMU"


@BOTH
def test_two_thousand_lives_leave_no_memory_behind(loaded, version):
    _, library = loaded(version, "both")
    slave = library.slave()

    def live(times):
        for _ in range(times):
            slave.begin()
            slave.step(0.0, PERIOD)
            slave.restore(slave.state())
            slave.fmu.reset()
            slave.free()
            if library.is_2:
                slave.fmu.instantiate(callbacks=slave._callbacks)
            else:
                slave.fmu.instantiate()

    live(200)
    grown = []
    for _ in range(3):  # what Python itself takes comes once, a leak every time
        before = resident_bytes()
        live(700)
        grown.append(resident_bytes() - before)
    assert min(grown) < 100_000  # an instance has 10 kB: a leak of one in 50 would show
    slave.free()


LIVES = r"""
#include "fmi2.c"

static int said;

static void hear(fmi2ComponentEnvironment e, fmi2String n, fmi2Status s, fmi2String c, fmi2String m, ...)
{
    (void)e, (void)n, (void)s, (void)c, (void)m;
    said++;
}

int main(void)
{
    const fmi2CallbackFunctions functions = {hear, NULL, NULL, NULL, NULL};
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
        fmi2FMUstate state = NULL, copy = NULL;
        size_t size = 0;
        static char bytes[100000];
        if (fmi2GetFMUstate(one, &state) || fmi2SerializedFMUstateSize(one, state, &size)) return 4;
        if (size > sizeof bytes || fmi2SerializeFMUstate(one, state, bytes, size)) return 5;
        if (fmi2DeSerializeFMUstate(one, bytes, size, &copy) || fmi2SetFMUstate(one, copy)) return 6;
        if (fmi2FreeFMUstate(one, &state) || fmi2FreeFMUstate(one, &copy) || fmi2Reset(one)) return 7;
        fmi2FreeInstance(one);
    }
    fmi2FreeInstance(NULL);
    return said == 2000 ? 0 : 8;
}
"""


@pytest.mark.nightly
@pytest.mark.parametrize("precision", one_by_day(["float", "double"]))
def test_two_thousand_lives_under_the_sanitizers(tmp_path, card, tool, precision):
    """No leak, no access outside, no undefined conversion, whatever the inputs are."""
    target = target_of(card, precision=precision)
    for name, text in fmu_files(target, version="2.0").items():
        (tmp_path / Path(name).name).write_text(text, encoding="utf-8")
    (tmp_path / "lives.c").write_text(LIVES, encoding="ascii")
    sanitized = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-g"]
    command = [tool("gcc"), "-std=c99", "-O1", *sanitized, "lives.c", "damper_tables.c", "-o", "lives"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "lives"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


# ------------------------------------------------------------------------------------------- what is refused


@pytest.fixture
def target(card):
    return target_of(card, content="controller")


def test_a_source_that_was_not_verified_is_refused(tmp_path, target):
    path = tmp_path / "damper.fmu"
    with pytest.raises(InputError, match="damper: the C source is not verified"):
        write_fmu(target, path, verification=not_verified(target))
    failed = replace(believed(target), passed=False, problems=("controller.current is not finite",))
    with pytest.raises(InputError, match=r"\(controller\.current is not finite\)"):
        write_fmu(target, path, verification=failed)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.system
@pytest.mark.parametrize("other", [{"precision": "double"}, {"period_s": 2e-3}, {"controller": "paper"}])
def test_a_record_of_other_sources_is_refused(tmp_path, card, target, other):
    verification = believed(target_of(card, **{"content": "controller", **other}))
    with pytest.raises(InputError, match="the verification holds for other sources"):
        write_fmu(target, tmp_path / "damper.fmu", verification=verification)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.system
def test_a_record_of_a_real_check_is_taken(tmp_path, target, tool):
    tool("gcc")
    verification = verify_c(target, samples=2000)
    write_fmu(target, tmp_path / "damper.fmu", verification=verification)
    with zipfile.ZipFile(tmp_path / "damper.fmu") as archive:
        assert b'"passed": true' in archive.read("documentation/verification.json")


@pytest.mark.system
def test_a_place_that_cannot_be_written_to_is_one_message(tmp_path, target, tool):
    tool("gcc")
    with pytest.raises(InputError, match=r"damper\.fmu: cannot write: there is no folder .*nowhere; choose"):
        write_fmu(target, tmp_path / "nowhere" / "damper.fmu", verification=believed(target))
    (tmp_path / "taken.fmu").mkdir()
    with pytest.raises(InputError, match=r"taken\.fmu: cannot write: Is a directory; choose another folder"):
        write_fmu(target, tmp_path / "taken.fmu", verification=believed(target))
    assert [each.name for each in tmp_path.iterdir()] == ["taken.fmu"]


def test_a_version_that_is_not_there_is_one_message(tmp_path, target):
    with pytest.raises(InputError, match=r"FMI version is '1\.0'; expected one of 2\.0, 3\.0"):
        write_fmu(target, tmp_path / "a.fmu", version="1.0", verification=believed(target))  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------------ round trip


@pytest.mark.system
@EACH
def test_in_the_tracking_loop_the_fmu_has_the_rows_of_mrdamper_track(
    loaded, place, monkeypatch, version, precision
):
    """The card's controller and its FMU, sample by sample against the virtual rig's physics."""
    from mrdamper.jobs import track
    from mrdamper.jobs.options import TrackOptions
    from mrdamper.registry import JOBS

    options = TrackOptions(temperatures_degC=(60.0,), controllers=("recommended",))
    given = {"card": place / "card.json", "targets": ["sine-900N-1Hz"]}

    def rows_of_track() -> dict[str, object]:
        rows = cast(list[dict[str, object]], JOBS["track"].perform(given, options)[1]["rows"])
        assert len(rows) == 1
        return rows[0]

    def row_of(controller):
        with monkeypatch.context() as patch:
            patch.setattr(track, "controllers_for", lambda *_, **__: {"recommended": controller})
            return rows_of_track()

    printed = rows_of_track()
    target, library = loaded(version, "controller", precision)
    with library.slave() as slave:
        found = row_of(FmuController(slave, target.controller))
    assert found == row_of(target.controller)
    if precision == "double":
        assert found == printed
    numbers = {name: value for name, value in printed.items() if isinstance(value, float)}
    assert {name: found[name] for name in numbers} == pytest.approx(numbers, rel=1e-4)


@pytest.mark.system
def test_the_variables_have_names_of_their_own(card):
    for content in ("model", "controller", "both"):
        names = [each.name for each in variables_of(target_of(card, content=content))]
        assert len(names) == len(set(names))
