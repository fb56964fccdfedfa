"""The finite elements against independent programs, each with its own mesh, assembly or time stepping."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mrdamper.thermal.model.finite_element import FieldModel, build_field, discretise
from mrdamper.thermal.model.heat_equation import simulate_field
from mrdamper.thermal.model.mesh import mesh_section
from mrdamper.thermal.model.section import section_of
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.stirring import Stroke
from tests.oracles.cross_check import backward_euler, check_calculix, check_freefem, check_gmsh
from tests.oracles.freefem import run_freefem, write_freefem
from tests.oracles.gmsh_mesh import mesh_with_gmsh
from tests.support.tiers import one_by_day
from tests.thermal.designs import DRAWING

pytestmark = pytest.mark.system

BARE = DRAWING.with_sink(None)
RESTING = {
    name: replace(drawing, stroke=Stroke(0.0, 0.0)) for name, drawing in (("bare", BARE), ("fins", DRAWING))
}
"""At rest the fluid conducts alike along and across, which gmsh's even triangles resolve. Under a stroke they
do not: a corner of 0.5 mm leaves 0.3 K at the coil."""
Tool = Callable[[str], Path]


def fading(kelvin):
    """Power that falls with warmth, as an MR damper's does."""
    return 95.0 - 0.25 * (np.clip(kelvin, 273.15, 473.15) - 293.15)


DUTY = Load(1800.0, fading, 16.8)


def coarse(drawing) -> FieldModel:
    """Return a small model: what is compared does not depend on the mesh, both programs have the same."""
    section = section_of(drawing)
    return discretise(section, mesh_section(section, 0.03, levels=1))


@pytest.mark.nightly
@pytest.mark.parametrize("drawing", one_by_day([DRAWING, BARE]), ids=["fins", "bare"])
def test_freefem_agrees_at_every_node(tool: Tool, tmp_path: Path, drawing):
    """The whole nonlinear problem, 5 min; each program by its own method of order 2."""
    tool("FreeFem++")
    found = check_freefem(coarse(drawing), replace(DUTY, duration=300.0), tmp_path, step=30.0)
    assert np.ptp(found.theirs) > 3.0
    assert found.worst_K < 50e-3


@pytest.mark.nightly
@pytest.mark.parametrize("drawing", one_by_day([DRAWING, BARE]), ids=["fins", "bare"])
def test_freefem_agrees_after_half_an_hour_on_the_mesh_in_use(tool: Tool, tmp_path: Path, drawing):
    tool("FreeFem++")
    assert check_freefem(build_field(drawing), DUTY, tmp_path).worst_K < 50e-3


@pytest.mark.release
def test_freefem_takes_three_times_our_cpu_where_it_errs_no_less(tool: Tool, tmp_path: Path):
    """In steps of 30 s it errs as little as we do in steps up to 60 s."""
    tool("FreeFem++")
    model = build_field(DRAWING)
    script = write_freefem(model, DUTY, tmp_path, step=30.0)
    begin = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    run_freefem(script)
    theirs = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - begin
    begin = time.process_time()
    simulate_field(build_field(DRAWING).equation, [DUTY])
    assert theirs > 3.0 * (time.process_time() - begin)


@pytest.mark.parametrize("drawing", one_by_day([DRAWING, BARE]), ids=["fins", "bare"])
def test_calculix_agrees_at_every_node(tool: Tool, tmp_path: Path, drawing):
    """Frozen films and sources, nonlinear radiation; both by backward Euler, ten steps of a minute."""
    tool("ccx")
    found = check_calculix(coarse(drawing), DUTY, tmp_path, step=60.0, steps=10)
    assert np.ptp(found.theirs) > 3.0
    assert found.worst_K < 0.1


@pytest.mark.nightly
@pytest.mark.parametrize("drawing", one_by_day([DRAWING, BARE]), ids=["fins", "bare"])
def test_calculix_agrees_after_half_an_hour_on_the_mesh_in_use(tool: Tool, tmp_path: Path, drawing):
    tool("ccx")
    assert check_calculix(build_field(drawing), DUTY, tmp_path, step=30.0, steps=60).worst_K < 0.1


def test_gmsh_finds_the_same_volumes_and_areas(tool: Tool, tmp_path: Path):
    """It tags by bounding boxes, we by lines of a grid: a surface that one forgets is seen."""
    tool("gmsh")
    section = section_of(DRAWING)
    ours, theirs = mesh_section(section, 0.02), mesh_with_gmsh(section, tmp_path, size=0.02, corner=0.004)
    assert len(ours.corners) != len(theirs.corners)
    volumes = [np.bincount(mesh.region, mesh.volumes()) for mesh in (ours, theirs)]
    areas = [np.bincount(mesh.surface, mesh.areas()) for mesh in (ours, theirs)]
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-7)
    assert areas[1] == pytest.approx(areas[0], rel=1e-7)


@pytest.mark.parametrize("drawing", RESTING.values(), ids=RESTING)
def test_on_gmsh_s_mesh_the_means_are_the_same(tool: Tool, tmp_path: Path, drawing):
    tool("gmsh")
    found = check_gmsh(build_field(drawing), replace(DUTY, duration=400.0), tmp_path, corner=0.002)
    assert found.worst_K < 50e-3


@pytest.mark.nightly
@pytest.mark.parametrize("drawing", RESTING.values(), ids=RESTING)
def test_on_gmsh_s_fine_mesh_the_means_are_within_30_millikelvin(tool: Tool, tmp_path: Path, drawing):
    """Ours is of 8 mm; its coil is 26 mK off, and 14 with cells of 4."""
    tool("gmsh")
    assert check_gmsh(build_field(drawing), DUTY, tmp_path, corner=0.0005).worst_K < 30e-3


@pytest.mark.nightly
def test_a_wrong_film_is_seen_by_freefem(tool: Tool, tmp_path: Path):
    """The check can fail: a tenth less film on one side only."""
    tool("FreeFem++")
    section = section_of(BARE)
    weaker = replace(section, films=0.9 * section.films)
    mesh = mesh_section(section, 0.03, levels=0)
    load = replace(DUTY, duration=300.0)
    honest, false = (
        check_freefem(discretise(each, mesh), load, tmp_path, step=50.0) for each in (section, weaker)
    )
    assert np.abs(honest.ours - false.theirs).max() > 50e-3


@pytest.mark.nightly
def test_backward_euler_comes_to_the_same_as_ros2():
    """With small steps: the method that CalculiX is compared by solves the same equation."""
    model = coarse(BARE)
    ours = simulate_field(model.equation, [replace(DUTY, duration=120.0)], longest_step=5.0).state[-1]
    gaps = [
        np.abs(backward_euler(model.equation, DUTY, step=120.0 / steps, steps=steps) - ours).max()
        for steps in (40, 80)
    ]
    assert gaps[1] < 0.2
    assert gaps[0] / gaps[1] == pytest.approx(2.0, abs=0.25)
