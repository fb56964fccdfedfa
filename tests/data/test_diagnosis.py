"""Faults of known size in a run are reported, and a run without faults has no finding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.diagnosis.diagnose import diagnose
from mrdamper.data.diagnosis.resolution import white_noise
from mrdamper.data.finding import Finding, by_kind, without_repeats
from mrdamper.data.records import Recording, RigRun
from mrdamper.errors import InputError
from mrdamper.excitation import Chirp, Sine
from tests.support.campaigns import SINE, make_run
from tests.support.examples import examples

RNG_N = 5.0  # Noise of the measured force [N]


def recording(motion=SINE, *, changed=None, force_noise=RNG_N, **how):
    """Return a recording of dry friction with sensor noise. ``changed`` alters its arrays in place."""
    run = make_run(motion, **{"duration": 5.0, "noise": 5e-6, **how})
    rng = np.random.default_rng(7)
    fields = {
        "time": np.array(run.time),
        "displacement": np.array(run.displacement),
        "force": run.force + force_noise * rng.standard_normal(len(run)),
        "command": np.array(run.command),
    }
    if changed is not None:
        changed(fields)
    return Recording(name="run", command_unit="A", session="s", source="run.csv", **fields)


def kinds(given_run):
    return [finding.kind for finding in diagnose(given_run)]


def size_of(finding: Finding) -> float:
    assert finding.size is not None
    return finding.size


def only(given_run, kind):
    """Return the only finding of a run, after a check that it has this kind."""
    (finding,) = diagnose(given_run)
    assert finding.kind == kind
    assert finding.run == "run"
    assert finding.found
    assert finding.effect
    assert finding.remedy
    return finding


# ------------------------------------------------------------------------------------------- clean runs


@pytest.mark.parametrize(
    "motion",
    [SINE, Sine(0.025, 0.5), Sine(2e-3, 5.0), Chirp(0.003, 0.5, 4.0, 20.0)],
    ids=["sine", "slow", "fast", "chirp"],
)
@pytest.mark.parametrize("rest", [0.0, 1.0])
def test_clean_run_has_no_finding(motion, rest):
    duration = motion.duration if isinstance(motion, Chirp) else 6.0 / getattr(motion, "frequency", 1.0) + 2.0
    assert kinds(recording(motion, rest=rest, duration=duration)) == []


@given(
    amplitude=st.floats(1e-3, 0.03),
    frequency=st.floats(0.4, 4.0),
    quantum=st.sampled_from([0.0, 1e-6, 3e-6]),
    grain=st.sampled_from([0.0, 1.0, 3.0]),
    seed=st.integers(0, 1000),
)
def test_quantised_noisy_sine_has_no_fault(amplitude, frequency, quantum, grain, seed):
    """A coarsely quantised sine is constant at its reversals, without being clipped or stuck."""

    def coarse(fields):
        if grain:
            fields["force"] = np.round(fields["force"] / grain) * grain

    duration = 4.0 / frequency + 1.0
    motion = Sine(amplitude, frequency)
    run = recording(motion, quantum=quantum, seed=seed, changed=coarse, duration=duration, rate_Hz=400.0)
    assert [finding for finding in diagnose(run) if finding.severity == "fault"] == []
    assert not {"clipped", "stuck_sensor", "spikes", "force_early"} & set(kinds(run))


def test_virtual_rig_has_only_known_findings():
    """The virtual rig adds force noise of 5 N and an offset of 6 N. Only these two are reported."""
    from mrdamper.virtual_rig.campaign import Campaign
    from mrdamper.virtual_rig.lumped import LUMPED
    from mrdamper.virtual_rig.measurement import measure_run

    damper = LUMPED["nominal"]
    campaign = Campaign(temperatures_degC=(20.0, 100.0), currents_A=(0.0, 1.0, 2.0), steps=None)
    seen = 0
    for k, planned in enumerate(campaign.runs()):
        run, _ = measure_run(damper, planned, campaign, seed=k)
        for finding in diagnose(run):
            seen += 1
            assert finding.kind in {"force_offset", "force_noise"}
            expected = damper.offset_N if finding.kind == "force_offset" else campaign.sensors.force_noise_N
            assert finding.size == pytest.approx(expected, rel=0.15)
    assert seen < 10


# ----------------------------------------------------------------------------------------- faults of the time


def test_missing_samples_are_counted_by_channel():
    def spoil(fields):
        fields["force"][100:130] = np.nan
        fields["displacement"][7] = np.inf

    found = {f.channel: f for f in diagnose(recording(changed=spoil))}
    assert set(found) == {"force", "displacement"}
    assert found["force"].severity == "fault"
    assert (found["force"].size, found["force"].from_s, found["force"].to_s) == (30.0, 0.1, 0.129)
    assert found["displacement"].from_s == 0.007


@given(places=st.sets(st.integers(1, 4999), min_size=1, max_size=5))
def test_duplicated_and_reversed_times_are_counted(places):
    def still(fields):
        for k in places:
            fields["time"][k] = fields["time"][k - 1]

    def back(fields):
        fields["time"][3000:] -= 1.5

    assert only(recording(changed=still), "time_not_increasing").size >= 1.0
    finding = only(recording(changed=back), "time_not_increasing")
    assert finding.severity == "fault"
    assert finding.from_s == pytest.approx(2.999)


def test_change_of_sample_rate_is_reported():
    def slower(fields):
        fields["time"][2500:] = fields["time"][2499] + 2e-3 * np.arange(1, len(fields["time"]) - 2499)

    finding = only(recording(changed=slower), "mixed_sampling")
    assert finding.size == pytest.approx(0.5)
    assert finding.from_s == pytest.approx(2.5, abs=0.05)


# ------------------------------------------------------------------------------------------ faults of sensors


def test_clipped_displacement_is_found():
    def clip(fields):
        fields["displacement"] = np.maximum(fields["displacement"], -0.008)

    found = {f.kind: f for f in diagnose(recording(changed=clip))}
    assert found["clipped"].channel == "displacement"
    assert found["clipped"].effect.startswith("Velocity is zero")
    assert "lower end" in found["clipped"].found


@pytest.mark.parametrize(("factor", "kind"), [(1e12, "outliers"), (-1e9, "outliers")])
def test_single_force_outlier_is_fault(factor, kind):
    def outlier(fields):
        fields["force"][1234] = factor

    finding = only(recording(changed=outlier), kind)
    assert finding.size == factor
    assert finding.from_s == 1.234
    assert "wiring" in finding.remedy


# ------------------------------------------------------------------------------------------ mechanical faults


def test_reversed_force_sign_is_fault():
    def turn(fields):
        fields["force"] *= -1.0

    finding = only(recording(changed=turn), "force_sign")
    assert finding.severity == "fault"
    assert "sign = -1" in finding.remedy
    assert finding.size < -0.8


def test_coarsely_resolved_motion_is_not_reported_as_stuck():
    def coarse(fields):
        fields["displacement"] = np.round(fields["displacement"] / 4e-4) * 4e-4

    assert kinds(recording(changed=coarse)) == ["coarse_steps"]


@pytest.mark.parametrize("levels", [20, 40])
def test_plateau_of_8_bit_force_is_no_fault(levels):
    """Between two reversals, the force of a yielding damper stays within one step of an oscilloscope."""

    def coarse(fields):
        force = np.tanh(1.5 * fields["force"] / np.abs(fields["force"]).max())
        step = np.ptp(force) / levels
        fields["force"] = 500.0 * np.round(force / step) * step

    assert all(f.severity != "fault" for f in diagnose(recording(changed=coarse)))


# ------------------------------------------------------------------------------------------- force noise


@given(noise=st.floats(0.5, 200.0), seed=st.integers(0, 99))
@examples(20)
def test_force_noise_is_separated_from_damper_force(noise, seed):
    run = make_run(rate_Hz=1000.0)
    spoilt = run.force + noise * np.random.default_rng(seed).standard_normal(len(run))
    assert white_noise(spoilt) == pytest.approx(noise, rel=0.15)
    assert white_noise(spoilt[:15]) == 0.0  # The run is too short to determine the noise.


# ------------------------------------------------------------------------------------------- all runs


channel_values = st.sampled_from(
    [0.0, 1.0, -1.0, np.nan, np.inf, 1.7e308, -1.7e308, 1e300, 5e-324, 1e-9, 0.5]
)


@examples(50)
@given(
    n=st.integers(0, 60),
    data=st.data(),
)
def test_diagnosis_agrees_with_validation_of_runs(n, data):
    """The diagnosis accepts any array. It reports a fault if and only if the validation rejects the run."""
    seed = data.draw(st.integers(0, 10_000))
    rng = np.random.default_rng(seed)
    time = np.arange(n) / 100.0
    fields = {
        "time": time,
        "displacement": 0.01 * np.sin(20.0 * time),
        "force": rng.standard_normal(n) * 100.0,
    }
    fields["command"] = np.ones(n)
    for values in fields.values():
        for _ in range(data.draw(st.integers(0, 2)) if n else 0):
            values[data.draw(st.integers(0, n - 1))] = data.draw(channel_values)
    run = Recording(name="run", command_unit="A", **fields)
    faults = [finding for finding in diagnose(run) if finding.severity == "fault"]
    try:
        checked = run.checked()
    except InputError:
        assert faults
        return
    assert isinstance(checked, RigRun)


def a_finding(kind, severity="warning", size=None, run="", **fields):
    texts = {"found": "", "effect": "", "remedy": ""}
    return Finding(kind=kind, severity=severity, channel="force", size=size, run=run, **texts | fields)


def test_finding_counts_each_recording_once():
    """A recording with several findings of a kind counts once, and a copy of it does not count."""
    clipped = [a_finding("clipped", run=run, from_s=time) for run in ("one", "copy") for time in (0.0, 1.0)]
    copy = a_finding("duplicate", run="copy")
    assert [(finding.kind, count) for finding, count in by_kind([*clipped, copy])] == [
        ("clipped", 1),
        ("duplicate", 1),
    ]
    assert by_kind([*clipped, copy, a_finding("clipped", run="two")])[0][1] == 2
    assert by_kind([a_finding("clipped", run="copy"), copy])[0][1] == 1


def test_repeated_findings_are_listed_once():
    """A fault that two checks find is listed once. A fault at two times or in two runs is listed twice."""
    early, again = a_finding("force_early", run="one"), a_finding("force_early", run="one", found="again")
    other = [a_finding("force_early", run="two"), a_finding("force_early", run="one", from_s=1.0)]
    assert without_repeats([early, again, *other]) == [early, *other]
    campaign = [a_finding("drift"), a_finding("drift", found="another")]
    assert without_repeats([*campaign, *campaign]) == campaign


@pytest.mark.parametrize("rows", [(slice(None, 700), slice(703, None)), (slice(None, 703), slice(700, None))],
                         ids=["lost", "doubled"])  # fmt: skip
def test_lost_samples_are_reported_as_phase_jumps(rows):
    """The time stamps remain uniform, but displacement and force jump."""
    sound = recording()
    cut = {
        name: np.concatenate([getattr(sound, name)[part] for part in rows])
        for name in ("displacement", "force", "command")
    }
    time = np.median(np.diff(sound.time)) * np.arange(len(cut["force"]))
    finding = only(replace(sound, time=time, **cut), "phase_jumps")
    assert size_of(finding) == pytest.approx(3.0, abs=1.1)
    assert finding.from_s == pytest.approx(sound.time[700], abs=0.01)


# --------------------------------------------------------------------------------------- faults of known size


class Fault(NamedTuple):
    """A fault of a known size, and the kind and size of the finding that reports it."""

    kind: str
    spoil: Callable[[dict[str, Any], float], Any]
    injected: float
    size: Callable[[float], float]  # Converts the injected size to the reported size.
    tolerance: float  # Relative tolerance [-].
    span_s: tuple[float, float] | None = None


def force_plus(values):
    return lambda fields, size: fields.update(force=fields["force"] + size * values(fields))


def times(role, gain):
    return lambda fields, size: fields.update({role: fields[role] * gain(fields, size)})


def rolled(samples):
    return lambda fields, size: fields.update(force=np.roll(fields["force"], samples * round(size)))


def held(role, middle):
    def hold(fields, size):
        begin = middle - round(size) // 2
        fields[role][begin : begin + round(size)] = fields[role][begin]

    return hold


def grid(role):
    return lambda fields, size: fields.update({role: np.round(fields[role] / size) * size})


def lose(fields, size):
    rows = 300 + 40 * np.arange(round(size))
    fields.update({name: np.delete(values, rows) for name, values in fields.items()})


def drift_by(role):
    """Return a function that adds a drift. Its size is the change from the first to the ninth cycle."""
    return lambda fields, size: fields.update({role: fields[role] + size * fields["time"] / 4.0})


def hum(fields):
    return np.sqrt(2.0) * np.sin(2.0 * np.pi * 7.3 * SINE.frequency * fields["time"])


def white(fields):
    return np.random.default_rng(5).standard_normal(len(fields["time"]))


SPREAD_N, SPAN_N = float(np.std(make_run().force)), float(np.ptp(recording(noise=0.0).force))
STROKE_m, PERIOD = 0.020, 500  # [samples]
ROUNDING = np.sqrt(12.0)
CYCLES = (0.375, 4.875)  # Start and end [s] of nine cycles between reversals
ALL_BUT_ONE = float(np.sqrt(9.0 / 8.0 * 80.0 / 81.0))  # Standard deviation of nine values of alternating sign


def the_same(size):
    return size


FAULTS = {
    "offset": Fault("force_offset", force_plus(lambda _: 1.0), 0.11 * SPREAD_N, the_same, 0.005),
    "position drift": Fault(
        "position_drift", drift_by("displacement"), 0.032 * STROKE_m, the_same, 0.001, CYCLES
    ),
    "force drift": Fault("force_drift", drift_by("force"), 0.033 * SPAN_N, the_same, 0.01, CYCLES),
    "growth": Fault(
        "force_level_changes", times("force", lambda f, size: 1.0 + size * f["time"] / 4.0), 0.053,
        lambda size: 100.0 * ((4.0 + 4.625 * size) / (4.0 + 0.625 * size) - 1.0), 0.01, CYCLES,
    ),
    "early": Fault("force_early", rolled(-1), 2.0, lambda size: -1e-3 * round(size), 0.005),
    "late": Fault("force_late", rolled(1), 0.18 * PERIOD, lambda size: 1e-3 * round(size), 0.001),
    "noise": Fault("force_noise", force_plus(white), 0.053 * SPREAD_N, the_same, 0.03),
    "different cycles": Fault(
        "poor_repeatability",
        times("force", lambda f, size: 1.0 + size * np.where((2.0 * f["time"]).astype(int) % 2, 1.0, -1.0)),
        0.053 / ALL_BUT_ONE, lambda size: 100.0 * ALL_BUT_ONE * size, 0.01,
    ),
    "line": Fault("interference", force_plus(hum), 0.033 * SPREAD_N, the_same, 0.06),
    "lost": Fault("lost_samples", lose, 5.0, round, 1e-9, (0.299, 0.461)),
    "force steps": Fault("coarse_steps", grid("force"), 0.032 * ROUNDING * SPREAD_N, the_same, 1e-6),
    "stuck force": Fault(
        "stuck_sensor", held("force", 2500), 26.0, lambda size: 1e-3 * (size - 1), 1e-9, (2.487, 2.512)
    ),
    "stuck position": Fault(
        "stuck_sensor", held("displacement", 2125), 22.0, lambda size: 1e-3 * (size - 1), 1e-9, (2.114, 2.135)
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_finding_reports_size_of_injected_fault(name):
    fault = FAULTS[name]
    run = recording(noise=0.0, changed=lambda fields: fault.spoil(fields, fault.injected))
    found = next(finding for finding in diagnose(run) if finding.kind == fault.kind)
    assert size_of(found) == pytest.approx(fault.size(fault.injected), rel=fault.tolerance)
    assert fault.span_s is None or (found.from_s, found.to_s) == pytest.approx(fault.span_s, abs=1e-9)


# ---------------------------------------------------------------------------------- changes of unit and scale


class Twin(NamedTuple):
    """A change of units or scale that must not change the findings."""

    changed: Callable[[Recording], Recording]
    factors: dict[str, float]  # Unit of a finding: factor by which its size changes. "s" also scales times.
    begins_s: float = 0.0


def scaled(**gains):
    return lambda run: replace(
        run,
        **{role: getattr(run, role) * gain for role, gain in gains.items() if getattr(run, role) is not None},
    )


TWINS = {  # Scaling by powers of two is exact.
    "a force four times as large": Twin(scaled(force=4.0), {"N": 4.0}),
    "a motion of half the size": Twin(scaled(displacement=0.5, velocity=0.5), {"m": 0.5}),
    "twice as slow": Twin(scaled(time=2.0, velocity=0.5), {"s": 2.0, "ms": 2.0}),
    "a clock that began earlier": Twin(lambda run: replace(run, time=run.time + 16.0), {}, 16.0),
}  # fmt: skip


@pytest.mark.parametrize("twin", TWINS)
@pytest.mark.parametrize("name", FAULTS)
def test_findings_do_not_depend_on_units(name, twin):
    """The thresholds of findings are relative to the stroke, range, rate and noise of the run itself."""
    fault, same = FAULTS[name], TWINS[twin]
    sound = recording(noise=0.0, changed=lambda fields: fault.spoil(fields, fault.injected))
    first, other = diagnose(sound), diagnose(same.changed(sound))
    assert first
    assert [(f.kind, f.severity, f.channel) for f in other] == [
        (f.kind, f.severity, f.channel) for f in first
    ]
    slower = same.factors.get("s", 1.0)
    for one, two in zip(first, other, strict=True):
        assert two.size == pytest.approx(same.factors.get(one.unit, 1.0) * size_of(one), rel=1e-6)
        for place, again in ((one.from_s, two.from_s), (one.to_s, two.to_s)):
            assert (place is None) == (again is None)
            assert again == (
                None if place is None else pytest.approx(slower * place + same.begins_s, abs=1e-9)
            )
