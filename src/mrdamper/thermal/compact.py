"""Compact thermal model of a damper with six states for a controller.

    C_i dz_i/dt = -k_i z_i + p_i P + c_i R(T_coil) I^2 - sum_k h_k (S_k z - s_k (T_ambient - T_reference))

The heat sources are the mechanical power P and the heat R I^2 of the coil with resistance R and current I.
The factors p and c distribute these heat flows among the states. The states z are amplitudes of modes, which
are temperature distributions in the damper with heat capacities C and conductances k. The first mode is a
uniform temperature, so that the model conserves heat. Balanced truncation of the larger model in ``reduced``
yields the modes: they span the dominant subspace of the Gramian for heat sources, surfaces and outputs. The
model is passive for all heat-transfer coefficients. The omitted modes also respond to the heat sources. Their
steady-state response is added to the output temperatures and is called ``feedthrough``.

Each kind of surface k has one heat-transfer coefficient h_k, which is evaluated at the mean temperature of
the surface. S_k and s_k are integrals over the surface. Convection is tabulated versus ambient temperature,
air speed and temperature difference. Radiation and mounting are formulas.

The simulation in Python has the same implicit time step as ``thermal.c`` (core/kernel), which runs in
exported code. An export compares the two implementations. A steady-state Kalman filter at a typical
temperature corrects the model by sensor readings. The filter estimates the states and the *missing heat*,
which is the heat flow that the model does not contain. The missing heat is modelled as a random walk.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, eigh, solve_discrete_are, solve_triangular

from mrdamper.arrays import FloatArray
from mrdamper.quantities import REFERENCE_K
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.films.correlations import STEFAN_BOLTZMANN
from mrdamper.thermal.limits import limits_of
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.thermal.model.finite_element import build_field, cooling_in
from mrdamper.thermal.model.heat_equation import HeatEquation
from mrdamper.thermal.model.mesh import IntArray
from mrdamper.thermal.model.reduced import ReducedModel, reduce_field
from mrdamper.thermal.model.section import section_of
from mrdamper.thermal.model.stepping import Part
from mrdamper.thermal.settings import SETTINGS

PARTS: tuple[Part, ...] = ("gap", "coil", "seal")
POINT_COUNT = 3
"""Number of candidates for the hottest point of each part."""
UPDATE_S = 0.5
"""Duration of one time step [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class FilmTable:
    """Table of convective heat-transfer coefficients."""

    ambient: FloatArray  # ambient temperature [K], shape (3,), equidistant
    speed: FloatArray  # air speed [m/s], increasing
    above: FloatArray  # surface minus ambient temperature [K], increasing
    film: FloatArray  # coefficients [W/(m^2 K)], shape (types of surface, 3, speeds, differences)

    def interpolate(self, law: int, above: float, ambient: float, speed: float) -> float:
        """Return a convective heat-transfer coefficient [W/(m^2 K)] by interpolation in the table.

        ``law`` is the row of the table for a type of surface, and ``above`` the surface minus ambient
        temperature [K]. The interpolation is quadratic in the ambient temperature, and linear in air speed
        and in ``above``. Outside the table, the coefficient is constant. Only in ambient temperature, the
        quadratic is also used for half an interval beyond each end of the table.
        """
        width = self.ambient[1] - self.ambient[0]
        x = min(max((ambient - self.ambient[1]) / width, -1.5), 1.5)
        weight = np.array([0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)])
        sheet = np.tensordot(weight, self.film[law], (0, 0))
        over_speed = [np.interp(above, self.above, row) for row in sheet]
        return float(np.interp(speed, self.speed, over_speed))


@dataclass(frozen=True, slots=True, eq=False)
class CompactModel:
    """The matrices of the compact model with n states and k kinds of surface.

    The states are temperatures [K] relative to ``reference``.
    """

    reference: float  # reference temperature [K]
    capacity: FloatArray  # C: heat capacity of each state [J/K], shape (n,)
    conductance: FloatArray  # k: conductance of each state [W/K], shape (n,); zero for the uniform state
    mechanical: FloatArray  # p: factor of the mechanical power in the equation of each state, shape (n,)
    electrical: FloatArray  # c: factor of the coil heat in the equation of each state, shape (n,)
    loss: FloatArray  # S: integrals of the product of two modes over each surface [m^2], shape (k, n, n)
    mean: FloatArray  # weights of the states in the mean temperature of each surface, shape (k, n)
    law: tuple[int, ...]  # row of the table ``films`` that applies to each kind of surface
    radiation: FloatArray  # emissivity times the Stefan-Boltzmann constant, shape (k,)
    mount: FloatArray  # conductance to the mountings per area [W/(m^2 K)], shape (k,)
    films: FilmTable
    fluid: FloatArray  # weights of the states in the mean fluid temperature, shape (n,)
    coil: FloatArray  # weights of the states in the mean coil temperature, shape (n,)
    spots: FloatArray  # weights of the states in the temperatures of 3 points of each part, shape (3, 3, n)
    # Temperature rise of the omitted modes, per watt of mechanical power and per watt of coil heat
    fluid_feedthrough: FloatArray  # rise of the mean fluid temperature by omitted modes [K/W], shape (2,)
    coil_feedthrough: FloatArray  # rise of the mean coil temperature by omitted modes [K/W], shape (2,)
    spots_feedthrough: FloatArray  # rise by omitted modes at the points of ``spots`` [K/W], shape (3, 3, 2)
    limits: FloatArray  # temperature limits of gap, coil and seals [K], shape (3,)
    resistance: float  # coil resistance at 20 degC [ohm]
    air_speed: float  # default air speed [m/s]

    @property
    def states(self) -> int:
        return len(self.capacity)

    def film_of(self, kind: int, surface: float, ambient: float, air_speed: float) -> float:
        """Return the total heat-transfer coefficient of a kind of surface [W/(m^2 K)].

        The coefficient includes convection, radiation and mounting. Temperatures are in [K].
        """
        both = surface + ambient
        radiation = self.radiation[kind] * both * (surface**2 + ambient**2)
        convection = self.films.interpolate(self.law[kind], surface - ambient, ambient, air_speed)
        return max(convection, 0.0) + float(radiation) + float(self.mount[kind])


def compact_model(drawing: DamperDrawing) -> CompactModel:
    """Return the compact model of a geometry. Ambient temperature and air speed are inputs of the model."""
    reduced, others = _reduced(drawing)
    equation, kinds = reduced.equation, np.unique(reduced.full.surface)
    section = section_of(drawing)
    groups = [reduced.full.surface == kind for kind in kinds]
    seen = [equation.surface[group] for group in groups]
    areas = [equation.area[group] for group in groups]
    loss = np.array([(b.T * a) @ b for b, a in zip(seen, areas, strict=True)])
    mean = np.array([a @ b / a.sum() for b, a in zip(seen, areas, strict=True)])
    films = [_film_matrix(each, loss, kinds, reduced.full.surface) for each in others]
    sources = np.column_stack([equation.mechanical, equation.electrical])
    spots = _choose_spots(equation, films, sources)
    loads = np.column_stack(
        [
            SETTINGS.mechanical_weight_W * equation.mechanical,
            SETTINGS.coil_weight_W * equation.electrical,
            *(SETTINGS.surface_weight_W * mean),
            SETTINGS.output_weight_W * equation.fluid,
            *(SETTINGS.output_weight_W * spots[:2].reshape(-1, equation.size)),
        ]
    )
    basis = _modes(equation, films, loads)
    capacity = np.einsum("in,in->n", basis, equation.mass @ basis)
    conductance = np.einsum("in,in->n", basis, equation.stiffness @ basis)
    conductance[0] = 0.0
    rows = np.vstack([equation.fluid, equation.coil, spots.reshape(-1, equation.size)])
    through = np.mean([_feedthrough(equation, film, basis, sources, rows) for film in films], axis=0)
    return CompactModel(
        reference=REFERENCE_K,
        capacity=capacity,
        conductance=conductance,
        mechanical=basis.T @ equation.mechanical,
        electrical=basis.T @ equation.electrical,
        loss=np.einsum("im,kij,jn->kmn", basis, loss, basis),
        mean=mean @ basis,
        law=tuple(section.surfaces[kind].law for kind in kinds),
        radiation=np.array([section.surfaces[kind].emissivity for kind in kinds]) * STEFAN_BOLTZMANN,
        mount=np.array([section.surfaces[kind].mount for kind in kinds]),
        films=_film_table(drawing),
        fluid=equation.fluid @ basis,
        coil=equation.coil @ basis,
        spots=spots @ basis,
        fluid_feedthrough=through[0],
        coil_feedthrough=through[1],
        spots_feedthrough=through[2:].reshape(*spots.shape[:2], 2),
        limits=np.array([limit.kelvin for limit in limits_of(drawing)]),
        resistance=drawing.coil.resistance,
        air_speed=drawing.surroundings.air_speed,
    )


def _reduced(drawing: DamperDrawing) -> tuple[ReducedModel, list[HeatEquation]]:
    """Return a reduced model for several air speeds, and its equation at each speed."""
    full = build_field(drawing)
    around = [replace(drawing.surroundings, air_speed=speed) for speed in SETTINGS.basis_air_speeds_m_s]
    coolings = [cooling_in(full, each) for each in around]
    reduced = reduce_field(full, order=SETTINGS.source_model_order, elsewhere=coolings)
    return reduced, [replace(reduced.equation, cooling=each) for each in coolings]


def _film_matrix(equation: HeatEquation, loss: FloatArray, kinds: IntArray, surface: IntArray) -> FloatArray:
    """Return the heat-loss matrix [W/K], linearised at a typical temperature rise."""
    slope = equation.cooling.fluxes(np.full(len(surface), SETTINGS.typical_rise_K))[1].sum(axis=0)
    return np.asarray(
        sum(slope[surface == kind].mean() * each for kind, each in zip(kinds, loss, strict=True))
    )


def _modes(equation: HeatEquation, films: Sequence[FloatArray], loads: FloatArray) -> FloatArray:
    """Return the modes of the compact model in the unknowns of the reduced model.

    The first mode is a uniform temperature of 1 K. The other modes are the dominant directions of the
    Gramian. Step responses of the reduced model to ``loads``, shape (m, loads), determine the Gramian.
    """
    mass, uniform = equation.mass, equation.uniform
    gramian = np.zeros_like(mass)
    for film in films:
        rate, modes = eigh(equation.stiffness + film, mass)
        met = modes.T @ loads / rate[:, None]
        gramian += modes @ ((met @ met.T) / (rate[:, None] + rate)) @ modes.T
    apart = np.eye(len(uniform)) - np.outer(uniform, mass @ uniform) / (uniform @ mass @ uniform)
    root = cholesky(mass)  # upper triangular matrix with mass = rootᵀ root
    inner = root @ apart @ gramian @ apart.T @ root.T
    _, vectors = eigh(inner)
    space = solve_triangular(root, vectors[:, : -SETTINGS.compact_state_count : -1])
    _, turned = eigh(space.T @ equation.stiffness @ space, space.T @ mass @ space)
    return np.column_stack([uniform, space @ turned])


def _feedthrough(
    equation: HeatEquation, film: FloatArray, basis: FloatArray, sources: FloatArray, rows: FloatArray
) -> FloatArray:
    """Return the steady-state error of the compact model [K/W].

    The error is the response of the reduced model minus the response of its modes ``basis``. ``rows`` are
    the weights of the unknowns in each output.
    """
    matrix = equation.stiffness + film
    whole = np.linalg.solve(matrix, sources)
    kept = basis @ np.linalg.solve(basis.T @ matrix @ basis, basis.T @ sources)
    return np.asarray(rows @ (whole - kept))


def _choose_spots(equation: HeatEquation, films: Sequence[FloatArray], sources: FloatArray) -> FloatArray:
    """Return three points of each part that can be the hottest point of the part.

    A point is a row of weights of the m unknowns. The points are the hottest ones in short-term and
    steady-state responses to several ratios of mechanical power to coil heat. If fewer points are
    sufficient, a point is repeated.
    """
    mixtures = np.array([[1.0, 0.0], [0.9, 0.1], [0.7, 0.3], [0.3, 0.7], [0.0, 1.0]]).T
    fields = []
    for film in films:
        heated = np.column_stack([sources @ mixtures, film @ equation.uniform])
        for rate in SETTINGS.spot_rates_1_s:
            fields.append(np.linalg.solve(equation.stiffness + film + rate * equation.mass, heated))
    states = np.hstack(fields)
    found = []
    for part in PARTS:
        points = np.asarray(getattr(equation.spots, part))
        at = points @ states
        chosen: list[int] = []
        for _ in range(POINT_COUNT):
            best = at[chosen].max(axis=0) if chosen else np.full(at.shape[1], at.min())
            gain = np.maximum(at - best, 0.0) / at.max(axis=0)
            chosen.append(int(gain.sum(axis=1).argmax()))
        found.append(points[chosen])
    return np.array(found)


def _film_table(drawing: DamperDrawing) -> FilmTable:
    above, ambients = np.array(SETTINGS.film_rises_K), SETTINGS.film_ambient_K
    speeds = SETTINGS.film_air_speeds_m_s
    rows = []
    for ambient in ambients:
        for speed in speeds:
            around = replace(drawing.surroundings, ambient=ambient, air_speed=speed)
            section = section_of(replace(drawing, surroundings=around))
            rows.append([np.interp(ambient + above, section.grid, film) for film in section.films])
    table = np.array(rows).reshape(len(ambients), len(speeds), -1, len(above))
    return FilmTable(np.array(ambients), np.array(speeds), above, table.transpose(2, 0, 1, 3).copy())


@dataclass(frozen=True, slots=True, eq=False)
class CompactLoad:
    """Inputs of a simulation with n time steps. Arrays have the shape (n,)."""

    power: FloatArray  # mechanical power [W]
    coil_W: FloatArray  # heat R I^2 of the coil [W], with the resistance R at 20 degC
    ambient: FloatArray  # ambient temperature [K]
    air_speed: FloatArray  # air speed [m/s]


@dataclass(frozen=True, slots=True, eq=False)
class CompactHeating:
    """Results at the end of each of n time steps. Arrays have the shape (n,) unless stated otherwise."""

    state: FloatArray  # shape (n, states)
    fluid: FloatArray  # mean fluid temperature [K]
    hot: FloatArray  # temperatures of the hottest points of gap, coil and seals [K], shape (n, 3)
    coil_W: FloatArray  # heat R I^2 of the coil [W], with the resistance R at the coil temperature
    lost_W: FloatArray  # heat flow to air and mountings [W]


def simulate_compact(
    model: CompactModel, load: CompactLoad, *, start_K: float, step: float = UPDATE_S
) -> CompactHeating:
    """Simulate a compact model from a uniform temperature ``start_K`` with constant time steps [s]."""
    n = len(load.power)
    z = np.zeros(model.states)
    z[0] = start_K - model.reference
    states, coil_W, lost = np.empty((n, model.states)), np.empty(n), np.empty(n)
    for k in range(n):
        ambient, speed = float(load.ambient[k]), float(load.air_speed[k])
        warm = model.reference + float(model.coil @ z) - REFERENCE_K
        coil_W[k] = load.coil_W[k] * min(max(1.0 + COPPER_PER_K * warm, 0.2), 3.0)
        losses = _losses(model, z, ambient, speed)
        above = z.copy()
        above[0] -= ambient - model.reference
        heat = model.mechanical * load.power[k] + model.electrical * coil_W[k]
        rate = heat - model.conductance * z - losses @ above
        matrix = losses + np.diag(model.conductance + model.capacity / step)
        move = np.linalg.solve(matrix, rate)
        z = z + move
        states[k], lost[k] = z, float(losses[0] @ (above + move))
    sources = np.column_stack([load.power, coil_W])
    hot = states @ model.spots.reshape(-1, model.states).T
    hot += sources @ model.spots_feedthrough.reshape(-1, 2).T
    return CompactHeating(
        state=states,
        fluid=model.reference + states @ model.fluid + sources @ model.fluid_feedthrough,
        hot=model.reference + hot.reshape(n, *model.spots.shape[:2]).max(axis=2),
        coil_W=coil_W,
        lost_W=lost,
    )


def typical_power(model: CompactModel) -> float:
    """Return the power [W] that would heat the damper by 100 K in 30 min if there were no losses."""
    return float(model.capacity[0]) * SETTINGS.typical_power_rise_K / SETTINGS.typical_power_time_s


def sensor_gains(model: CompactModel, step: float = UPDATE_S) -> FloatArray:
    """Return the Kalman gains of two sensors for n states and missing heat, (2, n + 1).

    A gain is the correction of a state [K/K] or of the missing heat [W/K], divided by the difference between
    sensor and model. Row 0 is for the fluid thermometer. Row 1 is for the coil temperature, which is computed
    from the coil resistance. Each row assumes that there is no second sensor.
    """
    n, power = model.states, typical_power(model)
    matrix = np.diag(model.capacity / step + model.conductance)
    matrix += _losses(model, np.eye(n)[0] * SETTINGS.typical_rise_K, model.reference, model.air_speed)
    forward = np.zeros((n + 1, n + 1))
    forward[:n, :n] = np.linalg.solve(matrix, np.diag(model.capacity / step))
    forward[:n, n] = np.linalg.solve(matrix, model.mechanical)
    forward[n, n] = 1.0
    noise = np.zeros((n + 1, n + 1))
    into = forward[:n, n]
    noise[:n, :n] = (
        np.outer(into, into) * (SETTINGS.power_error_ratio * power) ** 2 * SETTINGS.power_error_time_s / step
    )
    noise[:n, :n] += np.diag(1e-9 * model.capacity[0] / model.capacity)
    noise[n, n] = (SETTINGS.missing_heat_ratio * power) ** 2 * step / SETTINGS.missing_heat_time_s
    gains = []
    for row, error in ((model.fluid, SETTINGS.fluid_noise_K), (model.coil, SETTINGS.coil_noise_K)):
        sees = np.append(row, 0.0)[None, :]
        heard = np.array([[error**2 * SETTINGS.sensor_noise_time_s / step]])
        spread = solve_discrete_are(forward.T, sees.T, noise, heard)
        gains.append((spread @ sees.T / (sees @ spread @ sees.T + heard))[:, 0])
    return np.array(gains)


def _losses(model: CompactModel, z: FloatArray, ambient: float, speed: float) -> FloatArray:
    """Return the matrix of the heat losses in state ``z`` [W/K], shape (n, n)."""
    surface = model.reference + model.mean @ z
    films = [model.film_of(k, float(kelvin), ambient, speed) for k, kelvin in enumerate(surface)]
    return np.asarray(np.tensordot(films, model.loss, (0, 0)))
