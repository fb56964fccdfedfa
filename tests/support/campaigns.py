"""Campaigns and runs for tests.

``make_run`` returns a run in closed form. ``short_runs`` are runs of Spencer's damper from an independent
program. ``default_campaign`` and ``default_fit`` return the default campaign on the virtual rig and the fit
to it, which are computed once in each process.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import mrdamper
from mrdamper.arrays import FloatArray
from mrdamper.data.records import Dataset, RigRun
from mrdamper.excitation import Motion, Sine
from mrdamper.identify.fit import fit_law
from mrdamper.identify.fit_data import FitData
from mrdamper.jobs.fit import FitResult
from mrdamper.models.card import ModelCard
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.lumped import LUMPED
from mrdamper.virtual_rig.measurement import measure, measure_run
from tests.oracles.spencer_damper import Campaign as SpencerCampaign
from tests.oracles.spencer_damper import measure as measure_spencer

SELECTED = "selected"  # Name of the hysteresis law that the model selection chooses
SHORT = SpencerCampaign(
    (("sine5mm1Hz", Sine(5e-3, 1.0)), ("sine10mm2Hz", Sine(10e-3, 2.0))),
    voltages=(0.0, 0.75, 1.5),
    duration_s=2.6,
)

# The reference paper uses these motions in its heating tests and hysteresis tests. A random motion would
# change the fitted loss of peak force by half a percentage point (docs/thermal.md).
HEATING_CAMPAIGN = Campaign(
    motions=("sine15mm1Hz", "sine5mm1Hz"),
    currents_A=(0.0, 1.0, 2.0),
    temperatures_degC=(20.0, 45.0, 75.0, 105.0, 130.0),
    steps=None,
)
SINE = Sine(0.010, 2.0)


def dry_friction(velocity: FloatArray) -> FloatArray:
    """Return a friction force of 1 kN that reverses smoothly within 10 mm/s [N]."""
    return np.asarray(1000.0 * np.tanh(velocity / 0.01), dtype=np.float64)


def fields_of_run(
    motion: Motion = SINE,
    *,
    duration: float = 5.0,
    rate_Hz: float = 1000.0,
    rest: float = 0.0,
    noise: float = 0.0,
    quantum: float = 0.0,
    seed: int = 0,
) -> dict[str, Any]:
    """Return the fields of a run that has ``rest`` seconds at rest, followed by the motion."""
    time = np.arange(round((duration + rest) * rate_Hz) + 1) / rate_Hz
    since = np.maximum(time - rest, 0.0)
    x = np.where(time < rest, motion.displacement(0.0), motion.displacement(since))
    v = np.where(time < rest, 0.0, motion.velocity(since))
    if noise:
        x = x + noise * np.random.default_rng(seed).standard_normal(len(x))
    if quantum:
        x = np.round(x / quantum) * quantum
    return {
        "name": "run",
        "time": time,
        "displacement": x,
        "force": dry_friction(v),
        "command": np.full(len(time), 0.5),
        "command_unit": "A",
    }


def make_run(motion: Motion = SINE, changed: Mapping[str, Any] | None = None, **how: Any) -> RigRun:
    """Return a run with the fields ``fields_of_run(motion, **how)``. ``changed`` has new values of fields."""
    fields = fields_of_run(motion, **how)
    return RigRun(**{**fields, **(changed or {})})


@cache
def short_runs() -> tuple[RigRun, ...]:
    """Return short runs of Spencer's damper, which an independent program simulates."""
    return measure_spencer(SHORT, seed=1)


def columns_of(run: RigRun) -> dict[str, FloatArray]:
    """Return the columns of a run with every second sample.

    The keys are headers with name and unit, for example ``force_N``.
    """
    chosen = {
        "time_s": run.time,
        "displacement_m": run.displacement,
        "force_N": run.force,
        "voltage_V": run.command,
    }
    return {name: np.array(values[::2]) for name, values in chosen.items()}


def write_csv(path: Path, columns: Mapping[str, FloatArray]) -> Path:
    """Write columns as a CSV file and return its path."""
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path


def write_runs(folder: Path, runs: Sequence[RigRun]) -> list[Path]:
    """Write each run as a CSV file into a folder and return the paths."""
    folder.mkdir(exist_ok=True)
    return [write_csv(folder / f"{run.name}.csv", columns_of(run)) for run in runs]


@cache
def default_campaign(preset: str) -> Dataset:
    """Return the default campaign on a damper of the virtual rig."""
    return Dataset(tuple(run for run, _ in measure(LUMPED[preset], Campaign())))


@cache
def default_fit(preset: str, law: str = SELECTED) -> FitResult:
    """Return the fit of the training runs of the default campaign."""
    named = None if law == SELECTED else law
    fitted: FitResult = mrdamper.fit(default_campaign(preset), named, hold_out=Campaign().hold_out)
    return fitted


@cache
def paper_card() -> ModelCard:
    """Return the card of a fit to runs of the virtual damper ``paper``. The fit takes two seconds."""
    damper, plan = LUMPED["paper"], HEATING_CAMPAIGN
    runs = tuple(measure_run(damper, each, plan, seed=1)[0] for each in plan.runs(damper.name))
    return fit_law(FitData.prepare(Dataset(runs))).card()
