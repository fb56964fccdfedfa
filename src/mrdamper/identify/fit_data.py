"""The data of one fit job: measured runs, prepared once and sorted independently of the order of files.

Screening, cross-validation and the final fit share this data and the fit problem that is derived from it. The
typical values (``Scale``) that define the search bounds come from all runs with constant current, even if a
fit uses only some of these runs. A parameter set therefore has the same meaning for any subset of the runs.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mrdamper.data.continuation import join_continuations
from mrdamper.data.prepare import Preparation, PreparedRun
from mrdamper.data.records import Dataset
from mrdamper.identify.evaluate import prepare_all, set_reference_temperature
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.settings import DEFAULT_SETTINGS, FitSettings
from mrdamper.identify.temperature import FluidFactors, Temperature, select_temperature_kind
from mrdamper.identify.templates import command_levels, scale_of, template
from mrdamper.identify.terms import Scale
from mrdamper.models.laws import HysteresisLaw


@dataclass(frozen=True)
class FitData:
    """Prepared runs and settings that all fits of one job share."""

    training: tuple[PreparedRun, ...]  # training runs in the order of the files
    held_out: tuple[PreparedRun, ...]
    # Training runs with constant current, sorted by their data; identical runs are used once. If there are
    # fewer than two currents, this field has all runs.
    steady: tuple[PreparedRun, ...]
    changing: tuple[PreparedRun, ...]  # remaining training runs with changing current, sorted by their data
    temperature: Temperature
    fluid: FluidFactors | None  # fluid with assumed temperature dependence; None: the dependence is fitted
    one_command: bool  # True: a fit with a single current for all runs is permitted
    preparation: Preparation
    fingerprint: str  # hash of the training data
    notes: tuple[str, ...] = ()
    settings: FitSettings = DEFAULT_SETTINGS

    @classmethod
    def prepare(
        cls,
        runs: Dataset,
        *,
        hold_out: Sequence[str] = (),
        preparation: Preparation | None = None,
        temperature: Temperature = "auto",
        fluid: FluidFactors | None = None,
        one_command: bool = False,
        settings: FitSettings = DEFAULT_SETTINGS,
    ) -> FitData:
        """Prepare the runs of a fit. Runs whose names match a pattern in ``hold_out`` are not fitted."""
        training, held_out = runs.split(hold_out) if hold_out else (runs, Dataset(()))
        fingerprint = training.fingerprint
        training, continued = join_continuations(training)
        preparation = preparation or Preparation()
        prepared, unseen = prepare_all(training, preparation), prepare_all(held_out, preparation)
        notes = _noisy_currents(training, prepared)
        if continued:
            note = f"{len(continued)} of the files continue the record of another file: they are one run"
            notes += (f"{note} (the first: {continued[0]})",)
        if fluid is not None:
            prepared, unseen = (tuple(map(set_reference_temperature, each)) for each in (prepared, unseen))
        else:
            prepared, temperature, remark = select_temperature_kind(prepared, temperature)
            notes += (remark,) if remark else ()
        distinct, repeated = _without_repetitions(prepared)
        if repeated:
            note = f"{len(repeated)} of the runs repeat the data of other runs: they are used once"
            notes += (f"{note} (the first: {repeated[0].name})",)
        steady = tuple(run for run in distinct if run.run.constant_command is not None)
        changing = tuple(run for run in distinct if run.run.constant_command is None)
        if command_levels(steady) < 2:
            # The law needs two currents. Therefore law and lag are fitted together to all runs.
            steady, changing = tuple(distinct), ()
        return cls(
            prepared,
            unseen,
            steady,
            changing,
            temperature,
            fluid,
            one_command,
            preparation,
            fingerprint,
            notes,
            settings,
        )

    @cached_property
    def scale(self) -> Scale:
        """Typical force, stroke, speed and current of the training runs with constant current.

        All search bounds are multiples of these values.
        """
        return scale_of(self.steady)

    def problem(
        self,
        law: str | HysteresisLaw,
        terms: Sequence[str] | None = None,
        start: Mapping[str, float] | None = None,
    ) -> FitProblem:
        """Return the problem of fitting a law with the named terms to the runs with constant current."""
        damper, free = template(
            law,
            self.steady,
            one_command=self.one_command,
            terms=terms,
            start=start,
            temperature=self.temperature,
            fluid=self.fluid,
            scale=self.scale,
        )
        return FitProblem(damper, free, self.steady, self.settings)


def _content(run: PreparedRun) -> tuple[float | str, ...]:
    """Return a sort key of a run that depends on the samples, and not on the name or file of the run."""
    path = run.trajectory
    kelvin = 0.0 if path.temperature is None else float(np.mean(path.temperature))
    digest = hashlib.sha256()
    for values in (path.displacement, path.command, path.temperature, run.force):
        if values is not None:
            digest.update(np.ascontiguousarray(values).tobytes())
    return (
        round(float(np.std(path.velocity)), 9),
        round(float(np.std(path.displacement)), 12),
        round(float(np.mean(path.command)), 9),
        round(kelvin, 6),
        digest.hexdigest(),
    )


def _without_repetitions(runs: Sequence[PreparedRun]) -> tuple[list[PreparedRun], list[PreparedRun]]:
    """Return the runs without exact repetitions, sorted by their data, and the repeated runs."""
    distinct: dict[tuple[float | str, ...], PreparedRun] = {}
    repeated = [run for run in runs if distinct.setdefault(_content(run), run) is not run]
    return [distinct[key] for key in sorted(distinct)], repeated


def _noisy_currents(runs: Dataset, prepared: Sequence[PreparedRun]) -> tuple[str, ...]:
    """Return a remark if noisy currents of some runs are treated as constant."""
    noisy = [
        run
        for run, each in zip(runs, prepared, strict=True)
        if run.constant_command is None and each.run.constant_command is not None
    ]
    if not noisy:
        return ()
    noise = f"{1e3 * max(float(np.std(run.command)) for run in noisy):.0f} m{noisy[0].command_unit}"
    return (f"the command of {len(noisy)} runs is noise about a level (at most {noise}): taken as steady",)
