"""Where a fit looks: bounds and starts in the size of the runs, and forms as rich as these allow."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.identify.groups import (
    Form,
    FreeCoefficient,
    Scale,
    archetypes_of,
    base_of,
    groups_of,
    starts_of,
)
from mrdamper.identify.templates import _dependence, command_levels, scale_of, template
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS, Coefficient, HysteresisLaw
from tests.identify.truths import TRUTHS, measured

SCALE = Scale(800.0, 0.02, 0.4, 9.0, 2.0, 5, ())
KERNEL = [law for law in LAWS.values() if law.kernel is not None]


def entries() -> Iterator[tuple[HysteresisLaw, FreeCoefficient]]:
    """Yield every law with each coefficient that a fit may move."""
    for law in KERNEL:
        of_groups = [entry for group in groups_of(law).values() for entry in group.entries]
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
            assert abs(entry.sized(1.0).start or 0.0) <= 0.05, "and begins with none"
        if unit == "N":
            assert min(abs(entry.lower), entry.upper) <= 0.02 or entry.lower <= -0.5
            assert entry.upper >= 0.5, "it may carry the force"
        if unit == "-":
            assert admissible.lower <= entry.lower
            assert entry.upper <= admissible.upper
        sized = entry.sized(10.0)
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
    groups = groups_of(law)
    entries = {entry.name: entry for entry in base_of(law)}
    for name, group in groups.items():
        assert name == group.name
        before = list(groups)[: list(groups).index(name)]
        assert set(group.needs) <= set(before), "each after those that it needs"
        own = {entry.name: entry for entry in group.entries}
        assert set().union(*group.starts) <= set(own)
        assert set(group.over_temperature) <= set(own) | set(entries)
        entries = {**own, **entries}
    starts = [*starts_of(law), *(start for group in groups.values() for start in group.starts)]
    for kind in archetypes_of(law):
        assert set(kind.groups) <= set(groups)
        assert all(set(groups[name].needs) <= set(kind.groups) for name in kind.groups)
        starts += [kind.start, kind.twin]
    for start in starts:
        for name, value in start.items():
            assert entries[name].lower <= value <= entries[name].upper, name


@given(
    force=st.floats(1.0, 1e6),
    stroke=st.floats(1e-4, 1.0),
    speed=st.floats(1e-3, 10.0),
    acceleration=st.floats(0.1, 1e4),
)
def test_the_size_of_each_unit_makes_the_size_of_the_runs(force, stroke, speed, acceleration):
    """A force of that size at the speed, the stroke, the acceleration."""
    size = Scale(force, stroke, speed, acceleration, 1.0, 3, ()).size_of
    for unit, times, whole in (
        ("N", 1.0, force),
        ("N/m", stroke, force),
        ("N s/m", speed, force),
        ("N (s/m)^mB", speed, force),
        ("N s^2/m^2", speed * speed, force),
        ("kg", max(acceleration, 100.0), force),
        ("m", 1.0, stroke),
        ("1/m", stroke, 1.0),
        ("1/m^2", stroke * stroke, 1.0),
        ("m/s", 1.0, speed),
        ("m/(N s)", force, speed),
        ("m/(s N^0.5)", math.sqrt(force), speed),
        ("s/m", speed, 1.0),
        ("-", 1.0, 1.0),
    ):
        assert size(unit) * times == pytest.approx(whole, rel=1e-12)
    assert size("(s/m)^m") ** 2 * speed == pytest.approx(1.0)
    assert {coefficient.unit for law in KERNEL for coefficient in law.coefficients} <= {
        *("N", "N/m", "N s/m", "N (s/m)^mB", "N s^2/m^2", "kg", "m", "1/m", "1/m^2", "m/s", "m/(N s)"),
        *("m/(s N^0.5)", "s/m", "(s/m)^m", "-"),
    }


@pytest.mark.parametrize("name", ["yield_force", "rho"])
def test_a_form_has_no_more_numbers_than_commands_and_begins_level(name):
    """It holds its start over all commands, but for a curve, which has reached its gain at the largest."""
    for form, levels in product(get_args(Form), (1, 2, 3, 4, 5, 9)):
        if form == "fixed":
            continue
        law, scale = LAWS["bouc-wen"], replace(SCALE, levels=levels)
        entry = FreeCoefficient(name, form, 20.0, 5e3, "linear" if law[name].linear else "log", 100.0)
        found, free = _dependence(law, entry, scale)
        assert 1 <= len(free) <= levels
        assert found.value(0.0) == pytest.approx(100.0 if found.kind not in ("hill", "saturation") else 10.0)
        assert found.value(scale.command) == pytest.approx(
            100.0 if found.kind not in ("hill", "saturation") else 110.0, rel=0.2
        )
        assert [each.name.partition(".")[0] for each in free] == [name] * len(free)
        inner = {each.name.partition(".")[2]: each for each in free}
        assert set(inner) <= set(found.parameter_names)
        if levels == 1 or form == "constant":
            assert found.kind == "constant"
        if "rate" in inner:  # three decades, one way or the other
            assert inner["rate"].upper == -inner["rate"].lower
            assert math.exp(inner["rate"].upper * scale.command) <= 1000.0 * (1.0 + 1e-9)
            assert inner["at_zero"].scale == entry.scale
        for power in (1, 2):
            if f"c{power}" in inner:  # as much at the largest command as the level may be
                number = inner[f"c{power}"]
                assert number.upper * scale.command**power == pytest.approx(5e3)
                assert number.lower == -number.upper
        if "half_command" in inner:
            half = inner["half_command"]
            assert half.lower < 0.2 * scale.command < 2.0 * scale.command < half.upper
        if "exponent" in inner:
            assert inner["exponent"].lower < 1.0
            assert inner["exponent"].upper > 2.0
        assert ("exponent" in inner) == (levels >= 4 and form in ("hill", "saturation"))
        assert ("sharpness" in inner) == (levels >= 5 and form == "saturation")
        fixed, none = _dependence(law, replace(entry, form="fixed"), scale)
        assert fixed.value(1.0) == 100.0
        assert not none


@pytest.mark.parametrize("law", TRUTHS)
def test_a_known_damper_lies_inside_the_bounds_of_its_own_runs(law):
    runs = measured(TRUTHS[law], noise=0.01, seed=0)
    damper, free = template(law, runs)
    known = TRUTHS[law].parameters
    inside = [each for each in free if each.name.partition(".")[0] in TRUTHS[law].coefficients]
    inside = [each for each in inside if each.name in known and known[each.name] != 0.0]
    assert inside
    for each in inside:
        assert each.lower <= known[each.name] <= each.upper, each.name
    assert damper.law.name == law


def test_the_size_of_runs_is_that_of_their_motion_and_force():
    runs = measured(Damper(LAWS["dahl"], TRUTHS["dahl"].coefficients), noise=0.0, seed=0)
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


def test_a_share_lies_between_none_and_all_and_gas_pushes_the_rod_out():
    chain = {entry.name: entry for group in groups_of(LAWS["chain"]).values() for entry in group.entries}
    for name in ("knee", "bristle_share", "follow_share"):
        assert (chain[name].lower, chain[name].upper, chain[name].start) == (0.0, 1.0, 0.5)
    assert (chain["gas_force"].start or 0.0) < 0.0, "gas pushes the rod out"


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
    assert (groups_of(law), starts_of(law), archetypes_of(law)) == ({}, (), ())
    for bounds in ((-math.inf, 1.0), (0.0, math.inf)):
        open_ended = replace(law, coefficients=(Coefficient("gain", "N", "", linear, *bounds),))
        with pytest.raises(InputError, match="coefficient gain needs finite lower and upper bounds"):
            base_of(open_ended)
