"""Fit one model to all runs of a campaign and test the consistency of the runs, for ``check --deep``.

The parameter search of ``identify.fit`` is used. Uncertainty, proposed tests and cross-validation are
omitted.
"""

from __future__ import annotations

from collections.abc import Sequence

from mrdamper.data.finding import Finding
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import Dataset, Recording, RigRun
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.consistency.runs import find_deviations, find_suspects, rms_residual
from mrdamper.identify.fit import default_law
from mrdamper.identify.fit_data import FitData
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.models.damper import Damper


def joint_test(runs: Sequence[Recording]) -> list[Finding]:
    """Fit one model to all runs that can be prepared, and return findings about deviating runs."""
    sound = _prepared(runs)
    try:
        damper, training, free = joint_fit(sound)
    except (InputError, ConvergenceError) as fault:
        return [
            Finding(
                kind="no_joint_test",
                severity="note",
                channel="",
                found=f"the runs could not be fitted together: {fault}".replace("\n", "; "),
                effect="Their consistency was not tested",
                remedy="Give all runs of a campaign at once, with two commands or more",
            )
        ]
    findings = find_deviations(damper, training, free=free)
    # A wrong run distorts the fit. Therefore the fit is repeated without each suspect.
    refits = []
    for name in find_suspects(damper, training, free=free):
        try:
            refitted, _, refit_free = joint_fit([run for run in sound if run.name != name], first=damper)
        except (InputError, ConvergenceError):
            continue
        refits.append((rms_residual(refitted, training, without=name), name, refitted, refit_free))
    if not refits:
        return list(findings)
    _, name, refitted, refit_free = min(refits, key=lambda refit: refit[0])
    refit_findings = find_deviations(
        refitted,
        training,
        free=refit_free,
        suspect=name,
        is_confirmed=any(finding.run == name for finding in findings),
    )
    if _group_kinds(findings) & _group_kinds(refit_findings):
        # A group of runs still deviates after the suspect is omitted. Therefore the suspect is not the cause.
        return list(findings)
    return [finding for finding in refit_findings if finding.run] or list(findings)


def _group_kinds(findings: Sequence[Finding]) -> set[str]:
    return {finding.kind for finding in findings if not finding.run}


def joint_fit(
    runs: Sequence[RigRun], *, first: Damper | None = None
) -> tuple[Damper, tuple[PreparedRun, ...], tuple[str, ...]]:
    """Return the fitted damper, the prepared runs, and the names of the parameters that are not at a bound.

    If ``first`` is given, the fit starts from this damper of a former fit.
    """
    data = FitData.prepare(Dataset(tuple(runs)))
    problem = data.problem(default_law(data.training))
    if first is not None and first.parameters.keys() != problem.template.parameters.keys():
        first = None
    dampers = () if first is None else (first,)
    result = fit_variable_projection(problem, starts=1 - len(dampers), dampers=dampers)
    return result.damper, data.training, tuple(each.name for each in result.estimates if not each.at_bound)


def _prepared(runs: Sequence[Recording]) -> list[RigRun]:
    """Return the valid runs, prepared for a fit. The diagnosis of single runs reports the invalid runs."""
    sound: list[RigRun] = []
    for run in runs:
        try:
            checked = run.checked()
            prepare_run(checked)
        except InputError:
            continue
        sound.append(checked)
    return sound
