"""The configuration: the kernel has the declared struct, and values out of range are refused."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from mrdamper import core
from mrdamper.control.config import MODES, header_text, modes_of
from mrdamper.control.controllers import controllers_for
from mrdamper.control.stepper import FAULTS, Flag
from tests.control.dampers import DOUBLE, changed

ALL = controllers_for(DOUBLE)
NEVER, ALWAYS, ASKED = "MRD_NEVER", "MRD_ALWAYS", "MRD_ASKED"


def on(name: str) -> set[str]:
    """Return the modes that a controller of its own is compiled with."""
    modes = modes_of(None, ALL[name].config)
    assert set(modes.values()) <= {NEVER, ALWAYS}
    return {macro.removeprefix("MRD_WITH_").lower() for macro, state in modes.items() if state == ALWAYS}


def test_flags_of_a_step_equal_the_kernel():
    header = (Path(core.__file__).parent / "kernel" / "controller.h").read_text(encoding="utf-8")
    kernel = {name: int(value) for name, value in re.findall(r"\bMRD_(\w+) = (\d+)", header)}
    assert {name: int(flag) for name, flag in Flag.__members__.items()} == kernel


def test_faults_are_all_flags_but_those_of_an_answer_and_of_an_envelope():
    answers = Flag.INFEASIBLE | Flag.CLAMPED | Flag.SATURATED
    assert set(Flag) - set(FAULTS) == set(
        answers | Flag.OUTSIDE_MOTION | Flag.OUTSIDE_TEMPERATURE | Flag.NO_FORCE
    )


def test_the_kernel_s_header_is_that_of_the_declaration():
    header = Path(core.__file__).parent / "kernel" / "controller_config.h"
    assert header.read_text(encoding="utf-8") == header_text()


def test_a_controller_is_compiled_with_its_own_modes_alone():
    usual = {"inverse", "heating", "extrapolation"}
    ahead = usual | {"preview", "play"}
    assert on("recommended") == on("recommended-causal") == ahead | {"compensation", "clamp"}
    assert on("recommended-adaptive") == on("recommended") | {"adaptive"}
    assert on("recommended-observer") == on("recommended") | {"observer"}
    assert on("paper") == usual | {"bank", "no_lag"}
    assert on("paper-unaware") == on("paper") | {"held_temperature"}
    assert on("static-preview") == ahead | {"static"}
    assert on("lead") == usual | {"play", "lead"}
    assert on("pi") == {"feedback", "play", "heating", "extrapolation"}
    assert on("clipped-on-off") == on("pi") | {"on_off"}


def test_what_model_and_controller_do_not_share_is_asked_and_so_is_what_may_be_tuned():
    """The model has no inverse: its own says nothing about the controller's."""
    model, paper = ALL["exact"].config, ALL["paper"].config
    both = modes_of(model, paper)
    assert both["MRD_WITH_BANK"] == both["MRD_WITH_NO_LAG"] == both["MRD_WITH_PLAY"] == ASKED
    assert both["MRD_WITH_PREVIEW"] == NEVER
    assert both["MRD_WITH_INVERSE"] == ALWAYS
    assert modes_of(None, paper, tuned=["inverse.margin"])["MRD_WITH_CLAMP"] == ASKED
    assert len(both) == len(MODES)


@pytest.mark.parametrize(
    "values",
    [
        {"axes__period": 0.0},
        {"axes__warmest": 200.0},
        {"law__elements": 3},
        {"actuation__dead_samples": 126},
        {"actuation__dead_samples": -1},
        {"inverse__models": 4},
        {"inverse__models": 0},
        {"inverse__method": 4},
        {"prediction__steps": 17},
        {"prediction__stretch": 0},
        {"prediction__samples": 0},
        {"law__chain": True},
        {"inverse__preview": math.nan},
        {"faults__frozen_samples": 2**31},
        {"law__series": True},
    ],
)
def test_a_value_out_of_its_range_is_refused_before_a_step(values):
    with pytest.raises(ValueError, match="configuration or tables are out of their range"):
        changed(ALL["recommended"], **values)
