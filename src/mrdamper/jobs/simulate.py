"""The job ``simulate``: compute the force of a card for a motion from a text description or a measurement."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.frames import Frame, FrameLike, parts_of
from mrdamper.data.prepare import Preparation, prepare_run
from mrdamper.data.proposal.recordings import RigFile
from mrdamper.data.readers import read_file
from mrdamper.data.records import Recording, RigRun
from mrdamper.data.words.headers import word_and_unit
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory, drive
from mrdamper.files import is_file
from mrdamper.jobs.options import SimulateOptions
from mrdamper.models import simulate as models
from mrdamper.models.card import ModelCard
from mrdamper.models.card_draws import draws_of, percentile_ends
from mrdamper.quantities import ZERO_CELSIUS_K, roles_of_unit
from mrdamper.results import JobResult
from mrdamper.thermal.duty import motion_at_command

_USUAL = SimulateOptions()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SimulateResult(JobResult):
    """A motion, and the force of the card in this motion."""

    _job = "simulate"
    title: str  # title of the card
    motion: str
    command_unit: str
    trajectory: Trajectory
    force: FloatArray  # force of the card [N], shape (n,)
    measured: FloatArray | None = None  # measured force [N], shape (n,); None if the motion has no force
    scored_from: int = 0  # index of the first sample that is included in the error
    # Lower and upper bound of the 90 % interval of the force [N]; None if there are no posterior samples.
    interval: tuple[FloatArray, FloatArray] | None = None


def simulate(
    card: ModelCard, motion: str | Path | RigRun | FrameLike | Trajectory, options: SimulateOptions = _USUAL
) -> SimulateResult:
    """Return the force of a model card in a motion.

    Parameters
    ----------
    motion : text MOTION:COMMAND:DURATION, such as ``sine:10mm:1Hz:1A:2s``; or ``Trajectory``; or measured
        run (file, data frame or ``RigRun``). The run is filtered and resampled like the runs of the card. A
        data frame needs no force column.

    Raises
    ------
    InputError
        If the motion is not readable, if its command has a different unit than the card, or if requested
        posterior samples are missing.
    """
    posterior = draws_of(card, options.posterior)
    measured, scored_from = None, 0
    unit: str = card.damper.command_unit
    if isinstance(motion, Trajectory):
        name, path = "trajectory", motion
    elif isinstance(motion, str) and not is_file(motion):
        what, command, unit, seconds = motion_at_command(motion)
        name, path = motion, drive(what, duration=seconds, rate_Hz=options.rate_Hz, command=command)
    else:
        run, is_measured = _run_of(motion)
        prepared = prepare_run(run, Preparation.from_dict(card.preparation))
        name, unit, path = run.name, run.command_unit, prepared.trajectory
        measured, scored_from = prepared.force if is_measured else None, prepared.scored_from
    if unit != card.damper.command_unit:
        raise InputError(
            place=name,
            found=f"the command is in {unit}",
            expected=f"{card.damper.command_unit}, as the card has it",
        )
    if path.temperature is None:
        path = replace(path, temperature=np.full(len(path), options.temperature_degC + ZERO_CELSIUS_K))
    force = models.simulate(card.damper, path)
    interval = None
    if posterior:
        interval = percentile_ends(np.stack([models.simulate(each, path) for each in posterior]))
    return SimulateResult(card.title, name, unit, path, force, measured, scored_from, interval)


def _run_of(motion: str | Path | RigRun | FrameLike) -> tuple[RigRun, bool]:
    """Return the run that defines the motion, and True if its force was measured."""
    part = parts_of(motion)[0]
    if isinstance(part, RigRun):
        return part, True
    if not isinstance(part, Frame):
        return _single_recording(read_file(Path(part))).checked(), True
    roles = {role for name in part.columns for role in roles_of_unit(word_and_unit(name)[1])}
    if "force" in roles:
        return _single_recording(part.read(ChannelMap())).checked(), True
    recording = _single_recording(replace(part, columns={**part.columns, "force_N": 0.0}).read(ChannelMap()))
    # A valid run needs a force that resists the motion. The simulation does not use the substitute force.
    stand_in = np.gradient(recording.displacement, recording.time)
    return replace(recording, force=stand_in).checked(), False


def _single_recording(file: RigFile) -> Recording:
    names = [each.name for each in file.recordings]
    if len(names) != 1:
        raise InputError(place="motion", found=f"{len(names)} runs ({', '.join(names[:6])})", expected="one")
    return file.recordings[0]
