"""Measuring on the virtual rig: a campaign's runs as the sensors wrote them, and the truth beside each.

A run begins in full motion, as a logger cuts it, with the damper run in. The truth of a run (what the sensors
would read without their faults) is for judging only: identification never sees it.
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
from mrdamper.virtual_rig.campaign import Body, Campaign, PlannedRun
from mrdamper.virtual_rig.plant import STEP_S, Plant, VirtualDamper
from mrdamper.virtual_rig.sensors import Sensors

_BLOCK = 500  # steps of the plant at one temperature, when it heats itself


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """What happened in a run, at the samples of its log, shape (n,) each."""

    time: FloatArray  # [s]
    displacement: FloatArray  # [m]
    velocity: FloatArray  # [m/s]
    force: FloatArray  # [N]
    coil_current: FloatArray  # [A]
    temperature_degC: FloatArray


def measure(
    damper: VirtualDamper, campaign: Campaign, sensors: Sensors | None = None, *, seed: int = 0
) -> Iterator[tuple[RigRun, Truth]]:
    """Run a campaign; give each run as the sensors wrote it, with its truth.

    A run's noise depends on the seed and its name alone: part of a campaign gives the same bytes. ``sensors``
    stand in place of the campaign's.
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
    """Run one run of a campaign: run the damper in, then log."""
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
    heated = campaign.body if campaign.procedure == "self-heating" else None
    force, coil, degrees = _log(plant, x[logged], v[logged], command[logged], run.temperature_degC, heated)
    x, v, a, command = x[logged], v[logged], run.motion.acceleration(time[logged]), command[logged]

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
    truth = Truth(read.time, x[::every], v[::every], force[::every], coil[::every], degrees[::every])
    return rig_run, truth


def _log(
    plant: Plant,
    x: FloatArray,
    v: FloatArray,
    command: FloatArray,
    start_degC: float,
    heated: Body | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return force [N], coil current [A] and temperature [degC] at each step of the plant."""
    if heated is None:
        response = plant.respond(x, v, command, start_degC)
        return response.force, response.coil_current, np.full(len(x), start_degC)
    force, coil, degrees = np.empty((3, len(x)))
    now = start_degC
    for k in range(0, len(x), _BLOCK):
        part = slice(k, k + _BLOCK)
        response = plant.respond(x[part], v[part], command[part], now)
        force[part], coil[part], degrees[part] = response.force, response.coil_current, now
        loss = response.force * v[part] + plant.damper.coil_resistance_ohm(now) * response.coil_current**2
        now = heated.warm(now, float(loss.mean()), len(loss) * STEP_S)
    return force, coil, degrees
