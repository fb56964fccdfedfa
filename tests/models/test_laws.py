"""The table of hysteresis laws has correct limits, defaults and linear coefficients."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.excitation import Sine, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import LAWS, HysteresisLaw
from mrdamper.models.simulate import simulate
from tests.models.test_reference import SOUND

every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
RIGID = {"gap_stiffness": 1e9, "gap_corner": 1e-9, "leak_damping": 0.0, "yield_velocity": 1e-9}


SERIES = ("spencer", "series-valve", "chain")


@every_law
def test_force_is_linear_in_linear_coefficients(law: HysteresisLaw):
    """Doubling a linear coefficient changes the force as much as raising the coefficient from zero."""
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
def test_chain_law_with_single_term_matches_formula(given, expected):
    """The springs of the chain are so stiff that their deflection is negligible."""
    forms = {name: Constant(value) for name, value in ({"yield_force": 0.0} | RIGID | given).items()}
    path = drive(Sine(0.5, 0.05), duration=40.0, rate_Hz=25.0, command=0.0)
    force = simulate(Damper(LAWS["chain"], forms), path)
    moving = (np.abs(path.velocity) > 1e-3) & (np.arange(len(path)) > 10)
    found = expected(path.displacement, path.velocity)
    assert force[moving] == pytest.approx(found[moving], abs=6e-3 * np.ptp(found) + 1e-6)
