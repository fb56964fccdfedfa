"""The verification of an export passes correct code and fails if one bit of a result changes."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.codegen import verify
from mrdamper.codegen.c_code import c_files, sources_sha256
from mrdamper.codegen.target import target_of
from mrdamper.codegen.verification_rows import envelope_rows
from mrdamper.codegen.verify import compare, difference, replay, round_rows, verify_c
from mrdamper.control.tables.heating import Heating
from mrdamper.errors import CheckError
from mrdamper.models.actuation import Actuation
from tests.export.exports import STRICT, a_target, card_of, ran, write
from tests.support.cards import CHAIN, DAMPERS, DOUBLE
from tests.support.tiers import one_by_day

pytestmark = pytest.mark.system

SHORT = 6000  # Number of samples


@pytest.fixture(autouse=True)
def _compiler(tool):
    tool("gcc")


# ------------------------------------------------------------------------------ comparison with Python


def assert_same_bits(target, samples=SHORT):
    record = verify_c(target, samples=samples)
    assert record.passed, record.problems
    assert record.max_ulp == 0
    return record


@pytest.mark.nightly
@pytest.mark.parametrize("law", one_by_day(["series-valve", *DAMPERS], 2))
def test_exported_law_equals_python(law):
    assert_same_bits(a_target(law))


@pytest.mark.parametrize("damper", one_by_day([CHAIN, DOUBLE]))
def test_exported_actuation_equals_python(damper):
    lags = Actuation(0.004, 0.001, 0.002, 0.003, largest_command=2.0, hysteresis_width_A=0.05)
    lags = replace(lags, freewheel_time_s=0.04, saturation=0.9, wide_hysteresis_width_A=0.15)
    assert_same_bits(target_of(card_of(replace(damper, actuation=lags))))


@pytest.mark.nightly
@pytest.mark.parametrize("controller", ["paper", "recommended-causal", "recommended-observer", "pi"])
def test_exported_controller_equals_python(controller):
    assert_same_bits(a_target("bouc-wen", content="controller", controller=controller))


@pytest.mark.nightly
@pytest.mark.parametrize(
    "target",
    [{"period_s": 5e-3}, {"period_s": 1e-4}, {"content": "model", "precision": "double"}],
    ids=["slow", "fast", "double"],
)
def test_exports_with_other_sampling_periods_equal_python(target):
    assert_same_bits(a_target(**target))


@pytest.mark.nightly
def test_export_in_volts_equals_python():
    assert_same_bits(target_of(card_of(replace(DOUBLE, command_unit="V"))))


@pytest.mark.nightly
def test_verification_inputs_set_all_sensor_flags():
    """The inputs of a verification with the default number of samples contain every kind of fault."""
    record = assert_same_bits(a_target(), 100_000)
    both = {
        "NO_DISPLACEMENT", "FROZEN", "MOTION_UNKNOWN", "NO_TEMPERATURE", "TEMPERATURE_JUMP",
        "NOMINAL_TEMPERATURE", "OUTSIDE_MOTION", "OUTSIDE_TEMPERATURE", "SATURATED",
    }  # fmt: skip
    assert both | {"NO_CURRENT", "NO_VELOCITY"} <= set(record.flags_raised["model"])
    assert both | {"NO_TARGET", "INFEASIBLE"} <= set(record.flags_raised["controller"])


def test_verification_inputs_set_stuck_thermometer_flag():
    """A light damper under a high load warms quickly, but its temperature reading is constant."""
    light = Heating(capacity_J_K=2.0, loss_W_K=0.01, resistance_20_ohm=5.0)
    record = assert_same_bits(target_of(card_of(DOUBLE), heating=light), 3 * SHORT)
    for part in ("model", "controller"):
        assert record.flags_raised[part]["FROZEN_TEMPERATURE"] > 0


SANITIZE = ("-O1", "-g", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")


@pytest.mark.parametrize("flags", one_by_day([("-O3",), ("-O0",), SANITIZE]))
def test_compiler_options_do_not_change_export_results(flags, tool, tmp_path):
    """The sanitizers also report no invalid access and no undefined operation."""
    target = a_target()
    write(target, tmp_path)
    units = ["damper.c", "damper_tables.c", "main.c"]
    ran(tool("gcc"), *STRICT, *flags, *units, "-o", "replay", cwd=tmp_path)
    rows = round_rows(target, envelope_rows(target, SHORT, 2))
    outputs, problems, _ = compare(target, rows, replay(target, [tmp_path / "replay"], rows, tmp_path))
    assert problems == []
    assert all(each.samples_differing == 0 for each in outputs.values())


# ------------------------------------------------------------------------------------------ wrong code


def change_source(monkeypatch, name, old, new):
    """Make the verification compile sources with one replaced text."""

    def files(target):
        sources = c_files(target)
        assert old in sources[name]
        return sources | {name: sources[name].replace(old, new, 1)}

    monkeypatch.setattr(verify, "c_files", files)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("damper_tables.c", ".largest = 2.0f", ".largest = 2.0000002f"),
        ("track_estimate.h", "*v += h * a;", "*v = h * a + *v * R(1.0000001);"),
    ],
    ids=["table", "arithmetic"],
)
def test_verification_fails_if_last_bit_changes(monkeypatch, name, old, new):
    change_source(monkeypatch, name, old, new)
    record = verify_c(a_target(content="model"), samples=SHORT)
    assert not record.passed
    assert record.max_ulp > 0


def test_verification_fails_on_compiler_warning(monkeypatch):
    include = '#include "controller.c"'
    change_source(monkeypatch, "damper.c", include, include + "\nstatic int idle;")
    with pytest.raises(CheckError, match=r"idle.* defined but not used"):
        verify_c(a_target(), samples=SHORT)


def test_verification_fails_if_program_crashes(monkeypatch):
    change_source(monkeypatch, "main.c", "    if (count != 3) {", "    if (count > 0) abort();\n    {")
    with pytest.raises(CheckError, match=r"the compiled replay ended with -6"):
        verify_c(a_target(), samples=100)


# ----------------------------------------------------------------------------------- record of a verification


def test_verification_record_contains_hash_of_sources():
    """A changed C file has a different hash. A changed README has the same hash."""
    record = verify_c(a_target(content="model"), samples=1000)
    files = c_files(a_target(content="model"))
    assert record.sources_sha256 == sources_sha256(files | {"README.md": "other words"})
    assert sources_sha256(files | {"damper.c": files["damper.c"] + " "}) != record.sources_sha256
    plain = json.loads(json.dumps(record.as_json()))
    assert plain["passed"] is True
    assert "-std=c99" in plain["compiler_flags"]
    assert plain["stack_bytes"]["damper_model_step"] > 0
    assert plain["sizes_bytes"]["code"] > 1000


def test_seed_determines_verification_inputs():
    target = a_target()
    one, again, other = (envelope_rows(target, 2000, seed) for seed in (3, 3, 4))
    for name, values in one.items():
        assert values.shape == (2000,)
        assert np.array_equal(values, again[name], equal_nan=True)
        assert not np.array_equal(values, other[name], equal_nan=True)


@given(st.floats(width=32, allow_nan=False, allow_infinity=False, min_value=-(2.0**100), max_value=2.0**100))
def test_adjacent_floats_differ_by_one_unit(value):
    above = np.nextafter(np.float32(value), np.float32(np.inf))
    columns = (np.array([1.0, value]), np.array([1.0, float(above)]))
    assert difference(*columns, single=True).ulp == 1
    assert difference(*columns, single=True).first_sample == 1
    assert difference(columns[0], columns[0], single=True).samples_differing == 0
