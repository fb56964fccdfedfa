"""Fitting a law to runs, and judging the fit: what the job ``identify`` is made of.

A law is named, or is a user's own in Python: an object or class with ``name``, ``coefficients``, ``rate``
and ``force`` (``models.laws.PythonLaw``).
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from typing import Literal

import numpy as np

from mrdamper.data.prepare import Preparation, PreparedRun, decimate
from mrdamper.data.records import Dataset, RigRun
from mrdamper.errors import InputError, command
from mrdamper.identify.actuation import ActuationFit, fit_changes, with_iron
from mrdamper.identify.assess import Assessment, Kind
from mrdamper.identify.assess import assess as assess_fit
from mrdamper.identify.checkpoint import CheckpointStore
from mrdamper.identify.confidence.left_out import across_motions, force_band, leave_folds_out
from mrdamper.identify.confidence.proposals import ProposedTest, propose_tests
from mrdamper.identify.groups import archetypes_of
from mrdamper.identify.limits import brought_inside
from mrdamper.identify.predict import at_reference, finite, predict, prepare_all, row, whole_envelope
from mrdamper.identify.problem import Estimate, FitProblem, FitResult, envelope_of
from mrdamper.identify.search.population import fit_cma, fit_genetic
from mrdamper.identify.search.variable_projection import MOST_ITERATIONS, fit_variable_projection
from mrdamper.identify.selection.candidates import Candidate
from mrdamper.identify.selection.judge import Judge
from mrdamper.identify.temperature import (
    TEMPERATURES,
    FluidFactors,
    Temperature,
    scale_thinning,
    settle_temperature,
)
from mrdamper.identify.templates import command_levels, template
from mrdamper.models.card import Evidence, Excerpt, ModelCard, cut_excerpt
from mrdamper.models.damper import Damper
from mrdamper.models.force_band import ForceBand
from mrdamper.models.laws import LAWS, HysteresisLaw, PythonLaw, find_law
from mrdamper.models.python_law import law_from_python, load_python_law
from mrdamper.models.simulate import simulate
from mrdamper.notes import Note
from mrdamper.runtime.pool import ONE_CORE, Pool, cpu_seconds
from mrdamper.runtime.progress import Progress, silent

__all__ = ["METHODS", "Identification", "Law", "Method", "assess", "fit", "predict", "resolve_law", "row"]

Method = Literal["varpro", "genetic", "cma"]
METHODS: tuple[Method, ...] = ("varpro", "genetic", "cma")

Law = str | HysteresisLaw | PythonLaw | type[PythonLaw]

_GROWN_ITERATIONS = 40  # of the fit of a law of groups, from where its search has led
_EXCERPT_RATE_Hz = 200.0
_LONGEST_EXCERPT = 600  # samples


@dataclass(frozen=True)
class Identification:
    """A fit with what it was made from: all that assessing it and writing its card take."""

    result: FitResult
    problem: FitProblem
    training: tuple[PreparedRun, ...]
    held_out: tuple[PreparedRun, ...]
    preparation: Preparation
    fingerprint: str
    cpu_s: float  # of preparation and fit; from the job, of choosing and judging too
    python_law: str | None = None  # where a user's own law comes from, ``file.py:Class``
    actuation: ActuationFit | None = None  # from the training runs whose command steps
    force_band: ForceBand | None = None  # of motions that were left out; None: not known
    next_tests: tuple[ProposedTest, ...] = ()  # that would shrink it most, the best first

    @property
    def damper(self) -> Damper:
        return self.result.damper

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        return self.result.estimates

    @property
    def cost_percent(self) -> float:
        """Root of the mean over the training runs of squared ``nrmse_percent``."""
        return self.result.cost_percent

    def card(
        self, assessment: Assessment | None = None, *, title: str = "", sources: Iterable[str] = ()
    ) -> ModelCard:
        """Return the model card; without an assessment the plain one (no runs left out) is made."""
        judged = assessment or assess(self)
        result = self.result
        notes: dict[str, object] = {"words": list(judged.words), "passivity_min": judged.passivity_min}
        if result.notes:
            notes["method"] = list(result.notes)
        if self.actuation is not None:
            found = self.actuation
            notes["actuation"] = {
                "standard_errors": {name: finite(error) for name, error in found.standard_errors.items()},
                **{name: finite(time) for name, time in found.response_times.items()},
                "driver_quadrants": found.driver_quadrants,
                "t90_s": found.t90_s,
                "rmse_N": found.rmse_N,
                "unlagged_rmse_N": found.unlagged_rmse_N,
            }
        if self.next_tests:
            notes["next_tests"] = [{**asdict(each), "sentence": each.sentence} for each in self.next_tests]
        if self.damper.assumed:
            notes["assumed"] = list(self.damper.assumed)
        if result.cancelled:
            notes["cancelled"] = "interrupted: the best parameters so far, not converged ones"
        return ModelCard(
            title=title or f"{self.damper.law.name}, {len(self.training)} training runs",
            damper=self.damper,
            envelope=whole_envelope(self.training),
            evidence=Evidence(
                runs=tuple(row(error) for error in judged.runs),
                method=result.method,
                cost=result.cost_percent,
                dataset_fingerprint=self.fingerprint,
                seed=result.seed,
                versions=versions(),
                session_offsets_N=result.offsets_N,
            ),
            standard_errors={e.name: finite(e.standard_error) for e in self.estimates},
            preparation=self.preparation.to_dict(),
            excerpt=_excerpt(self.damper, self.training),
            sources=tuple(sources),
            notes=notes,
            python_law=self.python_law,
            force_band=self.force_band,
        )


def fit(  # noqa: PLR0913 - the options of a fit, by keyword
    runs: Dataset | Iterable[RigRun],
    law: Law | None = None,
    *,
    method: Method = "varpro",
    starts: int = 3,
    seed: int = 0,
    hold_out: Sequence[str] = (),
    session_offsets: bool = False,
    one_command: bool = False,
    terms: Sequence[str] | None = None,
    temperature: Temperature = "auto",
    fluid: FluidFactors | None = None,
    coil_resistance_ohm: float | None = None,
    preparation: Preparation | None = None,
    first: Damper | None = None,
    cut_short: bool = False,
    on_progress: Progress = silent,
    checkpoint: CheckpointStore | None = None,
) -> Identification:
    """Fit one law to all runs that are not held out, over all their commands and temperatures at once.

    Where some runs hold their command and others step it, the law is fitted to the former, and the actuation
    (delay and lags) to the latter.

    Parameters
    ----------
    law : a law's name, or a user's own law in Python (object or class); None: ``series-valve``, or
        ``double-bouc-wen`` for runs at several temperatures
    method : ``varpro`` (variable projection), ``genetic`` (the paper's baseline) or ``cma``
    starts : Latin-hypercube starts of ``varpro``
    hold_out : patterns of the names of runs that the fit must not see
    session_offsets : let each session have its own constant force
    one_command : allow runs at a single command (the model then holds for it alone)
    terms : parallel terms to add to the law: ``friction`` (Stribeck), ``mass``, ``viscosity``, ``thinning``,
        ``gas`` (offset and stiffness over temperature); None: what the runs ask for (``templates.template``)
    temperature : the temperature laws of the coefficients (``identify.temperature``); "none" leaves it out
    fluid : its temperature laws are assumed; runs without a temperature channel count as at 20 degC
    coil_resistance_ohm : at 20 degC, for the card (measured with an ohmmeter)
    first : a damper of the same law and terms that ``varpro`` starts from, beside ``starts`` - 2 drawn starts
        (none for a law that is made of groups)
    cut_short : an interrupt has ended what came before: ``first`` is taken as it is, marked as cancelled
    on_progress : receives a ``SearchState`` as ``detail`` after every step
    checkpoint : recalls and keeps finished pieces of the search (``identify.checkpoint``); of one fit only

    Raises
    ------
    InputError
        Runs, law and options do not fit together.
    """
    if method not in METHODS:
        raise InputError(f"method is {method!r}", expected=f"one of: {', '.join(METHODS)}")
    if starts < 1:
        raise InputError(found=f"starts is {starts}", expected="1 or more")
    if temperature not in TEMPERATURES:
        raise InputError(f"temperature is {temperature!r}", expected=f"one of: {', '.join(TEMPERATURES)}")
    dataset = runs if isinstance(runs, Dataset) else Dataset(tuple(runs))
    training, held_out = dataset.split(hold_out) if hold_out else (dataset, Dataset(()))
    clock = cpu_seconds()
    how = preparation or Preparation()
    prepared = prepare_all(training, how)
    unseen = prepare_all(held_out, how)
    told = _told_of_commands(training, prepared)
    if fluid is not None:
        prepared, unseen = (tuple(map(at_reference, runs)) for runs in (prepared, unseen))
    else:
        prepared, temperature, settled = settle_temperature(prepared, temperature)
        told += (settled,) if settled else ()
    chosen, python_law = resolve_law(usual_law(prepared) if law is None else law)
    steady, stepping = split_by_command(prepared)
    damper, free = template(
        chosen, steady, one_command=one_command, groups=terms, temperature=temperature, fluid=fluid
    )
    grown = bool(archetypes_of(damper.law)) and (first is not None or bool(terms))
    if first is None and archetypes_of(damper.law):
        first = damper
        if terms and method == "varpro":
            judge = Judge(steady, one_command=one_command, temperature=temperature, fluid=fluid)
            first = judge.staged(Candidate(damper.law.name, tuple(terms))) or damper
    problem = FitProblem(damper, free, steady, session_offsets)
    if method == "varpro":
        result = fit_variable_projection(
            problem,
            starts=starts if first is None else 0 if cut_short or grown else max(starts - 2, 0),
            seed=seed,
            on_progress=on_progress,
            first=first,
            most=1 if cut_short else _GROWN_ITERATIONS if grown else MOST_ITERATIONS,
            checkpoint=checkpoint,
        )
        result = replace(result, cancelled=result.cancelled or cut_short)
    else:
        search = fit_genetic if method == "genetic" else fit_cma
        result = search(problem, seed=seed, on_progress=on_progress, checkpoint=checkpoint)
    result, band, tests = _for_other_motions(problem, result)
    if fluid is not None:
        result = replace(result, damper=scale_thinning(result.damper))
    damper, held = brought_inside(result.damper, envelope_of(prepared))
    result = replace(result, damper=damper, notes=(*result.notes, *told, *held))
    actuation: ActuationFit | None = None
    if stepping and not result.cancelled:
        result, actuation = _with_actuation(result, stepping, coil_resistance_ohm)
    return Identification(
        result,
        problem,
        prepared,
        unseen,
        how,
        training.fingerprint,
        cpu_seconds() - clock,
        python_law,
        actuation,
        band,
        tests,
    )


def _for_other_motions(
    problem: FitProblem, result: FitResult
) -> tuple[FitResult, ForceBand | None, tuple[ProposedTest, ...]]:
    """Return the fit with errors that cover other motions, the band of its force, and tests to run next."""
    if result.cancelled or result.damper.law.kernel is None:
        return result, None, ()
    tests, left = propose_tests(problem, result), leave_folds_out(problem, result)
    if left is None:
        return result, None, tests
    return replace(result, estimates=across_motions(problem, result, left)), force_band(left), tests


def _told_of_commands(runs: Dataset, prepared: Sequence[PreparedRun]) -> tuple[str, ...]:
    """Return a note where commands are taken as steady that carry more noise than a sensor's."""
    noisy = [
        run
        for run, each in zip(runs, prepared, strict=True)
        if run.constant_command is None and each.run.constant_command is not None
    ]
    if not noisy:
        return ()
    most = max(float(np.std(run.command)) for run in noisy)
    unit = noisy[0].command_unit
    form = "the command of {runs} runs is noise about a level (at most {most:.0f} m{unit}): taken as steady"
    return (Note("noisy_commands", form, runs=len(noisy), most=1e3 * most, unit=unit),)


def _with_actuation(
    result: FitResult, stepping: Sequence[PreparedRun], resistance_ohm: float | None
) -> tuple[FitResult, ActuationFit | None]:
    """Return the fit with the actuation that the stepped runs show; a note where they show none."""
    try:
        found = fit_changes(result.damper, stepping, resistance_20_ohm=resistance_ohm)
    except InputError as error:
        return replace(
            result, notes=(*result.notes, Note("no_actuation", "without an actuation: {why}", why=f"{error}"))
        ), None
    damper, actuation = with_iron(*found, stepping)
    return replace(result, damper=damper), actuation


def assess(
    fitted: Identification,
    *,
    leave_out: Sequence[Kind] = (),
    profiled: bool = False,
    draws: int = 0,
    seed: int | None = None,
    on_progress: Progress = silent,
    checkpoint: CheckpointStore | None = None,
    pool: Pool = ONE_CORE,
) -> Assessment:
    """Judge a fit: error by run, passivity, what the data cannot tell apart, and all in words.

    ``leave_out`` fits again without each part; ``profiled`` follows the worst direction along its profile;
    ``draws`` bootstrap fits draw the runs with replacement. The ``pool`` makes these fits.
    """
    return assess_fit(
        fitted.result,
        fitted.training,
        fitted.held_out,
        problem=fitted.problem,
        leave_out=leave_out,
        profiled=profiled,
        draws=draws,
        seed=fitted.result.seed if seed is None else seed,
        on_progress=on_progress,
        checkpoint=checkpoint,
        pool=pool,
    )


def usual_law(runs: Sequence[PreparedRun]) -> str:
    """Return the law that is fitted when none is asked for."""
    temperature_dependent = all(run.trajectory.temperature is not None for run in runs)
    return "double-bouc-wen" if temperature_dependent else "series-valve"


def split_by_command(
    runs: Sequence[PreparedRun],
) -> tuple[tuple[PreparedRun, ...], tuple[PreparedRun, ...]]:
    """Return the runs that the law is fitted to, and those that tell the actuation.

    They part where runs of constant command cover two levels or more; else the law takes them all, its lag
    with it.
    """
    steady = tuple(run for run in runs if run.run.constant_command is not None)
    if len(steady) == len(runs) or command_levels(steady) < 2:
        return tuple(runs), ()
    return steady, tuple(run for run in runs if run.run.constant_command is None)


def resolve_law(law: Law) -> tuple[HysteresisLaw, str | None]:
    """Return a law, and where it comes from (``file.py:Class``) when it is a user's own.

    A text that names a Python file runs that file.
    """
    if isinstance(law, HysteresisLaw):
        return law, None if law.python is None else _place_of(law.python)
    if isinstance(law, str):
        if ".py:" in law:
            return load_python_law(law), law
        if law not in LAWS and law == "auto":
            raise InputError(
                "law 'auto' compares laws",
                expected="one law",
                remedy=f"use mrdamper.identify, or {command('identify --law auto')}",
            )
        return find_law(law), None
    own = law() if isinstance(law, type) else law
    return law_from_python(own), _place_of(own)


def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    found = {}
    for name in ("mrdamper", "numpy", "scipy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # run from a source tree that is not installed
            found[name] = "unknown"
    return found


def _place_of(law: PythonLaw) -> str:
    try:
        return f"{inspect.getfile(type(law))}:{type(law).__name__}"
    except (OSError, TypeError):
        return f"<interactive>:{type(law).__name__}"


def _excerpt(damper: Damper, training: Sequence[PreparedRun]) -> Excerpt:
    """Cut the shortest first period among the runs of the highest command: it starts at rest."""

    def ends_at(run: PreparedRun) -> int:
        return run.scored_from + round((run.period_s or 1.0) / run.trajectory.step)

    steady = [run for run in training if run.run.constant_command is not None]
    coarse = [decimate(run, _EXCERPT_RATE_Hz) for run in steady or training]
    highest = max(float(np.abs(run.trajectory.command).max()) for run in coarse)
    strongest = [run for run in coarse if float(np.abs(run.trajectory.command).max()) == highest]
    run = min(strongest, key=ends_at)
    stop = min(ends_at(run), _LONGEST_EXCERPT, len(run))
    return cut_excerpt(
        damper,
        run.trajectory,
        run.force,
        simulate,
        run=run.name,
        samples=slice(0, stop),
        scored_from=run.scored_from if run.scored_from < stop else 0,
    )
