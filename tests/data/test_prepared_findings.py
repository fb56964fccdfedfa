"""Findings on prepared runs: how many samples and cycles they need, and from which share on they are told."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from mrdamper.core import turning_points
from mrdamper.data.cycles import cycles
from mrdamper.data.diagnosis.diagnose import diagnose
from mrdamper.data.diagnosis.mechanics import (
    find_drift,
    find_force_lag,
    find_force_offset,
    find_velocity_disagreement,
    looks_swapped,
)
from mrdamper.data.diagnosis.repeatability import alike, alike_cycles, drift
from mrdamper.data.diagnosis.resolution import (
    find_few_cycles,
    find_few_samples,
    find_interference,
    find_noise,
    samples_in_transition,
    white_noise,
)
from mrdamper.data.finding import Finding, Inference, percent
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import Recording
from mrdamper.excitation import Chirp, Sine
from tests.data.example_runs import SINE, make_run


def prepared(motion=SINE, force=None, **how) -> PreparedRun:
    """Return a prepared run; ``force`` takes its time."""
    run = make_run(motion, **how)
    return prepare_run(run if force is None else replace(run, force=np.asarray(force(run.time))))


# ------------------------------------------------------------------------------------------- samples


@pytest.mark.parametrize(
    ("per_cycle", "severity"),
    [(60.6, None), (59.5, "warning"), (20.5, "warning"), (20.05, "warning"), (19.5, "fault")],
)
def test_a_cycle_has_sixty_samples_and_twenty_at_the_least(per_cycle, severity):
    found = list(find_few_samples(prepared(rate_Hz=2.0 * per_cycle, duration=8.0)))
    of_cycle = [each for each in found if each.kind == "few_samples_per_cycle"]
    assert [each.severity for each in of_cycle] == [severity] * (severity is not None)
    for each in of_cycle:
        assert each.size == pytest.approx(per_cycle, rel=3e-3)
        assert each.found == f"the fastest cycle has {each.size:.3g} samples (at {2.0 * per_cycle:.4g} Hz)"
        assert each.remedy == "Record at 120 Hz or more"


def test_the_fastest_cycle_of_a_sweep_is_twice_its_shortest_stroke():
    path = prepared(Chirp(0.003, 0.5, 4.0, 20.0), duration=20.0, rate_Hz=100.0)
    x = path.trajectory.displacement
    shortest = min(np.diff(turning_points(x, 0.3 * float(np.ptp(x)))))
    (found,) = (each for each in find_few_samples(path) if each.kind == "few_samples_per_cycle")
    assert found.size == 2.0 * shortest
    assert found.severity == "warning"


def in_transition(path: PreparedRun) -> float | None:
    x = path.trajectory.displacement
    turns = [k for k in turning_points(x, 0.3 * float(np.ptp(x))).tolist() if k >= path.scored_from]
    if len(turns) < 4:
        return None
    counts = []
    for a, b in pairwise((first + second) // 2 for first, second in pairwise(turns)):
        if b - a < 4:
            continue
        change = path.force[b] - path.force[a]
        if change == 0.0:
            counts.append(b - a + 1.0)
            continue
        share = [(each - path.force[a]) / change for each in path.force[a : b + 1]]
        after = next(k for k, each in enumerate(share) if each >= 0.9)
        before = max(k for k in range(after) if share[k] <= 0.1)
        begins = before + (0.1 - share[before]) / (share[before + 1] - share[before])
        counts.append(after - 1 + (0.9 - share[after - 1]) / (share[after] - share[after - 1]) - begins)
    return float(np.median(counts)) if counts else None


@pytest.mark.parametrize("per_stroke", [3.7, 4.5, 5.5, 7.0, 25.0])
def test_a_transition_goes_from_a_tenth_to_nine_tenths_of_what_a_stroke_changes(per_stroke):
    """Of whole numbers: they reach a tenth and nine tenths exactly, and some strokes change nothing."""
    known = set()
    for seed in range(40):
        rng = np.random.default_rng(seed)
        strokes = max(float(rng.choice([3.6, 4.6, 5.6, 7.0])), 20.0 / per_stroke)
        path = prepared(Sine(1e-3, 50.0 / per_stroke), rate_Hz=100.0, duration=0.01 * per_stroke * strokes)
        x = path.trajectory.displacement
        ramp = np.interp(x, (x.min(), x.max()), (0.0, float(rng.choice([1.0, 2.0, 10.0]))))
        shaped = replace(path, force=np.round(ramp + rng.choice([0.0, 2.0]) * rng.standard_normal(len(x))))
        shaped = replace(shaped, scored_from=int(rng.integers(0, 4)))
        expected = in_transition(shaped)
        assert samples_in_transition(shaped) == (expected and pytest.approx(expected, rel=1e-12))
        known.add(expected is None)
    assert False in known


@pytest.mark.parametrize(("rate_Hz", "told"), [(340.0, True), (380.0, False)])
def test_a_force_changes_over_in_five_samples(rate_Hz, told):
    path = prepared(rate_Hz=rate_Hz)
    counted = samples_in_transition(path)
    assert counted is not None
    assert (counted < 5.0) == told
    assert 4.0 < counted < 6.0
    found = [each for each in find_few_samples(path) if each.kind == "few_samples_per_yield"]
    assert [(each.size, each.severity) for each in found] == [(counted, "warning")] * told
    for each in found:
        assert f"within {counted:.2g} samples (at {rate_Hz:.4g} Hz)" in each.found
        assert each.remedy.startswith(f"Record at {5.0 / counted * rate_Hz:.3g} Hz")


# ------------------------------------------------------------------------------------------- cycles


@pytest.mark.parametrize(("duration", "whole"), [(0.9, 0), (1.2, 1), (1.7, 2), (2.2, 3), (2.7, 4)])
def test_what_is_said_of_cycles_needs_so_many(duration, whole):
    """Two that repeat or lag, three that drift or have a line."""
    path = prepared(duration=duration, force=lambda t: 1e3 * np.cos(4.0 * np.pi * (t + 0.05)))
    drifting = replace(path, force=path.force + 400.0 * path.run.time)
    humming = replace(path, force=path.force + 300.0 * np.sin(4.0 * np.pi * 10.4 * path.run.time))
    assert len(cycles(path)) == whole
    few = list(find_few_cycles(path))
    assert [each.size for each in few] == [whole] * (whole < 2)
    assert all(f"has {whole} whole cycle{'s' * (whole != 1)} after" in each.found for each in few)
    assert bool(list(find_force_lag(path))) == (whole > 1)
    assert (drift(drifting) is not None) == (whole > 1)
    assert bool(list(find_drift(drifting))) == (whole > 2)
    assert bool(list(find_interference(humming))) == (whole > 2)


def test_runs_without_a_period_or_under_commands_that_change_have_no_finding_of_cycles():
    sweep = prepared(Chirp(0.003, 0.5, 4.0, 20.0), duration=20.0)
    turned = replace(sweep, force=np.roll(sweep.force, 30) + 300.0 * sweep.run.time)
    for find in (find_few_cycles, find_force_lag, find_interference):
        assert list(find(turned)) == []
    hot = prepared(force=lambda t: 1e3 * np.cos(4.0 * np.pi * t) + 300.0 * t + 300.0)
    stepped = np.where(hot.run.time < 2.0, 0.5, 1.5)
    changed = replace(hot, run=replace(hot.run, command=stepped))
    assert {each.kind for find in (find_drift, find_force_offset) for each in find(hot)} == {
        "force_drift", "force_offset"
    }  # fmt: skip
    for find in (find_drift, find_force_offset):
        assert list(find(changed)) == []
    hum = 300.0 * np.sin(4.0 * np.pi * 10.4 * hot.run.time) - 300.0 * hot.run.time
    humming = replace(changed, force=hot.force + hum)
    assert list(find_interference(humming)) == []
    assert list(find_interference(replace(humming, run=hot.run)))
    assert "poor_repeatability" not in [each.kind for each in find_noise(changed)]


@pytest.mark.parametrize(("share", "severity"), [(0.095, None), (0.105, "warning")])
def test_without_a_period_an_offset_is_told_from_a_tenth_of_the_spread_on(share, severity):
    sweep = prepared(Chirp(0.003, 0.5, 4.0, 20.0), duration=20.0)
    spread = float(np.std(sweep.force[sweep.scored_from :]))
    kept = slice(int(cycles(sweep).row[0]), int(cycles(sweep).end[-1]))
    v, x = sweep.trajectory.velocity[kept], sweep.trajectory.displacement[kept]
    terms = np.column_stack([np.ones(len(x)), np.sign(v), v, x - x.mean()])
    own = float(np.linalg.lstsq(terms, sweep.force[kept], rcond=None)[0][0])
    found = list(find_force_offset(replace(sweep, force=sweep.force - own + share * spread)))
    assert [each.severity for each in found] == [severity] * (severity is not None)
    assert all(each.size == pytest.approx(share * spread, rel=1e-6) for each in found)


@pytest.mark.parametrize("cycle_count", [3, 4, 9])
def test_a_line_is_one_between_the_multiples_of_the_motion_above_the_second(cycle_count):
    """By 1.2 lines of the spectrum, 0.1 to 0.3 of the motion's frequency."""
    path = prepared(duration=0.5 * cycle_count + 0.7)
    whole = alike_cycles(path)
    assert len(whole) == cycle_count
    off = min(max(1.2 / cycle_count, 0.1), 0.3)
    start = path.run.time[whole.row[0]]
    for line in range(cycle_count, 7 * cycle_count):
        harmonic = line / cycle_count
        wave = np.sqrt(2.0) * np.sin(2.0 * np.pi * 2.0 * harmonic * (path.run.time - start))
        found = list(find_interference(replace(path, force=path.force + 50.0 * wave)))
        told = harmonic > 2.0 and abs(harmonic - round(harmonic)) > off
        assert len(found) == told, harmonic
        for each in found:
            assert each.size == pytest.approx(50.0, rel=2e-3)
            assert f"at {2.0 * harmonic:.3g} Hz, no multiple of the motion's 2 Hz" in each.found
    assert {f.kind for f in find_interference(replace(path, force=path.force + 20.0 * wave))} == set()


def test_a_line_is_half_of_what_cycles_have_beside_their_mean():
    path = prepared()
    wave = np.sqrt(2.0) * np.sin(2.0 * np.pi * 15.1 * path.run.time)
    white = np.random.default_rng(3).standard_normal(len(path))
    for noise, told in ((1.0, True), (1.6, False)):
        noisy = path.force + 100.0 * (wave + noise * white)
        assert bool(list(find_interference(replace(path, force=noisy)))) == told


@pytest.mark.parametrize(("factor", "more"), [(1.9, False), (2.2, True), (2.8, True)])
def test_cycles_differ_by_more_than_noise_where_they_do_so_twice(factor, more):
    """Every other cycle is larger; noise adds to it by squares."""
    path = prepared(duration=8.0)
    spread = float(np.std(path.force))
    white = 0.04 * spread * np.random.default_rng(1).standard_normal(len(path))
    uneven = 0.04 * np.sqrt(factor**2 - 1.0) * np.where((2.0 * path.run.time).astype(int) % 2, 1.0, -1.0)
    (found,) = find_noise(replace(path, force=path.force * (1.0 + uneven) + white))
    assert found.kind == "poor_repeatability"
    assert ("noise explains" in found.found) == more


def test_noise_is_told_with_its_share():
    path = prepared()
    noisy = path.force + 80.0 * np.random.default_rng(1).standard_normal(len(path))
    found = next(each for each in find_noise(replace(path, force=noisy)) if each.kind == "force_noise")
    scored = noisy[path.scored_from :]
    assert found.size == pytest.approx(white_noise(scored), rel=1e-12)
    share = 100.0 * white_noise(scored) / float(np.std(scored))
    assert f"({share:.2g} % of its standard" in found.found
    assert found.effect == f"No model can have an error below {share:.2g} % on this run"


def test_cycles_are_alike_that_differ_by_less_than_three_in_a_hundred():
    usual = [100.0] * 5
    assert alike(np.array([*usual, 97.1, 102.9, 96.9, 103.1])).tolist() == [True] * 7 + [False] * 2
    assert alike(np.array([*usual, 103.0, 97.0])).tolist() == [True] * 5 + [False] * 2


# ------------------------------------------------------------------------------------------- channels


def of_cycles(counts_x, counts_force, *, gives=True):
    """Return a record of sines, so many cycles in it, whose loop gives power or takes it."""
    row = np.arange(1000)
    x, force = (np.sin(2.0 * np.pi * row * count / 1000.0) for count in (counts_x, counts_force))
    slow = 1e-2 * np.cos(2.0 * np.pi * row * counts_x / 1000.0)
    fields: Any = {"time": row / 100.0, "command": np.ones(1000), "displacement": 5.0 + x}
    force = force + (-slow if gives else slow) + 0.5
    return Recording(name="run", command_unit="A", force=force, **fields)


@pytest.mark.parametrize(
    ("counts", "swapped"),
    [((17, 9), False), ((18, 9), True), ((8, 4), False), ((9, 4), True), ((9, 9), False)],
)
def test_the_rougher_signal_reaches_almost_twice_as_high(counts, swapped):
    """By a window, to the line above its own: 18 of 10 is not more than 1.8 times, 19 of 10 is."""
    assert looks_swapped(of_cycles(*counts)) == swapped
    assert not looks_swapped(of_cycles(*counts, gives=False))


def test_a_loop_without_power_gives_none():
    still = of_cycles(18, 9)
    assert not looks_swapped(replace(still, force=np.tile([1.0, -1.0], 500), displacement=np.zeros(1000)))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (lambda v, x: 1.5 * v + 0.3, "it is 1.5 times as large"),
        (lambda v, x: -1.5 * v + 0.3, "its sign is turned, and it is 1.5 times as large"),
        (lambda v, x: np.roll(v, 60), "it may be delayed, filtered, or another channel"),
        (lambda v, x: np.roll(v, 200), "it may be delayed, filtered, or another channel"),
        (lambda v, x: -12.0 * x, "it may be delayed, filtered, or another channel"),
        (lambda v, x: np.full(len(v), 0.2), "it may be delayed, filtered, or another channel"),
    ],
)
def test_a_velocity_is_compared_with_the_rate_of_the_displacement(changed, said):
    path = prepared()
    v, x = path.trajectory.velocity, path.trajectory.displacement
    measured = np.asarray(changed(v, x))
    (found,) = find_velocity_disagreement(replace(path, run=replace(path.run, velocity=measured)))
    assert found.found.endswith(f"of its rms: {said}")
    assert found.size == pytest.approx(100.0 * np.std(measured - v) / np.std(v), rel=1e-9)


@pytest.mark.parametrize(("samples", "found"), [(0, "refused"), (1, "refused"), (2, "time_not_increasing")])
def test_times_of_two_samples_can_be_compared(samples, found):
    arrays: Any = {name: np.ones(samples) for name in ("time", "displacement", "force", "command")}
    run = Recording(name="run", command_unit="A", **arrays)
    assert [each.kind for each in diagnose(run)] == [found]


def test_a_size_is_known_to_two_standard_errors_and_told_in_per_cent():
    found = Finding(kind="lag", severity="note", channel="", found="", effect="", remedy="", size=5.0).within(
        0.5
    )
    assert (found.low, found.high) == (4.0, 6.0)
    assert [percent(share) for share in (1.0, 0.1, 0.0123)] == ["100 %", "10 %", "1.2 %"]
    said = Inference("run", "temperature", 293.15, "file name").in_words()
    assert said == "run: temperature 20 degC, from the file name"


@pytest.mark.parametrize("unit", ["A", "V"])
def test_a_missing_command_is_one_of_current_or_of_voltage(unit):
    run = make_run(Sine(0.01, 1.0))
    fields: Any = {name: getattr(run, name) for name in ("time", "displacement", "force")}
    gone = Recording(name="run", command_unit=unit, command=np.full(len(run), np.nan), **fields)
    assert [each.channel for each in diagnose(gone)] == ["current" if unit == "A" else "voltage"]
