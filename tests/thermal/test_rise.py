"""A card and a load cycle give the dissipated power. The power gives the temperature rise."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.excitation import Harmonics, Sine
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Arrhenius, Linear
from mrdamper.thermal.dissipation import LoopWork, tabulate_work
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import Duty, read_duty, segment_of, stroke_of
from mrdamper.thermal.temperature_rise import loads_of, simulate_rise
from tests.oracles.closed_form import heat_field
from tests.support.heated import predict_rise

DRAWING = read_drawing(Path(__file__).parents[2] / "examples" / "paper_damper.toml")
BARE = DRAWING.with_sink(None)


def dry_and_viscous(*, dry: float = 0.0, viscous: float = 0.0, **changed) -> Damper:
    coefficients: dict[str, ParameterLaw] = {
        "yield_force": Constant(dry),
        "yield_velocity": Constant(1e-6),
        "viscosity": Constant(viscous),
    }
    return Damper(LAWS["bingham"], {**coefficients, **changed})


def temperature_dependent() -> Damper:
    return dry_and_viscous(
        yield_force=TemperatureDependent(Polynomial((60.0, 500.0)), Linear(1.67e-3)),
        viscosity=TemperatureDependent(Constant(2400.0), Arrhenius(1435.5)),
    )


# --------------------------------------------------------------------------------------------- load cycles


def test_load_cycle_table_has_segment_per_row(tmp_path):
    path = tmp_path / "duty.csv"
    path.write_text(
        "time_s,amplitude_mm,frequency_Hz,current_A\n0,15,1,2\n600,0,0,0\n900,5,2,1\n1200,5,2,1\n"
    )
    duty = read_duty(path)
    assert [segment.duration for segment in duty.segments] == [600.0, 300.0, 300.0]
    assert [segment.command for segment in duty.segments] == [2.0, 0.0, 1.0]
    assert duty.segments[1].path is None
    rise = predict_rise(temperature_dependent(), BARE, duty)
    at = [rise.fluid_at(seconds) for seconds in (0.0, 600.0, 900.0, 1200.0)]
    assert at[1] > at[0]
    assert at[2] < at[1]
    assert at[3] > at[2]
    assert rise.energy_closure <= 1e-9


def test_equivalent_stroke_displaces_same_fluid_volume():
    """The equivalent sine displaces the mean volume per time. The amplitude is weighted by this volume."""
    sines = [(0.015, 1.0, 600.0), (0.004, 5.0, 300.0)]
    segments = [segment_of(Sine(size, hertz), 1.0, seconds) for size, hertz, seconds in sines]
    rest = replace(segments[0], path=None, duration=300.0)
    found = stroke_of(Duty((*segments, rest), "A", ""))
    moved = sum(size * hertz * seconds for size, hertz, seconds in sines)
    assert found.amplitude * found.frequency == pytest.approx(moved / 1200.0, rel=1e-3)
    weighted = sum(size**2 * hertz * seconds for size, hertz, seconds in sines) / moved
    assert found.amplitude == pytest.approx(weighted, rel=1e-3)
    still = stroke_of(Duty((rest,), "A", ""))
    assert (still.amplitude, still.frequency) == (0.0, 0.0)


def test_measured_sine_heats_like_ideal_sine(tmp_path):
    path, seconds = tmp_path / "motion.csv", np.arange(0.0, 120.0 + 1e-9, 0.01)
    rows = [f"{t:.2f},{15.0 * math.sin(2.0 * math.pi * t):.6f},2" for t in seconds]
    path.write_text("\n".join(["time_s,displacement_mm,current_A", *rows]))
    measured = predict_rise(temperature_dependent(), BARE, str(path))
    sine = predict_rise(temperature_dependent(), BARE, "sine:15mm:1Hz:2A:120s")
    gained = measured.fluid[-1] - measured.fluid[0]
    assert gained == pytest.approx(sine.fluid[-1] - sine.fluid[0], rel=2e-3)


# ------------------------------------------------------------------------------------------- dissipated power


def test_dry_friction_power_matches_formula():
    """A friction force F dissipates 4 A F in each cycle of amplitude A."""
    work = tabulate_work(dry_and_viscous(dry=1000.0), segment_of(Sine(0.015, 1.0), 2.0, 60.0))
    assert work.constant
    assert work.power[0] == pytest.approx(4.0 * 1000.0 * 0.015, rel=1e-3)
    assert work.peak[0] == pytest.approx(1000.0, rel=1e-6)


def test_dashpot_power_matches_formula():
    """The mean power of a sine is c v^2 / 2 with the peak velocity v."""
    speed = 2.0 * math.pi * 2.0 * 0.005
    work = tabulate_work(dry_and_viscous(viscous=3000.0), segment_of(Sine(0.005, 2.0), 0.0, 60.0))
    assert work.power[0] == pytest.approx(0.5 * 3000.0 * speed**2, rel=1e-5)
    assert work.peak[0] == pytest.approx(3000.0 * speed, rel=1e-6)


def test_spring_dissipates_no_power():
    work = tabulate_work(dry_and_viscous(stiffness=Constant(1e4)), segment_of(Sine(0.015, 1.0), 0.0, 60.0))
    assert work.power[0] == pytest.approx(0.0, abs=1e-3)


def test_power_of_aperiodic_motion_is_averaged():
    """The mean power of two sines is the sum of the powers of both sines.

    The tolerance is about the error of an averaging time that is half a beat too long.
    """
    tones = Harmonics((0.003, 0.002), (1.0, 1.5), (0.0, 1.0))
    work = tabulate_work(dry_and_viscous(viscous=3000.0), segment_of(tones, 0.0, 600.0))
    exact = sum(0.5 * 3000.0 * (2.0 * math.pi * f * a) ** 2 for a, f in ((0.003, 1.0), (0.002, 1.5)))
    assert work.power[0] == pytest.approx(exact, rel=0.01)


def test_interpolated_power_agrees_with_direct_calculation():
    damper, segment = temperature_dependent(), segment_of(Sine(0.015, 1.0), 2.0, 60.0)
    table = tabulate_work(damper, segment)
    between = np.array([297.0, 331.3, 388.8])
    own = tabulate_work(damper, segment, temperature_K=between)
    assert table.power_at(between) == pytest.approx(own.power, rel=2e-4)
    assert table.peak_at(between) == pytest.approx(own.peak, rel=2e-4)
    assert (np.diff(table.power_at(np.linspace(280.0, 420.0, 200))) < 0.0).all()


# ------------------------------------------------------------------------------------------- temperature rise


def test_force_stays_constant_without_temperature_model():
    rise = predict_rise(dry_and_viscous(dry=1000.0), BARE)
    assert "the card does not depend on temperature: its force is held constant" in rise.notes
    assert rise.force_loss_percent is None  # The loss of force is unknown.
    assert rise.mechanical_W == pytest.approx(60.0, rel=1e-3)


def test_force_falls_with_fluid_temperature():
    damper = temperature_dependent()
    rise = predict_rise(damper, BARE)
    at = np.array([293.15, float(rise.fluid[-1])])
    own = tabulate_work(damper, read_duty("sine:15mm:1Hz:2A:1800s").segments[0], temperature_K=at)
    assert rise.force_loss_percent == pytest.approx(100.0 * (1.0 - own.peak[1] / own.peak[0]), abs=0.02)
    assert rise.peak_force_N[0] == pytest.approx(own.peak[0], rel=1e-4)


def test_released_heat_is_sum_over_heat_paths():
    rise = predict_rise(temperature_dependent(), DRAWING)
    account = rise.energy_J
    paths = sum(account[path] for path in rise.paths_W)
    assert paths == pytest.approx(account["out"], rel=1e-12)
    assert account["mechanical"] + account["coil"] == pytest.approx(
        account["out"] + account["stored"], rel=1e-9
    )
    assert set(rise.paths_W) == {
        "body convection", "body radiation", "fin convection", "fin radiation", "mount",
    }  # fmt: skip
    assert "annular fins" in rise.correlations["fins"]


def test_coil_heat_follows_coil_resistance():
    rise = predict_rise(temperature_dependent(), BARE)
    resistance = 4.2 * (1.0 + 0.00393 * (rise.coil - 293.15))
    assert rise.coil_W == pytest.approx(4.0 * resistance, rel=1e-9)


def test_heating_stops_at_fluid_limit():
    hot = dry_and_viscous(dry=2000.0)
    rise = predict_rise(hot, BARE)
    assert rise.fluid_degC[-1] == pytest.approx(130.0, abs=1e-6)
    assert rise.time_to_limit_s == pytest.approx(np.interp(rise.limit_K, rise.hot["gap"], rise.time), abs=1.0)
    assert rise.time_to_limit_s < rise.time[-1]
    assert any("reaches its limit, 130 degC, after" in note for note in rise.notes)
    on = predict_rise(hot, BARE, stop_at_limit=False)
    assert on.time[-1] == pytest.approx(1800.0)
    assert on.time_to_limit_s == pytest.approx(rise.time_to_limit_s, abs=0.1)
    with pytest.raises(InputError, match=r"no temperature at 1800 s; the curve ends at"):
        rise.fluid_at(1800.0)


def test_card_in_volts_requires_driver_gain():
    volts = replace(temperature_dependent(), command_unit="V")
    with pytest.raises(InputError, match=r"its command is in A, the card's in V"):
        predict_rise(volts, BARE)
    with pytest.raises(InputError, match=r"expected coil.A_per_V"):
        predict_rise(volts, BARE, "sine:15mm:1Hz:2V:600s")
    driven = replace(BARE, coil=replace(BARE.coil, amperes_per_volt=0.5))
    rise = predict_rise(volts, driven, "sine:15mm:1Hz:2V:600s")
    assert rise.coil_W[0] == pytest.approx(4.2)


def test_reduced_model_heats_like_finite_elements():
    """The difference is at most 10 mK. Heat paths are the same as in the network, and energy is conserved."""
    duty = read_duty("sine:15mm:1Hz:2A:600s")
    works = [tabulate_work(temperature_dependent(), segment) for segment in duty.segments]
    rise, zones = (simulate_rise(works, DRAWING, duty, model=model) for model in ("reduced", "network"))
    _, course = heat_field(DRAWING, loads_of(works, DRAWING, duty))
    assert rise.fluid == pytest.approx(np.interp(rise.time, course.time, course.fluid), abs=0.01)
    assert rise.fluid != pytest.approx(zones.fluid, abs=0.01)
    assert rise.fluid[-1] == pytest.approx(zones.fluid[-1], abs=2.0)
    assert rise.paths_W.keys() == zones.paths_W.keys()
    assert rise.energy_J.keys() == zones.energy_J.keys()
    assert rise.energy_closure < 1e-9


# ----------------------------------------------------------------------------------- segments of a load cycle


def test_peak_force_is_reported_for_each_segment():
    """The two moving segments have different forces, which fall with temperature. The pause has no force."""
    kelvin = np.array([293.15, 393.15])
    works = [
        LoopWork(kelvin, np.full(2, 60.0), np.array([1000.0, 800.0])),
        LoopWork(kelvin, np.zeros(2), np.zeros(2)),
        LoopWork(kelvin, np.full(2, 60.0), np.array([500.0, 300.0])),
    ]
    moving = segment_of(Sine(0.01, 1.0), 1.0, 60.0)
    rest = replace(moving, path=None, command=0.0)
    duty = Duty((moving, rest, moving), "A", "")
    rise = simulate_rise(works, BARE, duty, model="network")
    for k, at in enumerate(rise.time):
        # A time at the end of a segment belongs to the next segment.
        which = 0 if at < 60.0 - 1e-6 else 1 if at < 120.0 - 1e-6 else 2
        force = float(works[which].peak_at(rise.fluid[k]))
        assert np.isnan(rise.peak_force_N[k]) if which == 1 else rise.peak_force_N[k] == pytest.approx(force)
    fall = 1.0 - float(works[2].peak_at(rise.fluid[-1])) / 500.0
    assert rise.force_loss_percent == pytest.approx(100.0 * fall)
