"""The kernel's laws: the force along one run, its tangents, and the Gram sums that a fit spends its time on.

Times are CPU, per sample of one candidate. Sums are those of 8 candidates on 12 runs of some 3,000 samples,
at every instruction set that the machine has; the ratio is to the widest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from bench.measure import Asked, Row, timed
from bench.problem import Problem
from mrdamper import core
from mrdamper.core import _kernel
from mrdamper.excitation import Sine, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import COMMON, LAWS

__all__ = ["run"]

OF_LAWS = {
    "bouc-wen": {"yield_force": 500.0, "rho": 1500.0, "kappa": -0.4, "n": 1.6},
    "double-bouc-wen": {
        **{"yield_force": 500.0, "second_force": 200.0, "rho": 1500.0, "second_rho": 200.0},
        **{"kappa": -0.4, "n": 1.6},
    },
    "bingham": {"yield_force": 500.0, "yield_velocity": 0.01},
    "tanh": {"yield_force": 500.0, "slope": 50.0, "shift": 0.1},
    "series-valve": {
        **{
            "stiffness": 731.0,
            "offset": 48.0,
            "yield_force": 500.0,
            "thinning": 3.2,
            "thinning_exponent": 0.43,
        },
        **{"yield_velocity": 2.5e-3, "position_gain": -2.3, "gap_stiffness": 1.2e7, "gap": 1.67e-4},
        **{"gap_corner": 4.6e-5, "leak_damping": 3e4, "leak_exponent": 0.994},
    },
    "lugre": {
        **{"yield_force": 500.0, "rho": 1500.0, "static_excess": 0.4, "fade_velocity": 0.01},
        **{"bristle_damping": 600.0},
    },
    "spencer": {
        **{"yield_force": 800.0, "series_damping": 3e4, "inner_viscosity": 2500.0, "inner_stiffness": 5000.0},
        **{"rho": 1500.0, "kappa": -0.4, "n": 1.6},
    },
}
SUMS = {"double-bouc-wen": 17.0, "series-valve": 111.0, "bingham": 10.8, "tanh": 12.0}
"""Most that a candidate's Gram sums may take per sample [ns], at the widest instruction set."""


def run() -> list[Row]:
    """Return force and tangents of every law, then its Gram sums."""
    return [*_laws(Problem().record), *_sums()]


def _numbers(law: str) -> tuple[int, np.ndarray, list[int]]:
    """Return a law's number, its coefficients, and the places of those that it has of its own."""
    damper = Damper(LAWS[law], {name: Constant(value) for name, value in OF_LAWS[law].items()})
    values = np.ascontiguousarray(damper.coefficients_at(0.0)[:, 0])
    places = [*([1, 2] if law == "series-valve" else []), *range(len(COMMON), len(values))]
    return LAWS[law].kernel or 0, values, places


def _laws(record: core.Record) -> list[Row]:
    """Time one candidate at a time: the force alone, and with all the law's own tangents."""
    rows = []
    for law in OF_LAWS:
        number, values, own = _numbers(law)
        jobs = {
            f"{law}, force": partial(core.run, number, record, values),
            f"{law}, {len(own)} tangents": partial(core.run, number, record, values, own),
        }
        rows += _law_rows("the kernel's laws, one run of 10,000 samples", jobs, record.samples)
    return rows


def _sums() -> list[Row]:
    """Time the Gram sums of 8 candidates on 12 runs, as a fit asks for them, at every instruction set."""
    best, rows = _kernel.level(), []
    paths = [drive(Sine(0.006 + 0.001 * k, 1.0 + 0.2 * k), duration=3.0 - 0.04 * k, rate_Hz=1e3, command=0.0)
             for k in range(12)]  # fmt: skip
    records, zeros = [core.open_record(path) for path in paths], [np.zeros(len(path)) for path in paths]
    samples = 8 * sum(map(len, paths))
    for law in OF_LAWS:
        number, values, own = _numbers(law)
        near = np.random.default_rng(0).uniform(0.8, 1.2, (8, 12, len(values))) * values
        near[:, :, LAWS[law].names.index("viscous_exponent")] = 1.0
        if law not in ("bingham", "tanh", "series-valve", "lugre"):  # one curve a candidate, as in a fit
            near[:, :, -4:] = near[:, :1, -4:]
        places = sorted({0, 1, 2, *own})

        def sums(
            level: str, number: int = number, near: np.ndarray = near, places: list[int] = places
        ) -> None:
            _kernel.use_level(level)
            core.gram_sums(number, records, zeros, [0] * 12, near, places)

        jobs = {
            f"{law}, {len(places)} tangents, {level}": partial(sums, level)
            for level in _kernel.levels()[::-1]
        }
        made = _law_rows("Gram sums of 8 candidates on 12 runs of 3,000 samples", jobs, samples)
        _kernel.use_level(best)
        if law in SUMS and best == "v4":
            bar, ns = SUMS[law], made[0].ns_per_sample or 0.0
            asked = (Asked(f"Gram sums of {law}, {best}, per candidate and sample", bar, ns, "ns"),)
            made[0] = replace(made[0], bar=f"{bar:g} ns", asked=asked)
        rows += made
    return rows


def _law_rows(group: str, jobs: Mapping[str, Callable[[], object]], samples: int) -> list[Row]:
    """Return a row of each job, as a ratio to the first."""
    spent = timed(jobs, 15)
    first = next(iter(spent.values())).cpu_s
    return [
        Row(name, each.cpu_s, 1e9 * each.cpu_s / samples, each.cpu_s / first, group=group, spread=each.spread)
        for name, each in spent.items()
    ]
