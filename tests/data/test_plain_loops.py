"""Findings and what plain loops over the samples say, on many small records of whole numbers.

Whole numbers have what measured ones seldom show: equal neighbours, values on a limit, and halves of them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from itertools import groupby, pairwise
from typing import Any

import numpy as np
import pytest

from mrdamper.data.diagnosis.resolution import white_noise
from mrdamper.data.diagnosis.sensors import (
    find_clipping,
    find_coarse_steps,
    find_implausible_sizes,
    find_spikes,
    find_stuck_sensors,
    resolution_of,
)
from mrdamper.data.diagnosis.timing import (
    find_counter,
    find_irregular_steps,
    find_phase_jumps,
    find_time_faults,
)
from mrdamper.data.records import Recording
from mrdamper.quantities import QUANTITIES

RECORDS = 120
Values = list[float]


def record(force, displacement=None, time=None, **more: Any) -> Recording:
    n = len(force)
    arrays = {
        "time": 0.5 * np.arange(n) if time is None else time,
        "displacement": np.arange(n) if displacement is None else displacement,
        "force": force,
        "command": np.where(np.arange(n) == n // 2, 1e3, 0.0),  # a spike that is nobody's business
    }
    fields: Any = {name: np.asarray(values, dtype=np.float64) for name, values in arrays.items()}
    return Recording(name="run", command_unit="A", **fields, **more)


def waves(seed: int) -> Values:
    """Return a wave of whole numbers: clipped, held, with spikes, noisy or coarse, by the seed."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(100, 420))
    size = float(rng.choice([3, 6, 20, 60, 300]))
    wave = size * np.sin(2.0 * np.pi * np.arange(n) * rng.uniform(0.004, 0.06) + rng.uniform(0.0, 6.0))
    wave += rng.choice([0.0, 0.0, 1.0, 4.0]) * rng.standard_normal(n)
    if rng.random() < 0.5:
        wave = np.clip(wave, -rng.uniform(0.5, 1.2) * size, rng.uniform(0.5, 1.2) * size)
    values = np.round(wave / (grain := float(rng.choice([1.0, 1.0, 2.0, 5.0])))) * grain
    for _ in range(int(rng.integers(0, 4))):
        begin = int(rng.integers(0, n - 5))
        values[begin : begin + int(rng.choice([3, 8, 20, 21, 22, 60]))] = values[begin]
    for _ in range(int(rng.integers(0, 4))):
        values[rng.integers(0, n)] += float(
            rng.choice([-1.0, 1.0]) * rng.choice([0.25, 0.5, 1.0, 4.0]) * size
        )
    values[0] = values[-1] - size  # it moves
    return [float(each) for each in values]


def of_channel(found, channel="force"):
    return [each for each in found if each.channel == channel]


def runs_of(values: Values) -> Iterator[tuple[int, int]]:
    """Give the first and the last sample of each row of equal values."""
    at = 0
    for _, group in groupby(values):
        length = len(list(group))
        yield at, at + length - 1
        at += length


def rms_step(values: Values) -> float:
    return math.sqrt(sum((b - a) ** 2 for a, b in pairwise(values)) / (len(values) - 1))


# ------------------------------------------------------------------------------------------- one channel


def clipped(values: Values) -> list[tuple[float, float, float, str, int]]:
    found = []
    for end, folded in (("upper", values), ("lower", [-each for each in values])):
        top, often = max(folded), Counter(folded)
        beside = [often[level] for level in sorted(often, reverse=True)[1:5]]
        flat = [
            (a, b)
            for a, b in runs_of(folded)
            if folded[a] == top and b - a >= 2 and a > 0 and b < len(folded) - 1
            and max(top - folded[a - 1], top - folded[b + 1]) > 0.05 * rms_step(folded)
        ]  # fmt: skip
        held = sum(b - a + 1 for a, b in flat)
        if flat and held >= 8 and held >= 8.0 * sum(beside) / len(beside):
            share = 100.0 * often[top] / len(folded)
            found.append((share, 0.5 * flat[0][0], 0.5 * flat[-1][1], end, len(flat)))
    return found


def test_clipping():
    seen = 0
    for seed in range(RECORDS):
        values = waves(seed)
        expected = clipped(values)
        found = of_channel(find_clipping(record(values)))
        assert [(f.from_s, f.to_s) for f in found] == [each[1:3] for each in expected]
        assert [f.size for f in found] == pytest.approx([each[0] for each in expected], rel=1e-12)
        for each, (share, _, _, end, flat) in zip(found, expected, strict=True):
            assert f"its {end} end" in each.found
            assert f"in {flat} segments" in each.found
            assert each.effect.startswith("Peak forces")
            assert each.severity == ("fault" if share > 1.0 else "warning")
        seen += len(found)
    assert seen > 10


def grid_of(values: Values) -> float:
    levels = sorted(set(values))
    if len(levels) < 3 or 2 * len(levels) > len(values):
        return 0.0
    apart = [b - a for a, b in pairwise(levels) if b - a > 1e-9 * (levels[-1] - levels[0])]
    step = float(np.median(apart))
    known = [each for each in apart if min(abs(each / step - whole) for whole in (1, 2, 3)) < 0.1]
    return step if len(known) >= 0.8 * len(apart) else 0.0


def test_resolution():
    found = set()
    for seed in range(RECORDS):
        values = waves(seed)
        for gain in (1.0, 0.1, 1e-6):  # not each multiple of a tenth is one number
            scaled = [gain * each for each in values]
            assert resolution_of(np.array(scaled)) == pytest.approx(grid_of(scaled), rel=1e-9)
        found.add(grid_of(values))
    assert len(found) > 3
    assert resolution_of(np.array([0.0, 1.0, 2.0, 2.0, 0.0, 1.0])) == 1.0
    assert resolution_of(np.array([0.0, 1.0, 1.0, 1.0, 0.0, 1.0])) == 0.0
    twice = np.repeat([10.0 + 1e-10, 10.0, 11.0, 12.0, 13.0 + 1e-10, 13.0], 3)
    assert resolution_of(twice) == pytest.approx(1.0)


def error_of_steps(values: Values) -> tuple[float, float]:
    """Return the resolution where it is coarse, and its error as a share of the spread."""
    share = grid_of(values) / math.sqrt(12.0) / float(np.std(values))
    return (grid_of(values), share) if share > 0.01 else (0.0, 0.0)


def test_coarse_steps():
    seen = set()
    for seed in range(RECORDS):
        values = waves(seed)
        step, share = error_of_steps(values)
        found = of_channel(find_coarse_steps(record(values)))
        assert [each.size for each in found] == ([step] if step else [])
        for each in found:
            assert each.severity == ("warning" if share > 0.03 else "note")
            levels = 1 + round((max(values) - min(values)) / step)
            assert each.found == f"force has steps of {step:.3g} N: {levels} levels over the run"
            assert each.effect.startswith(f"No model can come closer than {100.0 * share:.2g} %")
            seen.add(each.severity)
        rows = [0.999e-3 * (k % 9) for k in range(len(values))]
        (moved,) = of_channel(find_coarse_steps(record(values, rows)), "displacement")
        assert moved.found == "displacement has steps of 0.999 mm: 9 levels over the run"
    assert seen == {"warning", "note"}


def stuck(values: Values, other: Values, share: float) -> list[tuple[float, float]]:
    held = [(a, b) for a, b in runs_of(values) if b > a]
    lengths = [b - a for a, b in held]
    least = max(20.0, 5.0 * float(np.quantile(lengths, 0.9))) if len(held) > 4 else 20.0
    near, span = 1.5 * error_of_steps(values)[0], max(other) - min(other)
    for a, b in sorted(held, key=lambda each: each[0] - each[1]):
        before = abs(values[a] - values[a - 1]) if a else 0.0
        after = abs(values[b] - values[b + 1]) if b + 1 < len(values) else 0.0
        moved = max(other[a : b + 1]) - min(other[a : b + 1])
        if b - a >= least and max(before, after) > near and moved >= share * span:
            return [(0.5 * a, 0.5 * b)]
    return []


def test_stuck_sensors():
    seen = Counter[str]()
    for seed in range(RECORDS):
        force, x = waves(seed), waves(seed + RECORDS)
        n = min(len(force), len(x))
        force, x = force[:n], x[:n]
        for channel, values, other, share in (("force", force, x, 0.15), ("displacement", x, force, 0.5)):
            found = of_channel(find_stuck_sensors(record(force, x)), channel)
            assert [(each.from_s, each.to_s) for each in found] == stuck(values, other, share)
            seen[channel] += len(found)
            for each in found:
                assert each.size == (each.to_s or 0.0) - (each.from_s or 0.0)
    assert min(seen.values()) > 10


def spikes(values: Values) -> dict[int, float]:
    low, high = np.quantile(values, (0.005, 0.995))
    limit = max(0.1 * (high - low), 30.0 * white_noise(np.array(values)))
    found = {}
    for k in range(1, len(values) - 1):
        before, after = values[k] - values[k - 1], values[k] - values[k + 1]
        away = min(abs(before), abs(after))
        if (before > 0.0) == (after > 0.0) and (before < 0.0) == (after < 0.0) and away > limit:
            found[k] = away
    return found if 100 * len(found) <= len(values) else {}


def test_spikes():
    seen = 0
    for seed in range(RECORDS):
        values = waves(seed)
        expected = spikes(values)
        found = of_channel(find_spikes(record(values)))
        assert len(found) == bool(expected)
        for each in found:
            worst = max(expected, key=lambda k: expected[k])
            assert (each.size, each.from_s, each.to_s) == (
                expected[worst], 0.5 * min(expected), 0.5 * max(expected)
            )  # fmt: skip
            count = f"{len(expected)} spike{'s' * (len(expected) > 1)}"
            assert each.found == (
                f"force has {count}, the largest of {each.size:.3g} N at {0.5 * worst:.4g} s"
            )
        seen += len(found)
    assert seen > 15


def test_a_channel_that_does_not_move_has_no_steps_spikes_or_clipping():
    still = record([2.0] * 200)
    for find in (find_clipping, find_coarse_steps, find_spikes):
        assert of_channel(find(still)) == []


@pytest.mark.parametrize("role", ["force", "displacement", "velocity", "temperature", "command"])
def test_a_limit_itself_is_in_range(role):
    quantity = QUANTITIES["current" if role == "command" else role]
    values = np.linspace(quantity.low, quantity.high, 200)
    roles = {"force": np.arange(200.0), "displacement": 1e-3 * np.arange(200.0), "command": np.zeros(200)}
    fields: Any = {**roles, role: values, "time": np.arange(200.0)}
    assert list(find_implausible_sizes(Recording(name="run", command_unit="A", **fields))) == []
    for outside in (1, 2):  # of 200: fewer than one in a hundred, and no more
        beyond = values.copy()
        beyond[50 : 50 + outside] = np.nextafter(quantity.high, np.inf)
        (found,) = find_implausible_sizes(Recording(name="run", command_unit="A", **{**fields, role: beyond}))
        assert (found.kind, found.from_s, found.to_s) == (
            "outliers" if outside == 1 else "implausible_size", 50.0, 49.0 + outside
        )  # fmt: skip


# ------------------------------------------------------------------------------------------- time


def clocks(seed: int) -> Values:
    """Return times whose steps are 2, 3, 10, 11 or a little else."""
    rng = np.random.default_rng(seed)
    steps = np.full(int(rng.integers(70, 200)), 2.0)
    for _ in range(int(rng.integers(0, 4))):
        steps[rng.integers(0, len(steps))] = rng.choice([1.0, 2.5, 3.0, 3.5, 4.0, 7.0, 10.0, 11.0, 30.0])
    steps += rng.choice([0.0, 0.0, 0.125, 0.25, 0.5]) * rng.choice([-1.0, 1.0], len(steps))
    return [float(each) for each in np.cumsum([0.0, *steps])]


def test_lost_samples_jitter_and_gaps():
    seen = Counter[str]()
    for seed in range(RECORDS):
        time = clocks(seed)
        steps = [b - a for a, b in pairwise(time)]
        usual = float(np.median(steps))
        lost = [k for k, step in enumerate(steps) if step > 1.5 * usual]
        kept = [step for step in steps if step <= 1.5 * usual]
        expected: dict[str, tuple[Any, ...]] = {}
        if lost:
            missing = sum(round(steps[k] / usual) - 1 for k in lost)
            severity = "warning" if missing > 1e-3 * len(time) else "note"
            expected["lost_samples"] = (missing, severity, time[lost[0]], time[lost[-1] + 1])
        jitter = float(np.std(kept)) / usual
        if jitter > 0.05:
            severity = "warning" if jitter > 0.2 else "note"
            expected["jitter"] = (pytest.approx(1e3 * np.std(kept)), severity, None, None)
        run = record(np.arange(len(time)), time=time)
        found = {f.kind: (f.size, f.severity, f.from_s, f.to_s) for f in find_irregular_steps(run)}
        assert found == expected
        seen.update(found.keys())
        gaps = [k for k, step in enumerate(steps) if step > 5.0 * usual]
        of_gaps = [each for each in find_time_faults(run) if each.channel == "time"]
        if {each.kind for each in of_gaps} == {"mixed_sampling"}:
            continue
        assert [(f.size, f.from_s, f.to_s) for f in of_gaps] == (
            [(max(steps[k] for k in gaps), time[gaps[0]], time[gaps[-1] + 1])] if gaps else []
        )
        assert all(f"{len(gaps)} gap{'s' * (len(gaps) > 1)} of" in each.found for each in of_gaps)
        assert all(each.severity == "fault" for each in of_gaps)
        seen["gap"] += len(of_gaps)
    assert min(seen.values()) > 10


def test_one_lost_sample_in_a_thousand_is_a_note():
    for rows, severity in ((1001, "note"), (999, "warning"), (1000, "note")):
        time = np.arange(float(rows))
        time[500:] += 1.0
        (found,) = find_irregular_steps(record(time, time=time))
        assert (found.severity, found.size) == (severity, 1.0)
        assert found.found.startswith("about 1 samples are missing at 1 places (0.1 %), the first after")


@pytest.mark.parametrize("step", [1.0, 2.0, 0.5])
def test_whole_seconds_are_a_counter_where_a_stroke_takes_five_of_them(step):
    for rows in range(3, 40):
        for half in (1, 2, 4, 5, 6, 9):
            x = np.array([3.0 if k // half % 2 else -1.0 for k in range(rows)]) + 10.0
            middle = sum(x) / rows
            strokes = sum(bool((a < middle) != (b < middle)) for a, b in pairwise(x))
            told = step == 1.0 and strokes >= 2 and rows - 1 >= 5 * strokes
            found = list(find_counter(record(x, x, time=step * np.arange(rows))))
            assert [each.size for each in found] == [1.0] * told
            for each in found:
                assert f"takes {(rows - 1) / strokes:.3g} s" in each.found


def jumps(x: Values, time: Values) -> tuple[list[int], float]:
    """Return the steps that are no spike and no noise, and how many samples they span."""
    steps = [(b - a) / (t - s) for (a, b), (s, t) in zip(pairwise(x), pairwise(time), strict=True)]
    near = {k: float(np.median([*steps[k - 2 : k], *steps[k + 1 : k + 3]])) for k in range(2, len(steps) - 2)}
    away = [steps[k] - near[k] if k in near else 0.0 for k in range(len(steps))]
    usual = math.sqrt(sum(step**2 for step in steps) / len(steps))
    limit = max(0.6 * usual, 14.826 * float(np.median(np.abs(away))))

    def comes_back(k: int) -> bool:
        return abs(away[k] + away[k + 1]) < 0.5 * max(abs(away[k]), abs(away[k + 1]))

    places = [
        k
        for k, each in enumerate(away)
        if abs(each) > limit and not (k + 1 < len(away) and comes_back(k)) and not (k and comes_back(k - 1))
    ]
    if len(places) > 0.01 * len(x):
        return [], 0.0
    return places, sum(round(abs(away[k]) / max(abs(near[k]), 0.3 * usual)) for k in places)


def test_phase_jumps():
    seen = Counter[int]()
    for seed in range(RECORDS):
        rng = np.random.default_rng(seed)
        n = int(rng.choice([63, 64, 65, 120, 200, 300, 400]))
        row = np.arange(float(n))
        for _ in range(int(rng.integers(0, 4))):
            row[int(rng.integers(3, n - 3)) :] += float(rng.choice([-3.0, -1.0, 1.0, 2.0, 6.0]))
        x = 100.0 * np.sin(row * rng.uniform(0.03, 0.2)) + rng.choice([0.0, 0.3]) * rng.standard_normal(n)
        if rng.random() < 0.5:
            x[rng.integers(5, n - 5)] += 60.0
        time = np.cumsum(rng.choice([[0.5], [0.5, 0.5, 0.5, 0.75]][seed % 2], n))
        places, samples = jumps(x.tolist(), time.tolist()) if n >= 64 else ([], 0.0)
        found = list(find_phase_jumps(record(x, x, time)))
        assert [(f.size, f.from_s, f.to_s) for f in found] == (
            [(samples, time[places[0]], time[places[-1] + 1])] if places else []
        )
        for each in found:
            assert f"{len(places)} place{'s' * (len(places) > 1)} where" in each.found
        seen[len(places)] += 1
    assert {0, 1, 2} <= seen.keys()
