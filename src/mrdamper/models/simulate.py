"""Simulation: the force of a damper driven through a motion and a command.

A run comes whole (``simulate``) or in batches (``simulate_batch``, ``finish_run``): the forces are the same
bits, whatever the borders of the batches, and what one batch hands to the next is a value. Kernel laws run
in C; a user's law in Python runs whole, through ``python_law``'s integrator. ``tangents`` differentiates the
force.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.models.actuation import Actuation, Applied
from mrdamper.models.damper import Damper
from mrdamper.models.python_law import integrate
from mrdamper.quantities import REFERENCE_K

_PYTHON_TOLERANCE = 1e-8  # of the integrator of laws in Python
_FEW = 3  # runs fewer than these are simulated one by one


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A trajectory made ready for many simulations: the kernel's record of it, its command and temperature.

    ``constant`` is the command when it does not vary over the run, else ``None``; ``temperature`` [K] is the
    run's when it is known and does not vary; ``warms`` says that it does.
    """

    trajectory: Trajectory
    record: core.Record
    constant: float | None
    temperature: float | None
    temperature_varies: bool


def open_drive(trajectory: Trajectory, *, longest_step: float = core.LONGEST_STEP) -> Drive:
    """Return the trajectory made ready for the kernel; implicit laws take steps of at most so long [s]."""
    command, kelvin = trajectory.command, trajectory.temperature
    constant = float(command[0]) if np.ptp(command) == 0.0 else None
    temperature_varies = kelvin is not None and bool(np.ptp(kelvin) > 0.0)
    temperature = None if kelvin is None or temperature_varies else float(kelvin[0])
    record = core.open_record(trajectory, longest_step=longest_step)
    return Drive(trajectory, record, constant, temperature, temperature_varies)


def simulate(
    damper: Damper, trajectory: Trajectory | Drive, *, form: Literal["record", "causal"] = "record"
) -> FloatArray:
    """Return the damper's force [N] at every sample of a trajectory, shape (n,).

    Parameters
    ----------
    form : ``record`` uses whole monotone pieces between turning points located inside the sample
        interval; ``causal`` is the per-sample map of a real-time target. At 1 kHz they agree within
        1e-4 of the peak force.

    Raises
    ------
    InputError
        When the law is not well posed at a command or temperature of the trajectory; a damper that depends
        on temperature on a trajectory that has none.
    """
    drive = trajectory if isinstance(trajectory, Drive) else open_drive(trajectory)
    require_temperature(damper, drive.trajectory)
    if damper.law.kernel is None:
        return integrate(damper, drive.trajectory, tolerance=_PYTHON_TOLERANCE)
    command, _, temperature = applied_command(damper, drive)
    coefficients = _admissible_coefficients(damper, command, temperature, drive.trajectory.displacement)
    if form == "causal":
        return core.causal(damper.law.kernel, drive.record, coefficients)
    return core.run(damper.law.kernel, drive.record, coefficients)[0]


def simulate_each(damper: Damper, trajectories: Sequence[Trajectory | Drive]) -> list[FloatArray]:
    """Return the force [N] along each of several trajectories, as ``simulate`` does but for rounding.

    Those along which neither command nor temperature varies go together: implicit laws step several at once.

    Raises
    ------
    InputError
        As ``simulate`` does.
    """
    drives = [each if isinstance(each, Drive) else open_drive(each) for each in trajectories]
    points = [operating_point(each, temperature_dependent=damper.temperature_dependent) for each in drives]
    together = [k for k, point in enumerate(points) if point is not None and damper.law.kernel is not None]
    together = together if len(together) >= _FEW else []
    found = dict(zip(together, _at_points(damper, [drives[k] for k in together]), strict=True))
    return [found[k] if k in found else simulate(damper, drive) for k, drive in enumerate(drives)]


def _at_points(damper: Damper, drives: Sequence[Drive]) -> list[FloatArray]:
    """Return the force [N] along runs that are each at one operating point."""
    if not drives:
        return []
    for drive in drives:
        require_temperature(damper, drive.trajectory)
    points = [operating_point(each, temperature_dependent=damper.temperature_dependent) for each in drives]
    levels = {point: k for k, point in enumerate(dict.fromkeys(points))}
    command, kelvin = np.array(list(levels), dtype=np.float64).T
    found = damper.coefficients_at(command, kelvin)
    coefficients = np.ascontiguousarray(found[:, [levels[point] for point in points]].T)
    pairs = zip(coefficients, drives, strict=True)
    pushes = any(_reversed_valve(damper, row, drive.trajectory.displacement) for row, drive in pairs)
    if pushes or damper.law.violations(dict(zip(damper.law.names, found, strict=True))):
        return [simulate(damper, drive) for drive in drives]  # which says where, and why
    return core.forces(damper.law.kernel or 0, [drive.record for drive in drives], coefficients)


@dataclass(frozen=True, slots=True, eq=False)
class RunState:
    """All that a run in batches hands from one to the next; by default a run at rest before the first.

    Samples are *settled* once no later one can change the piece of motion that they belong to: behind the
    furthest point of the motion so far, when it goes on beyond that point or turns back by more than the dead
    band. ``held`` are the samples from the last settled one on (displacement, velocity, acceleration, applied
    command, temperature); copies, so that no batch is kept alive.

    Parameters
    ----------
    longest_step : longest step of the implicit laws [s]
    patience : samples that may be held back while the motion rests inside its dead band. Past that they are
        answered as the motion's going on has them; should it turn back after all, the force of those samples
        alone is off, by what a travel of the dead band makes of it.
    """

    longest_step: float = core.LONGEST_STEP
    patience: int = 1_000_000
    step: float = 0.0  # of the run [s]; 0 before the first batch
    dead_band: float = 0.0  # of the run [m]
    taken: int = 0  # samples given so far
    answered: int = 0  # samples whose force has been returned
    over: bool = False
    motion: FloatArray = field(default_factory=lambda: np.zeros(core.MOTION_NUMBERS), repr=False)
    law: FloatArray = field(default_factory=lambda: np.zeros(core.STATE_NUMBERS), repr=False)
    applied: FloatArray = field(default_factory=lambda: np.empty(0), repr=False)  # of the actuation
    held: tuple[FloatArray, ...] = field(default=(), repr=False)
    workspace: core.Workspace = field(default_factory=core.Workspace, repr=False)  # a cache, one thread's

    def __post_init__(self) -> None:
        if self.patience < 1:
            raise InputError(found=f"patience is {self.patience} samples", expected="1 or more")

    def to_arrays(self) -> dict[str, FloatArray]:
        """Return the state as float64 arrays by name, for ``from_arrays``."""
        numbers = [getattr(self, name) for name in _RUN_NUMBERS]
        kept = {"run": np.array(numbers, dtype=np.float64), "motion": self.motion, "law": self.law}
        return kept | {"applied": self.applied} | {f"held_{k}": each for k, each in enumerate(self.held)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, FloatArray]) -> RunState:
        """Return the state that ``to_arrays`` gave: with the same damper the run goes on bit for bit.

        Raises
        ------
        InputError
            A part of the state is missing, or of another shape.
        """
        parts = {name: np.array(values, dtype=np.float64) for name, values in arrays.items()}
        expected = {"run": len(_RUN_NUMBERS), "motion": core.MOTION_NUMBERS, "law": core.STATE_NUMBERS}
        for name, count in expected.items():
            if name not in parts or parts[name].shape != (count,):
                shape = parts[name].shape if name in parts else "not there"
                raise InputError(
                    place="state of a run", found=f"{name} is {shape}", expected=f"{count} numbers"
                )
        longest_step, patience, step, dead_band, taken, answered, over = parts["run"].tolist()
        held = tuple(parts[f"held_{k}"] for k in range(_HELD) if f"held_{k}" in parts)
        lengths = [len(column) for column in held]
        if taken and (len(lengths) != _HELD or lengths[0] < 1 or len(set(lengths[:4])) != 1):
            raise InputError(
                place="state of a run",
                found=f"held columns have {lengths} samples",
                expected=f"{_HELD} of one length",
            )
        return cls(
            longest_step=longest_step,
            patience=int(patience),
            step=step,
            dead_band=dead_band,
            taken=int(taken),
            answered=int(answered),
            over=bool(over),
            motion=parts["motion"],
            law=parts["law"],
            applied=parts.get("applied", np.empty(0)),
            held=held,
        )


_RUN_NUMBERS = ("longest_step", "patience", "step", "dead_band", "taken", "answered", "over")
_HELD = 5  # columns: displacement, velocity, acceleration, applied command, temperature


def simulate_batch(
    damper: Damper, batch: Trajectory, state: RunState | None = None
) -> tuple[FloatArray, RunState]:
    """Return the force [N] of the samples that are settled by now, shape (m,), and the state after the batch.

    The samples follow on the ones returned before. ``finish_run`` returns those that are left at the end.

    Parameters
    ----------
    batch : the run's next samples, two or more, of one step and dead band with all others
    state : what the batch before returned; None: the run begins here, at rest

    Raises
    ------
    InputError
        A law in Python, which runs whole only; a batch of another step or dead band, or after the end; what
        ``simulate`` refuses.
    """
    state = RunState() if state is None else state
    if state.over:
        raise InputError(found="the run is over: finish_run was called", expected="no further batch")
    if damper.law.kernel is None:
        raise InputError(place=damper.law.name, found="a law in Python runs whole, not in batches")
    if state.taken:
        for name in ("step", "dead_band"):
            found, expected = getattr(batch, name), getattr(state, name)
            if found != expected:
                raise InputError(
                    place="batch", found=f"{name} is {found}", expected=f"the first batch's, {expected}"
                )
    require_temperature(damper, batch)
    lag = damper.command_lag_s
    applied = Applied(damper.actuation or Actuation(lag, lag), batch.step)
    if state.taken:
        applied.restore(state.applied)
    command = applied.on(batch.command)
    kelvin = batch.temperature if damper.temperature_dependent else None
    new = (batch.displacement, batch.velocity, batch.acceleration, command)
    state = replace(
        state,
        step=batch.step,
        dead_band=batch.dead_band,
        taken=state.taken + len(batch),
        applied=applied.state(),
    )
    return _answer(damper, state, (*new, np.empty(0) if kelvin is None else kelvin), last=False)


def finish_run(damper: Damper, state: RunState) -> tuple[FloatArray, RunState]:
    """Return the force [N] of the samples that are left, shape (m,), and the state of a run that is over."""
    if state.over or not state.held:
        return np.empty(0), replace(state, over=True)
    return _answer(damper, replace(state, over=True), (np.empty(0),) * _HELD, last=True)


def _answer(
    damper: Damper, state: RunState, new: tuple[FloatArray, ...], *, last: bool
) -> tuple[FloatArray, RunState]:
    """Return the force of the settled samples among those held and new ones, and the state after them."""
    held = tuple(np.concatenate(pair) for pair in zip(state.held, new, strict=True)) if state.held else new
    x, v, a, command, kelvin = held
    if np.ptp(command) == 0.0 and (not len(kelvin) or np.ptp(kelvin) == 0.0):
        command, kelvin = command[:1], kelvin[:1]
    coefficients = _admissible_coefficients(damper, command, kelvin if len(kelvin) else None, x)
    motion, law = state.motion.copy(), state.law.copy()
    record = core.open_batch(
        state.step,
        (x, v, a),
        motion,
        dead_band=state.dead_band,
        longest_step=state.longest_step,
        patience=state.patience,
        last=last,
    )
    force = core.carry(damper.law.kernel or 0, record, coefficients, law, state.workspace)[record.behind :]
    keep = max(record.samples - 1, 0)
    return force, replace(
        state,
        motion=motion,
        law=law,
        held=tuple(column[keep:].copy() for column in held),
        answered=state.answered + len(force),
    )


def require_temperature(damper: Damper, trajectory: Trajectory) -> None:
    """Raise ``InputError`` where a damper that depends on temperature has none to go by."""
    if damper.temperature_dependent and trajectory.temperature is None:
        raise InputError(
            found="the model depends on temperature, and the run has no temperature channel",
            expected="a column such as temperature_degC",
            remedy=(
                "Map the channel, or state it as a constant in the channel map ([constant] temperature_degC "
                "= 20)"
            ),
        )


def operating_point(drive: Drive, *, temperature_dependent: bool) -> tuple[float, float] | None:
    """Return command and temperature [K] of a run at one operating point; None where either varies."""
    if drive.constant is None or (temperature_dependent and drive.temperature_varies):
        return None
    kelvin = drive.temperature if temperature_dependent else None
    return drive.constant, REFERENCE_K if kelvin is None else kelvin


def applied_command(damper: Damper, drive: Drive) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Return the command at the law, its derivative by the lag, and the temperature [K].

    One sample each where neither varies.
    """
    point = operating_point(drive, temperature_dependent=damper.temperature_dependent)
    if point is not None:
        return np.array([point[0]]), np.zeros(1), np.array([point[1]])
    path = drive.trajectory
    kelvin = (
        damper.held(path.temperature)
        if damper.temperature_dependent and path.temperature is not None
        else None
    )
    if damper.actuation is not None:
        return damper.actuation.applied(path.command, path.step), np.zeros(len(path)), kelvin
    return *core.lagged(path.command, path.step, damper.command_lag_s), kelvin


def _admissible_coefficients(
    damper: Damper, command: FloatArray, temperature: FloatArray | None, displacement: FloatArray
) -> FloatArray:
    """Return the law's coefficients, shape (m,) for one command, else (m, n).

    Raises
    ------
    InputError
        The law is not well posed with them on these displacements [m].
    """
    found = damper.coefficients_at(command, temperature)
    violations = damper.law.violations(dict(zip(damper.law.names, found, strict=True)))
    violations += _reversed_valve(damper, found, displacement)
    if violations:
        raise InputError(faults=[InputError(each) for each in violations])
    return np.ascontiguousarray(found[:, 0] if len(command) == 1 else found)


def _reversed_valve(damper: Damper, coefficients: FloatArray, displacement: FloatArray) -> tuple[str, ...]:
    """Say where along a displacement [m] the series valve would push: it has no bounded solution there."""
    if damper.law.name != "series-valve":
        return ()
    share = 1.0 + coefficients[damper.law.names.index("position_gain")] * displacement
    worst = int(np.argmin(share))
    if share[worst] > 0.0:
        return ()
    return (
        f"series-valve: 1 + position_gain x is {share[worst]:g} at x = {displacement[worst]:g} m; the law is "
        "well posed while it is positive (shorten the stroke, or bring position_gain nearer to 0)",
    )
