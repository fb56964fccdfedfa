"""Load and integrate user-defined laws in Python.

SciPy's adaptive LSODA integrates the equations along the cubic Hermite interpolant of the trajectory. The
integration restarts at each reversal, and the step never exceeds the sampling period. This is slow but
general. The C kernel ignores reversals that are smaller than the dead band of the trajectory, but this
integrator uses every reversal. This module does not depend on the kernel.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.excitation import Trajectory
from mrdamper.files import is_file
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS, Coefficient, HysteresisLaw, PythonLaw
from mrdamper.quantities import REFERENCE_K

Values = Mapping[str, float]
State = Sequence[float]
# (states, displacement, velocity, coefficients) -> state rates
Rate = Callable[[State, float, float, Values], State]
Force = Callable[[State, float, float, float, Values], float]  # like Rate, with acceleration after velocity


@dataclass(frozen=True, slots=True)
class Equations:
    """Equations of a hysteresis law with any number of internal states, zero at first.

    ``rate`` is None for a law without internal states. ``scale`` returns the typical sizes of the states,
    computed from the coefficients at the first sample. The tolerance of the integrator is relative to these
    sizes.
    """

    rate: Rate | None
    force: Force
    scale: Callable[[Values], State] = lambda _: (1.0,)


def integrate(
    damper: Damper, trajectory: Trajectory, equations: Equations | None = None, *, tolerance: float = 1e-10
) -> FloatArray:
    """Return the damper force [N] at the samples of a trajectory, shape (n,).

    At the first sample, the effective command equals the command. Errors of a state are about ``tolerance``
    times the typical size of the state. A smaller tolerance takes more time.

    Parameters
    ----------
    equations : equations of the law; None: the equations of the user-defined law of the damper

    Raises
    ------
    ConvergenceError
        If the integrator fails, or a law returns a value that is not finite.
    """
    if equations is None:
        equations = _equations_of(damper.law)
    states = integrate_states(damper, trajectory, equations, tolerance=tolerance)
    return force_of_states(damper, trajectory, states, equations)


def integrate_states(
    damper: Damper,
    trajectory: Trajectory,
    equations: Equations | None = None,
    *,
    tolerance: float,
) -> FloatArray:
    """Return the internal states at the samples, shape (n, states); arguments as for ``integrate``."""
    equations = equations or _equations_of(damper.law)
    path = _Path(damper, trajectory)
    if equations.rate is None:
        return np.zeros((path.count, 1))
    return _integrate(equations.rate, equations.scale(path.evaluate(0, 0.0)[2]), path, damper, tolerance)


def force_of_states(
    damper: Damper, trajectory: Trajectory, states: FloatArray, equations: Equations | None = None
) -> FloatArray:
    """Return the damper force [N] at the samples from the internal states, shape (n,).

    Raises
    ------
    ConvergenceError
        If the law returns a force that is not finite.
    """
    equations = equations or _equations_of(damper.law)
    path = _Path(damper, trajectory)
    samples = [path.evaluate(k, 0.0) for k in range(path.count - 1)] + [path.evaluate(path.count - 2, 1.0)]
    moved = zip(states.tolist(), samples, trajectory.acceleration.tolist(), strict=True)
    result = np.array([equations.force(z, x, v, a, c) for z, (x, v, c), a in moved])
    if not np.isfinite(result).all():
        first = int(np.flatnonzero(~np.isfinite(result))[0])
        raise ConvergenceError(
            place=f"law {damper.law.name!r}", found=f"the force is {result[first]} at sample {first}"
        )
    return result


def _equations_of(law: HysteresisLaw) -> Equations:
    own = law.python
    if own is None:
        raise InputError(f"law {law.name!r} is the kernel's", expected="a law in Python, or its equations")
    return Equations(
        lambda state, x, v, values: (own.rate(state[0], x, v, values),),
        lambda state, x, v, _, values: own.force(state[0], x, v, values),
    )


class _Path:
    """Motion and coefficients as continuous functions of time.

    The motion is the cubic Hermite interpolant of (x, v). The command is linear between samples, then lagged.
    """

    def __init__(self, damper: Damper, trajectory: Trajectory) -> None:
        self.step, self.count = trajectory.step, trajectory.displacement.size
        self.cubics: list[list[float]] = hermite(trajectory).tolist()
        self._damper, self._names = damper, damper.law.names
        command, self._lag = trajectory.command, damper.command_lag_s
        if damper.actuation is not None:  # The effective command is interpolated linearly.
            command = damper.actuation.apply(command, trajectory.step)
        self._command: list[float] = command.tolist()
        kelvin = trajectory.temperature if damper.temperature_dependent else None
        self._kelvin: list[float] = [REFERENCE_K] if kelvin is None else kelvin.tolist()
        self._applied = [self._command[0]]
        for k in range(self.count - 1):
            self._applied.append(self._first_order_lag(k, self._applied[k], 1.0))
        constant = len({*self._command}) == 1 and len({*self._kelvin}) == 1
        self._constant = self._values(self._command[0], self._kelvin[0]) if constant else None

    def evaluate(self, k: int, theta: float) -> tuple[float, float, Values]:
        """Return displacement, velocity and coefficients at a fraction of interval k.

        ``theta`` is the fraction, 0 to 1.
        """
        x0, x1, x2, x3 = self.cubics[k]
        x = x0 + theta * (x1 + theta * (x2 + theta * x3))
        v = (x1 + theta * (2 * x2 + theta * 3 * x3)) / self.step
        if self._constant is not None:
            return x, v, self._constant
        here = self._kelvin[0]
        if len(self._kelvin) > 1:
            here = self._kelvin[k] + theta * (self._kelvin[k + 1] - self._kelvin[k])
        return x, v, self._values(self._first_order_lag(k, self._applied[k], theta), here)

    def _first_order_lag(self, k: int, applied: float, theta: float) -> float:
        """Return the lagged command at the fraction theta of sample interval k.

        The result solves applied' = (command - applied) / lag for a linear command. The first value is
        ``applied``.
        """
        start, end, lag = self._command[k], self._command[k + 1], self._lag
        command = start + theta * (end - start)
        if lag == 0.0:
            return command
        behind = (end - start) / self.step * lag
        return command - behind + (applied - start + behind) * math.exp(-theta * self.step / lag)

    def _values(self, applied: float, temperature: float) -> dict[str, float]:
        at = self._damper.coefficients_at(applied, temperature)[:, 0]
        return dict(zip(self._names, at.tolist(), strict=True))


def _integrate(rate: Rate, scale: State, path: _Path, damper: Damper, tolerance: float) -> FloatArray:
    """Return the states at the samples, shape (n, states); the integration restarts at each reversal."""
    call_count_max = 20_000  # max calls of ``rate`` for one sample; some tens are normal
    from scipy.integrate import solve_ivp

    last = path.count - 1
    turns = [k + theta for k, cubic in enumerate(path.cubics) for theta in turns_of(cubic)]
    rests = [k for k, cubic in enumerate(path.cubics) if cubic[1] == 0.0]
    local = tolerance / 30  # The error limit of one step is smaller, because the errors of many steps add up.
    samples, state = np.arange(path.count, dtype=np.float64), np.zeros((path.count, len(scale)))
    z = state[0]
    for start, end in pairwise(np.unique([0.0, *rests, *turns, float(last)]).tolist()):
        left = iter(range(int(call_count_max * (end - start + 1.0))))

        def slope(time: float, at: FloatArray, left: Iterator[int] = left) -> list[float]:  # time in samples
            if next(left, None) is None:  # LSODA itself does not limit the number of calls.
                raise ConvergenceError(
                    place=f"law {damper.law.name!r}",
                    found=f"no progress at sample {time:.3f}, where its state is {at[0]:g}",
                )
            k = min(int(time), last - 1)
            return [path.step * each for each in rate(at.tolist(), *path.evaluate(k, time - k))]

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
            raise ConvergenceError(
                place=f"law {damper.law.name!r}", found=f"the integrator stopped: {solution.message}"
            )
        state[inside] = solution.y[:, : inside.size].T
        z = solution.y[:, -1]
    return state


def hermite(trajectory: Trajectory) -> FloatArray:
    """Return the coefficients of the cubic Hermite interpolant on each interval, shape (n - 1, 4).

    x(theta) = x0 + x1 theta + x2 theta^2 + x3 theta^3 for theta from 0 to 1.
    """
    x, v = trajectory.displacement, trajectory.step * trajectory.velocity
    rise = np.diff(x)
    return np.stack([x[:-1], v[:-1], 3 * rise - 2 * v[:-1] - v[1:], v[:-1] + v[1:] - 2 * rise], axis=1)


def turns_of(cubic: Sequence[float]) -> list[float]:
    """Return the points between 0 and 1 at which the slope of a cubic polynomial changes sign."""
    c, b, a = cubic[1], 2 * cubic[2], 3 * cubic[3]
    discriminant = b * b - 4 * a * c
    if discriminant <= 0.0:
        return []
    q = -0.5 * (b + math.copysign(math.sqrt(discriminant), b))
    roots = [q / a if a else math.inf, c / q if q else math.inf]
    return sorted(theta for theta in roots if 0.0 < theta < 1.0)


def law_from_python(law: PythonLaw) -> HysteresisLaw:
    """Return a user-defined law as a ``HysteresisLaw``.

    Raises
    ------
    InputError
        If ``name``, ``coefficients``, ``rate`` or ``force`` is missing, or the name is in use or invalid.
    """
    what = f"law of class {type(law).__name__}"
    lacking = [part for part in ("name", "coefficients", "rate", "force") if not hasattr(law, part)]
    if lacking:
        raise InputError(
            place=what, found=f"no {' or '.join(lacking)}; a law has name, coefficients, rate() and force()"
        )
    given: tuple[object, Sequence[object]] = (law.name, law.coefficients)
    name, coefficients = given
    if not isinstance(name, str) or not name or name in LAWS:
        raise InputError(place=what, found=f"name is {name!r}; choose one that is not {', '.join(LAWS)}")
    names = [c.name for c in coefficients if isinstance(c, Coefficient)]
    if len(set(names)) < len(coefficients) or not all(each.isidentifier() for each in names):
        raise InputError(
            place=what, found="coefficients must be Coefficient(...) with different names like yield_force"
        )
    title = (type(law).__doc__ or law.name).strip().splitlines()[0]
    return HysteresisLaw(
        name, title, tuple(law.coefficients), "a user-defined law without known conditions", None, law
    )


def load_python_law(reference: str) -> HysteresisLaw:
    """Return the law in ``path/to/file.py:ClassName``. This runs the file.

    Raises
    ------
    InputError
        If the file or class does not exist, or the file raises an exception.
    """
    file, colon, name = reference.rpartition(":")
    path = Path(file)
    if not colon or not name.isidentifier() or path.suffix != ".py":
        raise InputError(place=f"law {reference!r}", found="expected path/to/file.py:ClassName")
    if not is_file(path):
        raise InputError(
            place=f"law {reference!r}", found=f"there is no file {path}; give its path from {Path.cwd()}"
        )
    spec = importlib.util.spec_from_file_location(f"mrdamper_user_law_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(place=f"law {reference!r}", found=f"Python cannot import {path}")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
        made = getattr(module, name, None)
        law = made() if made is not None else None
    except Exception as fault:  # Any exception in the user's file counts as invalid input.
        raise InputError(
            place=f"law {reference!r}", found=f"{type(fault).__name__}: {fault}; correct {path}"
        ) from fault
    if law is None:
        defined = [key for key, value in vars(module).items() if isinstance(value, type)]
        raise InputError(
            place=f"law {reference!r}",
            found=f"{path} has no class {name}; it has {', '.join(defined) or 'none'}",
        )
    return law_from_python(law)
