"""Finite-element model of transient heat conduction in the meridian section of a damper with fins.

The elements are axisymmetric quadratic triangles. Radiation and convection depend on the local surface
temperature. Mechanical power depends on the mean fluid temperature, and coil heat on the local temperature.
``section`` defines the problem, and ``heat_equation`` integrates it in time. This model is the reference for
the fast network.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.quantities import REFERENCE_K
from mrdamper.thermal.drawing import DamperDrawing, Surroundings
from mrdamper.thermal.heat_capacity import CapacityCurve
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.thermal.model.heat_equation import (
    Cooling,
    HeatEquation,
    HotSpots,
    StoredHeat,
)
from mrdamper.thermal.model.mesh import IntArray, SectionMesh, mesh_section
from mrdamper.thermal.model.network import PATHS
from mrdamper.thermal.model.section import Role, Section, section_of

_FACET_POINTS = 3  # number of Gauss points on a facet
_SAME_M = 1e-9  # Positions with a smaller difference count as equal.
_SIDES = ((0, 1), (1, 2), (0, 2))  # corners between which the nodes 3, 4 and 5 of a triangle are placed


@dataclass(frozen=True, slots=True, eq=False)
class FieldModel:
    """A section, its mesh, and the heat equation for the temperatures at the nodes of the mesh.

    The unknowns are the temperatures at ``nodes``: first the corners in the order of the mesh, then the
    midpoints of the sides. ``elements`` contains the six nodes of each triangle: corners, then the midpoints
    of the sides 01, 12, 02.
    """

    section: Section
    mesh: SectionMesh
    nodes: FloatArray  # coordinates (r, z) of the nodes [m], shape (n, 2)
    elements: IntArray  # indices of the six nodes of each triangle, shape (t, 6)
    equation: HeatEquation
    surface: IntArray  # index in ``section.surfaces`` of each surface point, shape (p,)

    def field(self, state: FloatArray) -> FloatArray:
        """Return the temperatures at the nodes [K] for unknowns above ambient [K]."""
        return np.asarray(state + self.equation.ambient)


def build_field(drawing: DamperDrawing, *, size: float = 0.008) -> FieldModel:
    """Return the finite-element model of a geometry.

    Parameters
    ----------
    size : maximum side of a cell of the mesh [m]
    """
    section = section_of(drawing)
    return discretise(section, mesh_section(section, size))


def discretise(section: Section, mesh: SectionMesh) -> FieldModel:
    """Return the finite-element model of a section on a mesh."""
    nodes, elements = _quadratic_nodes(mesh)
    size, local = len(nodes), _Local(mesh)
    heat = np.array([region.volumetric_heat for region in section.regions])[mesh.region]
    along = np.array([(region.conductivity_r, region.conductivity_z) for region in section.regions])[
        mesh.region
    ]

    def assembled(parts: FloatArray) -> sparse.csr_array:
        rows, columns = np.repeat(elements, 6, axis=1), np.tile(elements, 6)
        return sparse.csr_array((parts.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))

    def mean_over(*roles: Role) -> FloatArray:
        """Return the node weights for the mean temperature of the regions with some roles.

        The weights are also the load vector for 1 W of heat, distributed uniformly in these regions.
        """
        inside = _with_roles(section, mesh, roles)
        row = np.bincount(elements[inside].ravel(), local.loads[inside].ravel(), size)
        return np.asarray(row / row.sum()) if inside.any() else np.zeros(size)

    in_coil = _with_roles(section, mesh, ("coil",))
    coil_volume = float(mesh.volumes()[in_coil].sum()) if in_coil.any() else 1.0
    storage = [
        StoredHeat(assembled(local.products * (heat * inside)[:, None]), curve)
        for curve, inside in _growing(section, mesh)
    ]
    surface, area, which = _surface_points(mesh, elements, size)
    coil = mean_over("coil")
    equation = HeatEquation(
        ambient=section.ambient,
        mass=assembled(local.products * heat[:, None]),
        stiffness=assembled(local.conduction(along)),
        mechanical=mean_over("gap"),
        electrical=coil,
        warming=assembled(local.products * (COPPER_PER_K / coil_volume * in_coil)[:, None]),
        surface=surface,
        area=area,
        cooling=_cooling(section, which, section.ambient),
        fluid=mean_over("gap", "chamber"),
        coil=coil,
        wall=mean_over("wall"),
        uniform=np.ones(size),
        reference_growth=1.0 + COPPER_PER_K * (section.ambient - REFERENCE_K),
        spots=_spots(section, mesh, nodes, elements),
        storage=tuple(storage),
    )
    return FieldModel(section, mesh, nodes, elements, equation, which)


def _growing(section: Section, mesh: SectionMesh) -> list[tuple[CapacityCurve, NDArray[np.bool_]]]:
    """Return curve and triangles of each part whose heat capacity is not constant."""
    parts: dict[tuple[str, CapacityCurve], list[int]] = {}
    for k, region in enumerate(section.regions):
        if region.growth is not None:
            parts.setdefault((region.part, region.growth), []).append(k)
    return [(curve, np.isin(mesh.region, regions)) for (_, curve), regions in parts.items()]


def _quadratic_nodes(mesh: SectionMesh) -> tuple[FloatArray, IntArray]:
    """Return the coordinates of all nodes (corners, then midpoints) [m], and the nodes of each triangle."""
    pairs = np.concatenate([mesh.triangles[:, list(side)] for side in _SIDES])
    sides, which = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
    nodes = np.concatenate([mesh.corners, mesh.corners[sides].mean(axis=1)])
    middles = len(mesh.corners) + which.reshape(3, -1).T
    return nodes, np.ascontiguousarray(np.hstack([mesh.triangles, middles]))


def _reference() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return three arrays of integrals of shape functions over a unit triangle.

    The integrands are the shape functions, shape (6, 3); products of two shape functions, shape (36, 3); and
    products of two derivatives of shape functions, shape (3, 3, 36, 3). The last axis is for the factor in
    every integrand: one of three barycentric coordinates, of which the radius r is a linear function. Radon's
    formula with seven points is exact for polynomials of degree 5 (tested).
    """
    root = math.sqrt(15.0)
    points, weights = [[1.0 / 3.0] * 3], [9.0 / 40.0]
    for sign in (1.0, -1.0):
        near = (6.0 + sign * root) / 21.0
        for k in range(3):
            points.append([1.0 - 2.0 * near if k == j else near for j in range(3)])
            weights.append((155.0 + sign * root) / 1200.0)
    at, weight = np.array(points), np.array(weights)
    ends, other = (at[:, [side[k] for side in _SIDES]] for k in (0, 1))
    shape = np.hstack([at * (2.0 * at - 1.0), 4.0 * ends * other])
    slope = np.zeros((len(at), 6, 3))
    for k in range(3):
        slope[:, k, k] = 4.0 * at[:, k] - 1.0
        one, two = _SIDES[k]
        slope[:, 3 + k, one], slope[:, 3 + k, two] = 4.0 * at[:, two], 4.0 * at[:, one]
    products = np.einsum("q,qi,qj,qm->ijm", weight, shape, shape, at).reshape(36, 3)
    slopes = np.einsum("q,qic,qjd,qm->cdijm", weight, slope, slope, at).reshape(3, 3, 36, 3)
    return np.einsum("q,qi,qm->im", weight, shape, at), products, slopes


class _Local:
    """Element matrices of all triangles for unit conductivity and unit heat capacity."""

    def __init__(self, mesh: SectionMesh) -> None:
        corners = mesh.corners[mesh.triangles]
        doubled = mesh.doubled_areas()
        # Area of each triangle times 2 pi r at its three corners, shape (t, 3).
        self._turned = math.pi * doubled[:, None] * corners[:, :, 0]
        r, z = corners[:, :, 0], corners[:, :, 1]
        after, before = [1, 2, 0], [2, 0, 1]
        self._gradient = np.stack([z[:, after] - z[:, before], r[:, before] - r[:, after]]) / doubled[:, None]
        shapes, products, self._slopes = _reference()
        self.loads = self._turned @ shapes.T  # integrals of shape functions, shape (t, 6)
        self.products = self._turned @ products.T  # integrals of their pairwise products, shape (t, 36)

    def conduction(self, along: FloatArray) -> FloatArray:
        """Return the conduction matrices of all triangles for conductivities along r and z, shape (t, 36)."""
        joint = np.einsum("dta,dtb,td->tab", self._gradient, self._gradient, along)
        weight = joint[:, :, :, None] * self._turned[:, None, None, :]
        return np.asarray(np.tensordot(weight, self._slopes, ([1, 2, 3], [0, 1, 3])))


def _spots(section: Section, mesh: SectionMesh, nodes: FloatArray, elements: IntArray) -> HotSpots:
    """Return matrices that select the candidate nodes for the hottest point of gap, coil and seals.

    The candidates of the seals are on the rod surface in the caps.
    """

    def elements_of(role: Role) -> IntArray:
        return np.unique(elements[_with_roles(section, mesh, (role,))])

    at = np.zeros(len(nodes), dtype=np.bool_)
    for seal in section.seals:
        at |= (
            (np.abs(nodes[:, 0] - seal.inner) < _SAME_M)
            & (nodes[:, 1] >= seal.low - _SAME_M)
            & (nodes[:, 1] <= seal.high + _SAME_M)
        )
    unit = sparse.eye_array(len(nodes), format="csr")
    return HotSpots(*(unit[rows] for rows in (elements_of("gap"), elements_of("coil"), np.flatnonzero(at))))


def _with_roles(section: Section, mesh: SectionMesh, roles: Sequence[Role]) -> NDArray[np.bool_]:
    return np.isin(mesh.region, [k for k, region in enumerate(section.regions) if region.role in roles])


def _surface_points(
    mesh: SectionMesh, elements: IntArray, size: int
) -> tuple[sparse.csr_array, FloatArray, IntArray]:
    """Return interpolation matrix, areas and surface indices of points on the surface.

    The matrix interpolates node temperatures at the Gauss points of the facets. The areas [m^2] are the
    weights of the points in integrals over the surface of revolution.
    """
    ends = np.sort(
        np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [0, 2]]])
    )
    middle = dict(zip(map(tuple, ends.tolist()), elements[:, 3:].T.ravel().tolist(), strict=True))
    try:
        middles = np.array([middle[min(a, b), max(a, b)] for a, b in mesh.facets.tolist()], dtype=np.int64)
    except KeyError as fault:
        raise InputError(place="mesh", found=f"the facet {fault} is not the side of a triangle") from fault
    at, weight = np.polynomial.legendre.leggauss(_FACET_POINTS)
    s = 0.5 * (1.0 + at)
    shape = np.stack([(1.0 - s) * (1.0 - 2.0 * s), s * (2.0 * s - 1.0), 4.0 * s * (1.0 - s)], axis=1)
    first, last = mesh.corners[mesh.facets[:, 0]], mesh.corners[mesh.facets[:, 1]]
    length = np.hypot(*(last - first).T)
    radius = first[:, :1] + np.outer(last[:, 0] - first[:, 0], s)
    area = math.pi * length[:, None] * radius * weight
    columns = np.repeat(np.column_stack([mesh.facets, middles]), len(s), axis=0)
    points = len(columns)
    values = sparse.csr_array(
        (np.tile(shape, (len(mesh.facets), 1)).ravel(), (np.repeat(np.arange(points), 3), columns.ravel())),
        shape=(points, size),
    )
    return values, area.ravel(), np.repeat(mesh.surface, len(s))


def cooling_in(model: FieldModel, surroundings: Surroundings, *, reference: float | None = None) -> Cooling:
    """Return the cooling of a model in surroundings that differ from its geometry.

    Parameters
    ----------
    reference : temperature that is subtracted from all unknowns [K]; None: ambient of the model
    """
    drawing = model.section.drawing
    if drawing is None:
        raise InputError(place="section", found="it has no geometry", expected="``section_of``")
    elsewhere = section_of(replace(drawing, surroundings=surroundings))
    return _cooling(elsewhere, model.surface, model.section.ambient if reference is None else reference)


def _cooling(section: Section, which: IntArray, reference: float) -> Cooling:
    """Return the cooling of points; ``which``: their indices in ``section.surfaces``."""
    surfaces = section.surfaces
    return Cooling(
        section.ambient,
        section.grid,
        section.films,
        law=np.array([each.law for each in surfaces], dtype=np.int64)[which],
        emissivity=np.array([each.emissivity for each in surfaces])[which],
        mount=np.array([each.mount for each in surfaces])[which],
        paths=np.array(
            [[PATHS.index(each.convection_path), PATHS.index(each.radiation_path)] for each in surfaces],
            dtype=np.int64,
        )
        .reshape(-1, 2)[which]
        .T,
        reference=reference,
    )
