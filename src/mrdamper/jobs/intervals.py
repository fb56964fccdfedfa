"""Compute 90 % intervals of forces and coefficients from posterior samples (``models.card_draws``).

A posterior sample is one of several equally likely dampers. The intervals describe the uncertainty of the
force due to the parameters. They exclude the model error of the law and the sensor noise. The expected error
of a measured force is ``models.force_band``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.prepare import PreparedRun, decimate, select_plot_samples
from mrdamper.models.card_draws import percentile_ends
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import open_drive, simulate
from mrdamper.quantities import REFERENCE_K

PYTHON_RATE_Hz = 200.0
"""Sampling rate of simulations with a law in Python. It is low because such a law is slow."""


@dataclass(frozen=True, slots=True, eq=False)
class ForceInterval:
    """90 % intervals of the force in the plotted cycle of a run, shape (n,), and of the error of the run."""

    name: str
    time_s: FloatArray  # time since the first plotted sample
    measured_N: FloatArray
    modelled_N: FloatArray  # force of the fitted damper
    low_N: FloatArray  # lower end of the interval
    high_N: FloatArray  # upper end of the interval
    rmse_N: tuple[float, float]  # interval of the RMS error of the whole scored run

    @property
    def width_N(self) -> float:
        """Return the mean width of the force interval during the plotted cycle."""
        return float(np.mean(self.high_N - self.low_N))


@dataclass(frozen=True, slots=True, eq=False)
class CoefficientInterval:
    """A coefficient versus the command at 20 degC, with its 90 % interval; arrays have the shape (n,)."""

    name: str
    unit: str
    command: FloatArray
    value: FloatArray
    low: FloatArray
    high: FloatArray


def force_interval(damper: Damper, dampers: Sequence[Damper], run: PreparedRun) -> ForceInterval:
    """Return the force of a damper in a run, and its 90 % interval from the posterior samples ``dampers``."""
    if damper.law.kernel is None:
        run = decimate(run, PYTHON_RATE_Hz)
    drive, start = open_drive(run.trajectory), run.scored_from
    forces = np.stack([simulate(each.on_limits(), drive) for each in (damper, *dampers)])
    drawn = select_plot_samples(run)
    errors = np.array([rms(force[start:] - run.force[start:]) for force in forces[1:]])
    least, most = percentile_ends(errors)
    low, high = percentile_ends(forces[1:, drawn])
    time = run.trajectory.time[drawn]
    return ForceInterval(
        run.name,
        time - time[0],
        run.force[drawn],
        forces[0, drawn],
        low,
        high,
        (float(least), float(most)),
    )


def coefficient_intervals(
    damper: Damper, dampers: Sequence[Damper], commands: tuple[float, float]
) -> tuple[CoefficientInterval, ...]:
    """Return all coefficients that depend on the command, with intervals from the posterior samples."""
    command = np.linspace(*commands, 41)  # number of points on the curve of a coefficient versus the command
    kelvin = np.full(len(command), REFERENCE_K)
    found = []
    for name, form in damper.coefficients.items():
        if form.kind != "constant":
            value, *others = (
                np.asarray(each.coefficients[name].value(command, kelvin)) for each in (damper, *dampers)
            )
            ends = percentile_ends(np.stack(others))
            found.append(CoefficientInterval(name, damper.law[name].unit, command, value, *ends))
    return tuple(found)
