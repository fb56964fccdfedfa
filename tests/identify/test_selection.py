"""The choice of a law: the truth is found again, terms that pay are switched on, failures are rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.errors import InputError
from mrdamper.identify.checkpoint import CheckpointStore
from mrdamper.identify.scores import score_run
from mrdamper.identify.selection.candidates import Candidate, Judged
from mrdamper.identify.selection.judge import Judge
from mrdamper.identify.selection.select import select
from mrdamper.identify.selection.starts import asymmetry_percent, level_of
from mrdamper.identify.templates import scale_of, template
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Bipolynomial, Constant
from mrdamper.models.simulate import simulate
from mrdamper.runtime.pool import Pool
from mrdamper.runtime.signals import Interrupted
from tests.identify.truths import AS_IT_IS, TRUTHS, measured
from tests.support.warm import warm_damper, warm_runs

TRUTH = "bouc-wen-saturating"
LAWS = ("bingham", "bouc-wen", TRUTH)


@pytest.fixture(scope="module")
def runs() -> tuple[PreparedRun, ...]:
    return measured(TRUTHS[TRUTH], noise=0.02, seed=0, rate_Hz=250.0)


class Memory(CheckpointStore):
    """Keeps what it is given."""

    def __init__(self) -> None:
        self.pieces: dict[str, Mapping[str, Any]] = {}

    def recall(self, key: str) -> Mapping[str, Any] | None:
        return self.pieces.get(key)

    def keep(self, key: str, value: Mapping[str, Any]) -> None:
        self.pieces[key] = dict(value)


def test_the_law_is_chosen_by_motions_that_were_left_out(runs):
    found = select(Judge(runs), LAWS)
    assert (found.chosen.candidate, found.table[0].reason) == (Candidate(TRUTH, ()), "chosen")
    assert found.left_out == "3 folds of whole motions"
    assert found.table[0].left_out_percent == pytest.approx(2.0, rel=0.1)
    assert found.table[0].held_out_worst < 3.0
    assert {row.law for row in found.table} == set(LAWS)
    assert all(row.reason for row in found.table)


def test_constant_and_changing_commands_count_alike(runs):
    """Twelve runs of 2 % and two of 6 %: neither is lost among the others."""
    fitted = Judge(runs).fit_anew(Candidate(TRUTH, ()))
    squares = np.full((3, 12), np.nan)
    squares[np.arange(12) % 3, np.arange(12)] = 4.0
    one = Judged(fitted, squares, (), 0.0, np.array([35.0, 37.0]))
    assert one.percent == pytest.approx(np.sqrt((4.0 + 36.0) / 2.0))
    assert sorted(one.by_run)[:12] == [2.0] * 12
    other = replace(one, squares=2.0 * squares, changing=np.array([8.0, 9.5]))
    gain, t = other.gain_over(one)
    assert gain == pytest.approx(1.0 - np.sqrt((8.0 + 8.75) / 2.0) / one.percent)
    assert t > 10.0  # the folds lose 4 a run, all alike; the two runs gain 27
    assert one.gain_over(other)[1] == pytest.approx(-t)
    assert replace(one, changing=np.zeros(0)).percent == 2.0


def test_a_mass_on_the_piston_is_switched_on_and_nothing_else(runs):
    loaded = tuple(replace(run, force=run.force + 12.0 * run.trajectory.acceleration) for run in runs)
    found = select(Judge(loaded), (TRUTH,))
    assert found.chosen.candidate.groups == ("mass",)
    assert found.chosen.damper.parameters["mass.value"] == pytest.approx(12.0, rel=0.05)


def test_no_mass_is_heavier_than_a_piston_of_the_force_can_be(runs):
    """On slow runs, on which force over acceleration is tons: 10 kg per kilonewton."""
    slow = [replace(run, trajectory=replace(run.trajectory, acceleration=0.01 * run.trajectory.acceleration))
            for run in runs]  # fmt: skip
    for law in ("bouc-wen", "chain"):
        free = {each.name: each for each in template(law, slow, groups=("mass",))[1]}
        assert free["mass.value"].upper == pytest.approx(scale_of(slow).force / 100.0)


def test_groups_that_are_given_are_fixed(runs):
    found = select(Judge(runs, terms=("mass",)), (TRUTH,))
    assert [row.groups for row in found.table] == [("mass",)]


def test_a_law_far_behind_the_first_one_is_fitted_roughly_and_is_a_row_with_its_error(runs):
    """Its first steps on short segments end above what was asked for; a law that comes near goes on."""
    judge, poor, good = Judge(runs), Candidate("bingham", ()), Candidate(TRUTH, ())
    whole, rough = Judge(runs).fit_anew(poor), judge.fit_anew(poor, 5.0)
    assert judge.on_segments(whole) > 5.0
    assert whole.training_percent < rough.training_percent < 1.5 * whole.training_percent
    assert judge.fit_anew(good, 5.0).training_percent == Judge(runs).fit_anew(good).training_percent
    reasons = {row.law: row.reason for row in select(Judge(runs), (TRUTH, "bingham")).table}
    assert reasons["bingham"].startswith("training error +")


def test_what_no_law_can_be_fitted_to_is_the_first_one_s_error(runs):
    still = [run for run in runs if run.run.constant_command == 1.0]
    with pytest.raises(InputError, match=r"have one command \(1 A\).*--one-command"):
        select(Judge(still), LAWS)


def test_one_run_alone_is_cut_into_blocks_of_time(runs):
    (run,) = (each for each in runs if each.run.name == "harmonics 1 A")
    found = select(Judge([run], one_command=True), LAWS)
    assert (found.left_out, found.chosen.candidate.law) == ("5 blocks of time", TRUTH)
    assert np.isfinite(found.table[0].left_out_percent)


def test_an_interrupted_choice_keeps_the_best_so_far_and_goes_on_where_it_was(runs, monkeypatch):
    whole, memory = select(Judge(runs), LAWS), Memory()
    cross_validate = Judge.cross_validate

    def stops(self, fitted, former=None):
        raise Interrupted

    monkeypatch.setattr(Judge, "cross_validate", stops)
    cut = select(Judge(runs, checkpoint=memory), LAWS)
    assert cut.interrupted
    assert cut.chosen.candidate.law == TRUTH
    monkeypatch.setattr(Judge, "cross_validate", cross_validate)
    again = select(Judge(runs, checkpoint=memory), LAWS)
    assert dict(again.chosen.damper.parameters) == dict(whole.chosen.damper.parameters)
    assert {key.split()[0] for key in memory.pieces} == {"fit", "left"}


@pytest.mark.system
def test_the_choice_is_the_same_on_one_core_and_on_two_and_keeps_the_same_pieces(runs):
    kept = Memory(), Memory()
    one, two = (
        select(Judge(runs, checkpoint=memory, pool=Pool(jobs)), ("dahl", "bouc-wen", TRUTH))
        for jobs, memory in enumerate(kept, 1)
    )
    assert dict(one.chosen.damper.parameters) == dict(two.chosen.damper.parameters)
    tables = [[str(replace(row, cpu_s=0.0)) for row in found.table] for found in (one, two)]
    assert tables[0] == tables[1]
    assert list(kept[0].pieces) == list(kept[1].pieces)


def test_a_law_that_is_wrong_about_changing_commands_is_left(monkeypatch):
    """Laws alike at constant commands: one has 30 % where they change, the other 3 %."""
    plain = measured(TRUTHS["dahl"], noise=0.02, seed=0, rate_Hz=250.0)
    judge = Judge(plain, changing=plain[:2], terms=())
    for right in ("dahl", "bouc-wen"):
        errors = {name: [9.0, 16.0] if name == right else [900.0, 910.0] for name in ("dahl", "bouc-wen")}
        monkeypatch.setattr(
            Judge, "_on_changing", lambda _, damper, __, of=errors: (damper, of[damper.law.name])
        )
        found = select(judge, ("dahl", "bouc-wen"))
        assert found.chosen.candidate.law == right
        assert found.left_out == "3 folds of whole motions, 2 runs of changing command"


def test_of_runs_of_a_changing_command_the_lags_are_no_error(runs):
    """The truth behind lags: what is left is what the lags that are found are off."""
    path = replace(runs[4].trajectory, command=np.where(runs[4].trajectory.time % 0.5 < 0.25, 0.5, 2.0))
    lagged = replace(TRUTHS[TRUTH], actuation=Actuation(0.02, 0.03, 0.0, 0.005))
    record = replace(runs[4].run, command=path.command, name="steps")
    stepped = replace(runs[4], run=record, trajectory=path, force=simulate(lagged, path))
    judge = Judge(runs, changing=[stepped, stepped])
    judged = judge.cross_validate(judge.fit_anew(Candidate(TRUTH, ())))
    still = score_run(judged.fitted.damper, stepped).nrmse_percent
    assert np.sqrt(judged.changing) == pytest.approx([1.0, 1.0], abs=1.0)
    assert still > 10.0
    again = judge.cross_validate(judge.fit_anew(Candidate("dahl", ())))  # begins at the lags found before
    alone = Judge(runs, changing=[stepped, stepped])
    assert again.changing == pytest.approx(
        alone.cross_validate(alone.fit_anew(Candidate("dahl", ()))).changing, rel=0.02
    )


@pytest.fixture(scope="module")
def slot() -> tuple[Damper, tuple[PreparedRun, ...]]:
    """Return a slot whose fluid creeps before it yields, with a mass, and runs of it."""
    truth = TRUTHS["chain"]
    more = {"viscosity": 900.0, "creep": 2e-5, "knee": 0.8, "mass": 3.0}
    more |= {"friction_force": 60.0, "friction_stiffness": 2e5, "thinning": 0.0}
    damper = replace(truth, coefficients={**truth.coefficients, **{k: Constant(v) for k, v in more.items()}})
    return damper, measured(damper, noise=0.02, seed=2, rate_Hz=250.0)


def test_a_law_of_groups_grows_to_what_is_there(slot):
    """From the nearest archetype; what grows is no worse than it on what was left out."""
    damper, runs = slot
    found = select(Judge(runs), ("chain",))
    on = found.chosen.damper.parameters
    assert set(found.chosen.candidate.groups) >= {"viscosity", "creep", "knee", "friction"}
    assert on["creep.value"] == pytest.approx(damper.parameters["creep.value"], rel=0.2)
    assert on["viscosity.value"] == pytest.approx(damper.parameters["viscosity.value"], rel=0.1)
    begun = [row for row in found.table if row.groups == ("viscosity", "creep", "bypass", "knee", "friction")]
    assert found.table[0].left_out_percent <= begun[0].left_out_percent
    assert found.table[0].left_out_percent < 3.0


@pytest.fixture(scope="module")
def few(slot) -> tuple[Judge, Candidate, Damper]:
    """Return a law of three groups, which the stages lead to."""
    judge, candidate = Judge(slot[1]), Candidate("chain", ("knee", "creep", "viscosity"))
    damper = judge.staged(candidate)
    assert damper is not None
    return judge, candidate, damper


def test_stages_lead_to_the_groups_that_are_asked_for(slot, few):
    """No stage ends above the one before: a group begins at the size that misses least."""
    (damper, _), (judge, candidate, begun) = slot, few
    every = Candidate("chain", ("mass", *candidate.groups, "friction"))
    staged = judge.staged(every)
    assert staged is not None
    errors = [judge.fit_from(on, [at]).training_percent for on, at in ((candidate, begun), (every, staged))]
    assert errors[1] < min(errors[0], 3.0)
    assert staged.parameters["creep.value"] == pytest.approx(damper.parameters["creep.value"], rel=0.3)


def test_a_fit_begins_at_the_nearest_of_the_dampers_it_is_given(few):
    """A poor one first or last changes nothing; what one lacks begins at its least size."""
    judge, candidate, near = few
    poor = judge.staged(Candidate("chain", ("viscosity",)))
    assert poor is not None
    alone = judge.fit_from(candidate, [near]).training_percent
    assert [judge.fit_from(candidate, each).training_percent for each in ([poor, near], [near, poor])] == [
        alone
    ] * 2
    assert judge.fit_from(candidate, [poor]).training_percent > alone


@pytest.fixture(scope="module")
def elastic() -> tuple[PreparedRun, ...]:
    """Return runs of a fluid that yields elastically and thins, behind seals that it leaks past."""
    truth = TRUTHS["chain"]
    more = {
        "bristle_share": 0.95,
        "bristle_stiffness": 3e6,
        "friction_force": 40.0,
        "friction_stiffness": 4e5,
    }
    more |= {
        "thinning": 0.0,
        "thinning_force": 400.0,
        "gap": 0.0,
        "gap_stiffness": 2e5,
        "leak_damping": 1.5e6,
    }
    damper = replace(truth, coefficients={**truth.coefficients, **{k: Constant(v) for k, v in more.items()}})
    return measured(damper, noise=0.02, seed=3, rate_Hz=250.0)


def test_of_two_ends_alike_the_one_that_changing_commands_prefer_is_taken(elastic, monkeypatch):
    """With and without the leak, the runs of constant command end within a few per cent of each other."""
    begun = {}
    for sign in (1.0, -1.0):

        def error(_, damper, __, sign=sign):
            return damper, [1e4 + sign * np.log(damper.parameters["gap_stiffness.value"])]

        monkeypatch.setattr(Judge, "_on_changing", error)
        judge = Judge(elastic, changing=elastic[:2])
        candidate, damper = judge.beginning("chain", judge.kinds("chain")[1]) or (None, None)
        assert candidate is not None
        assert damper is not None
        begun[sign] = judge.fit_from(candidate, [damper])
    soft, stiff = (begun[sign].damper.parameters["gap_stiffness.value"] for sign in (1.0, -1.0))
    assert soft < 0.1 * stiff
    errors = [each.training_percent for each in begun.values()]
    assert max(errors) < 1.2 * min(errors)


def test_a_gas_that_follows_temperature_is_there_from_the_beginning():
    """Force and slope of its level are those of the gas; runs without one begin without it."""
    plain = warm_damper()
    gas = {"offset": Bipolynomial((-300.0, -1.02), 1), "stiffness": Bipolynomial((900.0, 3.1), 1)}
    gassy = replace(plain, coefficients={**plain.coefficients, **gas})
    for damper, on in ((gassy, True), (plain, False)):
        runs = [prepare_run(run, AS_IT_IS) for run in warm_runs(damper, seed=3)]
        judge, level = Judge(runs), level_of(runs)
        assert [kind is not None and "gas" in kind.groups for kind in judge.kinds("chain")] == 3 * [on]
        usual = judge.beginning("dahl", None)
        assert usual is not None
        assert ("gas" in usual[0].groups) == on
        assert level is not None
        if on:
            assert level.force == pytest.approx(-300.0, rel=0.1)
            assert level.slope == pytest.approx(-1.02, rel=0.2)
    assert (
        level_of([replace(run, trajectory=replace(run.trajectory, temperature=None)) for run in runs]) is None
    )


def test_mean_forces_that_grow_with_force_tell_an_asymmetric_damper(runs):
    """A gas does not; of a side stronger by ``share`` all but what a constant takes is told."""
    shares = (0.0, 0.3)
    level = [replace(run, force=run.force - np.mean(run.force) + 200.0) for run in runs]
    for share in shares:
        asymmetric = [replace(run, force=run.force + share * np.abs(run.force - 200.0)) for run in level]
        assert (asymmetry_percent(asymmetric) > 5.0) == (share > 0.0)
        kinds = Judge(asymmetric).kinds("chain")
        assert [kind is not None and "flow-asymmetry" in kind.groups for kind in kinds].count(True) == (
            3 if share else 0
        )
        assert len(kinds) == (6 if share else 3)
