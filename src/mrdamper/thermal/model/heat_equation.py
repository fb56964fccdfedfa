"""The heat equation after discretisation in space, and its integration in time.

    M dθ/dt = -K θ + p P(mean fluid) + W (c + E θ) - Bᵀ a q(B θ)        θ = T - ambient

M is the mass matrix (heat capacities), and K the conduction matrix. P is the mechanical power with the load
vector p. W is the coil heat at 20 degC with the load vector c. E is the increase of the coil heat with the
local temperature, because the coil resistance increases. B interpolates θ at the surface points, which have
the areas a and the heat fluxes q. The matrices are sparse for the finite elements, and small and dense for
the reduced model. Both models use the same time integration (``stepping``). If the heat capacity of a part
depends on its mean temperature, M changes with time. The Jacobian is exact except for this change. Because P
depends on the mean fluid temperature, the Jacobian is a sparse matrix plus a dense matrix of rank one. The
Sherman-Morrison formula solves equations with this sum.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.interpolate import CubicSpline
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse.linalg import splu

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError, EnvelopeError, InputError
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.thermal.films.correlations import STEFAN_BOLTZMANN
from mrdamper.thermal.heat_capacity import CapacityCurve
from mrdamper.thermal.model.mesh import IntArray
from mrdamper.thermal.model.network import PATHS
from mrdamper.thermal.model.stepping import FIRST_STEP_S, EnergyAccount, Load, Part, Solver, integrate

Matrix = Any  # sparse or dense matrix

_ROUNDING_K = 1e-5  # Newton steps that are smaller than this can be rounding errors.


class Cooling:
    """Heat flux at p surface points versus temperature: convection (tabulated), radiation, and mountings.

    Parameters
    ----------
    ambient : temperature of the surroundings [K]
    grid, films : temperatures [K], and convective coefficients at these temperatures, as in ``Section``
    law : row of ``films`` that applies to each point, shape (p,)
    emissivity : emissivity of each point, shape (p,)
    mount : conductance to the mountings per area of each point [W/(m^2 K)], shape (p,)
    paths : indices in ``network.PATHS`` of convection and radiation of each point, shape (2, p)
    reference : temperature that is subtracted from all unknowns [K]; None: ambient
    """

    def __init__(
        self,
        ambient: float,
        grid: FloatArray,
        films: FloatArray,
        *,
        law: IntArray,
        emissivity: FloatArray,
        mount: FloatArray,
        paths: IntArray,
        reference: float | None = None,
    ) -> None:
        self.ambient, self.grid = ambient, grid
        self._reference = reference = ambient if reference is None else reference
        self._law, self._mount = law, mount
        self._black = emissivity * STEFAN_BOLTZMANN
        self._low, self._width = float(grid[0]) - reference, float(grid[1] - grid[0])
        # Coefficients of cubic splines of convective heat flux, shape (rows of ``films``, intervals, 4).
        self._cubics = CubicSpline(grid, (films * (grid - ambient)).T).c.transpose(2, 1, 0).copy()
        points = np.arange(len(law))
        mount_column = np.full(len(law), PATHS.index("mount"))
        # The matrix ``_sort`` sums the heat flows of all points by path of ``PATHS``. Its columns are the
        # convection at all points, then the radiation, then the conduction to the mountings.
        where = np.concatenate([paths[0], paths[1], mount_column])
        self._sort = sparse.csr_array(
            (np.ones(3 * len(law)), (where, np.concatenate([points + k * len(law) for k in range(3)]))),
            shape=(len(PATHS), 3 * len(law)),
        )

    def fluxes(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the fluxes by convection, radiation and mount [W/m^2], and their derivatives [W/(m^2 K)].

        Both arrays have the shape (3, p).
        """
        at = (theta - self._low) / self._width
        place = at.astype(np.intp)
        if theta.size and not (at.min() >= 0.0 and at.max() < self._cubics.shape[1]):
            raise self.refusal(theta)
        c3, c2, c1, c0 = self._cubics[self._law, place].T
        x = (at - place) * self._width
        kelvin = theta + self._reference
        cube = self._black * kelvin**3
        flux = np.stack(
            [
                ((c3 * x + c2) * x + c1) * x + c0,
                cube * kelvin - self._black * self.ambient**4,
                self._mount * (kelvin - self.ambient),
            ]
        )
        slope = np.stack([(3.0 * c3 * x + 2.0 * c2) * x + c1, 4.0 * cube, self._mount])
        return flux, slope

    def by_path(self, fluxes: FloatArray, area: FloatArray) -> FloatArray:
        """Return the heat flow through each path of ``network.PATHS`` [W], shape (paths,).

        ``fluxes`` are heat fluxes at the p points, as returned by the method ``fluxes``, shape (3, p).
        ``area`` are the areas of these points.
        """
        return np.asarray(self._sort @ (fluxes * area).ravel())

    def refusal(self, theta: FloatArray) -> EnvelopeError:
        """Return the EnvelopeError for surface temperatures outside the tabulated range."""
        worst = (
            theta[np.argmax(np.where(np.isfinite(theta), np.abs(theta), np.inf))]
            + self._reference
            - ZERO_CELSIUS_K
        )
        low, high = self.grid[0] - ZERO_CELSIUS_K, self.grid[-1] - ZERO_CELSIUS_K
        return EnvelopeError(
            place="heating",
            found=f"a surface is at {worst:.4g} degC",
            expected=f"{low:.0f} to {high:.0f} degC",
            remedy="Reduce the load, check the dimensions in the geometry file, or stop at the fluid limit",
        )


@dataclass(frozen=True, slots=True, eq=False)
class HotSpots:
    """Matrices of shape (m, n) that return temperatures of a part for n unknowns.

    Each row is for one of m points that can be the hottest point of the part.
    """

    gap: Matrix
    coil: Matrix
    seal: Matrix


@dataclass(frozen=True, slots=True, eq=False)
class StoredHeat:
    """Temperature-dependent heat capacity of one part of the damper."""

    mass: Matrix  # mass matrix of the part with its mean heat capacity [J/K], shape (n, n)
    curve: CapacityCurve  # heat capacity divided by its mean, versus the mean temperature of the part


@dataclass(frozen=True, slots=True, eq=False)
class HeatEquation:
    """The sparse or dense matrices of the heat equation with n unknowns and p surface points."""

    ambient: float  # ambient temperature [K]
    mass: Matrix  # heat capacities [J/K], shape (n, n)
    stiffness: Matrix  # heat conduction [W/K], shape (n, n)
    mechanical: FloatArray  # load vector for 1 W of mechanical power, shape (n,)
    electrical: FloatArray  # load vector for 1 W of coil heat, shape (n,)
    warming: Matrix  # E: derivative of 1 W of coil heat with respect to the unknowns [1/K], shape (n, n)
    surface: Matrix  # B: temperatures of the surface points for given unknowns, shape (p, n)
    area: FloatArray  # area of the surface points [m^2], shape (p,)
    cooling: Cooling
    fluid: FloatArray  # weights of the unknowns for the mean fluid temperature, shape (n,)
    coil: FloatArray  # weights for the mean coil temperature, shape (n,)
    wall: FloatArray  # weights for the mean temperature of tube and caps, shape (n,)
    uniform: FloatArray  # unknowns for a uniform temperature of 1 K, shape (n,)
    reference_growth: float  # coil heat at ambient temperature divided by coil heat at 20 degC [-]
    spots: HotSpots
    storage: tuple[StoredHeat, ...] = ()

    @property
    def size(self) -> int:
        """Return the number of unknowns."""
        return len(self.uniform)

    def mass_at(self, state: FloatArray) -> Matrix:
        """Return the mass matrix at the temperatures of a state [J/K], shape (n, n)."""
        found = self.mass
        for part in self.storage:
            row = part.mass @ self.uniform
            mean = float(row @ state) / float(row @ self.uniform) + self.ambient
            found = found + (part.curve.evaluate(mean) - 1.0) * part.mass
        return found

    def heat(self, states: FloatArray) -> FloatArray:
        """Return the heat that is stored above ambient [J], shape (...) for states of shape (..., n)."""
        found = states @ (self.mass @ self.uniform)
        for part in self.storage:
            row = part.mass @ self.uniform
            above, capacity = states @ row, float(row @ self.uniform)
            start, end = (
                part.curve.integral(self.ambient + each / capacity) for each in (0.0 * above, above)
            )
            found = found + capacity * (end - start) - above
        return np.asarray(found)


@dataclass(frozen=True, slots=True, eq=False)
class FieldHeating(EnergyAccount):
    """Result of a simulation: temperatures, heat flows and energies at the end of each time step.

    The columns of ``flow`` and ``energy`` are the paths of ``network.PATHS``, then mechanical power, then
    coil heat.
    """

    equation: HeatEquation
    time: FloatArray  # [s], shape (k,)
    state: FloatArray  # unknowns above ambient [K], shape (k, n)
    flow: FloatArray  # heat flow through each path and from each source [W], shape (k, 7)
    energy: FloatArray  # heat through each path and from each source since the start [J], shape (k, 7)
    stopped: bool  # True if the simulation stopped because the fluid reached a given temperature

    def _mean(self, weights: FloatArray) -> FloatArray:
        return np.asarray(self.state @ weights + self.equation.ambient)

    @property
    def fluid(self) -> FloatArray:
        """Mean temperature of the fluid [K], shape (k,)."""
        return self._mean(self.equation.fluid)

    @property
    def coil(self) -> FloatArray:
        """Mean temperature of the coil [K], shape (k,)."""
        return self._mean(self.equation.coil)

    @property
    def wall(self) -> FloatArray:
        """Mean temperature of tube and caps [K], shape (k,)."""
        return self._mean(self.equation.wall)

    def hottest(self, part: Part) -> FloatArray:
        """Return the temperature of the hottest point of a part [K], shape (k,)."""
        points: Matrix = getattr(self.equation.spots, part)
        return np.asarray((points @ self.state.T).max(axis=0) + self.equation.ambient)

    @property
    def columns(self) -> Mapping[str, Sequence[int]]:
        """Return the columns of ``flow`` and ``energy`` for each loss path; unused paths are omitted."""
        return {path: [k] for k, path in enumerate(PATHS) if self.flow[:, k].any() or self.energy[:, k].any()}

    @property
    def stored(self) -> FloatArray:
        """Heat stored since the start [J], shape (k,)."""
        found = self.equation.heat(self.state)
        return np.asarray(found - found[0])


def simulate_field(
    equation: HeatEquation,
    loads: Sequence[Load],
    *,
    start: float | FloatArray | None = None,
    longest_step: float = 60.0,
    first_step: float = FIRST_STEP_S,
    stop_at: float = math.inf,
) -> FieldHeating:
    """Simulate a heat equation with consecutive loads.

    Parameters
    ----------
    start : uniform temperature at the start [K], or unknowns above ambient, shape (n,); None: ambient
    longest_step : maximum step [s]; steps grow from ``first_step`` after each change of load
    stop_at : mean fluid temperature at which the simulation stops [K]

    Raises
    ------
    EnvelopeError
        If the temperature of a surface is outside the table of convective coefficients.
    """
    return FieldHeating(
        equation,
        *integrate(
            FieldSystem(equation),
            loads,
            _first_state(equation, start),
            first_step=first_step,
            longest_step=longest_step,
            stop_at=stop_at,
        ),
    )


def steady_field(equation: HeatEquation, load: Load) -> FloatArray:
    """Return the unknowns above ambient in the steady state for a load [K], shape (n,).

    The nonlinear equation is solved by Newton's method.

    Raises
    ------
    ConvergenceError
        If there is no steady state (no losses), or the iteration did not converge.
    """
    system = FieldSystem(equation)
    system.take(load)
    state = _first_state(equation, equation.ambient + 50.0)
    before = math.inf
    for _ in range(60):
        here = system.evaluate(state)
        move = system.solver(here, 1.0, 0.0)(here.rate)
        # Newton's step is judged by temperatures at some points, because reduced unknowns have no unit.
        seen = (equation.surface @ move, equation.spots.gap @ move, equation.spots.coil @ move)
        largest = max(float(np.abs(each).max(initial=0.0)) for each in seen)
        if not math.isfinite(largest) or largest > 1e9:
            break
        state = np.asarray(state + move * min(1.0, 50.0 / max(largest, 1e-300)))
        # Stop if the iteration has converged or if only rounding errors remain.
        if largest < 1e-9 or before <= 2.0 * largest < 2.0 * _ROUNDING_K:
            return state
        before = largest
    raise ConvergenceError(
        place="steady state",
        found="Newton's method did not converge in 60 steps. Without losses there is no steady state",
    )


def _first_state(equation: HeatEquation, start: float | FloatArray | None) -> FloatArray:
    given = np.asarray(equation.ambient if start is None else start, dtype=np.float64)
    if given.ndim == 0:
        return np.asarray(equation.uniform * (float(given) - equation.ambient))
    if given.shape != (equation.size,):
        raise InputError(
            place="heating",
            found=f"start has shape {given.shape}",
            expected=f"one number or ({equation.size},)",
        )
    return given.copy()


@dataclass(frozen=True, slots=True, eq=False)
class _Here:
    """Right-hand side of the heat equation, heat flows and derivatives at one state."""

    rate: FloatArray  # M dθ/dt [W], shape (n,)
    flow: FloatArray  # heat flow through each path and from each source [W], shape (7,)
    slopes: FloatArray  # derivatives of the surface fluxes [W/(m^2 K)], shape (3, p)
    power_slope: float  # derivative of the mechanical power [W/K]


class FieldSystem:
    """Implements ``stepping.System`` for a heat equation.

    A state contains the n unknowns above ambient [K], then the heat through each path and from both sources
    since the start [J].
    """

    def __init__(self, equation: HeatEquation) -> None:
        self.equation, self.nodes = equation, equation.size
        # ``_warm_row`` times the unknowns is the increase of the total coil heat / coil heat at 20 degC.
        self._warm_row = np.asarray(equation.warming.T @ equation.uniform)
        self._mass = equation.mass  # mass matrix at the state of the last call of ``linearise``

    def take(self, load: Load) -> None:
        """Set the load. Its mechanical power is stored as a cubic spline of the fluid temperature."""
        grid = self.equation.cooling.grid
        self._power = CubicSpline(grid - self.equation.ambient, load.power(grid))
        self._coil_W = load.coil_W

    def fluid(self, state: FloatArray) -> float:
        """Return the mean fluid temperature [K]."""
        return float(self.equation.fluid @ state[: self.nodes]) + self.equation.ambient

    def rate(self, state: FloatArray) -> FloatArray:
        """Return the right-hand side of the equation [W], an array in the order of the state.

        The array contains M dθ/dt for the unknowns, then the heat flow through each path and from both
        sources.
        """
        here = self.evaluate(state[: self.nodes])
        warming = here.rate
        if self.equation.storage:  # Convert M dθ/dt: all stages of a step use the mass matrix ``_mass``.
            mass = self.equation.mass_at(state[: self.nodes])
            warming = self._mass @ factorise(mass)(warming)
        return np.concatenate([warming, here.flow])

    def inertia(self, rate: FloatArray) -> FloatArray:
        """Return M times a derivative of the unknowns, then derivatives of the energies."""
        return np.concatenate([self._mass @ rate[: self.nodes], rate[self.nodes :]])

    def balance(self, before: FloatArray, after: FloatArray) -> FloatArray:
        """Return the state ``after`` a step, corrected so that the energy balance closes.

        The correction adds a uniform temperature. It is zero if heat capacities are constant. Heat capacities
        that depend on temperature cause an error of the energy balance in each step.
        """
        e, n = self.equation, self.nodes
        if not e.storage:
            return after
        gone = after[n:] - before[n:]
        wanted = float(e.heat(before[:n])) + float(gone[-2:].sum() - gone[:-2].sum())
        found = after.copy()
        for _ in range(3):
            capacity = float(e.uniform @ (e.mass_at(found[:n]) @ e.uniform))
            found[:n] += (wanted - float(e.heat(found[:n]))) / capacity * e.uniform
        return found

    def linearise(self, state: FloatArray, shrunk: float) -> tuple[FloatArray, Solver]:
        """Return the right-hand side, and the solver of (M - ``shrunk`` J) x = b.

        ``shrunk`` is gamma times the time step [s], as in ``stepping.System``. J is the Jacobian.
        """
        n = self.nodes
        here = self.evaluate(state[:n])
        self._mass = self.equation.mass_at(state[:n])
        solve = self.solver(here, shrunk, 1.0)

        def with_energies(right: FloatArray) -> FloatArray:
            move = solve(right[:n])
            return np.concatenate([move, right[n:] + shrunk * self.flow_change(here, move)])

        return np.concatenate([here.rate, here.flow]), with_energies

    def evaluate(self, state: FloatArray) -> _Here:
        e = self.equation
        fluxes, slopes = e.cooling.fluxes(e.surface @ state)
        mean = float(e.fluid @ state)
        power, power_slope = float(self._power(mean)), float(self._power(mean, 1))
        coil = self._coil_W * (e.reference_growth + float(self._warm_row @ state))
        rate = power * e.mechanical + (self._coil_W * e.reference_growth) * e.electrical
        rate += self._coil_W * (e.warming @ state) - e.stiffness @ state
        rate -= e.surface.T @ (e.area * fluxes.sum(axis=0))
        flow = np.concatenate([e.cooling.by_path(fluxes, e.area), [power, coil]])
        return _Here(rate, flow, slopes, power_slope)

    def flow_change(self, here: _Here, move: FloatArray) -> FloatArray:
        """Return the linearised change of all heat flows [W] for a change of the unknowns."""
        e = self.equation
        lost = e.cooling.by_path(here.slopes * (e.surface @ move), e.area)
        gained = [here.power_slope * (e.fluid @ move), self._coil_W * (self._warm_row @ move)]
        return np.concatenate([lost, gained])

    def solver(self, here: _Here, shrunk: float, inertia: float) -> Solver:
        """Return the solver of (``inertia`` M - ``shrunk`` J) x = b with the Jacobian J.

        ``inertia`` is 1 for a time step and 0 for the steady state.
        """
        e = self.equation
        weight = e.area * here.slopes.sum(axis=0)
        bend = shrunk * here.power_slope
        matrix = inertia * self._mass + shrunk * (e.stiffness - self._coil_W * e.warming)
        matrix = matrix + shrunk * (e.surface.T @ (e.surface * weight[:, None]))
        solve = factorise(matrix)
        spread = solve(e.mechanical)
        gain = bend / (1.0 - bend * float(e.fluid @ spread))

        def corrected(right: FloatArray) -> FloatArray:
            plain = solve(right)
            return np.asarray(plain + spread * (gain * float(e.fluid @ plain)))

        return corrected


def factorise(matrix: Matrix) -> Solver:
    """Factorise a dense or sparse matrix; return a function that solves linear systems with this matrix."""
    if isinstance(matrix, np.ndarray):
        factors = lu_factor(matrix, check_finite=False)
        return lambda right: np.asarray(lu_solve(factors, right, check_finite=False))
    # Pivots stay on the diagonal because the matrix is nearly symmetric. The option panel_size is only 2
    # because wider panels are not faster.
    sparse_factors = splu(
        sparse.csc_array(matrix),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.01,
        relax=1,
        panel_size=2,
        options={"SymmetricMode": True},
    )
    return lambda right: np.asarray(sparse_factors.solve(right))
