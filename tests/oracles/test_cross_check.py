"""The finite elements agree with FreeFem++, which has its own assembly, quadrature and time steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

from mrdamper.arrays import FloatArray
from mrdamper.thermal.model.finite_element import FieldModel, build_field, discretise
from mrdamper.thermal.model.heat_equation import simulate_field
from mrdamper.thermal.model.mesh import mesh_section
from mrdamper.thermal.model.section import section_of
from mrdamper.thermal.model.stepping import Load
from tests.oracles.freefem import run_freefem, write_freefem
from tests.support.tiers import one_by_day
from tests.thermal.designs import DRAWING

pytestmark = [pytest.mark.system, pytest.mark.nightly]

BARE = DRAWING.with_sink(None)
SAME_PLACE_M = 1e-9
Tool = Callable[[str], Path]


def fading(kelvin: FloatArray) -> FloatArray:
    """Return a power that decreases with temperature, like the power of an MR damper."""
    return np.asarray(95.0 - 0.25 * (np.clip(kelvin, 273.15, 473.15) - 293.15))


DUTY = Load(1800.0, fading, 16.8)


def final_temperatures(
    model: FieldModel, load: Load, folder: Path, step: float = 20.0
) -> tuple[FloatArray, FloatArray]:
    """Return the final temperatures [K] of the package and of FreeFem++ at each node."""
    theirs = run_freefem(write_freefem(model, load, folder, step=step))
    ours = simulate_field(model.equation, [load], longest_step=0.5 * step)
    distance, which = (np.asarray(each) for each in KDTree(theirs.nodes).query(model.nodes))
    assert len(theirs.nodes) == len(model.nodes)
    assert distance.max() < SAME_PLACE_M
    return ours.state[-1] + ours.equation.ambient, theirs.temperature[which]


@pytest.mark.parametrize("drawing", one_by_day([DRAWING, BARE]), ids=["fins", "bare"])
def test_freefem_agrees_at_every_node(tool: Tool, tmp_path: Path, drawing):
    """The load lasts half an hour. Package and FreeFem++ use different time integrators of second order."""
    tool("FreeFem++")
    ours, theirs = final_temperatures(build_field(drawing), DUTY, tmp_path)
    assert np.ptp(theirs) > 3.0
    assert np.abs(ours - theirs).max() < 50e-3


def test_freefem_comparison_detects_wrong_film_coefficient(tool: Tool, tmp_path: Path):
    """A heat-transfer coefficient that is 10 % lower in one program makes the temperatures differ."""
    tool("FreeFem++")
    section = section_of(BARE)
    mesh = mesh_section(section, 0.03, levels=0)
    load = replace(DUTY, duration=300.0)
    right, wrong = (
        final_temperatures(
            discretise(replace(section, films=factor * section.films), mesh), load, tmp_path, 50.0
        )
        for factor in (1.0, 0.9)
    )
    assert np.abs(right[0] - wrong[1]).max() > 50e-3
