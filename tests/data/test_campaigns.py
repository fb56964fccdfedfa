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

TABLE = [  # a plan, a channel, its lowest and highest value; the peak of the force is 1 kN, the current 0.5 A
    ("", "force", 150.0, 20e3),
    ("", "displacement", 2e-3, 0.5),
    ("", "current", 0.3, 15.0),
    ("peak_force_N = 2000", "force", 800.0, 3200.0),
    ("largest_current_A = 2", "current", 0.26, 2.6),
    ("largest_current_A = 20", "current", 0.3, 26.0),
    ("stroke_mm = 25", "displacement", 2e-3, 0.025),
    # area of the piston 1143.5 mm^2; 2 x 3 kPa x A L / g, 1.5 x 3.1 x 100 kPa x A L / g
    ("bore_mm = 40\nrod_mm = 12\ngap_mm = 1\npole_mm = 20", "force", 137.2, 10635.0),
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

    for end, inside in ((low, 1.02), (high, 0.98)):
        assert channel not in dict(told(inside * end))
        assert dict(told(end / inside))[channel] == pytest.approx(end / inside, rel=1e-6)


@pytest.mark.parametrize(
    ("plan", "current", "told"),
    [
        ("", 0.99, []),  # a small force is that of a small current,
        ("", 1.0, ["force"]),  # but not of 1 A
        ("peak_force_N = 1000\nlargest_current_A = 2", 1.59, []),  # nor one of 0.8 of the largest
        ("peak_force_N = 1000\nlargest_current_A = 2", 1.61, ["force"]),
        ("bore_mm = 40\nrod_mm = 12\ngap_mm = 0.3\npole_mm = 20", 0.29, ["current"]),
        ("bore_mm = 40\nrod_mm = 12\ngap_mm = 0.3\npole_mm = 20", 0.31, ["force"]),
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
