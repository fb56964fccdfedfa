"""Runs as laboratories write them: noise on the command, limits that rounding passes, extreme sizes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.records import Dataset, RigRun, with_steady_commands
from mrdamper.errors import EnvelopeWarning, InputError
from mrdamper.identify import fit as fitting
from mrdamper.identify.evaluate import beyond_in_words, evaluate
from mrdamper.identify.problem import FitProblem, FreeParameter
from mrdamper.identify.windows import one_window
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Bipolynomial, ParameterLaw, Polynomial
from mrdamper.models.laws import Coefficient, find_law
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS, simulate_runs
from tests.support.tiers import one_by_day

TRUTH = REFERENCE_DAMPERS["bouc-wen"]
ENVELOPE = OperatingEnvelope(command=(0.0, 2.0), displacement=(-0.01, 0.01), velocity=(-0.1, 0.1))


def raw(*, force: float = 1.0, noise_A: float = 0.0) -> Dataset:
    """Return the runs of a known damper, its forces scaled, with noise on the command."""
    rng = np.random.default_rng(5)
    return Dataset(
        tuple(
            replace(
                each.run,
                force=force * each.run.force,
                command=each.run.command + noise_A * rng.standard_normal(len(each.run)),
            )
            for each in simulate_runs(TRUTH, noise=0.01, seed=3)
        )
    )


def damper(**forms: ParameterLaw) -> Damper:
    return replace(TRUTH, coefficients={**TRUTH.coefficients, **forms})


# Limits of a law


def test_what_rounding_takes_past_a_limit_is_on_the_limit():
    """3e-5 N below zero beside a kilonewton; a larger step past it is still refused."""
    near = damper(yield_force=Polynomial((-3e-5, 600.0)))
    assert near.violations([0.0, 1.0]) == ()
    assert near.coefficients_at(0.0)[near.law.names.index("yield_force"), 0] == 0.0
    assert damper(yield_force=Polynomial((-0.1, 600.0))).violations([0.0, 1.0]) != ()


# Noise on the command


def test_noise_on_the_command_is_a_level_and_steps_are_not():
    noisy = with_steady_commands(raw(noise_A=0.03))
    assert {round(run.constant_command or 0.0, 1) for run in noisy} == {0.0, 0.5, 1.0, 2.0}
    stepped = replace(noisy[0], command=np.where(np.arange(len(noisy[0])) % 600 < 300, 0.0, 0.15))
    assert with_steady_commands((stepped, *noisy[1:]))[0].constant_command is None


def test_a_noisy_command_is_fitted_as_a_steady_one_and_it_is_said():
    found = fitting.fit(raw(noise_A=0.03), "bouc-wen", starts=1, preparation=NO_SMOOTHING)
    assert found.actuation is None
    assert max(error.nrmse_percent for error in fitting.assess(found).runs) < 2.0
    (told,) = (note for note in found.result.notes if "is noise about a level" in note)
    assert re.search(r"\(at most (29|3[0-3]) mA\)", str(told))


# Sizes


@pytest.mark.parametrize("law", one_by_day(["bouc-wen", "double-bouc-wen", "series-valve"], 2))
def test_the_size_of_a_damper_does_not_change_what_its_fit_comes_to(law):
    """Bounds are measured in the runs: 200 kN are fitted as well as a kilonewton."""
    usual, scaled = (
        fitting.fit(raw(force=size), law, starts=2, preparation=NO_SMOOTHING).cost_percent
        for size in (1.0, 150.0)
    )
    assert scaled == pytest.approx(usual, rel=0.02)


def test_runs_of_27_samples_a_second_and_of_10000_leave_a_card():
    def at(rate_Hz: float) -> tuple[RigRun, ...]:
        return tuple(each.run for each in simulate_runs(TRUTH, noise=0.01, seed=3, rate_Hz=rate_Hz)[:4])

    for rate_Hz, most in ((27.0, 12.0), (10_000.0, 2.0)):
        found = fitting.fit(Dataset(at(rate_Hz)), "bouc-wen", starts=1)
        assert found.card().damper.law.name == "bouc-wen"
        assert found.cost_percent < most


# What a fit and a choice refuse


@pytest.mark.parametrize(
    ("names", "words"), [(("strength",), "no parameter 'strength'"), (("rho.value",) * 2, "set free twice")]
)
def test_what_a_law_does_not_have_or_has_once_cannot_be_free(names, words):
    free = tuple(FreeParameter(name, 1.0, 1e4) for name in names)
    with pytest.raises(InputError, match=words):
        FitProblem(TRUTH, free, simulate_runs(TRUTH, noise=0.0, seed=3))


def test_constant_force_is_rejected():
    run = simulate_runs(TRUTH, noise=0.0, seed=3)[0]
    with pytest.raises(InputError, match="does not change"):
        one_window(replace(run, force=np.ones_like(run.force)), 1)


def test_a_fit_its_damper_and_its_card_have_one_error_on_a_run():
    """Fit and card know which runs they have seen; another force under a seen name is none of them."""
    found = fitting.fit(raw(), find_law("dahl"), starts=1, preparation=NO_SMOOTHING)
    runs = list(raw())
    seen = evaluate(found, runs)
    assert {each.split for each in seen} == {"training"}
    assert {each.split for each in evaluate(found.card(), runs)} == {"training"}
    bare = evaluate(found.damper, runs, preparation=NO_SMOOTHING)
    assert {each.split for each in bare} == {"held_out"}
    assert [each.rmse_N for each in bare] == pytest.approx([each.rmse_N for each in seen])
    other = replace(runs[5], force=1.5 * runs[5].force)
    assert evaluate(found.card(), [other])[0].split == "held_out"


def test_a_card_warns_beyond_its_commands_and_a_warm_law_asks_for_a_temperature():
    card = fitting.fit(raw(), "dahl", starts=1, preparation=NO_SMOOTHING).card()
    far = replace(list(raw())[-1], command=np.full(len(list(raw())[-1]), 5.0))
    with pytest.warns(EnvelopeWarning, match="5"):
        evaluate(card, [far])
    warm = replace(
        TRUTH, coefficients={**TRUTH.coefficients, "yield_force": Bipolynomial((5.0, -0.3, 400.0, -1.0))}
    )
    with pytest.raises(InputError, match=r"\(and 11 more of 12 runs\): has no temperature channel"):
        evaluate(warm, raw(), preparation=NO_SMOOTHING)
    with pytest.raises(InputError, match="no run has a temperature to leave out"):
        fitting.assess(
            fitting.fit(raw(), "dahl", starts=1, preparation=NO_SMOOTHING), leave_out=("temperature",)
        )


class Dashpot:
    """A user's law."""

    name = "dashpot"
    coefficients = (Coefficient("c", "N s/m", "damping", linear=True),)

    def rate(self, state: float, displacement: float, velocity: float, values: Mapping[str, float]) -> float:
        return 0.0

    def force(self, state: float, displacement: float, velocity: float, values: Mapping[str, float]) -> float:
        return values["c"] * velocity


def test_what_is_said_beyond_the_temperatures_of_a_fit_is_what_the_damper_does_there():
    """Held at the edge of its range, extrapolated without one, the same where nothing depends on it."""
    warm = damper(yield_force=Bipolynomial((60.0, -0.3, 400.0, -1.0)))
    assert "does not depend on temperature" in beyond_in_words(TRUTH)
    assert "extrapolated" in beyond_in_words(warm)
    held = replace(warm, temperature_range=(293.15, 343.15))
    assert "below 20 or above 70 degC" in beyond_in_words(held)
    at = [held.coefficients_at(1.0, kelvin)[:, 0] for kelvin in (343.15, 400.0)]
    np.testing.assert_array_equal(at[0], at[1])


def test_a_law_is_named_by_object_class_file_or_name():
    """And says where it comes from, when it is a user's own."""
    assert fitting.resolve_law("dahl") == (find_law("dahl"), None)
    assert fitting.resolve_law(find_law("dahl")) == (find_law("dahl"), None)
    by_class, place = fitting.resolve_law(Dashpot)
    by_object, again = fitting.resolve_law(Dashpot())
    assert by_class.names == by_object.names == ("c",)
    assert place == again == f"{__file__}:Dashpot"
    assert fitting.resolve_law(by_class) == (by_class, place)
