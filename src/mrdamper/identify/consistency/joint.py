"""Fit one model to all runs of a campaign and test the consistency of the runs, for ``check --deep``."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from operator import itemgetter

from mrdamper.data.finding import Finding
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import Dataset, Recording, RigRun, accepted_runs
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.consistency.runs import find_deviations, find_suspects, rms_residual
from mrdamper.identify.fit import default_law
from mrdamper.identify.fit_data import FitData
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.models.damper import Damper


def joint_test(runs: Sequence[Recording]) -> list[Finding]:
    """Fit one model to all runs that can be prepared, and return findings about deviating runs."""
    sound = []
    for run in accepted_runs(runs):
        with suppress(InputError):  # The diagnosis of single runs reports the invalid runs.
            prepare_run(run)
            sound.append(run)
    try:
        damper, training, free = joint_fit(sound)
    except (InputError, ConvergenceError) as fault:
        return [
            Finding(
                kind="no_joint_test",
                severity="note",
                found=f"the runs could not be fitted together: {fault}".replace("\n", "; "),
                effect="Their consistency was not tested",
                remedy="Give all runs of a campaign at once, with two commands or more",
            )
        ]
    findings = find_deviations(damper, training, free=free)
    # A wrong run distorts the fit. Therefore the fit is repeated without each suspect.
    refits = []
    for name in find_suspects(damper, training, free=free):
        with suppress(InputError, ConvergenceError):
            refitted, _, free = joint_fit([run for run in sound if run.name != name], first=damper)
            refits.append((rms_residual(refitted, training, without=name), name, refitted, free))
    if not refits:
        return list(findings)
    _, name, refitted, free = min(refits, key=itemgetter(0))
    is_confirmed = any(finding.run == name for finding in findings)
    second = find_deviations(refitted, training, free=free, suspect=name, is_confirmed=is_confirmed)
    kinds, second_kinds = ({each.kind for each in found if not each.run} for found in (findings, second))
    if kinds & second_kinds:
        # A group of runs still deviates after the suspect is omitted. Therefore the suspect is not the cause.
        return list(findings)
    return [finding for finding in second if finding.run] or list(findings)


def joint_fit(
    runs: Sequence[RigRun], *, first: Damper | None = None
) -> tuple[Damper, tuple[PreparedRun, ...], tuple[str, ...]]:
    """Return the fitted damper, the prepared runs, and the names of the parameters that are not at a bound.

    If ``first`` is given, the fit starts from this damper of a former fit.
    """
    data = FitData.prepare(Dataset(tuple(runs)))
    problem = data.problem(default_law(data.training))
    names = problem.template.parameters.keys()
    dampers = () if first is None or first.parameters.keys() != names else (first,)
    result = fit_variable_projection(problem, starts=1 - len(dampers), dampers=dampers)
    return result.damper, data.training, tuple(each.name for each in result.estimates if not each.at_bound)
