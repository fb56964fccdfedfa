"""Simulation: Bouc-Wen ensembles and the stepped laws, and the everyday way to do it beside them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from bench.measure import Row, interleaved
from mrdamper import core
from mrdamper.core import _kernel
from mrdamper.excitation import Sine, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import COMMON, LAWS
from mrdamper.models.reference import bouc_wen_closed_form

__all__ = ["run"]

CANDIDATES, SAMPLES, RATE_Hz = 512, 10_000, 1000.0
MOTION = Sine(0.010, 1.7)
BARS = {"v4": "9 ns", "baseline": "13 ns"}
SERIES = {
    **{"stiffness": 731.0, "offset": 48.0, "yield_force": 500.0, "thinning": 3.2, "thinning_exponent": 0.43},
    **{"yield_velocity": 2.5e-3, "position_gain": -2.3, "gap_stiffness": 1.2e7, "gap": 1.67e-4},
    **{"gap_corner": 4.6e-5, "leak_damping": 3e4, "leak_exponent": 0.994},
}


STEPPED = {
    "lugre": {
        "yield_force": 500.0,
        "rho": 1500.0,
        "static_excess": 0.4,
        "fade_velocity": 0.01,
        "bristle_damping": 600.0,
    },
    "spencer": {
        **{"yield_force": 800.0, "series_damping": 3e4, "inner_viscosity": 2500.0, "inner_stiffness": 5000.0},
        **{"rho": 1500.0, "kappa": -0.4, "n": 1.6},
    },
}


def _values(law: str, numbers: Mapping[str, float]) -> np.ndarray:
    damper = Damper(LAWS[law], {name: Constant(value) for name, value in numbers.items()})
    return np.ascontiguousarray(damper.coefficients_at(0.0)[:, 0])


def _series(**changed: float) -> np.ndarray:
    return _values("series-valve", {**SERIES, **changed})


def run() -> list[Row]:
    """Return time per candidate-sample at each instruction-set level, and the comparators."""
    trajectory = drive(MOTION, duration=(SAMPLES - 1) / RATE_Hz, rate_Hz=RATE_Hz, command=0.0)
    shape = {"rho": 1500.0, "kappa": -0.4, "n": 1.6}
    times = np.arange(0.25, MOTION.frequency * SAMPLES / RATE_Hz, 0.5) / MOTION.frequency
    turning = [(int(t * RATE_Hz), float(MOTION.displacement(t))) for t in times]
    exact = bouc_wen_closed_form(trajectory.displacement, turning, **shape)
    number = LAWS["bouc-wen"].kernel or 0
    values = _values("bouc-wen", {"yield_force": 1.0, **shape})
    draw = np.random.default_rng(0)
    candidates = np.tile(values, (CANDIDATES, 1, 1))
    candidates[:, 0, len(COMMON) :] *= draw.uniform(0.8, 1.2, (CANDIDATES, 4))
    measured = [np.ascontiguousarray(exact)]
    record = core.open_record(trajectory)

    def ensemble(level: str) -> None:
        _kernel.use_level(level)
        core.squared_errors(number, [record], measured, [0], candidates)

    best = _kernel.level()
    levels = _kernel.levels()[::-1]
    spent = interleaved({level: partial(ensemble, level) for level in levels})
    rows = []
    for level in levels:
        _kernel.use_level(level)
        error = np.abs(core.run(number, record, values)[0] - exact).max()
        ns = 1e9 * spent[level] / (CANDIDATES * SAMPLES)
        title = f"bouc-wen, {CANDIDATES} x {SAMPLES:,}, force and squared error, {level}"
        against = f"{error:.1e} of the largest force from the closed form"
        rows.append(
            Row(title, spent[level], ns, spent[level] / spent[levels[0]], against, BARS.get(level, ""))
        )
    _kernel.use_level(best)
    return [
        *rows,
        *_tangents(record, values, number),
        *_series_valve(record),
        *_stepped(record),
        _solve_ivp(exact, shape, rows[0]),
    ]


def _tangents(record: core.Record, values: np.ndarray, number: int) -> list[Row]:
    """One candidate at a time: the force alone, and with the tangents by yield force, rho, kappa and n."""
    spent = interleaved(
        {
            "force": lambda: core.run(number, record, values),
            "tangents": lambda: core.run(number, record, values, range(len(COMMON), len(values))),
        },
        repeats=51,
    )
    return [
        Row(f"bouc-wen, one candidate, {name}", cpu, 1e9 * cpu / SAMPLES, cpu / spent["force"])
        for name, cpu in spent.items()
    ]


def _series_valve(record: core.Record) -> list[Row]:
    number, values = LAWS["series-valve"].kernel or 0, _series()
    chain = [1, 2, *range(len(COMMON), len(values))]
    spent = interleaved(
        {
            "tangents off": lambda: core.run(number, record, values),
            "12 tangents": lambda: core.run(number, record, values, chain),
            "tangents off, leak exponent 1": lambda: core.run(number, record, _series(leak_exponent=1.0)),
        },
        repeats=21,
    )
    return [
        Row(
            f"series-valve, 1 kHz, {name}",
            cpu,
            1e9 * cpu / SAMPLES,
            cpu / spent["tangents off"],
            "order 2, see docs/laws.md",
            "250 ns" if name.startswith("tangents off") else "",
        )
        for name, cpu in spent.items()
    ]


def _stepped(record: core.Record) -> list[Row]:
    """Time the other laws that are stepped along the record: the force, and with all their own tangents."""
    rows = []
    for law, numbers in STEPPED.items():
        number, values = LAWS[law].kernel or 0, _values(law, numbers)
        own = range(len(COMMON), len(values))
        tangents = f"{len(own)} tangents"
        spent = interleaved(
            {
                "tangents off": partial(core.run, number, record, values),
                tangents: partial(core.run, number, record, values, own),
            },
            repeats=31,
        )
        rows += [
            Row(
                f"{law}, 1 kHz, {name}",
                cpu,
                1e9 * cpu / SAMPLES,
                cpu / spent["tangents off"],
                "order 2, see docs/laws.md",
            )
            for name, cpu in spent.items()
        ]
    return rows


def _solve_ivp(exact: np.ndarray, shape: dict[str, float], best: Row) -> Row:
    """SciPy as people use it, on a twentieth of the record: time per sample is what is compared."""
    from scipy.integrate import solve_ivp

    share = SAMPLES // 20
    times = np.arange(share) / RATE_Hz
    rho, kappa, n = shape["rho"], shape["kappa"], shape["n"]

    def slope(t: float, w: np.ndarray) -> np.ndarray:
        v = MOTION.velocity(t)
        u = w * np.sign(v)
        return np.asarray(rho * v * (1.0 - np.where(u > 0.0, 1.0, kappa) * np.abs(w) ** n))

    found: list[np.ndarray] = []

    def solve() -> None:
        found[:] = [solve_ivp(slope, (0.0, times[-1]), [0.0], t_eval=times, rtol=1e-6, atol=1e-8).y[0]]

    cpu = interleaved({"solve_ivp": solve}, repeats=3)["solve_ivp"]
    error = float(np.abs(found[0] - exact[:share]).max())
    ns = 1e9 * cpu / share
    ratio = ns / best.ns_per_sample if best.ns_per_sample else None
    title = f"scipy solve_ivp RK45, rtol 1e-6, measured on {share} of {SAMPLES:,} samples, one candidate"
    return Row(title, cpu, ns, ratio, f"{error:.1e} of the largest force from the closed form")
