"""The check of an export: it passes what is right, and does not pass what was changed by a bit."""

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
from mrdamper.codegen.verification_rows import COLUMNS, envelope_rows
from mrdamper.codegen.verify import compare, difference, not_verified, replay, rounded, verify_c
from mrdamper.control.tables.heating import Heating
from mrdamper.errors import CheckError
from mrdamper.models.actuation import Actuation
from tests.control.dampers import CHAIN, DAMPERS, DOUBLE
from tests.export.exports import ENVELOPE, STRICT, a_target, card_of, ran, write
from tests.support.tiers import one_by_day

pytestmark = pytest.mark.system

SHORT = 6000  # samples: a little of everything


@pytest.fixture(autouse=True)
def _a_compiler(tool):
    tool("gcc")


# -------------------------------------------------------------------------------------- the same bits


@pytest.mark.nightly
@pytest.mark.parametrize("law", one_by_day(["series-valve", *DAMPERS], 2))
def test_in_single_precision_every_law_has_the_same_bits_in_c_as_in_python(law):
    record = verify_c(a_target(law), samples=SHORT)
    assert record.passed, record.problems
    assert record.worst_ulp == 0
    assert set(record.outputs) == {
        *(f"model.{output}" for output in ("force", "applied", "flags")),
        *(f"controller.{output}" for output in ("current", "force", "flags")),
    }


@pytest.mark.parametrize("damper", one_by_day([CHAIN, DOUBLE]))
def test_a_free_wheeling_current_of_iron_that_saturates_has_the_same_bits(damper):
    lags = Actuation(0.004, 0.001, 0.002, 0.003, largest_command=2.0, play=0.05, wheel_s=0.04, saturation=0.9)
    lags = replace(lags, wide_play=0.15)
    record = verify_c(target_of(card_of(replace(damper, actuation=lags))), samples=SHORT)
    assert record.passed, record.problems
    assert record.worst_ulp == 0


@pytest.mark.nightly
def test_over_a_hundred_thousand_steps():
    record = verify_c(a_target(), samples=100_000)
    assert record.passed, record.problems
    assert record.worst_ulp == 0
    # The run has seen what there is to see: motion, commands and temperatures past the envelope, ...
    assert record.covered["displacement"][0] < ENVELOPE.displacement[0]
    assert record.covered["displacement"][1] > ENVELOPE.displacement[1]
    assert record.covered["current"][0] < 0.0
    assert record.covered["current"][1] > ENVELOPE.command[1]
    assert record.covered["temperature"][1] > 398.15 + 10.0
    # ... and every kind of failed reading.
    assert record.readings_not_finite > 1000
    model = {
        "NO_DISPLACEMENT", "FROZEN", "MOTION_UNKNOWN", "NO_TEMPERATURE", "TEMPERATURE_JUMP",
        "NOMINAL_TEMPERATURE", "OUTSIDE_MOTION", "OUTSIDE_TEMPERATURE", "SATURATED", "NO_CURRENT",
        "NO_VELOCITY",
    }  # fmt: skip
    assert model <= set(record.flags_raised["model"])
    own = {"SATURATED", "NO_CURRENT", "NO_VELOCITY"}  # of a model's readings
    assert (model - own) | {"NO_TARGET", "INFEASIBLE", "CLAMPED"} <= set(record.flags_raised["controller"])


@pytest.mark.nightly
@pytest.mark.parametrize("law", ["double-bouc-wen", "series-valve"])
@pytest.mark.parametrize("content", ["model", "controller"])
def test_in_double_precision_too(law, content):
    record = verify_c(a_target(law, content=content, precision="double"), samples=SHORT)
    assert record.passed, record.problems
    assert record.worst_relative <= 1e-12
    assert {name.partition(".")[0] for name in record.outputs} == {content}


@pytest.mark.nightly
@pytest.mark.parametrize(
    "controller",
    [
        "paper",
        "recommended-causal",
        "recommended-observer",
        "clipped-on-off",
        "pi",
    ],
)
def test_every_kind_of_controller_has_the_same_bits(controller):
    record = verify_c(a_target("bouc-wen", content="controller", controller=controller), samples=SHORT)
    assert record.passed, record.problems
    assert record.worst_ulp == 0


@pytest.mark.nightly
@pytest.mark.parametrize("period_s", one_by_day([5e-3, 1e-4]))
def test_at_other_periods_as_well(period_s):
    record = verify_c(a_target(period_s=period_s), samples=SHORT)
    assert record.passed, record.problems
    assert record.worst_ulp == 0


@pytest.mark.parametrize("level", one_by_day(["-O3", "-O0"]))
def test_the_optimisation_level_changes_no_bit(level, tool, tmp_path):
    target = a_target()
    write(target, tmp_path)
    units = ["damper.c", "damper_tables.c", "main.c"]
    ran(tool("gcc"), *STRICT, level, *units, "-o", "replay", cwd=tmp_path)
    rows = rounded(target, envelope_rows(target, SHORT, 2))
    outputs, problems, _ = compare(target, rows, replay(target, [tmp_path / "replay"], rows, tmp_path))
    assert problems == []
    assert all(each.samples_differing == 0 for each in outputs.values())


def test_address_and_undefined_behaviour_sanitisers_have_nothing_to_say(tool, tmp_path):
    target = a_target()
    write(target, tmp_path)
    units = ["damper.c", "damper_tables.c", "main.c"]
    strict = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
    ran(tool("gcc"), *STRICT, "-O1", "-g", *strict, *units, "-o", "replay", cwd=tmp_path)
    rows = rounded(target, envelope_rows(target, SHORT, 1))
    _, problems, _ = compare(target, rows, replay(target, [tmp_path / "replay"], rows, tmp_path))
    assert problems == []


# ---------------------------------------------------------------------------- what is not the same


def changed(monkeypatch, name, old, new):
    """Have the check compile sources of which one text is another."""

    def files(target):
        found = c_files(target)
        assert old in found[name]
        return found | {name: found[name].replace(old, new, 1)}

    monkeypatch.setattr(verify, "c_files", files)


def test_a_table_that_is_wrong_in_its_last_bit_is_found(monkeypatch):
    changed(monkeypatch, "damper_tables.c", ".largest = 2.0f", ".largest = 2.0000002f")
    record = verify_c(a_target(), samples=SHORT)
    assert not record.passed
    assert record.worst_ulp > 0
    assert any("is not Python's at" in problem for problem in record.problems)
    assert "expected the same bits" in record.problems[0]


def test_arithmetic_that_is_fused_or_reordered_is_found(monkeypatch):
    changed(monkeypatch, "track_estimate.h", "*v += h * a;", "*v = h * a + *v * R(1.0000001);")
    assert not verify_c(a_target(content="model"), samples=SHORT).passed


def test_a_check_of_a_reading_that_is_left_out_is_found(monkeypatch):
    """Without the look at a displacement that is not a number the output is none either."""
    changed(
        monkeypatch,
        "track_estimate.h",
        "const bool there = magnitude(reading) <= c->faults.far_x;",
        "const bool there = true;",
    )
    record = verify_c(a_target(content="model"), samples=4 * SHORT)
    assert not record.passed
    assert any("is not finite" in problem for problem in record.problems)


def test_a_warning_is_an_error(monkeypatch):
    changed(monkeypatch, "damper.c", '#include "controller.c"', '#include "controller.c"\nstatic int idle;')
    with pytest.raises(CheckError, match=r"cc .* damper\.c .* failed: .*idle.* defined but not used"):
        verify_c(a_target(), samples=SHORT)


def test_a_program_that_falls_over_is_told(monkeypatch):
    changed(
        monkeypatch,
        "main.c",
        "int main(int count, char **argument)\n{",
        "int main(int count, char **argument)\n{\n    if (count > 0) abort();",
    )
    with pytest.raises(CheckError, match=r"the compiled replay ended with -6"):
        verify_c(a_target(), samples=100)


# ------------------------------------------------------------------------------------------ the record


@pytest.fixture(scope="module")
def record():
    return verify_c(a_target(content="model"), samples=1000)


def test_the_record_holds_for_these_sources_and_no_others(record):
    files = c_files(a_target(content="model"))
    assert record.sources_sha256 == sources_sha256(files)
    assert sources_sha256(files | {"README.md": "other words"}) == record.sources_sha256
    assert sources_sha256(files | {"damper.c": files["damper.c"] + " "}) != record.sources_sha256
    other = target_of(card_of(DOUBLE), content="model", period_s=2e-3)
    assert sources_sha256(c_files(other)) != record.sources_sha256


def test_the_record_is_json_and_says_what_it_was_made_with(record):
    plain = json.loads(json.dumps(record.as_json()))
    assert plain["passed"] is True
    assert plain["verified"] is True
    assert plain["samples"] == 1000
    assert "-std=c99" in plain["compiler_flags"]
    assert plain["compiler_version"]
    assert plain["stack_bytes"]["damper_model_step"] > 0
    assert plain["sizes_bytes"]["code"] > 1000
    assert 500 < plain["sizes_bytes"]["state"] < 2000


def test_a_record_of_nothing_does_not_pass():
    record = not_verified(a_target())
    assert not record.passed
    assert record.as_json()["verified"] is False


def test_the_same_seed_gives_the_same_rows_and_another_one_others():
    target = a_target()
    one, again, other = (envelope_rows(target, 2000, seed) for seed in (3, 3, 4))
    for name in COLUMNS:
        assert one[name].shape == (2000,)
        assert np.array_equal(one[name], again[name], equal_nan=True)
        assert not np.array_equal(one[name], other[name], equal_nan=True)


@given(st.floats(width=32, allow_nan=False, allow_infinity=False, min_value=-(2.0**100), max_value=2.0**100))
def test_neighbours_are_one_unit_apart(value):
    above = np.nextafter(np.float32(value), np.float32(np.inf))
    columns = (np.array([1.0, value]), np.array([1.0, float(above)]))
    assert difference(*columns, single=True).ulp == 1
    assert difference(*columns, single=True).first_sample == 1
    assert difference(columns[0], columns[0], single=True).samples_differing == 0


def test_the_smallest_numbers_of_either_sign_are_two_units_apart():
    least = float(np.nextafter(np.float32(0.0), np.float32(1.0)))
    assert difference(np.array([least]), np.array([-least]), single=True).ulp == 2


def test_a_frozen_thermometer_is_found_with_the_same_bits():
    """A light damper under a hard duty: the reading stands still while it should rise."""
    light = Heating(capacity_J_K=2.0, loss_W_K=0.01, resistance_20_ohm=5.0)
    record = verify_c(target_of(card_of(DOUBLE), heating=light), samples=3 * SHORT)
    assert record.passed, record.problems
    for part in ("model", "controller"):
        assert record.flags_raised[part]["FROZEN_TEMPERATURE"] > 0


@pytest.mark.nightly
def test_a_damper_in_volts_is_verified_as_well():
    record = verify_c(target_of(card_of(replace(DOUBLE, command_unit="V"))), samples=1000)
    assert record.passed, record.problems
