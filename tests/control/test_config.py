"""The controller configuration has the same fields in Python and C. Invalid values are rejected."""

from __future__ import annotations

import math
import re
from dataclasses import fields
from pathlib import Path

import pytest

from mrdamper import core
from mrdamper.control.config import Config, compile_options
from mrdamper.control.controllers import controllers_for
from mrdamper.control.stepper import Flag
from tests.support.cards import CHAIN, DOUBLE, SERIES, changed

KERNEL = Path(core.__file__).parent / "kernel"
RECOMMENDED = controllers_for(DOUBLE)["recommended"]


def test_python_and_kernel_flags_are_equal():
    header = (KERNEL / "controller.h").read_text(encoding="utf-8")
    kernel = {name: int(value) for name, value in re.findall(r"\bMRD_(\w+) = (\d+)", header)}
    assert {name: int(flag) for name, flag in Flag.__members__.items()} == kernel


def test_configuration_fields_equal_fields_of_kernel():
    """The C header is written by hand. Its names and order must equal the fields of the dataclasses."""
    header = (KERNEL / "controller_config.h").read_text(encoding="utf-8")
    structs = re.findall(r"typedef struct \{\n(.*?)\} mrd_(\w+);", header, re.DOTALL)
    kernel = {part: re.findall(r"^ +\w+ (\w+);", members, re.MULTILINE) for members, part in structs}
    parts = {f"config_{each.name}": getattr(RECOMMENDED.config, each.name) for each in fields(Config)}
    parts["lags"] = RECOMMENDED.config.actuation.lags
    assert kernel == {name: [each.name for each in fields(part)] for name, part in parts.items()}


@pytest.mark.parametrize(
    ("damper", "name", "expected"),
    [
        (DOUBLE, "paper", (0, 0, 0)),
        (DOUBLE, "recommended", (0, 0, 1)),
        (SERIES, "recommended", (1, 0, 1)),
        (CHAIN, "recommended", (0, 1, 1)),
    ],
)
def test_compile_options_exclude_unused_controller_parts(damper, name, expected):
    options = compile_options(controllers_for(damper)[name].config)
    assert tuple(options.values()) == expected


@pytest.mark.parametrize(
    "values",
    [
        {"axes__period": 0.0},
        {"axes__warmest": 200.0},
        {"law__elements": 3},
        {"law__series": True},
        {"gains__yield_force": 0.0},
        {"actuation__dead_samples": 126},
        {"inverse__method": 1},
        {"inverse__method": 4},
        {"inverse__preview": math.nan},
        {"prediction__steps": 17},
        {"faults__frozen_samples": 2**31},
    ],
)
def test_invalid_configuration_value_is_rejected(values):
    with pytest.raises(ValueError, match="configuration or tables are out of their range"):
        changed(RECOMMENDED, **values)
