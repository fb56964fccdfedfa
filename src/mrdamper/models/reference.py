"""The reference: every hysteresis law simulated slowly and obviously, and the Bouc-Wen state in closed form.

The kernel (``core``) is fast; this module is what it is tested against, and what runs a user's own law in
Python. The equations stand here as one writes them on paper; SciPy's adaptive LSODA integrates them along
the trajectory's cubic Hermite interpolant, anew from each reversal and never with a step longer than the
sampling. The trajectory's dead band is not applied: every reversal counts.

The closed form shares nothing with the integrator: it inverts the hypergeometric function along each
monotone stretch of motion.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import digamma, hyp2f1

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.excitation import Trajectory
from mrdamper.files import is_file
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS, Coefficient, HysteresisLaw, PythonLaw
from mrdamper.models.temperature import REFERENCE_K

__all__ = [
    "bouc_wen_closed_form",
    "bouc_wen_distance",
    "bouc_wen_state",
    "law_from_python",
    "load_python_law",
    "simulate_reference",
    "turning_points",
]

_VISCOUS_SPEED = 0.1  # [m/s], where the viscosity is viscous force over speed
_MOST_CALLS = 20_000  # of a law's rate, per sample; some tens are usual

Values = Mapping[str, float]
Equation = Callable[[float, float, float, Values], float]  # of state, displacement, velocity, coefficients
State = Sequence[float]
Rate = Callable[[State, float, float, Values], State]  # the same for all the states of a law
Force = Callable[[State, float, float, Values], float]


def simulate_reference(damper: Damper, trajectory: Trajectory, *, tolerance: float = 1e-10) -> FloatArray:
    """Return the damper force [N] at the samples, shape (n,).

    The internal state starts at zero, the applied command at the first sample's. Errors of the state stay
    near ``tolerance`` times its scale; the time taken grows as it is made smaller.

    Raises
    ------
    ConvergenceError
        The integrator gave up, or a user's law returned something that is not finite.
    """
    path = _Path(damper, trajectory)
    law = damper.law
    rate, force = _equations(law)
    state = np.zeros((path.count, 1)) if rate is None else _integrate(rate, path, damper, tolerance)
    samples = [path.at(k, 0.0) for k in range(path.count - 1)] + [path.at(path.count - 2, 1.0)]
    result = np.array([force(z, x, v, c) for z, (x, v, c) in zip(state.tolist(), samples, strict=True)])
    if law.python is None:
        parallel = [_parallel(v, a, c) for (_, v, c), a in zip(samples, path.acceleration, strict=True)]
        result += parallel
    if not np.isfinite(result).all():
        first = int(np.flatnonzero(~np.isfinite(result))[0])
        raise ConvergenceError(f"law {law.name!r}: the force is {result[first]} at sample {first}")
    return result


# ------------------------------------------------------------------------------------------ the equations


def _parallel(v: float, a: float, c: Values) -> float:
    """Return what acts beside every law: viscosity, inertia and Stribeck friction [N]."""
    stribeck = c["coulomb_friction"] + c["breakaway_friction"] * math.exp(
        -((v / c["stribeck_velocity"]) ** 2)
    )
    viscous = math.copysign(math.pow(abs(v) / _VISCOUS_SPEED, c["viscous_exponent"]), v) * _VISCOUS_SPEED
    return c["viscosity"] * viscous + c["mass"] * a + stribeck * math.tanh(v / c["transition_velocity"])


def _spring(x: float, c: Values) -> float:
    return c["stiffness"] * x + c["offset"]


def _bouc_wen_rate(w: float, v: float, rho: float, kappa: float, n: float) -> float:
    u = w if v > 0.0 else -w  # positive while loading
    if u >= 0.0:
        return rho * v * (1.0 - math.pow(u, n))
    return rho * v * (1.0 - kappa * math.pow(min(-u, 1.0), n))  # past 1 by rounding, kappa = 1 would run away


def _bouc_wen(w: float, _x: float, v: float, c: Values) -> float:
    return _bouc_wen_rate(w, v, c["rho"], c["kappa"], c["n"])


def _bouc_wen_force(w: float, x: float, _v: float, c: Values) -> float:
    return _spring(x, c) + c["yield_force"] * w


def _dahl(w: float, _x: float, v: float, c: Values) -> float:
    return _bouc_wen_rate(w, v, c["rho"], -1.0, 1.0)


def _saturating_force(w: float, x: float, v: float, c: Values) -> float:
    share = abs(v) / (abs(v) + c["saturation_velocity"])
    return _spring(x, c) + (c["yield_force"] + c["rate_force"] * share) * w


def _bingham_force(_w: float, x: float, v: float, c: Values) -> float:
    return _spring(x, c) + c["yield_force"] * math.tanh(v / c["yield_velocity"])


def _tanh_force(_w: float, x: float, v: float, c: Values) -> float:
    side = (x > 0.0) - (x < 0.0)
    return _spring(x, c) + c["yield_force"] * math.tanh(c["slope"] * v + c["shift"] * side)


def _compliance_force(e: float, e_rate: float, c: Values) -> float:
    """Return the force of free play, spring and leak at travel e [m] and its rate [m/s]."""
    k, d, r = c["gap_stiffness"], c["gap"], c["gap_corner"]
    spring = k / 2 * (2 * e + math.hypot(e - d, r) - math.hypot(e + d, r))
    return spring + c["leak_damping"] * math.copysign(abs(e_rate) ** c["leak_exponent"], e_rate)


def _valve_force(y_rate: float, y: float, x: float, c: Values) -> float:
    """Return the force of the MR valve at its travel y [m] and velocity [m/s]."""
    thinning = c["thinning"] * math.copysign(abs(y_rate) ** c["thinning_exponent"], y_rate)
    shape = math.tanh(y_rate / c["yield_velocity"]) + thinning
    return c["offset"] + c["stiffness"] * y + c["yield_force"] * (1.0 + c["position_gain"] * x) * shape


def _valve_velocity(e: float, x: float, v: float, c: Values) -> float:
    """Return the valve velocity at which valve and compliance carry the same force [m/s]."""

    def surplus(y_rate: float) -> float:  # rises with y_rate
        return _valve_force(y_rate, x - e, x, c) - _compliance_force(e, v - y_rate, c)

    at_rest = surplus(0.0)
    if at_rest == 0.0:
        return 0.0
    near, far = 0.0, math.copysign(c["yield_velocity"], -at_rest)
    while surplus(far) * at_rest > 0.0:
        near, far = far, 4.0 * far
        if abs(far) > 1e6:
            raise ConvergenceError(
                "series-valve: the valve cannot carry the compliance's force at any speed; "
                "give it thinning, or the compliance leak_damping"
            )
    return float(brentq(surplus, near, far, xtol=1e-30, rtol=1e-15, maxiter=500))


def _series_valve(e: float, x: float, v: float, c: Values) -> float:
    return v - _valve_velocity(e, x, v, c)


def _series_valve_force(e: float, x: float, v: float, c: Values) -> float:
    return _valve_force(_valve_velocity(e, x, v, c), x - e, x, c)


def _lugre_slip(w: float, v: float, c: Values) -> float:
    """Return the velocity of the bristles [m/s]: what they bend less what they slip."""
    level = 1.0 + c["static_excess"] * math.exp(-((v / c["fade_velocity"]) ** 2))
    return v - abs(v) * w / level


def _lugre(w: float, _x: float, v: float, c: Values) -> float:
    return c["rho"] * _lugre_slip(w, v, c)


def _lugre_force(w: float, x: float, v: float, c: Values) -> float:
    return _spring(x, c) + c["yield_force"] * w + c["bristle_damping"] * _lugre_slip(w, v, c)


def _spencer_inner(state: State, v: float, c: Values) -> float:
    """Return the velocity y' of the series dashpot [m/s]; the states are e = x - y [m] and w."""
    e, w = state
    pull = c["yield_force"] * w + c["inner_viscosity"] * v + c["inner_stiffness"] * e
    return pull / (c["inner_viscosity"] + c["series_damping"])


def _spencer(state: State, _x: float, v: float, c: Values) -> State:
    e_rate = v - _spencer_inner(state, v, c)
    return e_rate, _bouc_wen_rate(state[1], e_rate, c["rho"], c["kappa"], c["n"])


def _spencer_force(state: State, x: float, v: float, c: Values) -> float:
    return c["series_damping"] * _spencer_inner(state, v, c) + _spring(x, c)


def _double(state: State, _x: float, v: float, c: Values) -> State:
    first, second = state
    kappa, n = c["kappa"], c["n"]
    return _bouc_wen_rate(first, v, c["rho"], kappa, n), _bouc_wen_rate(second, v, c["second_rho"], kappa, n)


def _double_force(state: State, x: float, _v: float, c: Values) -> float:
    return _spring(x, c) + c["yield_force"] * state[0] + c["second_force"] * state[1]


_EQUATIONS: Mapping[str, tuple[Equation | None, Equation]] = {
    "bouc-wen": (_bouc_wen, _bouc_wen_force),
    "dahl": (_dahl, _bouc_wen_force),
    "bouc-wen-saturating": (_bouc_wen, _saturating_force),
    "bingham": (None, _bingham_force),
    "tanh": (None, _tanh_force),
    "lugre": (_lugre, _lugre_force),
    "series-valve": (_series_valve, _series_valve_force),
}


def _equations(law: HysteresisLaw) -> tuple[Rate | None, Force]:
    """Return rate (None: no memory) and force of a law, of all its states: one, but for two laws."""
    if law.name == "spencer":
        return _spencer, _spencer_force
    if law.name == "double-bouc-wen":
        return _double, _double_force
    rate, force = (law.python.rate, law.python.force) if law.python is not None else _EQUATIONS[law.name]

    def force_of_one(state: State, x: float, v: float, c: Values) -> float:
        return force(state[0], x, v, c)

    if rate is None:
        return None, force_of_one
    return lambda state, x, v, c: (rate(state[0], x, v, c),), force_of_one


# -------------------------------------------------------------------------------- path and integration


class _Path:
    """Motion and coefficients between the samples: cubic Hermite of (x, v), command linear then lagged."""

    def __init__(self, damper: Damper, trajectory: Trajectory) -> None:
        self.step, self.count = trajectory.step, trajectory.displacement.size
        self.acceleration: list[float] = trajectory.acceleration.tolist()
        self.cubics: list[list[float]] = _hermite(trajectory).tolist()
        self._damper, self._names = damper, damper.law.names
        command, self._lag = trajectory.command, damper.command_lag_s
        if damper.actuation is not None:  # worked out at the samples, linear between them
            command = damper.actuation.applied(command, trajectory.step)
        self._command: list[float] = command.tolist()
        warm = trajectory.temperature if damper.temperature_dependent else None
        self._warm: list[float] = [REFERENCE_K] if warm is None else warm.tolist()
        self._applied = [self._command[0]]
        for k in range(self.count - 1):
            self._applied.append(self._lagged(k, self._applied[k], 1.0))
        constant = len({*self._command}) == 1 and len({*self._warm}) == 1
        self._constant = self._values(self._command[0], self._warm[0]) if constant else None

    def at(self, k: int, theta: float) -> tuple[float, float, Values]:
        """Return displacement, velocity and coefficients at the share theta of interval k."""
        x0, x1, x2, x3 = self.cubics[k]
        x = x0 + theta * (x1 + theta * (x2 + theta * x3))
        v = (x1 + theta * (2 * x2 + theta * 3 * x3)) / self.step
        if self._constant is not None:
            return x, v, self._constant
        here = self._warm[0]
        if len(self._warm) > 1:
            here = self._warm[k] + theta * (self._warm[k + 1] - self._warm[k])
        return x, v, self._values(self._lagged(k, self._applied[k], theta), here)

    def _lagged(self, k: int, applied: float, theta: float) -> float:
        """Solve applied' = (command - applied)/lag from the interval's start, the command being linear."""
        start, end, lag = self._command[k], self._command[k + 1], self._lag
        command = start + theta * (end - start)
        if lag == 0.0:
            return command
        behind = (end - start) / self.step * lag
        return command - behind + (applied - start + behind) * math.exp(-theta * self.step / lag)

    def _values(self, applied: float, temperature: float) -> dict[str, float]:
        at = self._damper.coefficients_at(applied, temperature)[:, 0]
        return dict(zip(self._names, at.tolist(), strict=True))


def _integrate(rate: Rate, path: _Path, damper: Damper, tolerance: float) -> FloatArray:
    """Return the states at the samples, shape (n, states), integrated anew from each reversal."""
    last = path.count - 1
    turns = [k + theta for k, cubic in enumerate(path.cubics) for theta in _turns(cubic)]
    rests = [k for k, cubic in enumerate(path.cubics) if cubic[1] == 0.0]
    local = tolerance / 30  # the errors of many steps add up
    scale = _state_scale(damper, path)
    samples, state = np.arange(path.count, dtype=np.float64), np.zeros((path.count, len(scale)))
    z = state[0]
    for start, end in pairwise(np.unique([0.0, *rests, *turns, float(last)]).tolist()):
        left = iter(range(int(_MOST_CALLS * (end - start + 1.0))))

        def slope(time: float, at: FloatArray, left: Iterator[int] = left) -> list[float]:  # time in samples
            if next(left, None) is None:  # LSODA itself would go on for ever
                raise ConvergenceError(
                    f"law {damper.law.name!r}: no progress at sample {time:.3f}, where its state is {at[0]:g}"
                )
            k = min(int(time), last - 1)
            return [path.step * each for each in rate(at.tolist(), *path.at(k, time - k))]

        inside = np.flatnonzero((samples > start) & (samples <= end))
        solution = solve_ivp(
            slope,
            (start, end),
            z,
            method="LSODA",
            t_eval=np.union1d(samples[inside], end),
            max_step=1.0,
            rtol=max(local, 1e-13),
            atol=[local * each for each in scale],
        )
        if not solution.success:
            raise ConvergenceError(f"law {damper.law.name!r}: the integrator stopped: {solution.message}")
        state[inside] = solution.y[:, : inside.size].T
        z = solution.y[:, -1]
    return state


def _state_scale(damper: Damper, path: _Path) -> State:
    """Return the states' sizes for which ``tolerance`` is meant: 1, or the travel under the yield force."""
    _, _, c = path.at(0, 0.0)
    if damper.law.name == "series-valve":
        return (max(c["yield_force"], 1.0) / c["gap_stiffness"],)
    if damper.law.name == "spencer":
        return 1.0 / c["rho"], 1.0
    if damper.law.name == "double-bouc-wen":
        return 1.0, 1.0
    return (1.0,)


def _hermite(trajectory: Trajectory) -> FloatArray:
    """Return x(theta) = x0 + x1 theta + x2 theta^2 + x3 theta^3 on each interval, shape (n - 1, 4)."""
    x, v = trajectory.displacement, trajectory.step * trajectory.velocity
    rise = np.diff(x)
    return np.stack([x[:-1], v[:-1], 3 * rise - 2 * v[:-1] - v[1:], v[:-1] + v[1:] - 2 * rise], axis=1)


def _turns(cubic: Sequence[float]) -> list[float]:
    """Return where the cubic's slope changes sign inside 0..1."""
    c, b, a = cubic[1], 2 * cubic[2], 3 * cubic[3]
    discriminant = b * b - 4 * a * c
    if discriminant <= 0.0:
        return []
    q = -0.5 * (b + math.copysign(math.sqrt(discriminant), b))
    roots = [q / a if a else math.inf, c / q if q else math.inf]
    return sorted(theta for theta in roots if 0.0 < theta < 1.0)


# ------------------------------------------------------------------------------ Bouc-Wen in closed form


def turning_points(trajectory: Trajectory) -> tuple[tuple[int, float], ...]:
    """Return the reversals between samples as (interval, displacement [m]), from the cubic Hermite."""
    cubics = _hermite(trajectory)
    return tuple(
        (k, float(np.polynomial.polynomial.polyval(theta, cubic)))
        for k, cubic in enumerate(cubics)
        for theta in _turns(cubic.tolist())
    )


def bouc_wen_distance(w: float, kappa: float, n: float) -> float:
    r"""Return the normalised travel tau from w = 0 to w along one direction of motion [-].

    .. math:: \tau(w) = w\,F(1, 1/n; 1 + 1/n; w^n)

    with kappa |w|^n in place of w^n for w < 0. F is Gauss's hypergeometric function; dtau/dw = 1/(1 - w^n),
    or 1/(1 - kappa |w|^n) for w < 0.

    Notes
    -----
    ``hyp2f1`` loses all digits near 1 when c - a - b is a rounding error instead of 0, and returns
    infinity from 1 - 1e-13 on: hence b from c, and the leading terms of its logarithmic series there.
    """
    c = 1.0 + 1.0 / n
    b = c - 1.0
    argument = w**n if w >= 0.0 else kappa * (-w) ** n
    if argument > 1.0 - 1e-12:
        distance_to_one = -math.expm1(n * math.log(abs(w)))
        if w < 0.0:
            distance_to_one += (1.0 - kappa) * (-w) ** n
        if distance_to_one <= 0.0:
            return math.copysign(math.inf, w)
        return w * -b * (math.log(distance_to_one) + float(digamma(b)) + float(np.euler_gamma))
    return w * float(hyp2f1(1.0, b, c, argument))


def bouc_wen_state(distance: float, kappa: float, n: float) -> float:
    """Return w in [-1, 1] at the normalised travel tau [-]: the inverse of ``bouc_wen_distance``."""
    low, high = math.nextafter(-1.0, 0.0), math.nextafter(1.0, 0.0)
    if distance >= bouc_wen_distance(high, kappa, n):
        return 1.0
    if distance <= bouc_wen_distance(low, kappa, n):
        return -1.0
    return float(
        brentq(lambda w: bouc_wen_distance(w, kappa, n) - distance, low, high, xtol=1e-16, rtol=1e-15)
    )


def bouc_wen_closed_form(
    displacement: Sequence[float] | FloatArray,
    turning: Sequence[tuple[int, float]] = (),
    *,
    rho: float,
    kappa: float,
    n: float,
) -> FloatArray:
    """Return the Bouc-Wen state w at the samples, exact to rounding, from w = 0 at the first.

    Parameters
    ----------
    displacement : at the samples [m], shape (n,)
    turning : reversals between samples, in order, as (k, displacement [m]) for interval k to k + 1
    rho, kappa, n : inverse yield displacement [1/m], unloading shape [-], sharpness [-]
    """
    between: dict[int, list[float]] = {}
    for k, x in turning:
        between.setdefault(k, []).append(x)
    here = origin = float(displacement[0])
    direction, start, w = 0.0, 0.0, 0.0
    states = [w]
    for k in range(len(displacement) - 1):
        for there in [*between.get(k, []), float(displacement[k + 1])]:
            towards = float(np.sign(there - here))
            if towards not in (0.0, direction):
                direction, origin = towards, here
                start = bouc_wen_distance(towards * w, kappa, n)
            if direction:
                w = direction * bouc_wen_state(start + rho * abs(there - origin), kappa, n)
            here = there
        states.append(w)
    return np.array(states)


# ------------------------------------------------------------------------------------ a user's own law


def law_from_python(law: PythonLaw) -> HysteresisLaw:
    """Return a user's own law as a ``HysteresisLaw``.

    Raises
    ------
    InputError
        ``name``, ``coefficients``, ``rate`` or ``force`` missing, or a name that is taken or not usable.
    """
    what = f"law of class {type(law).__name__}"
    lacking = [part for part in ("name", "coefficients", "rate", "force") if not hasattr(law, part)]
    if lacking:
        raise InputError(
            f"{what}: no {' or '.join(lacking)}; a law has name, coefficients, rate() and force()"
        )
    given: tuple[object, Sequence[object]] = (law.name, law.coefficients)
    name, coefficients = given
    if not isinstance(name, str) or not name or name in LAWS:
        raise InputError(f"{what}: name is {name!r}; choose one that is not {', '.join(LAWS)}")
    names = [c.name for c in coefficients if isinstance(c, Coefficient)]
    if len(set(names)) < len(coefficients) or not all(each.isidentifier() for each in names):
        raise InputError(
            f"{what}: coefficients must be Coefficient(...) with different names like yield_force"
        )
    title = (type(law).__doc__ or law.name).strip().splitlines()[0]
    return HysteresisLaw(
        name, title, tuple(law.coefficients), "a user's own law: no conditions known", None, law
    )


def load_python_law(reference: str) -> HysteresisLaw:
    """Return the law in ``path/to/file.py:ClassName``. This runs the file.

    Raises
    ------
    InputError
        The file or class is not there, or does not run.
    """
    file, colon, name = reference.rpartition(":")
    path = Path(file)
    if not colon or not name.isidentifier() or path.suffix != ".py":
        raise InputError(f"law {reference!r}: expected path/to/file.py:ClassName")
    if not is_file(path):
        raise InputError(f"law {reference!r}: there is no file {path}; give its path from {Path.cwd()}")
    spec = importlib.util.spec_from_file_location(f"mrdamper_user_law_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"law {reference!r}: Python cannot import {path}")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
        made = getattr(module, name, None)
        law = made() if made is not None else None
    except Exception as fault:  # whatever the user's file raises is bad input
        raise InputError(f"law {reference!r}: {type(fault).__name__}: {fault}; correct {path}") from fault
    if law is None:
        defined = [key for key, value in vars(module).items() if isinstance(value, type)]
        raise InputError(
            f"law {reference!r}: {path} has no class {name}; it has {', '.join(defined) or 'none'}"
        )
    return law_from_python(law)
