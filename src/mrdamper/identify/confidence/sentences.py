"""Sentences about the uncertainty of a fit: worst direction, profile, bootstrap.

``worst_direction`` costs a few passes over the runs; ``profile`` and ``bootstrap`` fit again, from the
fit's own parameters, on runs that are prepared once. Which tests would identify a parameter is not said here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrdamper.identify.confidence.direction import Direction
from mrdamper.identify.confidence.profiles import Profile
from mrdamper.identify.confidence.resampling import Bootstrap

_LOOSE = 10.0  # [%] of a direction's standard error: from there on the data "cannot tell"


def sentence(found: Direction | Profile | Bootstrap) -> str:
    """Return what was found in one plain sentence, with its parameters."""
    if isinstance(found, Profile):
        return _about_profile(found)
    if isinstance(found, Bootstrap):
        return _about_bootstrap(found)
    named = found.named
    steps = [_step_in_words(found, name) for name in named]
    if len(named) == 1:
        of, apart = named[0], f"do not pin down {named[0]}"
        what = f"{steps[0][0]} it by {steps[0][1]}"
    elif len(named) == 2:
        of, apart = f"the combination of {_listed(named)}", f"cannot tell {named[0]} from {named[1]}"
        what = f"{steps[0][0]} the first by {steps[0][1]} and {steps[1][0]} the second by {steps[1][1]}"
    else:
        of, apart = f"the combination of {_listed(named)}", f"cannot tell {_listed(named)} apart"
        what = _listed([f"{verb} {n} by {much}" for n, (verb, much) in zip(named, steps, strict=True)])
    known = f"the least certain is {of}, known to {_short(found.standard_error_percent)} %"
    if not any(found.changes):  # no step was found that the bounds and the noise allow
        loose = found.standard_error_percent >= _LOOSE
        return f"The data {apart}." if loose else f"The data tell all parameters apart; {known}."
    if found.others_follow:
        what += ", the others following,"
    noise = f"the noise (error {_two_apart(found.cost_percent, found.moved_percent)})"
    if found.standard_error_percent < _LOOSE:
        return f"The data tell all parameters apart; {known}: {what} changes the fit no more than {noise}."
    return f"The data {apart}: {what} changes the fit by less than {noise}."


def _step_in_words(found: Direction, name: str) -> tuple[str, str]:
    """Return the verb and the size of a parameter's change."""
    i = found.names.index(name)
    change, unit = found.changes[i], found.units[i]
    verb = "raising" if change > 0.0 else "lowering"
    if found.relative[i]:
        return verb, f"{_short(100.0 * abs(change) / found.scales[i])} %"
    return verb, _short(abs(change)) + ("" if unit == "-" else f" {unit}")


def _short(value: float) -> str:
    return f"{value:.2g}" if not 100.0 <= value < 1e6 else f"{value:.0f}"


def _two_apart(before: float, after: float) -> str:
    """Return both with as many digits as tell them apart, within reason."""
    digits = next((d for d in range(4, 8) if f"{before:.{d}g}" != f"{after:.{d}g}"), 8)
    return f"{before:#.{digits}g} % before, {after:#.{digits}g} % after"


def _about_profile(found: Profile) -> str:
    low, high = found.interval
    unit = "" if found.unit == "-" else f" {found.unit}"
    counted = (
        f"{found.effective_samples:.0f} effective samples of {found.samples}, {found.blocks} half cycles"
    )
    why = {
        "bound": "the bound of the search",
        "no fit": "a value without any fit",
        "span": "the end of the span that was looked at",
        "closed": "",
    }
    open_ends = [
        f"open at {side}, where {why[end]} was reached first"
        for side, end in zip(("the lower end", "the upper end"), found.ends, strict=True)
        if end != "closed"
    ]
    said = f"{found.name} lies between {low:.4g} and {high:.4g}{unit} with 95 % confidence ({counted})"
    return f"{said}; the interval is {' and '.join(open_ends)}." if open_ends else f"{said}."


def _about_bootstrap(found: Bootstrap) -> str:
    failed = f", {found.failed} failed" if found.failed else ""
    stopped = ", interrupted" if found.cancelled else ""
    said = f"{found.draws} of {found.asked} draws of runs{failed}{stopped}"
    if found.draws < 2:
        return f"{said}: too few to state a spread."
    middle = np.abs(np.median(found.values, axis=0))
    spread = np.array(list(found.standard_deviation.values()))
    unknown = np.full(len(middle), np.inf)
    percent = 100.0 * np.divide(spread, middle, out=unknown, where=middle > 0.0)
    worst = int(np.argmax(percent))
    return (
        f"{said}: from draw to draw {found.names[worst]} scatters most, by {_short(float(percent[worst]))} % "
        f"(standard deviation), half of all parameters by less than {_short(float(np.median(percent)))} %."
    )


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"
