"""Where a fit looks: bounds and starts in the size of the runs, and forms as rich as these allow."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.identify.templates import command_levels, scale_of, template
from mrdamper.identify.terms import (
    FreeCoefficient,
    Scale,
    archetypes_of,
    base_of,
    starts_of,
    terms_of,
)
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS, Coefficient, HysteresisLaw
from tests.identify.reference_dampers import REFERENCE_DAMPERS, simulate_runs

SCALE = Scale(800.0, 0.02, 0.4, 9.0, 2.0, 5, ())
KERNEL = [law for law in LAWS.values() if law.kernel is not None]


def entries() -> Iterator[tuple[HysteresisLaw, FreeCoefficient]]:
    """Yield every law with each coefficient that a fit may move."""
    for law in KERNEL:
        of_groups = [entry for group in terms_of(law).values() for entry in group.entries]
        yield from ((law, entry) for entry in (*base_of(law), *of_groups) if entry.form != "fixed")


def test_a_fit_may_look_far_and_nowhere_that_the_law_does_not_admit():
    """A term may be next to nothing, and may be all there is: bounds are in the size of the runs."""
    for law, entry in entries():
        admissible, unit = law[entry.name], law[entry.name].unit
        assert entry.lower < entry.upper
        if entry.scale == "log":
            stiff = unit == "N/m" or entry.name == "gas_length"  # longer than the stroke
            assert 0.0 < entry.lower <= (3.0 if stiff else 0.5)
            assert entry.upper / entry.lower >= (5.0 if unit == "-" else 200.0)
        elif admissible.linear or unit in {"N", "kg", "m"}:
            assert entry.lower <= 0.0 < entry.upper, "it may be away"
        if entry.lower < 0.0 and entry.name != "kappa":  # of a loop as slender as may be
            assert entry.upper == -entry.lower, "one way as far as the other"
            assert abs(entry.scaled(1.0).start or 0.0) <= 0.05, "and begins with none"
        if unit == "N":
            assert min(abs(entry.lower), entry.upper) <= 0.02 or entry.lower <= -0.5
            assert entry.upper >= 0.5, "it may carry the force"
        if unit == "-":
            assert admissible.lower <= entry.lower
            assert entry.upper <= admissible.upper
        sized = entry.scaled(10.0)
        assert (sized.lower, sized.upper) == (10.0 * entry.lower, 10.0 * entry.upper)
        assert sized.start is not None
        assert entry.lower <= sized.start / 10.0 <= entry.upper
        if entry.start is None:
            middle = math.sqrt(entry.lower * entry.upper) if entry.scale == "log" else None
            assert sized.start == pytest.approx(
                10.0 * (middle or 0.5 * (entry.lower + entry.upper)), abs=1e-12
            )


@pytest.mark.parametrize("law", KERNEL, ids=lambda law: law.name)
def test_every_start_is_inside_the_bounds_and_every_need_is_there(law):
    groups = terms_of(law)
    entries = {entry.name: entry for entry in base_of(law)}
    for name, group in groups.items():
        assert name == group.name
        before = list(groups)[: list(groups).index(name)]
        assert set(group.needs) <= set(before), "each after those that it needs"
        own = {entry.name: entry for entry in group.entries}
        assert set().union(*group.starts) <= set(own)
        assert set(group.linear_in_temperature) <= set(own) | set(entries)
        entries = {**own, **entries}
    starts = [*starts_of(law), *(start for group in groups.values() for start in group.starts)]
    for kind in archetypes_of(law):
        assert set(kind.terms) <= set(groups)
        assert all(set(groups[name].needs) <= set(kind.terms) for name in kind.terms)
        starts += [kind.start, kind.alternative_start]
    for start in starts:
        for name, value in start.items():
            assert entries[name].lower <= value <= entries[name].upper, name


@pytest.mark.parametrize("law", REFERENCE_DAMPERS)
def test_a_known_damper_lies_inside_the_bounds_of_its_own_runs(law):
    runs = simulate_runs(REFERENCE_DAMPERS[law], noise=0.01, seed=0)
    damper, free = template(law, runs)
    known = REFERENCE_DAMPERS[law].parameters
    inside = [each for each in free if each.name.partition(".")[0] in REFERENCE_DAMPERS[law].coefficients]
    inside = [each for each in inside if each.name in known and known[each.name] != 0.0]
    assert inside
    for each in inside:
        assert each.lower <= known[each.name] <= each.upper, each.name
    assert damper.law.name == law


def test_the_size_of_runs_is_that_of_their_motion_and_force():
    runs = simulate_runs(Damper(LAWS["dahl"], REFERENCE_DAMPERS["dahl"].coefficients), noise=0.0, seed=0)
    scale = scale_of(runs)
    assert scale.stroke == pytest.approx(0.01, rel=0.01)
    assert scale.speed == pytest.approx(2.0 * math.pi * 2.0 * 0.01, rel=0.01)
    assert scale.acceleration == pytest.approx((2.0 * math.pi * 2.0) ** 2 * 0.01, rel=0.05)
    peak = max(np.abs(run.force).max() for run in runs)
    assert 0.95 * peak <= scale.force <= peak
    assert (scale.command, scale.levels, scale.temperatures) == (2.0, 4, ())
    still = scale_of(runs[::4])
    assert (still.command, still.levels) == (1.0, 1)
    _, two = template("dahl", runs[:2])  # a straight line each, and rho
    assert [each.name for each in two][:2] == ["viscosity.c0", "viscosity.c1"]
    varying = [
        replace(run, run=replace(run.run, command=np.linspace(0, 1, len(run.run.command)))) for run in runs
    ]
    assert command_levels(varying) == 0
    assert scale_of([runs[0], varying[1]]).levels == 4


@pytest.mark.parametrize(
    ("lower", "upper", "scale"),
    [(1.0, 50.0, "linear"), (1.0, 51.0, "log"), (0.0, 1e6, "linear"), (-1.0, 1e3, "linear")],
)
@pytest.mark.parametrize("linear", [True, False])
def test_a_law_in_python_is_fitted_inside_its_own_bounds_on_a_logarithm_from_fifty_to_one_on(
    lower, upper, scale, linear
):
    python: Any = object()
    gain = Coefficient("gain", "N", "", linear, lower, upper)
    law = HysteresisLaw("mine", "Mine", (gain,), "", None, python)
    (entry,) = base_of(law)
    assert (entry.name, entry.lower, entry.upper, entry.scale) == ("gain", lower, upper, scale)
    assert (entry.form, entry.start) == ("polynomial" if linear else "constant", None)
    assert (terms_of(law), starts_of(law), archetypes_of(law)) == ({}, (), ())
    for bounds in ((-math.inf, 1.0), (0.0, math.inf)):
        open_ended = replace(law, coefficients=(Coefficient("gain", "N", "", linear, *bounds),))
        with pytest.raises(InputError, match="coefficient gain needs finite lower and upper bounds"):
            base_of(open_ended)
