"""Ways to integrate the Bouc-Wen law: ours, by hand in C, and those of packages that one would take instead.

Each takes a ``Problem`` and returns a job without arguments that gives the first candidate's force [N]; what
it prepares once (compiling, sampling the motion) is not part of the job. An import that fails is the caller's
to tell.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable
from ctypes import c_double, c_size_t
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bench.native import library, pointer
from bench.problem import Problem
from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.models.laws import LAWS

__all__ = [
    "Job",
    "cvode",
    "diffrax_tsit5",
    "explicit_euler",
    "jax_rk4",
    "kernel",
    "kernel_errors",
    "numba_rk4",
    "octave_lsode",
    "odeint",
    "reference_c",
    "reference_errors",
    "rk4_c",
    "solve_ivp",
]

Job = Callable[[], FloatArray]
Traced = Any  # what JAX passes through a function


def kernel(problem: Problem) -> Job:
    """Prepare the project's kernel: exact flow, one table a candidate."""
    number = LAWS["bouc-wen"].kernel or 0
    record, table, measured = problem.record, problem.coefficients, [problem.measured]
    force = core.run(number, record, np.ascontiguousarray(table[0, 0]))[0]

    def job() -> FloatArray:
        core.squared_errors(number, [record], measured, [0], table)
        return force

    return job


def kernel_errors(problem: Problem) -> FloatArray:
    """Return the kernel's sums of squared errors [N^2], shape (candidates,)."""
    number = LAWS["bouc-wen"].kernel or 0
    return core.squared_errors(number, [problem.record], [problem.measured], [0], problem.coefficients)[:, 0]


def reference_errors(problem: Problem) -> FloatArray:
    """Return the plain C's sums of squared errors [N^2], shape (candidates,)."""
    errors = np.empty(problem.candidates)
    _reference(problem, errors)()
    return errors


def reference_c(problem: Problem) -> Job:
    """Prepare the same method in plain C for this law alone (``reference.c``)."""
    return _reference(problem, np.empty(problem.candidates))


def _reference(problem: Problem, errors: FloatArray) -> Job:
    call, track = library().reference_errors, problem.trajectory
    pieces = problem.record.pieces
    first = np.array([piece[0] for piece in pieces], dtype=np.int64)
    turn = np.array([*(piece[1] for piece in pieces), track.displacement[-1]], dtype=np.float64)
    side = np.array([float(piece[2]) for piece in pieces])
    candidates = np.zeros((problem.candidates, 7))
    candidates[:, 3:] = problem.values
    force = np.empty(problem.samples)
    x, v, measured = track.displacement, track.velocity, problem.measured

    def job(out: FloatArray | None = None) -> FloatArray:
        call(c_size_t(problem.samples), pointer(x), pointer(v), pointer(measured), c_size_t(len(first)),
             pointer(first), pointer(turn), pointer(side), c_size_t(problem.candidates), pointer(candidates),
             pointer(errors), None if out is None else pointer(out))  # fmt: skip
        return force

    job(force)
    return job


def rk4_c(problem: Problem, substeps: int = 1) -> Job:
    """Runge-Kutta in time, by hand in C, vectors over the candidates (``rk4.c``)."""
    call, velocity, measured = library().rk4_errors, problem.velocity(substeps), problem.measured
    rows = np.ascontiguousarray(problem.values.T)
    work, errors, force = (
        np.empty(problem.candidates),
        np.empty(problem.candidates),
        np.empty(problem.samples),
    )

    sizes = (c_size_t(problem.samples), c_size_t(substeps), c_double(1.0 / problem.rate_Hz))
    given = (pointer(velocity), pointer(measured), c_size_t(problem.candidates))
    taken = (pointer(work), pointer(errors), pointer(force))

    def job() -> FloatArray:
        call(*sizes, *given, *(pointer(row) for row in rows), *taken)
        return force

    return job


def explicit_euler(problem: Problem) -> Job:
    """Euler's step in NumPy over all candidates: quick to write, and wrong."""
    yield_force, rho, kappa, n = problem.values.T
    v, step = problem.velocity(1)[::2], 1.0 / problem.rate_Hz

    def job() -> FloatArray:
        w, errors, force = (
            np.zeros(problem.candidates),
            np.zeros(problem.candidates),
            np.empty(problem.samples),
        )
        for i in range(problem.samples):
            if i:
                k = np.where(w * v[i - 1] >= 0.0, 1.0, kappa)
                w = w + step * rho * v[i - 1] * (1.0 - k * np.abs(w) ** n)
            force[i] = yield_force[0] * w[0]
            errors += (problem.measured[i] - yield_force * w) ** 2
        return force

    return job


def numba_rk4(problem: Problem, substeps: int = 1) -> Job:
    """Compile the loops of ``rk4.c`` by numba with ``fastmath``."""
    call = _compiled_by_numba()
    velocity, rows, step = problem.velocity(substeps), problem.values.T.copy(), 1.0 / problem.rate_Hz
    force = np.empty(problem.samples)

    def job() -> FloatArray:
        call(velocity, problem.measured, step / substeps, substeps, rows[0], rows[1], rows[2], rows[3], force)
        return force

    job()
    return job


@cache
def _compiled_by_numba() -> Callable[..., FloatArray]:
    import numba

    @numba.njit(fastmath=True, inline="always")
    def slope(w, v, rho, kappa, n):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        k = 1.0 if w * v >= 0.0 else kappa
        return rho * v * (1.0 - k * (abs(w) + 1e-300) ** n)

    @numba.njit(fastmath=True)
    def integrate(velocity, measured, h, sub, size, rho, kappa, n, force):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202, PLR0913, PLR0917
        w, errors = np.zeros(len(size)), np.zeros(len(size))
        for i in range(len(measured)):
            for s in range(sub if i else 0):
                at = 2 * ((i - 1) * sub + s)
                v0, v1, v2 = velocity[at], velocity[at + 1], velocity[at + 2]
                for j in range(len(size)):
                    a = slope(w[j], v0, rho[j], kappa[j], n[j])
                    b = slope(w[j] + 0.5 * h * a, v1, rho[j], kappa[j], n[j])
                    c = slope(w[j] + 0.5 * h * b, v1, rho[j], kappa[j], n[j])
                    d = slope(w[j] + h * c, v2, rho[j], kappa[j], n[j])
                    w[j] += h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            force[i] = size[0] * w[0]
            for j in range(len(size)):
                errors[j] += (measured[i] - size[j] * w[j]) ** 2
        return errors

    return integrate  # type: ignore[no-any-return]


def jax_rk4(problem: Problem, substeps: int = 1) -> Job:
    """Runge-Kutta by ``lax.scan`` over samples and ``vmap`` over candidates, compiled, double precision."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)  # noqa: FBT003
    velocity = problem.velocity(substeps)
    count = problem.samples - 1
    ends = np.stack([velocity[i : i + 2 * substeps * count : 2] for i in range(3)], axis=1)
    stages = jnp.asarray(ends.reshape(count, substeps, 3))
    h = 1.0 / (problem.rate_Hz * substeps)

    def one(size: Traced, rho: Traced, kappa: Traced, n: Traced, stages: Traced, measured: Traced) -> Traced:
        def slope(w: Traced, v: Traced) -> Traced:
            return rho * v * (1.0 - jnp.where(w * v >= 0.0, 1.0, kappa) * (jnp.abs(w) + 1e-300) ** n)

        def sample(carried: Traced, given: Traced) -> Traced:
            (w, error), (at, wanted) = carried, given
            for v in at:
                a = slope(w, v[0])
                b = slope(w + 0.5 * h * a, v[1])
                c = slope(w + 0.5 * h * b, v[1])
                w = w + h / 6.0 * (a + 2.0 * b + 2.0 * c + slope(w + h * c, v[2]))
            return (w, error + (wanted - size * w) ** 2), w

        (_, error), w = jax.lax.scan(sample, (0.0, measured[0] ** 2), (stages, measured[1:]))
        return error, size * w

    solve = jax.jit(jax.vmap(one, in_axes=(0, 0, 0, 0, None, None)))
    given = [jnp.asarray(row) for row in problem.values.T]
    wanted = jnp.asarray(problem.measured)

    def job() -> FloatArray:
        error, force = solve(*given, stages, wanted)
        error.block_until_ready()
        return np.concatenate([[0.0], np.asarray(force[0])])

    job()
    return job


def diffrax_tsit5(problem: Problem, tolerance: float = 1e-6) -> Job:
    """Tsit5 with diffrax's own step control, ``vmap`` over the candidates, compiled, double precision."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)  # noqa: FBT003
    times, wanted = jnp.asarray(problem.times), jnp.asarray(problem.measured)
    size, omega = problem.shape.amplitude_m, 2.0 * np.pi * problem.shape.frequency_Hz

    def slope(t: Traced, w: Traced, args: Traced) -> Traced:
        rho, kappa, n = args
        v = size * omega * jnp.cos(omega * t)
        return rho * v * (1.0 - jnp.where(w * v >= 0.0, 1.0, kappa) * (jnp.abs(w) + 1e-300) ** n)

    def one(yield_force: Traced, rho: Traced, kappa: Traced, n: Traced) -> Traced:
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(slope),
            diffrax.Tsit5(),
            times[0],
            times[-1],
            1.0 / problem.rate_Hz,
            jnp.asarray(0.0),
            args=(rho, kappa, n),
            saveat=diffrax.SaveAt(ts=times),
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=1e-2 * tolerance),
            max_steps=20 * problem.samples,
        )
        force = yield_force * solution.ys
        return jnp.sum((wanted - force) ** 2), force

    solve = jax.jit(jax.vmap(one))
    given = [jnp.asarray(row) for row in problem.values.T]

    def job() -> FloatArray:
        error, force = solve(*given)
        error.block_until_ready()
        return np.asarray(force[0])

    job()
    return job


# ------------------------------------------------------------------------------------ one by one, in Python


def _slope(problem: Problem, values: FloatArray) -> Callable[[float, float], float]:
    """Return the law's rate in plain Python: quicker than NumPy on one number."""
    from math import cos, pi

    _, rho, kappa, n = values.tolist()
    omega = 2.0 * pi * problem.shape.frequency_Hz
    speed = problem.shape.amplitude_m * omega

    def slope(t: float, w: float) -> float:
        v = speed * cos(omega * t)
        return float(rho * v * (1.0 - (1.0 if w * v >= 0.0 else kappa) * abs(w) ** n))

    return slope


def _one_by_one(problem: Problem, solve: Callable[[Callable[[float, float], float]], FloatArray]) -> Job:
    slopes = [_slope(problem, values) for values in problem.values]

    def job() -> FloatArray:
        first: FloatArray | None = None
        for slope, values in zip(slopes, problem.values, strict=True):
            force = values[0] * solve(slope)
            error = problem.measured[: len(force)] - force
            float(error @ error)
            first = force if first is None else first
        assert first is not None
        return first

    return job


def solve_ivp(problem: Problem, tolerance: float = 1e-6, method: str = "RK45") -> Job:
    """``scipy.integrate.solve_ivp``."""
    from scipy.integrate import solve_ivp as integrate

    ends = (0.0, float(problem.times[-1]))

    def solve(slope: Callable[[float, float], float]) -> FloatArray:
        def rate(t: float, w: FloatArray) -> FloatArray:
            return np.array([slope(t, w[0])])

        tight = {"rtol": tolerance, "atol": 1e-2 * tolerance}
        found = integrate(rate, ends, [0.0], method, problem.times, **tight)  # type: ignore[call-overload]
        return np.asarray(found.y[0])

    return _one_by_one(problem, solve)


def odeint(problem: Problem, tolerance: float = 1e-6) -> Job:
    """``scipy.integrate.odeint`` (LSODA)."""
    from scipy.integrate import odeint as integrate

    def solve(slope: Callable[[float, float], float]) -> FloatArray:
        found = integrate(
            lambda t, w: slope(t, w[0]),
            [0.0],
            problem.times,
            tfirst=True,
            rtol=tolerance,
            atol=1e-2 * tolerance,
        )
        return np.asarray(found[:, 0])

    return _one_by_one(problem, solve)


def cvode(problem: Problem, tolerance: float = 1e-6) -> Job:
    """CVODE (BDF) of scikit-sundae, the right-hand side in Python."""
    from sksundae.cvode import CVODE

    def solve(slope: Callable[[float, float], float]) -> FloatArray:
        def rate(t: float, w: FloatArray, out: FloatArray) -> None:
            out[0] = slope(t, w[0])

        solver = CVODE(rate, rtol=tolerance, atol=1e-2 * tolerance, method="BDF", max_num_steps=100_000)
        return np.asarray(solver.solve(problem.times, np.zeros(1)).y[:, 0])

    return _one_by_one(problem, solve)


_OCTAVE = """1;
function dw = rate (w, t, p)
  v = p(4) * cos (p(5) * t);
  if (w * v >= 0) k = 1; else k = p(2); end
  dw = p(1) * v * (1 - k * abs (w) ^ p(3));
end
lsode_options ("relative tolerance", {tolerance:g});
lsode_options ("absolute tolerance", {absolute:g});
candidates = [{candidates}];
t = (0:{last})' / {rate:.17g};
for j = 1:rows (candidates)
  p = candidates(j, 2:6);
  w = candidates(j, 1) * lsode (@(w, t) rate (w, t, p), 0, t);
  if (j == 1) fid = fopen ("{out}", "w"); fwrite (fid, w, "double"); fclose (fid); end
end
"""


def octave_lsode(problem: Problem, tolerance: float = 1e-6) -> Job:
    """``lsode`` of GNU Octave, a process of its own: its start is part of the job."""
    program = shutil.which("octave-cli") or shutil.which("octave")
    if program is None:
        raise ImportError("the program octave is not installed")
    omega = 2.0 * np.pi * problem.shape.frequency_Hz
    motion = [problem.shape.amplitude_m * omega, omega]
    rows = "; ".join(" ".join(f"{value:.17g}" for value in [*row, *motion]) for row in problem.values)
    folder = Path(tempfile.mkdtemp(prefix="mrdamper-bench-"))
    script, out = folder / "run.m", folder / "w.bin"
    script.write_text(
        _OCTAVE.format(
            tolerance=tolerance, absolute=1e-2 * tolerance, candidates=rows, last=problem.samples - 1,
            rate=problem.rate_Hz, out=out,
        ),
        encoding="utf-8",
    )  # fmt: skip

    def job() -> FloatArray:
        subprocess.run(
            [str(program), "--no-gui", "--norc", "--quiet", str(script)], check=True, capture_output=True
        )
        return np.fromfile(out)

    return job
