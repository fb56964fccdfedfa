"""Runs against a plan, their names, a data sheet and each other: from where on each difference is told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mrdamper.data.diagnosis.campaign import compare
from mrdamper.data.diagnosis.declared import find_against_names, find_odd_siblings
from mrdamper.data.diagnosis.plausible import find_implausible_damper
from mrdamper.data.records import Recording, RigRun
from mrdamper.errors import InputError
from mrdamper.excitation import Sine
from mrdamper.quantities import ZERO_CELSIUS_K
from tests.data.example_runs import make_run


def run_of(
    name: str = "run", frequency: float = 2.0, stroke_m: float = 0.020, current: float = 0.5, **fields: Any
) -> RigRun:
    """Return a sine with a force of 1 kN."""
    run = make_run(Sine(0.5 * stroke_m, frequency), duration=4.0 / frequency + 0.3)
    return replace(run, name=name, command=np.full(len(run), current), **fields)


def warm(run, celsius):
    return replace(run, temperature=np.full(len(run), celsius + ZERO_CELSIUS_K))


def noisy(run, seed, gain=1.0):
    grain = 20.0 * np.random.default_rng(seed).standard_normal(len(run))
    return replace(run, force=gain * run.force + grain)


# ------------------------------------------------------------------------------------------- declared

NAMED = [  # a declared value, what of it is measured, from which ratio on it is told
    ("frequency", "{:.5f}Hz", "time", 2.0, 1.03, lambda value: run_of(frequency=value)),
    ("frequency", "{:.5f}Hz", "time", 2.0, 1.0 / 1.03, lambda value: run_of(frequency=value)),
    ("stroke", "{:.5f}mm", "displacement", 20.0, 1.12, lambda value: run_of(stroke_m=1e-3 * value)),
    ("stroke", "{:.5f}mm", "displacement", 10.0, 2.0 * 1.12, lambda value: run_of(stroke_m=1e-3 * value)),
    ("stroke", "{:.5f}mm", "displacement", 10.0, 2.0 * 0.88, lambda value: run_of(stroke_m=1e-3 * value)),
    ("stroke", "{:.5f}mm", "displacement", 2.0, 1.15, lambda value: run_of(stroke_m=1e-3 * value)),
    ("command", "{:.5f}A", "current", 2.0, 1.06, lambda value: run_of(current=value)),
    ("command", "{:.5f}A", "current", 0.5, 1.12, lambda value: run_of(current=value)),
    ("command", "{:.5f}V", "current", 5.0, 1.06, lambda value: run_of(current=value, command_unit="V")),
    ("temperature", "{:.5f}C", "temperature", 60.0, 1.1, lambda value: warm(run_of(), value)),
]  # fmt: skip


@pytest.mark.parametrize("by", ["run", "file", "folder", "plan"])
@pytest.mark.parametrize(("quantity", "text", "channel", "declared", "ratio", "measured"), NAMED)
def test_what_is_declared_and_not_so_is_told_from_its_documented_ratio_on(
    tmp_path, by, quantity, text, channel, declared, ratio, measured
):
    key = {"frequency": "frequency_Hz", "stroke": "stroke_mm", "temperature": "temperature_degC"}
    told = {}
    for further in (-0.05, 0.05):  # of the difference
        found_ratio = ratio + further * (ratio - (2.0 if ratio > 1.5 else 1.0))
        run, source = measured(declared * found_ratio), tmp_path / "run.csv"
        said = text.format(declared)
        if by == "plan":
            (tmp_path / "plan.toml").write_text(f"[run.'r*']\n{key.get(quantity, quantity)} = {declared}\n")
        elif by == "run":
            run = replace(run, name=f"test_{said}_b")
        else:
            source = tmp_path / (f"test_{said}.csv" if by == "file" else f"of {said}/run.csv")
        told[further] = list(find_against_names([replace(run, source=str(source))]))
    (finding,) = told[0.05]
    assert told[-0.05] == []
    assert (finding.kind, finding.channel) == (f"declared_{quantity}", channel)
    assert finding.size == pytest.approx(found_ratio, rel=2e-3)


def test_a_noisy_sine_has_the_frequency_of_its_motion():
    """Noise of 5 % of the amplitude passes the middle, and any other level, many times a stroke."""
    run = run_of("sine_2.1Hz")
    noise = 5e-4 * np.random.default_rng(4).standard_normal(len(run))
    (finding,) = find_against_names([replace(run, displacement=run.displacement + noise)])
    assert finding.kind == "declared_frequency"
    assert finding.size == pytest.approx(2.0 / 2.1, rel=5e-3)


def test_two_numbers_of_one_quantity_in_a_name_declare_nothing():
    assert list(find_against_names([run_of("1Hz to 7Hz"), run_of("0.1A 1.9A")])) == []


@pytest.mark.parametrize(
    ("kind", "quantity", "least"),
    [("time_scale", "frequency", 0.015), ("displacement_scale", "stroke_m", 0.04)],
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_one_run_that_differs_from_three_of_its_motion_is_told(kind, quantity, least, sign):
    usual = {"frequency": 2.0, "stroke_m": 0.020}
    others = [run_of(f"{current:g}", current=current) for current in (0.0, 0.5, 1.0)]

    def odd(share):
        ratio = 1.0 + sign * share * least
        return ratio, run_of("odd", **{**usual, quantity: usual[quantity] * ratio})

    assert list(find_odd_siblings([*others, odd(0.95)[1]])) == []
    ratio, run = odd(1.05)
    (finding,) = find_odd_siblings([*others, run])
    size = 1.0 / ratio if kind == "time_scale" else ratio
    assert (finding.run, finding.kind) == ("odd", kind)
    assert (finding.low, finding.size, finding.high) == pytest.approx(
        (size - 2e-3, size, size + 2e-3), abs=2e-4
    )
    assert list(find_odd_siblings([*others[:2], run])) == []


# ------------------------------------------------------------------------------------------- the damper

VALVE = 0.25 * np.pi * (0.040**2 - 0.012**2) * 20.0  # [m^2], the piston's area times length over gap
TABLE = [  # a plan, a channel, its lowest and highest value; the peak of the force is 1 kN, the current 0.5 A
    ("", "force", 150.0, 20e3),
    ("", "displacement", 2e-3, 0.5),
    ("", "current", 0.3, 15.0),
    ("peak_force_N = 2000", "force", 800.0, 3200.0),
    ("largest_current_A = 2", "current", 0.26, 2.6),
    ("largest_current_A = 20", "current", 0.3, 26.0),
    ("stroke_mm = 25", "displacement", 2e-3, 0.025),
    (
        "bore_mm = 40\nrod_mm = 12\ngap_mm = 1\npole_mm = 20",
        "force",
        2.0 * 3e3 * VALVE,
        1.5 * 3.1 * 100e3 * VALVE,
    ),
]


@pytest.mark.parametrize(("plan", "channel", "low", "high"), TABLE)
def test_a_damper_is_asked_about_outside_of_its_table_or_data_sheet(tmp_path, plan, channel, low, high):
    (tmp_path / "plan.toml").write_text(f"[damper]\n{plan}\n")

    def told(value):
        run = replace(run_of(), source=str(tmp_path / "run.csv"))
        role = "command" if channel == "current" else channel
        now = 0.5 if channel == "current" else 0.5 * np.ptp(run.force) if channel == "force" else 0.020
        scaled: Any = {role: np.asarray(getattr(run, role) * (value / now))}
        changed = replace(run, **scaled)
        return [(each.channel, each.size) for each in find_implausible_damper([changed])]

    for end, inside in ((low, 1.0 + 1e-6), (high, 1.0 - 1e-6)):
        assert channel not in dict(told(inside * end))
        assert dict(told(end / inside))[channel] == pytest.approx(end / inside, rel=1e-9)


@pytest.mark.parametrize(
    ("plan", "current", "told"),
    [
        ("", 0.999999, []),  # a small force is that of a small current,
        ("", 1.0, ["force"]),  # but not of 1 A
        ("peak_force_N = 1000\nlargest_current_A = 2", 1.599999, []),  # nor one of 0.8 of the largest
        ("peak_force_N = 1000\nlargest_current_A = 2", 1.6, ["force"]),
        ("bore_mm = 40\nrod_mm = 12\ngap_mm = 0.3\npole_mm = 20", 0.299999, ["current"]),
        ("bore_mm = 40\nrod_mm = 12\ngap_mm = 0.3\npole_mm = 20", 0.3, ["force"]),
    ],
)  # fmt: skip
def test_a_small_force_is_asked_about_where_the_current_is_large(tmp_path, plan, current, told):
    """250 N: below 0.4 of the sheet's peak, below 300 N at 1 A, below the valve's 2 x 3 kPa."""
    (tmp_path / "plan.toml").write_text(f"[damper]\n{plan}\n")
    run = run_of(current=current, source=str(tmp_path / "run.csv"))
    found = find_implausible_damper([replace(run, force=0.25 * run.force)])
    assert [each.channel for each in found] == told


# ------------------------------------------------------------------------------------------- each other


@pytest.mark.parametrize(
    "alike",
    [
        lambda share: run_of("other", current=0.5 + 0.02 * share),
        lambda share: run_of("other", current=0.5, stroke_m=0.020 * (1.0 + 0.03 * share)),
        lambda share: run_of("other", current=0.5, frequency=2.0 * (1.0 + 0.03 * share)),
        lambda share: warm(run_of("other"), 20.0 + 3.0 * share),
    ],
    ids=["command", "stroke", "frequency", "temperature"],
)
def test_forces_of_two_dampers_are_told_where_all_else_is_alike(alike):
    """Force ranges 15 % apart; commands 20 mA, strokes and frequencies 3 %, temperatures 3 K at most."""
    first = run_of("first") if alike(0.0).temperature is None else warm(run_of("first"), 20.0)

    def told(share, gain):
        return [
            f for f in compare([noisy(first, 1), noisy(alike(share), 2, gain)]) if f.kind == "two_dampers"
        ]

    (finding,) = told(0.9, 1.0 / 1.2)
    assert (finding.run, finding.size) == ("first", pytest.approx(20.0, abs=1.5))
    assert told(0.9, 1.0 / 1.12) == []
    assert told(1.1, 1.0 / 1.2) == []


def test_held_out_run_of_another_damper_is_named():
    """The fit does not use the run. A pair of training runs has precedence."""
    first, other = noisy(run_of("first"), 1), noisy(run_of("other"), 2, 1.5)
    (finding,) = compare([first], [other])
    assert (finding.kind, finding.run) == ("two_dampers", "other")
    assert "first" in finding.found
    assert "the fit is not" in finding.effect
    third = noisy(run_of("third"), 3, 1.3)
    (finding,) = compare([first, third], [other])
    assert (finding.run, finding.effect) == ("first", "One law for both fits neither")


def test_one_force_under_amperes_and_volts_is_of_no_two_dampers():
    one, other = noisy(run_of("one"), 1), noisy(run_of("other", command_unit="V"), 2, 1.5)
    assert list(compare([one, other])) == []
    assert list(compare([warm(one, 20.0), replace(other, command_unit="A")])) == []


def test_runs_whose_time_stands_still_have_no_figures_to_compare():
    """Nor do they end in a division by nothing."""
    runs = [noisy(run_of(name), seed) for seed, name in enumerate(("one", "other"))]
    still = [
        Recording(name=run.name, time=np.zeros(len(run)), displacement=run.displacement, force=run.force,
                  command=run.command, command_unit="A")
        for run in runs
    ]  # fmt: skip
    assert list(compare(still)) == []


# ----------------------------------------------------------------------------------------- how many, how much


@pytest.mark.parametrize("rate_Hz", [25.0, 40.0, 1000.0])
@pytest.mark.parametrize("phase", [0.0, 0.31, 0.5, 0.77])
@pytest.mark.parametrize("ups", [0, 1, 2, 3, 4, 5])
def test_a_frequency_is_known_from_the_second_upward_passage_on(ups, phase, rate_Hz):
    """From where a sine passes its middle, between two samples; of four passages the first does not count."""
    period = 0.9973
    time = np.arange(round((ups + 0.55) * period * rate_Hz)) / rate_Hz
    x = 0.01 * np.sin(2.0 * np.pi * (time / period + 0.7)) + 1e-9 * phase
    run = Recording(name="run 3Hz", time=time + phase, displacement=x, force=100.0 * x,
                    command=np.ones(len(time)), command_unit="A")  # fmt: skip
    found = [each for each in find_against_names([run]) if each.kind == "declared_frequency"]
    passages = int(np.count_nonzero((x[:-1] < 0.0) & (x[1:] >= 0.0)))
    assert passages in {ups, ups + 1}
    assert len(found) == (passages > 1)
    for each in found:
        assert each.size == pytest.approx(1.0 / period / 3.0, rel=4e-3 if rate_Hz < 100.0 else 1e-5)


@pytest.mark.parametrize(
    ("spread", "share", "told"),
    [(0.0, 1.6e-2, True), (0.0, 1.4e-2, False), (0.008, 2.15e-2, True), (0.008, 1.85e-2, False)],
)
def test_an_odd_run_is_two_and_a_half_times_further_off_than_any_other(spread, share, told):
    others = [run_of(f"{k}", frequency=2.0 * (1.0 + spread * (k == 4)), current=0.1 * k) for k in range(5)]
    odd = run_of("odd", frequency=2.0 * (1.0 + share))
    found = [each for each in find_odd_siblings([*others, odd]) if each.run == "odd"]
    assert len(found) == told
    for each in found:
        assert each.size == pytest.approx(1.0 / (1.0 + share), rel=1e-3)
        assert (each.high or 0.0) - (each.low or 0.0) == pytest.approx(4e-3, rel=0.05)


def test_others_that_scatter_tell_no_odd_run():
    """By 0.3 % in frequency: half of them are further from their median than two thirds of it."""
    for scatter, told in ((1.5e-3, True), (2.5e-3, False)):
        others = [
            run_of(f"{k}", frequency=2.0 * (1.0 + scatter * (k - 2)), current=0.1 * k) for k in range(5)
        ]
        odd = run_of("odd", frequency=2.15)
        found = [each for each in find_odd_siblings([*others, odd]) if each.run == "odd"]
        assert len(found) == told


@pytest.mark.parametrize("samples", [0, 1, 2])
def test_a_record_of_one_sample_has_no_range(samples):
    full = Recording(name="run", time=np.arange(2.0), displacement=np.array([0.0, 0.02]),
                     force=np.array([-1.0, 1.0]), command=np.ones(2), command_unit="A")  # fmt: skip
    cut: Any = {role: getattr(full, role)[:samples] for role in ("time", "displacement", "force", "command")}
    found = [each.channel for each in find_implausible_damper([replace(full, **cut)])]
    assert found == (["force"] if samples == 2 else [])


def test_the_largest_of_all_runs_is_what_is_asked_about():
    sizes = [120.0, 90.0, 60.0]
    runs = [replace(run_of(f"{k}"), force=0.001 * size * run_of().force) for k, size in enumerate(sizes)]
    (finding,) = find_implausible_damper(runs)
    assert (finding.channel, finding.run) == ("force", "0")
    assert finding.size == pytest.approx(120.0, rel=1e-3)


@pytest.mark.parametrize("stroke_mm", [0.5, 5.0])
def test_a_motion_that_does_not_come_back_has_no_frequency(stroke_mm):
    time = np.arange(400) / 100.0
    for x in (1e-3 * stroke_mm * time, np.zeros(400), 1e-3 * stroke_mm * np.sin(2.0 * np.pi * time**2)):
        run = Recording(
            name="run 3Hz", time=time, displacement=x, force=x, command=np.ones(400), command_unit="A"
        )
        assert [each for each in find_against_names([run]) if each.kind == "declared_frequency"] == []


# ----------------------------------------------------------------------------------------- copies and delays


def copies(runs):
    return [each for each in compare(runs) if each.kind == "duplicate"]


@pytest.mark.parametrize(
    ("gain", "said"),
    [
        (1.0, "number for number"),
        (1.00095, "number for number"),
        (1.00105, "the force times 1.001"),
        (-2.0, "the force times -2"),
    ],
)
def test_a_copy_may_have_another_scale_of_the_force_and_no_other_motion(gain, said):
    first = replace(run_of("first"), force=run_of().force + 100.0)
    copy = replace(first, name="copy", force=gain * first.force + 7.0, displacement=first.displacement + 3e-4)
    (found,) = copies([first, copy])
    assert found.found == f"force and displacement are those of first, {said}"
    assert copies([first, replace(copy, displacement=1.001 * first.displacement)]) == []
    assert copies([first, replace(copy, force=np.roll(copy.force, 1))]) == []


def test_a_copy_has_two_samples_and_finite_numbers_in_each_channel():
    def of(n, **changed: Any):
        arrays = {
            "time": np.arange(n),
            "displacement": np.arange(n),
            "force": np.ones(n),
            "command": np.ones(n),
        }
        fields: Any = {k: np.asarray(v, dtype=np.float64) for k, v in {**arrays, **changed}.items()}
        return [Recording(name=name, command_unit="A", **fields) for name in ("one", "two")]

    assert [len(copies(of(n))) for n in (0, 1, 2, 3)] == [0, 0, 1, 1]
    assert "number for number" in copies(of(2))[0].found
    for role in ("time", "displacement", "force", "command"):
        assert copies(of(3, **{role: [0.0, np.nan, 1.0]})) == []
        assert role == "time" or copies(of(3, **{role: [0.0, 1.0]})) == []


def delayed(frequency, delay_s, *, stroke_m=0.02, name="run", current=0.0):
    """Return a sine whose force passes its middle so much after each reversal."""
    time = np.arange(round(4.6 / frequency * 2000.0)) / 2000.0
    phase = 2.0 * np.pi * frequency * time + 0.3
    force = 1e3 * np.cos(phase - 2.0 * np.pi * frequency * delay_s)
    return Recording(
        name=name, time=time, displacement=0.5 * stroke_m * np.sin(phase), force=force,
        command=np.full(len(time), current), command_unit="A",
    )  # fmt: skip


def lag_of(runs):
    """Return kind, size [ms] and run of the reported delay, if there is one."""
    return [
        (f.kind, 1e3 * (f.size or 0.0), f.run)
        for f in compare(runs)
        if f.kind in {"force_late", "force_early"}
    ]


@pytest.mark.parametrize(
    ("delays", "told"),
    [  # frequency [Hz]: delay [ms]
        ({2.0: 40.0}, None),  # at one frequency compliance may be that late,
        ({2.0: -1.9}, None),
        ({2.0: -2.1}, -2.1),  # and nothing is early
        ({2.0: -60.0}, -60.0),  # to a quarter of a stroke, 62.5 ms
        ({2.0: -65.0}, None),
        ({1.0: 10.4, 2.0: 10.4}, 10.4),
        ({1.0: 9.6, 2.0: 9.6}, None),
        ({1.0: 40.0, 2.0: 20.0}, None),  # a share of the stroke
        ({1.0: 52.0, 2.0: 32.0}, 12.0),
        ({1.0: 35.0, 2.0: 15.0}, None),  # early as a share, -5 ms, and not as a square, 8.3 ms
        ({1.0: 20.0, 2.0: 5.0}, None),  # viscosity
        ({1.0: 15.0, 2.0: 0.0}, -5.0),  # and an early force
        ({1.0: 17.5, 2.0: 2.5}, -2.5),
        ({1.0: 18.5, 2.0: 3.5}, None),
        ({1.0: 12.0, 1.29: 12.0}, None),  # two frequencies that are one
        ({1.0: 12.0, 1.31: 12.0}, 12.0),
    ],
)
def test_a_delay_is_what_is_left_as_the_period_goes_to_nothing(delays, told):
    runs = [
        delayed(f, 1e-3 * ms, name=f"{f}", stroke_m=0.02 + 1e-6 * k)
        for k, (f, ms) in enumerate(delays.items())
    ]
    larger = delayed(2.0, 0.03, name="larger", current=1.0)  # at another command
    found = lag_of([larger, *runs])
    expected = [] if told is None else [("force_late" if told > 0.0 else "force_early", told, runs[0].name)]
    assert [(kind, pytest.approx(size, abs=0.012), run) for kind, size, run in found] == expected
    for each in compare(runs):
        same = "is the same at all frequencies" if len(delays) > 1 else "no damper has"
        late = "late" if (told or 0.0) > 0.0 else "early"
        soft = ", or a damper whose viscosity over its stiffness is that time" * (late == "late")
        lag = f"the force is {abs(told or 0.0):.1f} ms {late}: a lag of its channel that {same}"
        assert each.found == lag + soft


def test_delays_are_compared_at_one_stroke_where_it_has_two_frequencies():
    """Of strokes 3 % apart or less; elsewhere the share of the stroke is another."""
    runs = [delayed(1.0, 0.030), delayed(2.0, 0.0202, stroke_m=0.0205), delayed(2.0, 0.060, stroke_m=0.0213)]
    ((kind, size, _),) = lag_of(runs)
    assert (kind, size) == ("force_late", pytest.approx(10.4, rel=1e-3))


@pytest.mark.parametrize(("share", "regular"), [(0.19, True), (0.21, False)])
def test_a_motion_is_periodic_where_its_strokes_last_as_long_to_a_fifth(share, regular):
    turns = np.cumsum([0.0, *([1.0, 1.0 + share, 1.0] * 4)])
    time = np.arange(0.0, turns[-1], 0.002)
    x = np.interp(time, turns, 0.01 * (-1.0) ** np.arange(len(turns)))
    runs = [
        Recording(name=name, time=time, displacement=x, force=gain * np.sign(np.gradient(x)) + 1e-3 * time,
                  command=np.zeros(len(time)), command_unit="A")
        for name, gain in (("one", 500.0), ("two", 800.0))
    ]  # fmt: skip
    assert ("two_dampers" in [each.kind for each in compare(runs)]) == regular


def as_read(run, **changed):
    """Return a run before it was checked, with other channels."""
    names = ("name", "time", "displacement", "force", "command", "command_unit")
    fields: Any = {name: getattr(run, name) for name in names}
    return Recording(**{**fields, **changed})


def test_a_force_that_never_changes_is_of_no_damper():
    still = np.full(len(run_of()), 5.0)
    runs = [as_read(run_of(name), force=still) for name in ("one", "two", "three")]
    assert [each.kind for each in compare([*runs, noisy(run_of("four"), 1)])] == ["duplicate"] * 2


# ----------------------------------------------------------------------------------------- what signals have


def passages(time, x):
    """Return where a motion passes its middle upward, from a quarter of its swing below to one above."""
    low, high = np.quantile(x, (0.02, 0.98))
    middle, swing = 0.5 * (low + high), 0.25 * (high - low)
    found, below, first = [], False, 0
    for k, value in enumerate(x - middle):
        if value < -swing:
            below, first = True, k
        elif value > swing and below:
            below = False
            b = next(j for j in range(first, k + 1) if x[j] - middle >= 0.0)
            a = b - 1
            found.append(time[a] + (middle - x[a]) / (x[b] - x[a]) * (time[b] - time[a]))
    return found


def test_a_frequency_is_that_of_passages_through_the_middle():
    known = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        size, period = float(rng.choice([4.0, 8.0, 100.0])), float(rng.uniform(8.0, 40.0))
        time = np.arange(round(period * rng.uniform(1.5, 6.0)))
        time = time + rng.choice([0.0, 0.2]) * rng.uniform(-1.0, 1.0, len(time))
        phase = 2.0 * np.pi * time / period + rng.uniform(0.0, 6.0)
        phase += rng.choice([0.0, 0.25]) * np.clip(1.0 - time / period, 0.0, 1.0)  # the first one starts late
        x = (
            np.round(size * np.sin(phase) + rng.choice([0.0, 0.1]) * size * rng.uniform(-1.0, 1.0, len(time)))
            + 3.0
        )
        ups = passages(time, x)
        periods = np.diff(ups[1:] if len(ups) > 3 else ups)
        steady = len(periods) > 0 and np.ptp(periods) <= 0.03 * np.median(periods)
        run = Recording(name="run 3Hz", time=time, displacement=1e-3 * x, force=x, command=np.ones(len(time)),
                        command_unit="A")  # fmt: skip
        found = [each.size for each in find_against_names([run])]
        assert found == ([pytest.approx(1.0 / np.mean(periods) / 3.0, rel=1e-9)] if steady else [])
        known += bool(steady)
    assert 30 < known < 140


@pytest.mark.parametrize(("mean", "deviation"), [(0.0, 0.02), (2.0, 0.12)])
def test_a_command_is_steady_to_a_twentieth_and_twenty_milliamperes(mean, deviation):
    run = run_of("run 7A")
    turned = np.where(np.arange(len(run)) % 2, 1.0, -1.0)[: len(run) // 2 * 2]
    for share in (0.99, 1.01):
        command = np.append(mean + share * deviation * turned, [mean] * (len(run) % 2))
        found = list(find_against_names([replace(run, command=command)]))
        assert [each.kind for each in found] == ["declared_command"] * (share < 1.0)


@pytest.mark.parametrize("unit", ["A", "V"])
def test_what_is_declared_and_what_is_measured_are_told_in_their_units(unit):
    run = warm(run_of(f"11Hz 33mm 2{unit} 80C", command_unit=unit), 20.0)
    stroke = 1e3 * float(np.subtract(*np.quantile(run.displacement, (0.998, 0.002))))
    said = [f.found for f in find_against_names([run])]
    assert said == [
        f"the name declares {declared}, and the signals have {found}"
        for declared, found in (
            ("11 Hz", "2 Hz"), ("33 mm", f"{stroke:.4g} mm"), (f"2 {unit}", f"0.5 {unit}"),
            ("80 degC", "20 degC"),
        )
    ]  # fmt: skip
    (size,) = (f.size for f in find_against_names([run]) if f.channel == "displacement")
    assert size == pytest.approx(stroke / 33.0, rel=1e-12)


def test_a_declared_nothing_is_no_divisor():
    (found,) = find_against_names([run_of("0A")])
    assert (found.size, found.found) == (0.5, "the name declares 0 A, and the signals have 0.5 A")
    assert list(find_against_names([run_of("0A", current=0.059)])) == []
    for role in ("time", "displacement", "force", "command"):
        changed: Any = {role: np.full(len(run_of()), np.nan)}
        assert list(find_against_names([as_read(run_of("9Hz 9A"), **changed)])) == []


@pytest.mark.parametrize(("quantity", "usual", "share"), [("frequency", 2.0, 0.12), ("stroke_m", 0.02, 0.25)])
def test_siblings_are_runs_of_nearly_the_same_motion(quantity, usual, share):
    """Of the odd run's, that is: frequencies to 12 %, strokes to 25 %."""
    for within in (0.99, 1.01):
        fields = {quantity: usual * (1.0 + within * share)}
        others = [run_of(f"{k}", current=0.1 * k, **fields) for k in range(3)]
        found = list(find_odd_siblings([*others, run_of("odd")]))
        assert [each.run for each in found] == ["odd"] * (within < 1.0)


@pytest.mark.parametrize("scatter", [0.010, 0.014])
def test_strokes_that_scatter_by_more_than_twelve_in_a_thousand_tell_no_odd_run(scatter):
    """Of five at -2 d, -d, 0, d and 2 d the scatter is 1.48 d."""
    others = [
        run_of(f"{k}", stroke_m=0.02 * (1.0 + scatter / 1.4826 * (k - 2)), current=0.1 * k) for k in range(5)
    ]
    found = [each.run for each in find_odd_siblings([*others, run_of("odd", stroke_m=0.0245)])]
    assert ("odd" in found) == (scatter < 0.012)


@pytest.mark.parametrize(
    ("plan", "fault"),
    [
        ("bore_mm = 10\nrod_mm = 10", "a rod"),
        ("bore_mm = 10\nrod_mm = 9.9", ""),
        ("bore_mm = 10", ""),
        ("rod_mm = 10", ""),
        ("gap_mm = 0.7", ""),
    ],
)
def test_a_rod_is_thinner_than_its_bore(tmp_path, plan, fault):
    (tmp_path / "plan.toml").write_text(f"[damper]\n{plan}\n")
    run = run_of(source=str(tmp_path / "run.csv"))
    if fault:
        with pytest.raises(InputError, match=fault):
            list(find_implausible_damper([run]))
    else:
        assert list(find_implausible_damper([run])) == []
