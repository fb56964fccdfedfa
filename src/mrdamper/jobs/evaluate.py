"""The job ``evaluate``: compute the error and the uncertainty of a card on runs.

The 90 % intervals of forces and coefficients are computed from posterior samples (``models.card_draws``),
which are equally likely parameter sets. These intervals contain only the uncertainty of the parameters. The
expected error of a measured force also contains model error and sensor noise; ``models.force_band`` computes
this error.

Modules that only a fit needs are not imported, so that the job starts fast.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.prepare import Preparation, PreparedRun, decimate, select_plot_samples
from mrdamper.data.records import Dataset
from mrdamper.errors import EnvelopeWarning
from mrdamper.identify import evaluate as scoring
from mrdamper.identify.scores import RunError
from mrdamper.jobs.options import EvaluateOptions
from mrdamper.models.card import SPLITS, ModelCard
from mrdamper.models.card_draws import draws_of, percentile_ends
from mrdamper.models.damper import Damper
from mrdamper.models.force_band import ForceBand
from mrdamper.models.simulate import open_drive, simulate
from mrdamper.quantities import REFERENCE_K
from mrdamper.results import JobResult
from mrdamper.runtime.pool import Pool

if TYPE_CHECKING:
    from mrdamper.identify.fit import Identification

PYTHON_RATE_Hz = 200.0
"""Sampling rate of simulations with a law in Python. It is low because such a law is slow."""
_USUAL = EvaluateOptions()


@dataclass(frozen=True, slots=True, eq=False)
class ForceInterval:
    """90 % intervals of the force in one plotted cycle, and of the error of the run."""

    name: str
    time_s: FloatArray  # time since the first plotted sample
    measured_N: FloatArray
    modelled_N: FloatArray  # force of the fitted damper
    low_N: FloatArray  # lower bound of the force interval
    high_N: FloatArray  # upper bound of the force interval
    rmse_N: tuple[float, float]  # 90 % interval of the RMS error over all samples after the warm-up

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


@dataclass(frozen=True, slots=True, repr=False)
class EvaluateResult(JobResult):
    """Errors of a model on runs. The result can be used as a sequence of the errors."""

    _job = "evaluate"
    law: str
    errors: tuple[RunError, ...]
    notes: tuple[str, ...]  # statements about runs that are outside the envelope of the card
    promised: Mapping[str, Mapping[str, float | int | None]]  # errors of the fit, as stored in the card
    band: ForceBand | None = None  # expected error of new runs, from the card
    forces: tuple[ForceInterval, ...] = ()  # force interval of every run; empty without posterior samples
    coefficients: tuple[CoefficientInterval, ...] = ()
    command_unit: str = ""

    def __iter__(self) -> Iterator[RunError]:
        return iter(self.errors)

    def __len__(self) -> int:
        return len(self.errors)

    def __getitem__(self, k: int) -> RunError:
        return self.errors[k]


def evaluate(
    card: ModelCard | Damper | Identification,
    runs: Dataset,
    preparation: Preparation | None = None,
    options: EvaluateOptions = _USUAL,
) -> EvaluateResult:
    """Prepare runs as stated in the card, and compute the errors of a model on them.

    Parameters
    ----------
    card : model card, damper or fit
    preparation : filter and resampling of the runs; None: the preparation that is stored in the card

    Raises
    ------
    InputError
        If the runs are invalid or lack a channel that the model needs, or if requested posterior samples are
        missing.
    """
    posterior = draws_of(card, options.posterior) if isinstance(card, ModelCard) else ()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", EnvelopeWarning)
        errors = scoring.evaluate(card, runs, preparation=preparation)
    notes = tuple(f"{each.message!s}" for each in caught if issubclass(each.category, EnvelopeWarning))
    damper = card if isinstance(card, Damper) else card.damper
    promised = {}
    if isinstance(card, ModelCard):
        promised = {split: card.evidence.errors(split) for split in SPLITS}
    if not isinstance(card, ModelCard):
        return EvaluateResult(damper.law.name, errors, notes, promised)
    found = EvaluateResult(damper.law.name, errors, notes, promised, card.force_band)
    if not posterior:
        return found
    prepared = scoring.prepare_for(card, runs, preparation)
    forces = Pool().map(lambda run: force_interval(damper, posterior, run), prepared)
    return replace(
        found,
        forces=tuple(forces),
        coefficients=coefficient_intervals(damper, posterior, card.envelope.command),
        command_unit=damper.command_unit,
    )
