"""Findings on runs that are spoilt in a known way; clean runs, virtual and real, have none that is false."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.diagnosis.campaign import compare
from mrdamper.data.diagnosis.diagnose import diagnose
from mrdamper.data.diagnosis.mechanics import looks_swapped
from mrdamper.data.diagnosis.plausible import find_implausible_damper
from mrdamper.data.diagnosis.repeatability import estimate_lag
from mrdamper.data.diagnosis.resolution import samples_in_transition, white_noise
from mrdamper.data.diagnosis.sensors import (
    find_clipping,
    find_spikes,
    find_stuck_sensors,
    resolution_of,
)
from mrdamper.data.diagnosis.timing import find_missing_numbers, find_time_faults
from mrdamper.data.finding import SEVERITIES, Finding, by_kind, percent, without_repeats
from mrdamper.data.prepare import prepare_run
from mrdamper.data.readers import read_runs
from mrdamper.data.records import Recording, RigRun
from mrdamper.errors import InputError
from mrdamper.excitation import Chirp, Sine, Triangle
from tests.data.example_runs import SINE, make_run
from tests.support.examples import examples

RNG_N = 5.0  # noise of the force [N]


def recording(motion=SINE, *, changed=None, force_noise=RNG_N, **how):
    """Return a run of dry friction with sensor noise, as read; ``changed`` alters its arrays in place."""
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
    """Return the one finding there is, which must be of this kind."""
    (finding,) = diagnose(given_run)
    assert finding.kind == kind
    assert finding.run == "run"
    assert finding.found
    assert finding.effect
    assert finding.remedy
    return finding


# ------------------------------------------------------------------------------------------- nothing


@pytest.mark.parametrize(
    "motion",
    [SINE, Sine(0.025, 0.5), Sine(2e-3, 5.0), Chirp(0.003, 0.5, 4.0, 20.0)],
    ids=["sine", "slow", "fast", "chirp"],
)
@pytest.mark.parametrize("rest", [0.0, 1.0])
def test_a_clean_run_has_no_finding(motion, rest):
    duration = motion.duration if isinstance(motion, Chirp) else 6.0 / getattr(motion, "frequency", 1.0) + 2.0
    assert kinds(recording(motion, rest=rest, duration=duration)) == []


@given(
    amplitude=st.floats(1e-3, 0.03),
    frequency=st.floats(0.4, 4.0),
    quantum=st.sampled_from([0.0, 1e-6, 3e-6]),
    grain=st.sampled_from([0.0, 1.0, 3.0]),
    seed=st.integers(0, 1000),
)
def test_no_sine_of_a_quantised_noisy_rig_is_called_faulty(amplitude, frequency, quantum, grain, seed):
    """Coarse converters stand still at the turns of a sine: neither clipped nor stuck."""

    def coarse(fields):
        if grain:
            fields["force"] = np.round(fields["force"] / grain) * grain

    duration = 4.0 / frequency + 1.0
    motion = Sine(amplitude, frequency)
    run = recording(motion, quantum=quantum, seed=seed, changed=coarse, duration=duration, rate_Hz=400.0)
    assert [finding for finding in diagnose(run) if finding.severity == "fault"] == []
    assert not {"clipped", "stuck_sensor", "spikes", "force_early"} & set(kinds(run))


def test_the_virtual_rig_has_only_what_its_truth_holds():
    """Noise of 5 N and an offset of 6 N are in the rig's parameters; nothing else is found."""
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


@pytest.mark.system
def test_real_runs_show_what_their_laboratories_know(real_data):
    """What is known of these rigs (none is clipped, stuck, swapped or delayed), and nothing else.

    UTFSM: offset of 24 to 58 N, the 25 mm 0.25 Hz run at 1 A grows by 6 %, the force at 0 A falls. UTFPR: gas
    preload of 100 to 140 N, the mean position drifts by up to 3.5 mm, repeatability 2 to 12 %.
    """
    runs = read_runs(real_data / "dev")
    found = [finding for run in runs for finding in diagnose(run)]
    assert {finding.severity for finding in found} <= {"warning", "note"}
    assert {finding.kind for finding in found} == {
        "force_offset", "force_level_changes", "position_drift", "poor_repeatability", "force_noise",
    }  # fmt: skip
    offsets = {f.run: size_of(f) for f in found if f.kind == "force_offset"}
    assert all(24.0 < size < 60.0 for run, size in offsets.items() if "utfsm" in run)
    assert all(98.0 < size < 140.0 for run, size in offsets.items() if "utfpr" in run)
    assert sum("utfpr" in run for run in offsets) == 26
    grows = {f.run: size_of(f) for f in found if f.kind == "force_level_changes"}
    assert grows.pop("utfsm_sine_25mm0p25Hz_1.00A") == pytest.approx(6.0, abs=0.6)
    assert all("0.00A" in run and size < 0.0 for run, size in grows.items())
    drifts = [f for f in found if f.kind == "position_drift"]
    assert {f.run[:5] for f in drifts} == {"utfpr"}
    assert all(abs(size_of(f)) < 3.5e-3 for f in drifts)
    assert all(5.0 < size_of(f) < 12.0 for f in found if f.kind == "poor_repeatability")
    assert list(compare(runs.runs)) == []


# ------------------------------------------------------------------------------------------- time


def test_missing_numbers_are_counted_by_channel():
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


def test_a_change_of_rate_is_told():
    def slower(fields):
        fields["time"][2500:] = fields["time"][2499] + 2e-3 * np.arange(1, len(fields["time"]) - 2499)

    finding = only(recording(changed=slower), "mixed_sampling")
    assert finding.size == pytest.approx(0.5)
    assert finding.from_s == pytest.approx(2.5, abs=0.05)


# ------------------------------------------------------------------------------------------- sensors


def test_a_clipped_displacement_is_found_on_its_side():
    def clip(fields):
        fields["displacement"] = np.maximum(fields["displacement"], -0.008)

    found = {f.kind: f for f in diagnose(recording(changed=clip))}
    assert found["clipped"].channel == "displacement"
    assert found["clipped"].effect.startswith("Velocity is zero")
    assert "lower end" in found["clipped"].found


@pytest.mark.parametrize("role", ["force", "displacement"])
@pytest.mark.parametrize("first", [0, 1, 2100, 4500, 4501])
def test_a_stuck_sensor_has_its_time(role, first):
    """Wherever it is: at the very beginning and end, too."""

    def stick(fields):
        fields[role][first : first + 500] = fields[role][first]

    found = {f.kind: f for f in diagnose(recording(changed=stick))}
    assert found["stuck_sensor"].channel == role
    assert found["stuck_sensor"].from_s == pytest.approx(1e-3 * first)
    assert found["stuck_sensor"].to_s == pytest.approx(1e-3 * (first + 499))
    assert found["stuck_sensor"].severity == "fault"


def test_a_channel_that_never_moves_is_refused():
    def dead(fields):
        fields["force"][:] = 3.0

    finding = only(recording(changed=dead), "refused")
    assert finding.severity == "fault"
    assert "force never changes" in finding.found


@given(grain=st.floats(1e-3, 50.0), levels=st.integers(20, 400), seed=st.integers(0, 99))
def test_the_resolution_of_a_grid_is_found_whatever_its_size(grain, levels, seed):
    steps = np.random.default_rng(seed).integers(0, levels, 4000)
    assert resolution_of(grain * steps) == pytest.approx(grain, rel=1e-6)
    assert resolution_of(np.random.default_rng(seed).standard_normal(4000)) == 0.0


@pytest.mark.parametrize(("further", "known"), [(2, True), (3, True), (4, False)])
def test_a_grid_may_miss_two_levels_in_a_row_and_no_more(further, known):
    """A fifth of the distances between neighbouring levels may be anything; here a third are larger."""
    levels = np.cumsum(np.tile([1, 1, further], 40))
    assert resolution_of(np.repeat(0.25 * levels, 3)) == (0.25 if known else 0.0)


@pytest.mark.parametrize(("factor", "kind"), [(1e12, "outliers"), (-1e9, "outliers")])
def test_an_outlier_is_a_fault_with_its_place(factor, kind):
    def outlier(fields):
        fields["force"][1234] = factor

    finding = only(recording(changed=outlier), kind)
    assert finding.size == factor
    assert finding.from_s == 1.234
    assert "wiring" in finding.remedy


# ------------------------------------------------------------------------------------------- mechanics


def test_a_turned_force_is_told_with_the_cure():
    def turn(fields):
        fields["force"] *= -1.0

    finding = only(recording(changed=turn), "force_sign")
    assert finding.severity == "fault"
    assert "sign = -1" in finding.remedy
    assert finding.size < -0.8


@pytest.mark.parametrize("role", ["force", "displacement"])
def test_a_velocity_channel_tells_which_of_the_two_is_reversed(role):
    """Without one, a turned force and a turned displacement are the same loop: both are named."""

    def turn(fields):
        fields["velocity"] = np.gradient(fields["displacement"], fields["time"])
        fields[role] *= -1.0

    def turn_blind(fields):
        fields[role] *= -1.0

    (told,) = (f for f in diagnose(recording(changed=turn)) if f.severity == "fault")
    assert told.channel == role
    assert f"[channel.{role}]" in told.remedy
    finding = only(recording(changed=turn_blind), "force_sign")
    assert "the force or the displacement is reversed" in finding.found


def test_a_slow_motion_between_two_levels_is_no_stuck_sensor():
    def coarse(fields):
        fields["displacement"] = np.round(fields["displacement"] / 4e-4) * 4e-4

    assert kinds(recording(changed=coarse)) == ["coarse_steps"]


def test_exchanged_channels_are_told_from_a_turned_sign():
    """Scaled so that both are plausible, as a wrong channel map would have them."""

    def swap(fields):
        fields["displacement"], fields["force"] = 1e-5 * fields["force"], 1e5 * fields["displacement"]

    run = recording(changed=swap, force_noise=1.0)
    assert kinds(run)[0] == "swapped_channels"


def test_exchanged_channels_of_an_impossible_size_are_asked_about():
    def swap(fields):
        fields["displacement"], fields["force"] = 1e-3 * fields["force"], 1e3 * fields["displacement"]

    (finding,) = (f for f in diagnose(recording(changed=swap)) if f.severity == "fault")
    assert "exchanged" in finding.remedy


def test_a_force_that_fades_is_measured():
    def fade(fields):
        fields["force"] *= 1.0 - 0.04 * np.arange(5001) / 1000.0

    found = {f.kind: f for f in diagnose(recording(changed=fade))}
    assert found["force_level_changes"].size == pytest.approx(-16.5, abs=2.0)
    assert "falls" in found["force_level_changes"].found


# ------------------------------------------------------------------------------------------- resolution


def test_a_force_that_flips_between_two_samples_is_told():
    """Dry friction under a triangle turns at once: no rate would show its yield displacement."""
    found = {f.kind: f for f in diagnose(recording(Triangle(0.010, 0.04)))}
    assert size_of(found["few_samples_per_yield"]) < 2.0


def test_too_few_samples_at_a_reversal_are_counted():
    """Force swings within +-tanh^-1(0.8) of 10 mm/s, at the sine's acceleration A w^2."""
    expected_s = 2.0 * np.arctanh(0.8) * 0.01 / (0.010 * (4.0 * np.pi) ** 2)
    for rate_Hz in (500.0, 2000.0):
        counted = samples_in_transition(prepare_run(make_run(rate_Hz=rate_Hz)))
        assert counted == pytest.approx(expected_s * rate_Hz, rel=0.1)
    found = {f.kind: f for f in diagnose(recording(rate_Hz=200.0))}
    assert set(found) == {"few_samples_per_yield"}
    assert found["few_samples_per_yield"].size == pytest.approx(expected_s * 200.0, rel=0.3)


@given(noise=st.floats(0.5, 200.0), seed=st.integers(0, 99))
@examples(20)
def test_white_noise_is_told_from_the_loop(noise, seed):
    run = make_run(rate_Hz=1000.0)
    spoilt = run.force + noise * np.random.default_rng(seed).standard_normal(len(run))
    assert white_noise(spoilt) == pytest.approx(noise, rel=0.15)
    assert white_noise(spoilt[:15]) == 0.0  # nothing can be said


def test_a_run_without_motion_is_refused():
    def rest(fields):
        fields["displacement"] = 1e-6 * np.random.default_rng(0).standard_normal(len(fields["time"]))

    (finding,) = (f for f in diagnose(recording(changed=rest)) if f.severity == "fault")
    assert finding.kind == "refused"


# ------------------------------------------------------------------------------------------- all runs


channel_values = st.sampled_from(
    [0.0, 1.0, -1.0, np.nan, np.inf, 1.7e308, -1.7e308, 1e300, 5e-324, 1e-9, 0.5]
)


@examples(50)
@given(
    n=st.integers(0, 60),
    data=st.data(),
)
def test_whatever_a_file_holds_a_diagnosis_ends_and_agrees_with_the_record(n, data):
    """No array makes it fail; what the record refuses is a fault, and what has no fault is no refusal."""
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


def test_findings_of_one_kind_are_grouped():
    """The largest finding represents its kind, and the most severe kind comes first."""
    groups = by_kind(
        [
            a_finding("a", "note", 1.0, "one"),
            a_finding("b", "fault", 2.0, "one"),
            a_finding("a", "note", -3.0, "two"),
            a_finding("c", "warning", None),
        ]
    )
    assert [(finding.kind, finding.size, count) for finding, count in groups] == [
        ("b", 2.0, 1),
        ("c", None, 0),
        ("a", -3.0, 2),
    ]
    assert [finding.severity for finding, _ in groups] == list(SEVERITIES)


def test_run_count_counts_each_recording_once():
    """Several findings of a run, and a copy of the run, do not add to the number of runs."""
    clipped = [a_finding("clipped", run=run, from_s=time) for run in ("one", "copy") for time in (0.0, 1.0)]
    copy = a_finding("duplicate", run="copy")
    assert [(finding.kind, count) for finding, count in by_kind([*clipped, copy])] == [
        ("clipped", 1),
        ("duplicate", 1),
    ]
    assert by_kind([*clipped, copy, a_finding("clipped", run="two")])[0][1] == 2
    assert by_kind([a_finding("clipped", run="copy"), copy])[0][1] == 1


def test_repeated_findings_are_listed_once():
    """Two tests report one fault of a run once; faults at two times, or in two runs, are two."""
    early, again = a_finding("force_early", run="one"), a_finding("force_early", run="one", found="again")
    other = [a_finding("force_early", run="two"), a_finding("force_early", run="one", from_s=1.0)]
    assert without_repeats([early, again, *other]) == [early, *other]
    campaign = [a_finding("drift"), a_finding("drift", found="another")]
    assert without_repeats([*campaign, *campaign]) == campaign


@pytest.mark.parametrize("rows", [(slice(None, 700), slice(703, None)), (slice(None, 703), slice(700, None))],
                         ids=["lost", "doubled"])  # fmt: skip
def test_samples_that_are_lost_or_doubled_behind_the_clock_are_jumps_of_the_phase(rows):
    """The time goes on evenly; displacement and force do not."""
    sound = recording()
    cut = {
        name: np.concatenate([getattr(sound, name)[part] for part in rows])
        for name in ("displacement", "force", "command")
    }
    time = np.median(np.diff(sound.time)) * np.arange(len(cut["force"]))
    finding = only(replace(sound, time=time, **cut), "phase_jumps")
    assert size_of(finding) == pytest.approx(3.0, abs=1.1)
    assert finding.from_s == pytest.approx(sound.time[700], abs=0.01)


@pytest.mark.parametrize("gain", [1.0, 1.03])
def test_a_copy_is_told_although_its_force_was_scaled_and_rounded(gain):
    first = replace(recording(), name="first")
    copy = replace(first, name="copy", force=np.round(gain * first.force, 1))
    again = replace(
        recording(changed=lambda f: f.update(force=f["force"] + 3.0 * RNG_N * _noise())), name="again"
    )
    found = [each for each in compare([first, copy, again]) if each.kind == "duplicate"]
    assert [(each.run, each.severity) for each in found] == [("copy", "warning")]
    assert ("number for number" if gain == 1.0 else f"the force times {gain}") in found[0].found


def _noise():
    return np.random.default_rng(8).standard_normal(len(recording()))


# ------------------------------------------------------------------------------------------ where each begins


class Begins(NamedTuple):
    """A fault, from which size on it is told, and what is told then."""

    kind: str
    severity: str
    spoil: Callable[[dict[str, Any], float], Any]
    least: float
    size: Callable[[float], float]  # of the finding, from that of the fault
    within: float  # share
    place: tuple[float, float] | None = None  # [s]
    effect: str = ""  # begins so
    remedy: str = ""  # contains


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


def beyond(samples):
    return lambda fields, size: fields["force"].__setitem__(slice(100, 100 + samples(size)), 1e7)


def jitter(fields, size):
    fields["time"] += size * UNIFORM / np.std(np.diff(UNIFORM))


def lose(fields, size):
    rows = 300 + 40 * np.arange(round(size))
    fields.update({name: np.delete(values, rows) for name, values in fields.items()})


def drift_by(role):
    """Move a channel by a size from the first to the last of nine cycles."""
    return lambda fields, size: fields.update({role: fields[role] + size * fields["time"] / 4.0})


def hum(fields):
    return np.sqrt(2.0) * np.sin(2.0 * np.pi * 7.3 * SINE.frequency * fields["time"])


def white(fields):
    return np.random.default_rng(5).standard_normal(len(fields["time"]))


def faster(fields, size):
    fields["velocity"] = (1.0 + size) * np.gradient(fields["displacement"], fields["time"])


SPREAD_N, SPAN_N = float(np.std(make_run().force)), float(np.ptp(recording(noise=0.0).force))
STROKE_m, PERIOD = 0.020, 500  # samples
UNIFORM = np.random.default_rng(3).uniform(-1.0, 1.0, 5001)
ROUNDING = np.sqrt(12.0)
CYCLES = (0.375, 4.875)  # nine, from reversal to reversal
ALL_BUT_ONE = float(np.sqrt(9.0 / 8.0 * 80.0 / 81.0))  # of nine, five are below; their mean is known


def the_same(size):
    return size


BEGINS = {
    "offset": Begins("force_offset", "note", force_plus(lambda _: 1.0), 0.05 * SPREAD_N, the_same, 0.005),
    "large offset": Begins(
        "force_offset", "warning", force_plus(lambda _: 1.0), 0.10 * SPREAD_N, the_same, 0.005),
    "drift of the position": Begins(
        "position_drift", "warning", drift_by("displacement"), 0.03 * STROKE_m, the_same, 0.001, CYCLES,
        "A stiffness turns it", "a law without stiffness"),
    "drift of the force": Begins(
        "force_drift", "warning", drift_by("force"), 0.031 * SPAN_N, the_same, 0.01, CYCLES,
        "A constant offset", "Let the load cell"),
    "growth": Begins(
        "force_level_changes", "warning", times("force", lambda f, size: 1.0 + size * f["time"] / 4.0),
        0.0505, lambda size: 100.0 * ((4.0 + 4.625 * size) / (4.0 + 0.625 * size) - 1.0), 0.01, CYCLES),
    "early": Begins(
        "force_early", "warning", rolled(-1), 1.5, lambda size: -1e-3 * round(size), 0.005, None,
        "The loop opens", "a mass"),
    "late": Begins(
        "force_late", "warning", rolled(1), 0.17 * PERIOD, lambda size: 1e-3 * round(size), 0.001, None,
        "A delay is taken for hysteresis", "the damper is elastic"),
    "velocity": Begins("velocity_disagrees", "warning", faster, 0.1, lambda size: 100.0 * size, 0.002),
    "noise": Begins("force_noise", "warning", force_plus(white), 0.05 * SPREAD_N, the_same, 0.03),
    "unlike cycles": Begins(
        "poor_repeatability", "warning",
        times("force", lambda f, size: 1.0 + size * np.where((2.0 * f["time"]).astype(int) % 2, 1.0, -1.0)),
        0.05 / ALL_BUT_ONE, lambda size: 100.0 * ALL_BUT_ONE * size, 0.01, None, "", "Look for heating"),
    "line": Begins("interference", "warning", force_plus(hum), 0.0315 * SPREAD_N, the_same, 0.06),
    "jitter": Begins("jitter", "note", jitter, 0.05e-3, lambda size: 1e3 * size, 1e-6),
    "much jitter": Begins("jitter", "warning", jitter, 0.2e-3, lambda size: 1e3 * size, 0.01),
    "lost": Begins("lost_samples", "warning", lose, 4.7, round, 1e-9, (0.299, 0.461)),
    "steps of the force": Begins(
        "coarse_steps", "note", grid("force"), 0.01 * ROUNDING * SPREAD_N, the_same, 1e-6, None,
        "No model can come closer"),
    "large steps of the force": Begins(
        "coarse_steps", "warning", grid("force"), 0.03 * ROUNDING * SPREAD_N, the_same, 1e-6),
    "steps of the position": Begins(
        "coarse_steps", "note", grid("displacement"), 0.01 * ROUNDING * 0.01 / np.sqrt(2.0), the_same, 1e-6,
        None, "Steps of the displacement"),
    "force held while the damper goes 15 % of its way": Begins(
        "stuck_sensor", "fault", held("force", 2500), 24.5, lambda size: 1e-3 * (round(size) - 1), 1e-9,
        (2.487, 2.512)),
    "position held for 20 steps": Begins(
        "stuck_sensor", "fault", held("displacement", 2125), 20.5, lambda size: 1e-3 * (round(size) - 1),
        1e-9, (2.114, 2.135)),
    "small force": Begins(
        "small_signal", "warning", times("force", lambda _, size: 1.0 / size), SPAN_N / 5.0,
        lambda size: SPAN_N / size, 1e-9, None, "", "kN read as N"),
    "small motion": Begins(
        "small_signal", "warning", times("displacement", lambda _, size: 1.0 / size), STROKE_m / 50e-6,
        lambda size: STROKE_m / size, 1e-6),
    "few samples out of range": Begins(
        "outliers", "fault", beyond(lambda size: round(1.0 / size)), 1.0 / 50.5, lambda _: 1e7, 1e-9,
        (0.1, 0.147), "", "Cut the samples out"),
    "samples out of range": Begins(
        "implausible_size", "fault", beyond(round), 50.5, lambda _: 1e7, 1e-9, (0.1, 0.152), "",
        "Check the column"),
}  # fmt: skip


@pytest.mark.parametrize("of", BEGINS)
def test_a_finding_begins_at_its_documented_size_and_states_the_true_one(of):
    fault = BEGINS[of]
    below, above = 0.95 * fault.least, 1.05 * fault.least
    smaller, larger = (
        {f.kind: f for f in diagnose(recording(noise=0.0, changed=lambda f, s=size: fault.spoil(f, s)))}
        for size in (below, above)
    )
    found = larger[fault.kind]
    assert found.severity == fault.severity
    assert size_of(found) == pytest.approx(fault.size(above), rel=fault.within)
    assert fault.place is None or (found.from_s, found.to_s) == pytest.approx(fault.place, abs=1e-9)
    assert found.effect.startswith(fault.effect)
    assert fault.remedy in found.remedy
    if fault.kind in smaller:
        assert SEVERITIES.index(smaller[fault.kind].severity) > SEVERITIES.index(fault.severity)


@pytest.mark.parametrize("share", [-1.0, 0.5, 2.0])
def test_a_drift_of_the_force_is_a_share_of_its_range_from_the_first_cycle_to_the_last(share):
    drifts = drift_by("force")
    run = recording(noise=0.0, changed=lambda fields: drifts(fields, share * SPAN_N))
    (found,) = (each for each in diagnose(run) if each.kind == "force_drift")
    span = float(np.ptp(run.force[375:4875]))
    assert f"({percent(abs(size_of(found)) / span)} of its range)" in found.found


@pytest.mark.parametrize(
    ("command", "unit", "peak_N", "told"),
    [(1.0, "A", 299.0, True), (-1.0, "A", 299.0, True), (1.0, "A", 301.0, False), (0.99, "A", 299.0, False),
     (5.0, "V", 299.0, False), (5.0, "V", 0.1, True)],
)  # fmt: skip
def test_a_weak_damper_is_doubted_from_one_ampere_on(command, unit, peak_N, told):
    """Of volts nobody knows the current."""
    run = recording(noise=0.0)
    force = peak_N * run.force / (0.5 * np.ptp(run.force))
    run = replace(run, force=force, command=np.full(len(run), command), command_unit=unit)
    assert [each.channel for each in find_implausible_damper([run])] == ["force"] * told


@pytest.mark.parametrize(
    ("flat", "cycles", "alike", "told"),
    [
        (2, 9, False, False),  # two samples in a row are no plateau,
        (3, 3, False, True),
        (3, 2, False, False),  # and six in all are too few
        (4, 2, False, True),
        (
            15,
            9,
            True,
            False,
        ),  # where every level is passed twice a cycle, the last one holds eight times as many
        (17, 9, True, True),
    ],
)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_plateau_is_clipped_where_it_holds_more_than_the_levels_beside_it(flat, cycles, alike, told, side):
    period = 400
    row = np.arange(period * cycles)
    folded = np.abs((row + 100 + 0.5 * (flat % 2 == 0)) % period - 200)
    grain = np.zeros(len(row)) if alike else 1e-6 * np.random.default_rng(1).uniform(size=len(row))
    force = side * np.minimum(folded + grain, 200.5 - 0.5 * flat)
    spoilt = Recording(
        name="run", command_unit="A", time=1e-3 * row, displacement=np.sin(1.234 * row) + 1e-3 * row,
        force=force, command=np.ones(len(row)),
    )  # fmt: skip
    at_top = np.flatnonzero(force == force[np.argmax(side * force)])
    found = [each for each in find_clipping(spoilt) if each.channel == "force"]
    assert len(at_top) == flat * cycles
    assert len(found) == told
    for each in found:
        assert each.size == pytest.approx(100.0 * flat / period)
        assert each.severity == ("fault" if flat > 4 else "warning")  # of 400 samples: above 1 %
        assert (each.from_s, each.to_s) == pytest.approx((1e-3 * at_top[0], 1e-3 * at_top[-1]))
        assert f"{'upper' if side > 0 else 'lower'} end" in each.found
        assert f"in {cycles} segments" in each.found


# ------------------------------------------------------------------------------------------ what is the same


class Twin(NamedTuple):
    """A change of a record that is the same test in other units."""

    changed: Callable[[Recording], Recording]
    factors: dict[str, float]  # of a finding's size, by its unit; places go with "s"
    begins_s: float = 0.0


def scaled(**gains):
    return lambda run: replace(
        run,
        **{role: getattr(run, role) * gain for role, gain in gains.items() if getattr(run, role) is not None},
    )


TWINS = {  # powers of two: not one digit is rounded otherwise
    "a force four times as large": Twin(scaled(force=4.0), {"N": 4.0}),
    "a motion of half the size": Twin(scaled(displacement=0.5, velocity=0.5), {"m": 0.5}),
    "twice as slow": Twin(scaled(time=2.0, velocity=0.5), {"s": 2.0, "ms": 2.0}),
    "a clock that began earlier": Twin(lambda run: replace(run, time=run.time + 16.0), {}, 16.0),
}  # fmt: skip
OF_ABSOLUTE_SIZE = {"small force", "small motion", "few samples out of range", "samples out of range"}


@pytest.mark.parametrize("twin", TWINS)
@pytest.mark.parametrize("of", sorted(BEGINS.keys() - OF_ABSOLUTE_SIZE))
def test_the_same_test_in_other_units_has_the_same_findings(of, twin):
    """Whatever is judged is judged against the run itself: by its stroke, its range, its rate, its noise."""
    fault, same = BEGINS[of], TWINS[twin]
    sound = recording(noise=0.0, changed=lambda fields: fault.spoil(fields, 1.05 * fault.least))
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


# ------------------------------------------------------------------------------------------ how exactly


def test_white_noise_is_known_from_sixteen_samples_on():
    noise = np.random.default_rng(2).standard_normal(16)
    fourth = np.abs([noise[k : k + 5] @ [1.0, -4.0, 6.0, -4.0, 1.0] for k in range(12)])
    assert white_noise(noise) == pytest.approx(1.4826 * float(np.median(fourth)) / 70.0**0.5)
    assert white_noise(noise[:15]) == 0.0


@pytest.mark.parametrize("gain", [-2.0, -0.5, 0.5, 2.0])
def test_a_velocity_of_another_scale_is_told_with_its_factor(gain):
    clean = recording(noise=0.0)
    rate = np.gradient(clean.displacement, clean.time)
    (finding,) = diagnose(replace(clean, velocity=gain * rate))
    turned = "its sign is turned, and " if gain < 0.0 else ""
    assert finding.found.endswith(f"of its rms: {turned}it is {abs(gain):.3g} times as large")
    assert finding.size == pytest.approx(100.0 * abs(gain - 1.0), rel=1e-3)


@pytest.mark.parametrize(("irregular", "known"), [(0, True), (2, True), (3, False)])
@pytest.mark.parametrize("factor", [1.5, 2.5, 4.0, 0.3])
def test_eight_in_ten_distances_between_levels_make_a_grid(irregular, known, factor):
    """A regular one is the usual distance, twice or three times it, to a tenth."""
    steps = [1.0, 2.0, 3.0, 1.05, 1.0, 2.95, 1.0, 1.0, 1.0, 1.0]
    steps[2 : 2 + irregular] = [factor] * irregular
    levels = np.cumsum([0.0, *steps])
    assert resolution_of(np.repeat(levels, 3)) == pytest.approx(1.0 if known else 0.0)
    assert resolution_of(levels) == 0.0  # no level is there twice


@pytest.mark.parametrize(("others", "told"), [(3, True), (4, False)])
def test_what_stands_still_no_longer_than_usual_is_not_stuck(others, told):
    """Usual is what five segments of equal values have, or more."""
    rows = np.arange(600)
    force = np.sin(0.7 * rows) + 0.01 * rows
    for k in range(others):
        force[50 * k + 20 : 50 * k + 27] = force[50 * k + 20]
    force[400:428] = force[400]
    spoilt = Recording(
        name="run", command_unit="A", time=rows / 100.0, displacement=np.sin(0.05 * rows),
        force=force, command=np.ones(600),
    )  # fmt: skip
    found = [each for each in find_stuck_sensors(spoilt) if each.channel == "force"]
    assert len(found) == told
    for each in found:
        assert (each.from_s, each.to_s, each.size) == pytest.approx((4.0, 4.27, 0.27))


@pytest.mark.parametrize(("share", "rough"), [(0.015, False), (0.025, True)])
@pytest.mark.parametrize("gives", [True, False])
def test_a_rough_displacement_whose_loop_gives_power_is_exchanged(share, rough, gives):
    """Rough is what has more than 2 % of its power far above the force's frequency."""
    phase = 2.0 * np.pi * np.arange(1000) / 250.0
    x = np.sin(phase) + np.sqrt(share / (1.0 - share)) * np.sin(20.0 * phase)
    force = (-1.0 if gives else 1.0) * np.cos(phase)
    odd = Recording(
        name="run", command_unit="A", time=np.arange(1000) / 100.0, displacement=x, force=force,
        command=np.ones(1000),
    )  # fmt: skip
    assert looks_swapped(odd) == (rough and gives)


@pytest.mark.parametrize("ratio", [1.2, 1.0 / 1.2])
def test_two_dampers_are_apart_by_the_ratio_of_their_force_ranges(ratio):
    """Ranges without the outer per cents; the pair that is furthest apart is told."""
    rng = np.random.default_rng(1)
    first = replace(recording(), name="first")
    other, third = (
        replace(first, name=name, force=gain * first.force + 20.0 * rng.standard_normal(len(first)))
        for name, gain in (("other", 1.0 / ratio), ("third", 1.0))
    )
    ranges = {
        each.name: np.subtract(*np.quantile(each.force, (0.99, 0.01))) for each in (first, other, third)
    }
    (finding,) = (each for each in compare([first, third, other]) if each.kind == "two_dampers")
    apart = {name: 100.0 * abs(ranges[name] / ranges["other"] - 1.0) for name in ("first", "third")}
    assert finding.run == max(apart, key=lambda name: apart[name])
    assert finding.size == pytest.approx(apart[finding.run], rel=1e-6)


def test_a_delay_is_known_to_a_hundredth_of_a_sample_wherever_it_is():
    """Up to a quarter of the period: the correlation of two sines has one top."""
    path = prepare_run(make_run(SINE, noise=0.0))
    shifted = SINE.velocity(path.run.time - 0.03127)
    found = estimate_lag(replace(path, force=np.asarray(shifted)), 1.0 / SINE.frequency)
    assert found == pytest.approx(0.03127, abs=1e-5)


# ------------------------------------------------------------------------------------------ how few samples


def of_few(samples, **changed):
    """Return the first samples of a run; ``changed`` are whole channels."""
    full = {"time": np.arange(200) / 100.0, "displacement": 0.01 * np.sin(np.arange(200) / 8.0),
            "force": 1e3 * np.cos(np.arange(200) / 8.0), "command": np.ones(200)}  # fmt: skip
    fields: Any = {name: np.array(changed.get(name, values))[:samples] for name, values in full.items()}
    return Recording(name="run", command_unit="A", **fields)


STEP_BACK = np.array([0.0, -1.0, *np.arange(198.0)])
SPIKE = np.where(np.arange(200) == 1, 1e5, 1e3 * np.cos(np.arange(200) / 8.0))


@pytest.mark.parametrize(
    ("find", "changed", "least"),
    [
        (find_time_faults, {"time": STEP_BACK}, 2),
        (find_missing_numbers, {"force": np.full(200, np.nan)}, 1),
        (find_spikes, {"force": SPIKE}, 100),  # of which it is one in a hundred
    ],
)
def test_a_finding_begins_with_the_samples_that_show_it(find, changed, least):
    assert list(find(of_few(least - 1, **changed))) == []
    (finding,) = find(of_few(least, **changed))
    assert finding.kind


@pytest.mark.parametrize(("samples", "told"), [(15, False), (16, True)])
def test_exchanged_channels_of_a_refused_run_are_known_from_sixteen_samples_on(samples, told):
    phase = np.arange(16) * 2.0 * np.pi / 15.0
    odd = Recording(
        name="run", command_unit="A", time=np.arange(samples) / 100.0, command=np.ones(samples),
        displacement=1e4 * np.sign(np.sin(phase + 0.1))[:samples], force=-1e-2 * np.cos(phase)[:samples],
    )  # fmt: skip
    assert looks_swapped(odd)
    (finding,) = (each for each in diagnose(odd) if each.kind == "refused" or each.severity == "fault")
    assert ("exchanged" in finding.remedy) == (told and finding.kind == "refused")


@pytest.mark.parametrize("time", [[0.0, 1.0, 2.0], [0.0, 1.0, 1.0, 2.0], [0.0, 1.0, 0.5, 0.25]])
def test_places_where_time_does_not_go_on_are_counted_from_the_sample_before(time):
    still = [k for k in range(len(time) - 1) if time[k + 1] <= time[k]]
    rest = np.zeros(len(time))
    run = Recording(
        name="run", time=np.array(time), displacement=rest, force=rest, command=rest, command_unit="A"
    )
    found = list(find_time_faults(run))
    assert len(found) == bool(still)
    for each in found:
        assert (each.size, each.from_s, each.to_s) == (len(still), time[still[0]], time[still[-1]])
        goes = "stands still" if all(time[k + 1] == time[k] for k in still) else "goes back"
        assert f"time {goes} at {len(still)} places, the first after sample {still[0]}" in each.found
