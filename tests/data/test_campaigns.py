"""Runs are compared with their file names, with published dampers and with each other."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mrdamper.data.diagnosis.campaign import compare
from mrdamper.data.diagnosis.declared import (
    find_against_names,
    find_implausible_damper,
    find_odd_siblings,
)
from mrdamper.data.records import Recording, RigRun
from mrdamper.excitation import Sine
from mrdamper.quantities import ZERO_CELSIUS_K
from tests.support.campaigns import make_run


def run_of(
    name: str = "run", frequency: float = 2.0, stroke_m: float = 0.020, current: float = 0.5, **fields: Any
) -> RigRun:
    """Return a run with a sinusoidal motion and a force of 1 kN."""
    run = make_run(Sine(0.5 * stroke_m, frequency), duration=4.0 / frequency + 0.3)
    return replace(run, name=name, command=np.full(len(run), current), **fields)


def warm(run, celsius):
    return replace(run, temperature=np.full(len(run), celsius + ZERO_CELSIUS_K))


def noisy(run, seed, gain=1.0):
    grain = 20.0 * np.random.default_rng(seed).standard_normal(len(run))
    return replace(run, force=gain * run.force + grain)


# --------------------------------------------------------------------------------------- values in file names

DECLARED = {
    "frequency": ("3Hz", "time", 2.0 / 3.0),
    "stroke": ("30mm", "displacement", 20.0 / 30.0),
    "command": ("2A", "current", 0.25),
    "temperature": ("60C", "temperature", 40.0 / 60.0),
}


@pytest.mark.parametrize("place", ["run", "file", "folder"])
@pytest.mark.parametrize("quantity", DECLARED)
def test_run_contradicting_its_name_is_reported(place, quantity):
    """The run has 2 Hz, a stroke of 20 mm, 0.5 A and 40 degC. The file name states another value."""
    text, channel, size = DECLARED[quantity]
    run = warm(run_of(f"test_{text}_b" if place == "run" else "run"), 40.0)
    source = {"run": "run.csv", "file": f"test_{text}.csv", "folder": f"of {text}/run.csv"}[place]
    (finding,) = find_against_names([replace(run, source=source)])
    assert (finding.kind, finding.channel) == (f"declared_{quantity}", channel)
    assert finding.size == pytest.approx(size, rel=5e-3)


def test_frequency_of_noisy_sine_is_found():
    """With noise of 5 % of the amplitude, the displacement crosses its mean many times in each stroke."""
    run = run_of("sine_2.1Hz")
    noise = 5e-4 * np.random.default_rng(4).standard_normal(len(run))
    (finding,) = find_against_names([replace(run, displacement=run.displacement + noise)])
    assert finding.kind == "declared_frequency"
    assert finding.size == pytest.approx(2.0 / 2.1, rel=5e-3)


@pytest.mark.parametrize(
    ("kind", "quantity", "least"),
    [("time_scale", "frequency", 0.015), ("displacement_scale", "stroke_m", 0.04)],
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_deviating_stroke_or_frequency_is_found(kind, quantity, least, sign):
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
    named = replace(run, name="sine_2.1Hz_11mm")  # The file name states this motion, so it is intended.
    assert list(find_odd_siblings([*others, named])) == []


@pytest.mark.parametrize(("role", "factor"), [("force", 0.1), ("displacement", 1 / 25.4), ("command", 100.0)])
def test_implausible_force_or_command_is_reported(role, factor):
    run = run_of()
    (finding,) = find_implausible_damper([replace(run, **{role: factor * getattr(run, role)})])
    assert finding.channel == ("current" if role == "command" else role)
    assert list(find_implausible_damper([run])) == []


# ------------------------------------------------------------------------------------------- two dampers


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
def test_force_range_reveals_second_damper(alike):
    """The force ranges of similar runs may differ by 15 %. A larger difference indicates a second damper.

    Runs are similar if currents differ by at most 20 mA, strokes and frequencies by 3 %, and temperatures by
    3 K.
    """
    first = run_of("first") if alike(0.0).temperature is None else warm(run_of("first"), 20.0)

    def told(share, gain):
        return [
            f for f in compare([noisy(first, 1), noisy(alike(share), 2, gain)]) if f.kind == "two_dampers"
        ]

    (finding,) = told(0.9, 1.0 / 1.2)
    assert (finding.run, finding.size) == ("first", pytest.approx(20.0, abs=1.5))
    assert told(0.9, 1.0 / 1.12) == []
    assert told(1.1, 1.0 / 1.2) == []


@pytest.mark.parametrize(
    "change",
    [
        lambda run: {"displacement": 0.02 / np.pi * np.arcsin(run.displacement / 0.010)},
        lambda run: {"command": np.where(np.sin(9.0 * run.time) > 0.4, 1.0, run.command)},
    ],
    ids=["triangle", "switched current"],
)
def test_different_motion_or_current_is_no_second_damper(change):
    first, other = noisy(run_of("first"), 1), noisy(run_of("other"), 2, 1.5)
    assert [found.kind for found in compare([first, other])] == ["two_dampers"]
    assert list(compare([first, replace(other, **change(other))])) == []


def test_second_damper_in_held_out_run_is_reported():
    """The fit does not use a held-out run. If the training runs differ too, only they are reported."""
    first, other = noisy(run_of("first"), 1), noisy(run_of("other"), 2, 1.5)
    (finding,) = compare([first], [other])
    assert (finding.kind, finding.run) == ("two_dampers", "other")
    assert "first" in finding.found
    assert "the fit is not" in finding.effect
    third = noisy(run_of("third"), 3, 1.3)
    (finding,) = compare([first, third], [other])
    assert (finding.run, finding.effect) == ("first", "One law for both fits neither")


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
def test_scaled_copy_of_run_is_found(gain, said):
    first = replace(run_of("first"), force=run_of().force + 100.0)
    copy = replace(first, name="copy", force=gain * first.force + 7.0, displacement=first.displacement + 3e-4)
    (found,) = copies([first, copy])
    assert found.found == f"force and displacement are those of first, {said}"
    assert copies([first, replace(copy, displacement=1.001 * first.displacement)]) == []
    assert copies([first, replace(copy, force=np.roll(copy.force, 1))]) == []


def delayed(frequency, delay_s, *, stroke_m=0.02, name="run", current=0.0):
    """Return a sine whose force crosses its mean value ``delay_s`` after each reversal of the motion."""
    time = np.arange(round(4.6 / frequency * 2000.0)) / 2000.0
    phase = 2.0 * np.pi * frequency * time + 0.3
    force = 1e3 * np.cos(phase - 2.0 * np.pi * frequency * delay_s)
    return Recording(
        name=name, time=time, displacement=0.5 * stroke_m * np.sin(phase), force=force,
        command=np.full(len(time), current), command_unit="A",
    )  # fmt: skip


def lag_of(runs):
    """Return kind, size [ms] and run of the reported delays."""
    return [
        (f.kind, 1e3 * (f.size or 0.0), f.run)
        for f in compare(runs)
        if f.kind in {"force_late", "force_early"}
    ]


@pytest.mark.parametrize(
    ("delays", "told"),
    [  # Frequency [Hz]: delay of the force [ms]
        ({2.0: 40.0}, None),  # A single frequency does not separate a delay from compliance.
        ({2.0: -2.1}, -2.1),  # No mechanism can make the force lead the motion.
        ({1.0: 10.4, 2.0: 10.4}, 10.4),
        # The delay is proportional to the period, which indicates compliance.
        ({1.0: 40.0, 2.0: 20.0}, None),
        ({1.0: 52.0, 2.0: 32.0}, 12.0),
        # The fits a + b/f and a + b/f^2 give a = -5 and 8.3 ms. A lead is reported only if both are negative.
        ({1.0: 35.0, 2.0: 15.0}, None),
        # The fits give a = -15 and -5 ms. The smaller lead is reported.
        ({1.0: 15.0, 2.0: 0.0}, -5.0),
    ],
)
def test_force_delay_is_distinguished_from_compliance(delays, told):
    runs = [
        delayed(f, 1e-3 * ms, name=f"{f}", stroke_m=0.02 + 1e-6 * k)
        for k, (f, ms) in enumerate(delays.items())
    ]
    larger = delayed(2.0, 0.03, name="larger", current=1.0)  # A run at a different current is not compared.
    found = lag_of([larger, *runs])
    expected = [] if told is None else [("force_late" if told > 0.0 else "force_early", told, runs[0].name)]
    assert [(kind, pytest.approx(size, abs=0.012), run) for kind, size, run in found] == expected
    for each in compare(runs):
        same = "is the same at all frequencies" if len(delays) > 1 else "no damper has"
        late = "late" if (told or 0.0) > 0.0 else "early"
        soft = ", or a damper whose viscosity over its stiffness is that time" * (late == "late")
        lag = f"the force is {abs(told or 0.0):.1f} ms {late}: a lag of its channel that {same}"
        assert each.found == lag + soft
