"""One step of a controller: in C over many samples, from Python, in an FMU under FMPy, in plain NumPy.

All are given the same readings, and their commands are compared with ours: more than ``LIMIT`` of the
largest command (root mean square) is disqualified. Where no current gives the wanted force the nearest one is
a matter of the table's steps: for the peers that have no such table those samples are left out.
What is made once (tables, compiling, unpacking) is not counted. The slow ones are timed on fewer samples.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from bench.cards import card_of
from bench.measure import Asked, Row, absent, judged, timed
from bench.plain import PlainBank
from mrdamper.arrays import FloatArray
from mrdamper.control.controllers import ForceController, controllers_for
from mrdamper.control.protocol import Measurement, Reference
from mrdamper.control.stepper import Flag
from mrdamper.excitation import MOTIONS
from mrdamper.export.c_code import c_files, sources_sha256
from mrdamper.export.fmu import write_fmu
from mrdamper.export.record import Verification
from mrdamper.export.target import target_of
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Bipolynomial, Constant, Exponential, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Arrhenius

__all__ = ["DAMPER", "LIMIT", "run"]

SHOWN = ("paper", "recommended", "recommended-causal", "recommended-adaptive", "pi")
SAMPLES = 200_000
LIMIT = 0.01  # of the largest command, root mean square
MOST_NS = {
    "paper, C loop": 200.0,
    "paper, Python extension": 400.0,
    "recommended, C loop": 1000.0,
    "recommended, Python extension": 2000.0,
}

# A damper like the virtual rig's `nominal`: what is timed does not depend on its numbers.
DAMPER = Damper(
    LAWS["double-bouc-wen"],
    {
        "viscosity": TemperatureDependent(Polynomial((7000.0, 700.0)), Arrhenius(1500.0)),
        "viscous_exponent": Constant(0.9),
        "stiffness": Constant(1400.0),
        "offset": Polynomial((6.0, 10.0)),
        "coulomb_friction": Bipolynomial((5.0, 0.01)),
        "breakaway_friction": Bipolynomial((6.0, -0.05)),
        "stribeck_velocity": Constant(0.014),
        "transition_velocity": Constant(8e-4),
        "yield_force": Bipolynomial((40.0, 0.02, 400.0, -0.5, -60.0, -0.1)),
        "second_force": Bipolynomial((7.0, -0.06, 300.0, -1.0, 40.0, 0.2)),
        "rho": Exponential(16e3, 0.39),
        "second_rho": Exponential(5e3, -0.1),
        "kappa": Constant(-0.42),
        "n": Constant(0.57),
    },
    actuation=Actuation(0.008, 0.0065, 0.003, 0.0035, largest_command=2.0, play=0.025),
    temperature_range=(288.15, 398.15),
)

Job = Callable[[], FloatArray | list[float]]


@dataclass(frozen=True, slots=True)
class _Contender:
    """A way to run a controller, the samples that it is timed on, and whose command it is held against."""

    name: str
    make: Callable[[FloatArray], Job]
    samples: int
    like: ForceController
    tolerant: bool = False  # leaves out samples whose target no current gives


def run(*, full: bool = False) -> list[Row]:
    """Return CPU of one step; ``full`` gives the slow contenders four times the samples."""
    every = controllers_for(DAMPER)
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for name in SHOWN:
            rows += _side_by_side(name, list(_contenders(name, every[name], Path(folder), full=full)))
    return rows


def _contenders(name: str, made: ForceController, folder: Path, *, full: bool) -> Iterator[_Contender]:
    few = 4 if full else 1
    yield _Contender(f"{name}, C loop", partial(_in_c, made), SAMPLES, made)
    yield _Contender(f"{name}, Python extension", partial(_one_by_one, made), SAMPLES // 10, made)
    if name not in {"paper", "recommended"}:
        return
    single = replace(controllers_for(card_of(DAMPER))[name], single=True)
    yield _Contender(f"{name}, FMU in FMPy", partial(_in_fmpy, name, folder), few * 5_000, single)
    if name == "paper":
        plain = partial(_plain, lambda: PlainBank(DAMPER, made), lambda row: (row[0], row[2], row[3]))
        yield _Contender(f"{name}, plain NumPy (bench/plain.py)", plain, few * 2_000, made, tolerant=True)
        return


def _side_by_side(group: str, contenders: list[_Contender]) -> list[Row]:
    """Return a row for each way to run a controller; the C loop is the measure."""
    jobs: dict[str, Job] = {}
    rows: dict[str, Row] = {}
    for each in contenders:
        told = _told(each.like)[: each.samples]
        try:
            jobs[each.name] = each.make(told)
        except ImportError as fault:
            rows[each.name] = absent(each.name, fault, group)
            continue
        _, ours, flags = each.like.run(each.like.start(), told)
        counted = (flags & int(Flag.INFEASIBLE)) == 0 if each.tolerant else np.ones(len(told), dtype=bool)
        off = np.abs(np.asarray(jobs[each.name]()) - ours)[counted] / each.like.largest
        rms = float(np.sqrt(np.mean(off**2)))
        said = f"{rms:.1e} of the largest command off ours rms, {off.max():.1e} at most"
        rows[each.name] = Row(
            each.name, accuracy=said if rms else "the same bits as ours", group=group, error=rms
        )
    sizes = {each.name: each.samples for each in contenders}
    spent = timed(jobs)
    measure = next(iter(spent))
    first = spent[measure].cpu_s / sizes[measure]
    for name, found in spent.items():
        ns, most = 1e9 * found.cpu_s / sizes[name], MOST_NS.get(name)
        row = replace(
            rows[name],
            cpu_s=found.cpu_s,
            wall_s=found.wall_s,
            spread=found.spread,
            ns_per_sample=ns,
            ratio=found.cpu_s / sizes[name] / first,
            bar="" if most is None else f"{most:g} ns",
            asked=() if most is None else (Asked(f"{name}, one step", most, ns, "ns"),),
        )
        rows[name] = judged(row, LIMIT)
    return list(rows.values())


# ------------------------------------------------------------------------------------ the contenders


def _in_c(made: ForceController, told: FloatArray) -> Job:
    return lambda: made.run(made.start(), told)[1]


def _one_by_one(made: ForceController, told: FloatArray) -> Job:
    wanted = [Reference(row[0], row[1]) for row in told.tolist()]
    seen = [Measurement(row[2], row[3], row[4]) for row in told.tolist()]

    def job() -> list[float]:
        state, step = made.start(), made.step
        commands = []
        for w, s in zip(wanted, seen, strict=True):
            state, command = step(state, w, s)
            commands.append(command)
        return commands

    return job


def _plain(
    make: Callable[[], Any], readings: Callable[[list[float]], tuple[float, ...]], told: FloatArray
) -> Job:
    given = [readings(row) for row in told.tolist()]
    made = [make() for _ in range(12)]  # the tables are made once, not in the job

    def job() -> FloatArray:
        step = (made.pop() if made else make()).step
        return np.array([step(*each) for each in given])

    return job


def _in_fmpy(name: str, folder: Path, told: FloatArray) -> Job:
    """Step our exported FMU (FMI 3.0) as a master does: set the readings, do the step, get the command."""
    fmpy, fmi3 = import_module("fmpy"), import_module("fmpy.fmi3")
    target = target_of(card_of(DAMPER), content="controller", controller=name, name=name)
    sources = sources_sha256(c_files(target))
    passed = Verification(passed=True, sources_sha256=sources, precision=target.precision, samples=1)
    path = folder / f"{name}.fmu"
    write_fmu(target, path, version="3.0", verification=passed)
    place = fmpy.extract(str(path), unzipdir=str(folder / name))
    description = fmpy.read_model_description(place)
    numbers = {each.name: each.valueReference for each in description.modelVariables}
    fmu = fmi3.FMU3Slave(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=place,
        instanceName=name,
    )
    fmu.instantiate()
    fmu.enterInitializationMode(startTime=0.0)
    if "use_wanted_force_ahead" in numbers:
        fmu.setBoolean([numbers["use_wanted_force_ahead"]], [True])
    fmu.exitInitializationMode()
    start = fmu.getFMUState()
    inputs = {"wanted_force": 0, "wanted_force_ahead": 1, "displacement": 2, "temperature": 3}
    used = {key: column for key, column in inputs.items() if key in numbers}
    references, columns = [numbers[key] for key in used], list(used.values())
    rows, command, period = told[:, columns].tolist(), np.empty(len(told)), target.period_s
    output = [numbers["current"]]

    def job() -> FloatArray:
        fmu.setFMUState(start)
        put, step, get = fmu.setFloat64, fmu.doStep, fmu.getFloat64
        for k, row in enumerate(rows):
            put(references, row)
            step(currentCommunicationPoint=k * period, communicationStepSize=period)
            command[k] = get(output)[0]
        return command.copy()

    return job


# ------------------------------------------------------------------------------------ the readings


def _told(made: ForceController) -> FloatArray:
    t = made.period_s * np.arange(SAMPLES)
    motion, rng = MOTIONS["nonperiodic"], np.random.default_rng(1)
    rows = np.empty((SAMPLES, 5))
    rows[:, 0] = 1000.0 * np.tanh(motion.velocity(t) / 0.02)
    rows[:, 1] = 1000.0 * np.tanh(motion.velocity(t + made.preview_s) / 0.02)
    rows[:, 2] = motion.displacement(t) + 10e-6 * rng.standard_normal(SAMPLES)
    rows[:, 3] = 333.15 + 0.3 * rng.standard_normal(SAMPLES)
    rows[:, 4] = 0.9 * rows[:, 0]
    return rows
