"""The power of the preset ``paper`` and a geometry file give the temperatures of the reference paper.

Some statements of the paper about the same run contradict each other. The tests document the contradictions.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.excitation import Sine
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.films.correlations import annular_fin_efficiency, radiation_film
from mrdamper.thermal.model.surfaces import fin_film, fin_radiation
from mrdamper.thermal.temperature_rise import Rise, simulate_rise
from mrdamper.virtual_rig.damper import PRESETS
from mrdamper.virtual_rig.plant import STEP_S, simulate

FINNED = read_drawing(Path(__file__).parents[2] / "examples" / "paper_damper.toml")
BARE = FINNED.with_sink(None)


def rig_work(motion: Sine, current: float = 2.0) -> LoopWork:
    """Return the power and the peak force of the virtual rig in the third cycle at each temperature."""
    cycle = round(motion.period / STEP_S)
    time = np.arange(3 * cycle + 1) * STEP_S
    x, v = motion.displacement(time), motion.velocity(time)
    at = np.sort(np.append(np.linspace(273.15, 423.15, 11), 293.15))
    power, peak = [], []
    for kelvin in at:
        force = simulate(PRESETS["paper"], x, v, current, kelvin - 273.15).force[2 * cycle :]
        power.append(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(x[2 * cycle :])) / motion.period)
        peak.append(np.abs(force).max())
    return LoopWork(at, np.array(power), np.array(peak))


@pytest.fixture(scope="module")
def work() -> LoopWork:
    return rig_work(Sine(15e-3, 1.0))


def rise(work: LoopWork, drawing: DamperDrawing, minutes: float) -> Rise:
    duty = read_duty(f"sine:15mm:1Hz:2A:{60.0 * minutes:g}s")
    return simulate_rise([work], drawing, duty, stop_at_limit=False)


def test_paper_damper_dissipates_seventy_watts(work):
    assert work.peak_at(293.15) == pytest.approx(1300.0, abs=1.0)
    assert work.power_at(293.15) == pytest.approx(73.4, abs=0.2)


def test_geometry_file_gives_temperatures_of_paper(work):
    bare, finned = rise(work, BARE, 35.0), rise(work, FINNED, 30.0)
    assert bare.fluid_at(1800.0) - 273.15 == pytest.approx(129.9, abs=0.5)
    assert bare.fluid_at(2100.0) - 273.15 == pytest.approx(140.0, abs=0.5)
    assert finned.fluid_at(1800.0) - 273.15 == pytest.approx(76.9, abs=0.5)
    assert max(bare.energy_closure, finned.energy_closure) <= 1e-9


def test_force_losses_agree_with_paper(work):
    assert rise(work, BARE, 30.0).force_loss_percent == pytest.approx(25.9, abs=0.3)
    assert rise(work, FINNED, 30.0).force_loss_percent == pytest.approx(15.7, abs=0.3)


def test_fluid_limit_is_reached_after_thirty_minutes(work):
    bare = rise(work, BARE, 35.0)
    assert np.interp(bare.limit_K, bare.fluid, bare.time) == pytest.approx(1803.0, abs=30.0)
    assert bare.time_to_limit_s == pytest.approx(1720.0, abs=30.0)


def test_paper_relates_cooling_to_temperature_rise(work):
    """The reduction of 48.23 % refers to the temperature rise above 20 degC.

    If the reduction referred to degC, the damper without fins would have 148.5 degC after 30 min. This
    contradicts the 140 degC after 35 min in the paper because the temperature increases with time.
    """
    bare, finned = (rise(work, drawing, 30.0).fluid_degC[-1] for drawing in (BARE, FINNED))
    assert 100.0 * (bare - finned) / (bare - 20.0) == pytest.approx(48.23, abs=0.5)
    assert 100.0 * (bare - finned) / bare < 42.0
    assert (np.diff(rise(work, BARE, 35.0).fluid) > 0.0).all()


def test_paper_temperatures_contradict_stated_amplitude(work):
    """At the stated 5 mm, even the damper without fins is cooler than the paper reports with fins."""
    small = rig_work(Sine(5e-3, 1.0))
    assert rise(small, BARE, 30.0).fluid_degC[-1] == pytest.approx(75.0, abs=1.0)
    assert rise(small, FINNED, 30.0).fluid_degC[-1] == pytest.approx(49.0, abs=1.0)


def test_outer_diameter_in_paper_is_radius(work):
    """The piston does not fit into a body of 23 mm diameter. A scaled damper would exceed 200 degC."""
    with pytest.raises(InputError, match=r"Is 23 mm the body's radius"):
        replace(BARE, body=replace(BARE.body, outer_diameter=0.023))
    small = replace(
        BARE,
        body=replace(BARE.body, outer_diameter=0.023, wall=0.0025, cap=0.0025),
        piston=replace(BARE.piston, diameter=0.017),
        rod=replace(BARE.rod, diameter=0.007),
        coil=replace(BARE.coil, depth=0.002),
    )
    assert rise(work, small, 30.0).fluid_degC[-1] > 200.0


@pytest.mark.parametrize(("width", "least"), [(0.018, 0.98), (0.023, 0.975), (0.028, 0.965), (0.033, 0.95)])
def test_fin_efficiency_does_not_explain_best_width(width, least):
    """The fin efficiency is above 95 % for all widths, so it cannot cause the optimum width of the paper."""
    sink = FINNED.sink
    assert sink is not None
    sink = replace(sink, width=width)
    drawing = FINNED.with_sink(sink)
    film = float(fin_film(drawing, 350.0) + radiation_film(fin_radiation(drawing)[0], 350.0, 293.15))
    efficiency = annular_fin_efficiency(
        film,
        0.023,
        sink.corrected_radius(0.046),
        sink.thickness,
        sink.material.conductivity,
    )
    assert least < float(efficiency) < 1.0


def test_still_air_cools_less_than_in_paper(work):
    """Without the fitted multiplier, the damper with five fins is 20 K hotter than in the paper."""
    sink = FINNED.sink
    assert sink is not None
    plain = rise(work, FINNED.with_sink(replace(sink, film_multiplier=1.0)), 30.0)
    assert plain.fluid_degC[-1] == pytest.approx(97.0, abs=1.5)


def test_slow_air_gives_fin_temperature_of_paper(work):
    sink = FINNED.sink
    assert sink is not None
    plain = FINNED.with_sink(replace(sink, film_multiplier=1.0))
    speeds = [replace(plain.surroundings, air_speed=speed) for speed in (0.5, 1.0)]
    at = [rise(work, replace(plain, surroundings=around), 30.0).fluid_degC[-1] for around in speeds]
    assert at[0] > 76.9 > at[1]
