"""Compute the errors of a model on runs: the public function ``evaluate``, and its results as JSON.

This module does not import ``fit``, so that the evaluation of a card starts fast.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace

import numpy as np

from mrdamper.data.motion import velocity_band
from mrdamper.data.prepare import Preparation, PreparedRun, prepare_run
from mrdamper.data.records import Dataset, RigRun, with_steady_commands
from mrdamper.errors import EnvelopeWarning, InputError
from mrdamper.identify.problem import FittedDamper, envelope_of
from mrdamper.identify.scores import RunError, score_run
from mrdamper.identify.settings import NUMERICS
from mrdamper.models.card import ModelCard
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K


def evaluate(
    model: ModelCard | Damper | FittedDamper,
    runs: Dataset | Iterable[RigRun],
    *,
    preparation: Preparation | None = None,
) -> tuple[RunError, ...]:
    """Return the force error of a model on each run, at full sampling rate and without removing an offset.

    A run with the same name and error as a training run of the model is marked ``training``. All other runs
    are marked ``held_out``. If runs are outside the envelope of the card, one ``EnvelopeWarning`` lists them.
    """
    damper = model if isinstance(model, Damper) else model.damper
    prepared = prepare_for(model, runs, preparation)
    seen: dict[str, float] = {}
    band = None
    if isinstance(model, ModelCard):
        seen = {run["name"]: run["rmse_N"] for run in model.evidence.runs if run["split"] == "training"}
        band = model.force_band
        if outside := outside_envelope(model, prepared):
            warnings.warn("; ".join(outside), EnvelopeWarning, stacklevel=2)
    elif not isinstance(model, Damper):
        seen = {run.name: np.nan for run in model.training}
    errors = (score_run(damper, run, band=band) for run in prepared)
    return tuple(
        replace(error, split="training")
        if error.name in seen and not abs(error.rmse_N - seen[error.name]) > 1e-6 * error.rmse_N
        else error
        for error in errors
    )


def prepare_for(
    model: ModelCard | Damper | FittedDamper,
    runs: Dataset | Iterable[RigRun],
    preparation: Preparation | None = None,
) -> tuple[PreparedRun, ...]:
    """Return the runs prepared for the model; raise InputError if a run lacks a required temperature."""
    if isinstance(model, ModelCard):
        preparation = preparation or Preparation.from_dict(model.preparation)
    elif not isinstance(model, Damper):
        preparation = preparation or model.preparation
    damper = model if isinstance(model, Damper) else model.damper
    prepared = prepare_all(runs, preparation or Preparation())
    if all_assumed(damper):
        prepared = tuple(map(set_reference_temperature, prepared))
    lacking = [run.name for run in prepared if run.trajectory.temperature is None]
    if lacking and damper.temperature_dependent:
        more = f" (and {len(lacking) - 1} more of {len(prepared)} runs)" if len(lacking) > 1 else ""
        raise InputError(
            found=f"{lacking[0]}{more}: has no temperature channel, and the model depends on temperature",
            expected="a column such as temperature_degC",
            remedy="Map the channel, or state it as a constant in the channel map ([constant] "
            "temperature_degC = 20)",
        )
    return prepared


def operating_envelope(runs: Sequence[PreparedRun]) -> OperatingEnvelope:
    """Return the ranges of all quantities in the runs; the range of acceleration omits the extreme 0.2 %."""

    def union(ranges: Iterable[Sequence[float]]) -> tuple[float, float]:
        lows, highs = zip(*ranges, strict=True)
        return min(lows), max(highs)

    ends = NUMERICS.acceleration_quantile, 1.0 - NUMERICS.acceleration_quantile
    return replace(
        envelope_of(runs),
        acceleration=union(
            np.quantile(run.trajectory.acceleration[run.scored_from :], ends).tolist() for run in runs
        ),
        frequency=union(velocity_band(run.trajectory.velocity, run.trajectory.step) for run in runs),
    )


def outside_envelope(card: ModelCard, runs: Sequence[PreparedRun]) -> list[str]:
    """Return a sentence for each quantity that exceeds the envelope of the card in some runs."""
    notes, envelopes = [], {run.name: operating_envelope([run]) for run in runs}
    for quantity, unit, scale, shift in (
        ("command", card.damper.command_unit, 1.0, 0.0),
        ("displacement", "mm", 1e3, 0.0),
        ("velocity", "mm/s", 1e3, 0.0),
        ("acceleration", "m/s2", 1.0, 0.0),
        ("frequency", "Hz", 1.0, 0.0),
        ("temperature", "degC", 1.0, -ZERO_CELSIUS_K),
    ):
        allowed = getattr(card.envelope, quantity)
        if allowed is None:
            continue
        low, high = _with_slack(quantity, allowed)
        ranges = {name: getattr(envelope, quantity) for name, envelope in envelopes.items()}
        beyond = {name: ends for name, ends in ranges.items() if ends and (ends[0] < low or ends[1] > high)}
        if not beyond:
            continue
        extremes = min(ends[0] for ends in beyond.values()), max(ends[1] for ends in beyond.values())
        least, most, known_least, known_most = (scale * end + shift for end in (*extremes, *allowed))
        first = next(iter(beyond))
        where = f"{len(beyond)} of {len(runs)} runs (the first: {first})" if len(runs) > 1 else first
        words = (
            f"{quantity} is {least:.4g} to {most:.4g} {unit} in {where}; the card was fitted to "
            f"{known_least:.4g} to {known_most:.4g} {unit}"
        )
        notes.append(
            f"{words}, {describe_extrapolation(card.damper)}" if quantity == "temperature" else words
        )
    return notes


def _with_slack(what: str, allowed: tuple[float, float]) -> tuple[float, float]:
    """Return the range ``allowed`` of a quantity of the envelope, extended by a tolerance."""
    if what == "frequency":
        return 0.5 * allowed[0], 1.25 * allowed[1]
    share = 0.25 if what == "acceleration" else 0.05
    slack = 5.0 if what == "temperature" else share * max(map(abs, allowed))
    return allowed[0] - slack, allowed[1] + slack


def all_assumed(damper: Damper) -> bool:
    """Return True if the temperature dependence is assumed and not fitted; runs then need no temperature."""
    return bool(damper.assumed) and len(damper.assumed) == sum(
        form.temperature_dependent for form in damper.coefficients.values()
    )


def describe_extrapolation(damper: Damper) -> str:
    """Return a text that describes the force of a damper outside its temperature range."""
    if not damper.temperature_dependent:
        return "and its force does not depend on temperature"
    if damper.temperature_range is None:
        return "and beyond that its temperature laws are extrapolated"
    low, high = (kelvin - ZERO_CELSIUS_K for kelvin in damper.temperature_range)
    return f"and below {low:.4g} or above {high:.4g} degC its coefficients keep their value at that edge"


def set_reference_temperature(run: PreparedRun) -> PreparedRun:
    """Return the run, with a constant temperature of 20 degC if it has no temperature channel."""
    if run.trajectory.temperature is not None:
        return run
    kelvin = np.full(len(run), REFERENCE_K)
    return replace(run, trajectory=replace(run.trajectory, temperature=kelvin))


def row(error: RunError) -> dict[str, object]:
    """Return the error of a run as a JSON object."""
    values = {**asdict(error), "current_A": error.command if error.command_unit == "A" else None}
    if error.in_band_percent is None:
        del values["in_band_percent"]
    return values


def prepare_all(runs: Iterable[RigRun], preparation: Preparation) -> tuple[PreparedRun, ...]:
    """Return all runs after preparation. The noise of a constant command is removed.

    If runs are invalid, one InputError with all faults is raised.
    """
    prepared: list[PreparedRun] = []
    faults: list[InputError] = []
    for run in with_steady_commands(runs):
        try:
            prepared.append(prepare_run(run, preparation))
        except InputError as fault:
            faults.append(fault)
    if faults:
        raise InputError(faults=faults)
    return tuple(prepared)
