"""Measurement on the virtual rig: compute the sensor signals and the reference values of each run.

The log of a run begins in full motion, after a run-in of the damper. The reference values contain no noise.
They are used only for validation and never for identification.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.records import RigRun
from mrdamper.errors import InputError
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.virtual_rig.campaign import Campaign, PlannedRun
from mrdamper.virtual_rig.plant import STEP_S, Plant, VirtualDamper
from mrdamper.virtual_rig.sensors import Sensors


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """Noise-free reference values (ground truth) of a run at the logged samples, arrays of shape (n,)."""

    time: FloatArray  # [s]
    displacement: FloatArray  # [m]
    velocity: FloatArray  # [m/s]
    force: FloatArray  # force of the damper [N]
    coil_current: FloatArray  # [A]
    temperature_degC: FloatArray


def measure(
    damper: VirtualDamper, campaign: Campaign, sensors: Sensors | None = None, *, seed: int = 0
) -> Iterator[tuple[RigRun, Truth]]:
    """Generate pairs of sensor signals and reference values, one pair for each run of a campaign.

    The noise of a run depends only on the seed and the name of the run. Therefore a run has the same samples
    in any campaign. ``sensors`` replaces the sensors of the campaign.
    """
    if seed < 0:
        raise InputError(found=f"seed is {seed}", expected="zero or more")
    for run in campaign.runs(damper.name):
        yield measure_run(damper, run, campaign, sensors, seed=seed)


def measure_run(
    damper: VirtualDamper,
    run: PlannedRun,
    campaign: Campaign,
    sensors: Sensors | None = None,
    *,
    seed: int = 0,
) -> tuple[RigRun, Truth]:
    """Return the sensor signals and the reference values of one run. The log starts after the run-in."""
    chosen = sensors or campaign.sensors
    every = chosen.steps_per_sample
    before = round(run.run_in_s / STEP_S)
    steps = round(run.duration_s * chosen.rate_Hz) * every
    time = (np.arange(before + steps) - before) * STEP_S
    x, v = run.motion.displacement(time), run.motion.velocity(time)
    command = (
        np.full(len(time), run.current) if isinstance(run.current, float | int) else run.current.current(time)
    )
    plant = Plant(damper)
    plant.advance_many(x[:before], v[:before], command[:before], run.temperature_degC)
    logged = slice(before, None)
    x, v, a, command = x[logged], v[logged], run.motion.acceleration(time[logged]), command[logged]
    response = plant.respond(x, v, command, run.temperature_degC)
    force, degrees = response.force, np.full(len(x), run.temperature_degC)

    digest = hashlib.sha256(run.name.encode()).digest()
    words = np.frombuffer(digest, dtype="<u4").tolist()
    read = chosen.read(x, force, degrees, np.random.default_rng([seed, *words]), a)
    rig_run = RigRun(
        name=run.name,
        time=read.time,
        displacement=read.displacement,
        force=read.force,
        command=command[::every],
        command_unit="A",
        temperature=read.temperature_degC + ZERO_CELSIUS_K,
        session=f"virtual rig {damper.name}",
        motion=run.label,
        source=f"simulated: virtual damper {damper.name}, seed {seed}",
    )
    coil_current = response.coil_current[::every]
    truth = Truth(read.time, x[::every], v[::every], force[::every], coil_current, degrees[::every])
    return rig_run, truth
