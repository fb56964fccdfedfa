"""The table of the laws: its limits and defaults, and what a term does that nobody asked for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import LAWS, HysteresisLaw, find_law
from mrdamper.models.simulate import simulate
from tests.models.test_reference import SOUND

every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
RIGID = {"gap_stiffness": 1e9, "gap_corner": 1e-9, "leak_damping": 0.0, "yield_velocity": 1e-9}


@pytest.mark.parametrize("name", LAWS)
def test_a_default_lies_within_its_limits_a_force_may_be_absent_and_a_share_is_one(name: str):
    for each in find_law(name).coefficients:
        if each.default is not None:
            assert each.lower <= each.default <= each.upper, each
        if each.unit in {"N", "N s/m"} and each.name not in {"cavity_force", "series_damping"}:
            assert each.lower <= 0.0, each
        if each.description.startswith("share"):
            assert (each.lower, each.upper, each.default) == (0.0, 1.0, 0.0), each


@every_law
def test_a_limit_itself_is_admitted_and_what_is_beyond_is_told_with_the_range(law: HysteresisLaw):
    for each in law.coefficients:
        for limit, beyond in ((each.lower, -math.inf), (each.upper, math.inf)):
            if math.isinf(limit):
                continue
            assert law.violations({each.name: limit}) == ()
            out = float(np.nextafter(limit, beyond))
            (said,) = law.violations({each.name: np.array([limit, out, math.nan])})
            assert said.startswith(f"{law.name}: {each.name} is {out:g} {each.unit}; the law is well posed")
            assert said.endswith(f"for {each.lower:g} to {each.upper:g} {each.unit}")
        assert len(law.violations({each.name: math.nan})) == 1


SERIES = ("spencer", "series-valve", "chain")


@every_law
def test_a_parallel_law_is_linear_in_its_forces_and_no_law_in_what_it_does_not_say(law: HysteresisLaw):
    """The force at twice a linear coefficient is as far above that at one as this is above that at none."""
    if law.name not in SERIES:
        forces = {"N", "N s/m", "N/m", "kg"}
        assert [each.linear for each in law.coefficients] == [
            each.unit in forces for each in law.coefficients
        ]
    sound, path = SOUND[law.name], drive(Sine(0.01, 2.0), duration=0.6, rate_Hz=250.0, command=0.0)
    for each in law.coefficients:
        if not each.linear:
            continue
        at = [
            simulate(
                Damper(law, {name: Constant(v) for name, v in (sound | {each.name: size}).items()}), path
            )
            for size in (0.0, 150.0, 300.0)
        ]
        assert at[2] - at[1] == pytest.approx(at[1] - at[0], abs=1e-9 * float(np.abs(at[2]).max())), each
        assert np.ptp(at[1] - at[0]) > 0.0 or each.name == "offset"


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, lambda x, v: 0.0 * v),
        ({"yield_force": 200.0}, lambda x, v: 200.0 * np.sign(v)),
        ({"thinning_force": 300.0}, lambda x, v: 300.0 * np.sign(v) * np.abs(v / 0.1) ** 0.6),
        ({"orifice": 2e3}, lambda x, v: 2e3 * v * np.abs(v)),
        ({"viscosity": 800.0, "offset": 30.0}, lambda x, v: 800.0 * v + 30.0),
        ({"stiffness": 5e3}, lambda x, v: 5e3 * x),
        ({"coulomb_friction": 50.0, "transition_velocity": 1e-6}, lambda x, v: 50.0 * np.sign(v)),
    ],
)
def test_a_chain_of_one_term_has_that_term_s_force_and_no_other(given, expected):
    """Rigid: what it bends is nothing beside the stroke, at any sample that moves."""
    forms = {name: Constant(value) for name, value in ({"yield_force": 0.0} | RIGID | given).items()}
    path = drive(Sine(0.5, 0.05), duration=40.0, rate_Hz=25.0, command=0.0)
    force = simulate(Damper(LAWS["chain"], forms), path)
    moving = (np.abs(path.velocity) > 1e-3) & (np.arange(len(path)) > 10)
    found = expected(path.displacement, path.velocity)
    assert force[moving] == pytest.approx(found[moving], abs=6e-3 * np.ptp(found) + 1e-6)


def test_a_law_is_of_the_kernel_or_in_python_and_found_by_its_name():
    assert find_law("dahl") is LAWS["dahl"]
    with pytest.raises(InputError, match="no hysteresis law is called 'dall'"):
        find_law("dall")
    with pytest.raises(InputError, match="give either a kernel number or a Python law"):
        replace(LAWS["dahl"], kernel=None)
    with pytest.raises(InputError, match="law 'dahl' has no coefficient 'kappa'"):
        LAWS["dahl"]["kappa"]


def test_the_kernel_numbers_of_the_laws_are_their_own():
    assert {law.kernel for law in LAWS.values()} == set(range(len(LAWS)))
