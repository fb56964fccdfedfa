"""The Python API: fit, assess, predict. The jobs of the command line do the same and write files.

>>> runs = mrdamper.read_runs(["runs/"])  # doctest: +SKIP
>>> fitted = mrdamper.fit(runs, "series-valve", hold_out=["*chirp*"])  # doctest: +SKIP
>>> errors = mrdamper.assess(fitted).runs  # doctest: +SKIP
>>> mrdamper.predict(fitted.card(), other_runs)  # doctest: +SKIP

A law is named, or is a user's own in Python: an object or class with ``name``, ``coefficients``, ``rate``
and ``force`` (``models.laws.PythonLaw``).
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from typing import Literal

import numpy as np

from mrdamper.data.prepare import Preparation, PreparedRun, decimate, prepare_run
from mrdamper.data.records import Dataset, RigRun
from mrdamper.errors import InputError
from mrdamper.identify.assess import Assessment, Kind, RunError, score_run
from mrdamper.identify.assess import assess as assess_fit
from mrdamper.identify.problem import Estimate, FitProblem, FitResult, envelope_of
from mrdamper.identify.templates import template
from mrdamper.identify.variable_projection import Report, fit_variable_projection
from mrdamper.models.card import Evidence, Excerpt, ModelCard, cut_excerpt
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS, HysteresisLaw, PythonLaw, find_law
from mrdamper.models.simulate import simulate

__all__ = ["METHODS", "Identification", "Law", "Method", "assess", "fit", "predict", "resolve_law", "row"]

Method = Literal["varpro", "genetic", "cma"]
METHODS: tuple[Method, ...] = ("varpro", "genetic", "cma")

Law = str | HysteresisLaw | PythonLaw | type[PythonLaw]

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
    cpu_s: float  # of preparation and fit
    python_law: str | None = None  # where a user's own law comes from, ``file.py:Class``

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
        if result.cancelled:
            notes["cancelled"] = "interrupted: the best numbers so far, not converged ones"
        return ModelCard(
            title=title or f"{self.damper.law.name}, {len(self.training)} training runs",
            damper=self.damper,
            envelope=envelope_of(self.training),
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
        )


def fit(  # noqa: PLR0913 - the options of a fit, by keyword
    runs: Dataset | Iterable[RigRun],
    law: Law = "series-valve",
    *,
    method: Method = "varpro",
    starts: int = 1,
    seed: int = 0,
    hold_out: Sequence[str] = (),
    session_offsets: bool = False,
    one_command: bool = False,
    terms: Sequence[str] = (),
    preparation: Preparation | None = None,
    report: Report | None = None,
) -> Identification:
    """Fit one law to all runs that are not held out, over all their commands at once.

    Parameters
    ----------
    law : a law's name, or a user's own law in Python (object or class)
    method : ``varpro`` (variable projection), ``genetic`` (the paper's baseline) or ``cma``
    starts : Latin-hypercube starts of ``varpro``
    hold_out : patterns of the names of runs that the fit must not see
    session_offsets : let each session have its own constant force
    one_command : allow runs at a single command (the model then holds for it alone)
    terms : parallel terms to add to the law: ``friction`` (Stribeck), ``mass``, ``viscosity``
    report : told of every step

    Raises
    ------
    InputError
        Runs, law and options do not fit together.
    """
    if method not in METHODS:
        raise InputError(f"method is {method!r}; use one of: {', '.join(METHODS)}")
    if starts < 1:
        raise InputError(f"starts is {starts}; expected 1 or more")
    chosen, python_law = resolve_law(law)
    dataset = runs if isinstance(runs, Dataset) else Dataset(tuple(runs))
    training, held_out = dataset.split(hold_out) if hold_out else (dataset, Dataset(()))
    clock = time.process_time()
    how = preparation or Preparation()
    prepared = prepare_all(training, how)
    unseen = prepare_all(held_out, how)
    damper, free = template(chosen, prepared, one_command=one_command, terms=terms)
    problem = FitProblem(damper, free, prepared, session_offsets)
    prepared_in = time.process_time() - clock
    if method == "varpro":
        result = fit_variable_projection(problem, starts=starts, seed=seed, report=report)
    else:
        from mrdamper.identify.population import fit_cma, fit_genetic

        result = (fit_genetic if method == "genetic" else fit_cma)(problem, seed=seed, report=report)
    return Identification(
        result, problem, prepared, unseen, how, training.fingerprint, prepared_in + result.cpu_s, python_law
    )


def assess(
    fitted: Identification,
    *,
    leave_out: Sequence[Kind] = (),
    seed: int | None = None,
    report: Report | None = None,
) -> Assessment:
    """Judge a fit: error by run, passivity, words; ``leave_out`` fits again without each part."""
    return assess_fit(
        fitted.result,
        fitted.training,
        fitted.held_out,
        problem=fitted.problem,
        leave_out_kinds=leave_out,
        seed=fitted.result.seed if seed is None else seed,
        report=report,
    )


def predict(
    model: ModelCard | Damper | Identification,
    runs: Dataset | Iterable[RigRun],
    *,
    preparation: Preparation | None = None,
) -> tuple[RunError, ...]:
    """Return the force error of a model on runs, at full rate, no offset removed.

    The runs are prepared as the card says. A run that the card was identified on (same name, same error)
    is marked ``training``, any other ``held_out``.
    """
    seen: dict[str, float] = {}
    if isinstance(model, ModelCard):
        preparation = preparation or Preparation.from_dict(model.preparation)
        seen = {run["name"]: run["rmse_N"] for run in model.evidence.runs if run["split"] == "training"}
    elif isinstance(model, Identification):
        preparation = preparation or model.preparation
        seen = {run.name: np.nan for run in model.training}
    damper = model if isinstance(model, Damper) else model.damper
    errors = (score_run(damper, prepare_run(run, preparation)) for run in runs)
    return tuple(
        replace(error, split="training")
        if error.name in seen and not abs(error.rmse_N - seen[error.name]) > 1e-6 * error.rmse_N
        else error
        for error in errors
    )


def resolve_law(law: Law) -> tuple[HysteresisLaw, str | None]:
    """Return a law, and where it comes from (``file.py:Class``) when it is a user's own.

    A text that names a Python file runs that file.
    """
    from mrdamper.models.reference import law_from_python, load_python_law

    if isinstance(law, HysteresisLaw):
        return law, None if law.python is None else _place_of(law.python)
    if isinstance(law, str):
        if ".py:" in law:
            return load_python_law(law), law
        if law not in LAWS and law == "auto":
            raise InputError(
                "law 'auto' compares laws: use identify.assess.choose_law, or mrdamper identify --law auto"
            )
        return find_law(law), None
    own = law() if isinstance(law, type) else law
    return law_from_python(own), _place_of(own)


def row(error: RunError) -> dict[str, object]:
    """Return a run's error as JSON takes it, the contract's keys first."""
    values = asdict(error)
    first = ("name", "split", "rmse_N", "nrmse_percent", "nrmse_whole_percent", "nrmse_offset_free_percent")
    current = error.command if error.command_unit == "A" else None
    return {
        **{key: values.pop(key) for key in first},
        "command": values.pop("command"),
        "command_unit": values.pop("command_unit"),
        "current_A": current,
        "temperature_degC": values.pop("temperature_degC"),
        **values,
    }


def prepare_all(runs: Iterable[RigRun], preparation: Preparation) -> tuple[PreparedRun, ...]:
    """Prepare every run; what is wrong with them is told at once."""
    prepared, faults = [], []
    for run in runs:
        try:
            prepared.append(prepare_run(run, preparation))
        except InputError as fault:
            faults.append(str(fault))
    if faults:
        raise InputError("\n".join(faults))
    return tuple(prepared)


def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    found = {}
    for name in ("mrdamper", "numpy", "scipy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # run from a source tree that is not installed
            found[name] = "unknown"
    return found


def finite(value: float) -> float | None:
    """Return a number that JSON can hold, None for what is not finite."""
    return float(value) if np.isfinite(value) else None


def _place_of(law: PythonLaw) -> str:
    try:
        return f"{inspect.getfile(type(law))}:{type(law).__name__}"
    except (OSError, TypeError):
        return f"<interactive>:{type(law).__name__}"


def _excerpt(damper: Damper, training: Sequence[PreparedRun]) -> Excerpt:
    """Cut the shortest first period among the runs of the highest command: it starts at rest."""

    def ends_at(run: PreparedRun) -> int:
        return run.scored_from + round((run.period_s or 1.0) / run.trajectory.step)

    coarse = [decimate(run, _EXCERPT_RATE_Hz) for run in training]
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
