"""The finite elements against independent programs: FreeFem++, CalculiX, and a mesh by gmsh.

Each check writes the problem into a folder, runs the program there and compares: with FreeFem++ the whole
nonlinear problem, node by node; with CalculiX one with frozen films and sources and an equal step, node by
node; on gmsh's mesh our own solver, by mean temperatures. What they found stays in the folder.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.thermal.model.finite_element import FieldModel, discretise
from mrdamper.thermal.model.heat_equation import FieldHeating, FieldSystem, HeatEquation, simulate_field
from mrdamper.thermal.model.stepping import Load
from tests.oracles.calculix import run_calculix, write_calculix
from tests.oracles.closed_form import with_constant_films
from tests.oracles.freefem import run_freefem, write_freefem
from tests.oracles.gmsh_mesh import mesh_with_gmsh

__all__ = ["Comparison", "backward_euler", "check_calculix", "check_freefem", "check_gmsh"]

_SAME_PLACE = 1e-9  # [m]


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Temperatures that two programs found at the same places [K], shape (n,)."""

    program: str
    nodes: FloatArray  # (r, z) [m], shape (n, 2); empty for means
    ours: FloatArray
    theirs: FloatArray

    @property
    def worst_K(self) -> float:
        """Largest difference."""
        return float(np.abs(self.ours - self.theirs).max())


def check_freefem(model: FieldModel, load: Load, folder: Path, *, step: float = 20.0) -> Comparison:
    """Compare the temperatures at every node at the end of a load with FreeFem++'s.

    Parameters
    ----------
    step : of FreeFem++; ours are at most half of it [s]
    """
    from scipy.spatial import KDTree

    theirs = run_freefem(write_freefem(model, load, folder, step=step))
    ours = simulate_field(model.equation, [load], longest_step=0.5 * step)
    distance, which = (np.asarray(each) for each in KDTree(theirs.nodes).query(model.nodes))
    farthest = float(distance.max())
    if len(theirs.nodes) != len(model.nodes) or farthest > _SAME_PLACE:
        raise InputError(
            f"FreeFem++: {len(theirs.nodes)} nodes, ours are {len(model.nodes)}, the farthest {farthest:.3g} "
            "m from its like; expected the same nodes"
        )
    return Comparison("FreeFem++", model.nodes, _at_the_end(ours), theirs.temperature[which])


def check_calculix(
    model: FieldModel, load: Load, folder: Path, *, step: float = 30.0, steps: int = 20
) -> Comparison:
    """Compare the temperatures at every node with CalculiX's, films and sources frozen at the load's end.

    Both go by backward Euler with the same step [s], from ambient.
    """
    course = simulate_field(model.equation, [replace(load, duration=step * steps)])
    section = model.section
    at = float(course.wall[-1])
    films = np.array([np.interp(at, section.grid, row) for row in section.films])
    mechanical, coil = float(course.mechanical_W[-1]), float(course.coil_W[-1])
    theirs = run_calculix(
        write_calculix(model, films, folder, mechanical_W=mechanical, coil_W=coil, step=step, steps=steps),
        len(model.nodes),
    )
    frozen = discretise(with_constant_films(section, films), model.mesh).equation
    frozen = replace(frozen, warming=0.0 * frozen.warming, reference_growth=1.0)
    steady = Load(step * steps, lambda kelvin: np.full(kelvin.shape, mechanical), coil)
    ours = backward_euler(frozen, steady, step=step, steps=steps) + section.ambient
    return Comparison("CalculiX", model.nodes, ours, theirs)


def check_gmsh(
    model: FieldModel, load: Load, folder: Path, *, size: float = 0.008, corner: float = 0.0005
) -> Comparison:
    """Compare the means of fluid, coil and wall with those on gmsh's mesh (sizes [m]), both ours."""
    other = discretise(model.section, mesh_with_gmsh(model.section, folder, size=size, corner=corner))
    ours, theirs = (simulate_field(each.equation, [load]) for each in (model, other))
    return Comparison("gmsh", np.zeros((0, 2)), _means(ours), _means(theirs))


def backward_euler(equation: HeatEquation, load: Load, *, step: float, steps: int) -> FloatArray:
    """Return the unknowns above ambient after some steps of backward Euler from ambient [K], shape (n,).

    Each step by Newton's method.

    Raises
    ------
    ConvergenceError
        The iteration did not settle to 1e-9 K in 20 turns.
    """
    system = FieldSystem(equation)
    system.take(load)
    state = np.zeros(equation.size)
    for _ in range(steps):
        new = state
        for _ in range(20):
            here = system.evaluate(new)
            move = system.solver(here, 1.0, 1.0 / step)(here.rate - equation.mass @ (new - state) / step)
            new = new + move
            if float(np.abs(move).max()) < 1e-9:
                break
        else:
            raise ConvergenceError("backward Euler: Newton's method did not settle to 1e-9 K in 20 turns")
        state = new
    return state


def _at_the_end(course: FieldHeating) -> FloatArray:
    return np.asarray(course.state[-1] + course.equation.ambient)


def _means(course: FieldHeating) -> FloatArray:
    return np.concatenate([course.fluid, course.coil, course.wall])
