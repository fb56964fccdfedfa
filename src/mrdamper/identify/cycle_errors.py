"""A card over a long record: its errors, in all and by temperature."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.batches import LongRecord
from mrdamper.data.conditioning import Rules
from mrdamper.data.cycles import CycleFigures
from mrdamper.data.prepare import Preparation
from mrdamper.identify.predict import all_assumed, beyond_envelope
from mrdamper.identify.replay import Replay
from mrdamper.models.card import ModelCard
from mrdamper.notes import Note
from mrdamper.quantities import ZERO_CELSIUS_K

FIGURES = (
    "model_energy_J",
    "model_highest_force_N",
    "model_lowest_force_N",
    "error_N",
    "error_percent",
    "mean_error_N",
)

BIN_K = 10.0
"""Width of the temperatures [K] in which errors are summed."""

_PACE = 0.01  # of the usual step: a sampling that differs by more is noted


def columns_of(done: CycleFigures) -> dict[str, FloatArray]:
    """Return the columns of cycles.csv that tell of the model; none without one."""
    model = done.model
    if model is None:
        return {}
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = 100.0 * model.error_N / done.force_spread_N
    percent[~np.isfinite(percent)] = np.nan
    values = (
        model.energy_J,
        model.highest_force_N,
        model.lowest_force_N,
        model.error_N,
        percent,
        model.mean_error_N,
    )
    return dict(zip(FIGURES, values, strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleErrors:
    """How far a model is from some cycles: over all their samples, and by their energy."""

    cycles: int
    rmse_N: float
    nrmse_percent: float | None  # of the spread of the measured force; None where that does not change
    percent_of_peak: float | None  # of the measured force
    mean_error_N: float  # model less measured
    peak_N: float  # measured
    energy_J: float
    model_energy_J: float


@dataclass(frozen=True, slots=True)
class ErrorBin:
    """The errors on the cycles of some temperatures."""

    from_degC: float
    to_degC: float
    errors: CycleErrors


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelErrors:
    """What there is to say of a card that was replayed over a record."""

    card: ModelCard
    errors: CycleErrors | None  # None: no cycle has a force of the model
    cycles_without: int  # a force of the model
    by_temperature: tuple[ErrorBin, ...]
    rules: Rules | None  # of the conditioning, as chosen from the record's head; None before there was one
    segments: int
    notes: tuple[str, ...]


@dataclass(slots=True)
class _Sums:
    """Sums over cycles, from which errors follow."""

    cycles: int = 0
    samples: float = 0.0
    squared_error: float = 0.0
    error: float = 0.0
    force: float = 0.0
    squared_force: float = 0.0
    peak_N: float = 0.0
    energy_J: float = 0.0
    model_energy_J: float = 0.0

    def add(self, done: CycleFigures, which: NDArray[np.bool_]) -> None:
        model = done.model
        if model is None or not which.any():
            return
        n, mean = done.samples[which].astype(np.float64), done.mean_force_N[which]
        self.cycles += int(which.sum())
        self.samples += float(n.sum())
        self.squared_error += float(n @ model.error_N[which] ** 2)
        self.error += float(n @ model.mean_error_N[which])
        self.force += float(n @ mean)
        self.squared_force += float(n @ (done.force_spread_N[which] ** 2 + mean**2))
        peaks = np.maximum(done.highest_force_N[which], -done.lowest_force_N[which])
        self.peak_N = max(self.peak_N, float(peaks.max()))
        self.energy_J += float(done.energy_J[which].sum())
        self.model_energy_J += float(model.energy_J[which].sum())

    def errors(self) -> CycleErrors | None:
        """Return errors of the samples of all these cycles together, and energies; None without a cycle."""
        if not self.cycles:
            return None
        rmse = math.sqrt(self.squared_error / self.samples)
        variance = self.squared_force / self.samples - (self.force / self.samples) ** 2
        return CycleErrors(
            cycles=self.cycles,
            rmse_N=rmse,
            nrmse_percent=100.0 * rmse / math.sqrt(variance) if variance > 0.0 else None,
            percent_of_peak=100.0 * rmse / self.peak_N if self.peak_N > 0.0 else None,
            mean_error_N=self.error / self.samples,
            peak_N=self.peak_N,
            energy_J=self.energy_J,
            model_energy_J=self.model_energy_J,
        )


@dataclass(slots=True)
class ModelOver:
    """A card that goes along with a record, and its errors so far."""

    card: ModelCard
    replay: Replay
    lacking: int = 0  # cycles without a model's force
    _all: _Sums = field(default_factory=_Sums)
    _by_bin: dict[int, _Sums] = field(default_factory=dict)  # by number of the bin of temperature

    def add(self, done: CycleFigures) -> None:
        """Take the next cycles."""
        if done.model is None:
            return
        scored = np.isfinite(done.model.error_N)
        self.lacking += int(len(done) - scored.sum())
        self._all.add(done, scored)
        bins = np.floor((done.temperature_K - ZERO_CELSIUS_K) / BIN_K + 0.5)  # round ones in the middle
        for number in np.unique(bins[scored & np.isfinite(bins)]).tolist():
            self._by_bin.setdefault(int(number), _Sums()).add(done, scored & (bins == number))

    def errors(self) -> ModelErrors:
        """Return the errors so far."""
        found = ((number, sums.errors()) for number, sums in sorted(self._by_bin.items()))
        return ModelErrors(
            card=self.card,
            errors=self._all.errors(),
            cycles_without=self.lacking,
            by_temperature=tuple(
                ErrorBin(BIN_K * (number - 0.5), BIN_K * (number + 0.5), errors)
                for number, errors in found
                if errors is not None
            ),
            rules=self.replay.rules,
            segments=self.replay.segments,
            notes=tuple(self._notes()),
        )

    def _notes(self) -> list[Note]:
        notes = beyond_envelope(self.card, {self.replay.name: self.replay.extremes})
        if self.replay.segments > 1:
            form = (
                "the record breaks into {segments} segments; the model begins each from rest, so that its "
                "force over the first part of a stroke may be off"
            )
            notes.append(Note("segments", form, segments=self.replay.segments))
        if abs(self.replay.pace - 1.0) > _PACE:
            form = (
                "a segment is sampled at {pace:.4g} times the step of the head, and was taken as if at that "
                "step: the model's velocities are off by as much. Cut the record there"
            )
            notes.append(Note("pace", form, pace=self.replay.pace))
        return notes


def open_model(card: ModelCard, record: LongRecord) -> ModelOver:
    """Return a card ready to go along with a record.

    Raises
    ------
    InputError
        The card is of another command, or needs a temperature that the record lacks.
    """
    replay = Replay(
        card.damper,
        Preparation.from_dict(card.preparation),
        record.path.name,
        record.command_unit,
        reference_temperature=all_assumed(card.damper),
    )
    return ModelOver(card, replay)
