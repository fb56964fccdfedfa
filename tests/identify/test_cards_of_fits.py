"""What a fit is given and what its card keeps: the split of the runs, the bounds of a form."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.identify.fit import fit, usual_law
from mrdamper.identify.fit_data import split_by_command
from mrdamper.identify.problem import canonical
from mrdamper.identify.templates import template
from mrdamper.identify.terms import base_of, terms_of
from mrdamper.models.dependence import Constant, Exponential, Hill, Polynomial, Saturation
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS

LAW = REFERENCE_DAMPERS["bouc-wen"]


def run_of(
    command: float | tuple[float, float],
    frequency: float = 1.0,
    *,
    rest_s: float = 0.0,
    celsius: float | None = None,
) -> PreparedRun:
    """Return a run at a command, or at two, one after the other; a driver's sign changes no force."""
    rate_Hz = 1000.0
    path = drive(Sine(5e-3, frequency), duration=6.0, rate_Hz=rate_Hz, command=1.0)
    at = np.asarray(command, dtype=np.float64).reshape(-1)
    levels = np.repeat(at, -(-len(path) // len(at)))[: len(path)]
    force = simulate(LAW, replace(path, command=np.abs(levels)))
    rest = round(rest_s * rate_Hz)
    run = RigRun(
        name=f"{command} A {frequency:g} Hz",
        time=np.arange(len(path) + rest) / rate_Hz,
        displacement=np.concatenate([np.full(rest, path.displacement[0]), path.displacement]),
        force=np.concatenate([np.full(rest, force[0]), force]),
        command=np.concatenate([np.full(rest, levels[0]), levels]),
        command_unit="A",
        temperature=None if celsius is None else np.full(len(path) + rest, celsius + 273.15),
    )
    return prepare_run(run, NO_SMOOTHING)


# Split and levels


def test_steps_tell_the_actuation_where_steady_runs_have_two_commands() -> None:
    steady, stepped = [run_of(0.0), run_of(1.0)], run_of((0.0, 2.0))
    assert split_by_command([*steady, stepped]) == (tuple(steady), (stepped,))
    assert split_by_command([steady[0], stepped]) == ((steady[0], stepped), ())
    assert split_by_command(steady) == (tuple(steady), ())
    assert usual_law(steady) == "series-valve"
    assert usual_law([run_of(1.0, celsius=20.0)]) == "double-bouc-wen"
    assert usual_law([run_of(1.0, celsius=20.0), *steady]) == "series-valve"


# Bounds


@pytest.mark.parametrize("law", [name for name in LAWS if name in REFERENCE_DAMPERS])
@pytest.mark.parametrize("levels", [2, 3, 6])
def test_a_form_that_is_searched_never_leaves_the_range_of_its_law(law: str, levels: int) -> None:
    """Exponentials and bends at every corner of their bounds, over the commands of the runs."""
    runs = [run_of(command) for command in np.linspace(0.0, 2.0, levels)]
    groups = tuple(terms_of(LAWS[law]))
    needed = [name for name in groups if name != "mass"]
    damper, free = template(law, runs, terms=needed)
    entries = [
        *base_of(LAWS[law]),
        *(each for group in terms_of(LAWS[law]).values() for each in group.entries),
    ]
    forms = {each.name: each.form for each in reversed(entries)}
    bounds: dict[str, list[tuple[float, float]]] = {}
    for each in free:
        bounds.setdefault(each.name.partition(".")[0], []).append((each.lower, each.upper))
    commands = np.linspace(0.0, 2.0, 5)
    for name, form in damper.coefficients.items():
        if LAWS[law][name].linear or not isinstance(form, Exponential | Hill | Saturation):
            if isinstance(form, Polynomial) and name in bounds:
                assert len(form.parameters) == min(levels, 2 if forms[name] == "line" else 3)
                assert not any(form.parameters[1:])  # begins level
            continue
        rest = form.parameters[len(bounds[name]) :]
        values = np.array(
            [form.with_parameters((*corner, *rest)).value(commands) for corner in product(*bounds[name])]
        )
        assert values.max() <= LAWS[law][name].upper * (1.0 + 1e-9), name
        assert values.min() >= LAWS[law][name].lower * (1.0 - 1e-9), name
        if isinstance(form, Exponential):
            growth = values[:, -1] / values[:, 0]
            assert 1.05 < growth.max() <= 1e3 * (1.0 + 1e-9), name
            assert growth.min() == pytest.approx(1.0 / growth.max())


# Ways to say the same


def test_of_two_elements_the_quicker_one_is_the_first_where_that_changes_no_force() -> None:
    truth = REFERENCE_DAMPERS["double-bouc-wen"]
    quick, slow = truth.coefficients["rho"], truth.coefficients["second_rho"]
    strong, weak = truth.coefficients["yield_force"], truth.coefficients["second_force"]
    other_way = {"rho": slow, "second_rho": quick, "yield_force": weak, "second_force": strong}
    turned = replace(truth, coefficients={**truth.coefficients, **other_way})
    assert canonical(turned) == truth
    assert canonical(truth) == truth
    path = drive(Sine(5e-3, 1.0), duration=1.0, rate_Hz=500.0, command=1.0)
    np.testing.assert_allclose(simulate(turned, path), simulate(truth, path), rtol=1e-9)
    for name, other in (("yield_force", Hill(90.0, 1100.0, 1.2, 1.6, 2.0)), ("rho", Constant(1.0))):
        unlike = replace(turned, coefficients={**turned.coefficients, name: other})
        assert canonical(unlike) == unlike
    lines = Polynomial((30.0, 250.0))
    shorter = replace(turned, coefficients={**turned.coefficients, "yield_force": lines})
    assert canonical(shorter) == shorter


def test_a_fit_to_runs_of_one_command_is_made_where_it_is_asked_for() -> None:
    runs = [run_of(1.0, frequency).run for frequency in (1.0, 2.0)]
    with pytest.raises(InputError, match="all 2 training runs have one command"):
        fit(runs, "bingham", starts=1)
    found = fit(runs, "bingham", starts=1, one_command=True)
    assert found.damper.law.name == "bingham"
