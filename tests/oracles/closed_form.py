"""Reference solutions for heating: one heat capacity in closed form, finer meshes, constant coefficients."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.model.finite_element import FieldModel, build_field
from mrdamper.thermal.model.heat_equation import FieldHeating, simulate_field
from mrdamper.thermal.model.mesh import SectionMesh
from mrdamper.thermal.model.section import Section
from mrdamper.thermal.model.stepping import Load


def constant_heating(
    time: ArrayLike, power: float, conductance: float, capacity: float, *, ambient: float, start: float
) -> FloatArray:
    """Return the temperature of a single heat capacity at constant power [K], in the shape of ``time`` [s].

    T = T_a + P/G + (T_0 - T_a - P/G) exp(-G t / C), or a straight line for G = 0.

    Parameters
    ----------
    power : heating power [W]
    conductance : thermal conductance to ambient [W/K], zero or more
    capacity : heat capacity [J/K], positive
    ambient, start : temperatures of the ambient and at time zero [K]
    """
    seconds = np.asarray(time, dtype=np.float64)
    # The function (1 - exp(-x)) / x is replaced by its limit 1 if there are no losses (x = 0).
    share = conductance / capacity * seconds
    gained = np.where(share == 0.0, 1.0, -np.expm1(-share) / np.where(share == 0.0, 1.0, share))
    drive = (power - conductance * (start - ambient)) / capacity
    return np.asarray(start + drive * seconds * gained)


def with_constant_films(section: Section, films: FloatArray) -> Section:
    """Return a section whose heat-transfer coefficients do not depend on temperature [W/(m^2 K)]."""
    return replace(section, films=np.repeat(np.asarray(films)[:, None], len(section.grid), axis=1))


def refined(mesh: SectionMesh) -> SectionMesh:
    """Return a mesh with every triangle divided into four."""
    first = len(mesh.corners)
    pairs = np.concatenate([mesh.triangles[:, list(side)] for side in ((0, 1), (1, 2), (2, 0))])
    sides, which = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
    corners = np.concatenate([mesh.corners, mesh.corners[sides].mean(axis=1)])
    a, b, c = mesh.triangles.T
    ab, bc, ca = (first + which.reshape(3, -1).T).T
    cut = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    number = {(int(p), int(q)): first + k for k, (p, q) in enumerate(sides)}
    half = np.array([number[min(p, q), max(p, q)] for p, q in mesh.facets.tolist()], dtype=np.int64)
    ends = ((mesh.facets[:, 0], half), (half, mesh.facets[:, 1]))
    return SectionMesh(
        corners,
        np.concatenate([np.stack(three, axis=1) for three in cut]),
        np.tile(mesh.region, 4),
        np.concatenate([np.stack(two, axis=1) for two in ends]),
        np.tile(mesh.surface, 2),
    )


def heat_field(
    drawing: DamperDrawing,
    loads: Sequence[Load],
    *,
    size: float = 0.008,
    longest_step: float = 60.0,
    stop_at: float = math.inf,
) -> tuple[FieldModel, FieldHeating]:
    """Return the finite-element model of a damper and its temperatures during the loads."""
    model = build_field(drawing, size=size)
    return model, simulate_field(model.equation, loads, longest_step=longest_step, stop_at=stop_at)
