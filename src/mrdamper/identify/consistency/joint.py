"""The joint test: one law fitted to all runs of a campaign, for what it says of each of them.

The fit is that of ``identify`` without what a card needs beside it (bands, proposals, folds left out).
"""

from __future__ import annotations

from collections.abc import Sequence

from mrdamper.data.finding import Finding
from mrdamper.data.prepare import Preparation, PreparedRun, prepare_run
from mrdamper.data.records import Recording, RigRun
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.consistency.runs import consistency, doubted, misfit
from mrdamper.identify.fit import resolve_law, split_by_command, usual_law
from mrdamper.identify.predict import prepare_all
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.temperature import settle_temperature
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper


def joint_test(runs: Sequence[Recording]) -> list[Finding]:
    """Return what one law, fitted to all runs that can be prepared, finds in each of them."""
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
                effect="Whether they belong together was not tested",
                remedy="Give all runs of a campaign at once, with two commands or more",
            )
        ]
    found = consistency(damper, training, free=free)
    # once more without the run that is doubted: it has bent the fit towards itself, and away from the others
    refits = []
    for name in doubted(damper, training, free=free):
        try:
            others, _, left = joint_fit([run for run in sound if run.name != name], first=damper)
        except (InputError, ConvergenceError):
            continue
        refits.append((misfit(others, training, without=name), name, others, left))
    if not refits:
        return list(found)
    _, name, others, left = min(refits, key=lambda each: each[0])
    sure = any(each.run == name for each in found)
    again = consistency(others, training, free=left, without=name, sure=sure)
    if {each.kind for each in found if not each.run} & {each.kind for each in again if not each.run}:
        return list(found)  # what all have, also without that run, is no run's fault
    return [each for each in again if each.run] or list(found)


def joint_fit(
    runs: Sequence[RigRun], *, first: Damper | None = None
) -> tuple[Damper, tuple[PreparedRun, ...], tuple[str, ...]]:
    """Return the damper fitted to runs, these as prepared, and the parameters that are off their bounds.

    ``first`` is a former fit to start from.

    Raises
    ------
    InputError
        The runs cannot be prepared, or lack what a law needs (two commands, say).
    ConvergenceError
        No start of the fit found a finite cost.
    """
    prepared, temperature, _ = settle_temperature(prepare_all(runs, Preparation()), "auto")
    law, _ = resolve_law(usual_law(prepared))
    steady, _ = split_by_command(prepared)
    damper, free = template(law, steady, temperature=temperature)
    problem = FitProblem(damper, free, steady)
    if first is not None and first.parameters.keys() != damper.parameters.keys():
        first = None
    found = fit_variable_projection(problem, starts=1 if first is None else 0, first=first, with_errors=False)
    return found.damper, prepared, tuple(each.name for each in found.estimates if not each.at_bound)


def _prepared(runs: Sequence[Recording]) -> list[RigRun]:
    """Return the runs that can be prepared; what is wrong with the others is told by their own diagnosis."""
    sound: list[RigRun] = []
    for run in runs:
        try:
            checked = run.checked()
            prepare_run(checked)
        except InputError:
            continue
        sound.append(checked)
    return sound
