"""Ambient, wind and altitude over time: the reduced model against the finite elements in the same weather."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import Duty, Segment, read_duty
from mrdamper.thermal.films.air import air_at
from mrdamper.thermal.model.surfaces import body_film
from mrdamper.thermal.temperature_rise import simulate_rise
from tests.support.tiers import one_by_day

FINNED = read_drawing("paper")
BARE = FINNED.with_sink(None)
WORK = LoopWork(np.array([293.15]), np.array([80.0]), np.array([1000.0]))


def weather(folder: Path, rows: list[str], columns: str = "ambient_degC,air_m_s") -> Duty:
    path = folder / "weather.csv"
    path.write_text(
        f"time_s,amplitude_mm,frequency_Hz,current_A,{columns}\n" + "\n".join(rows), encoding="utf-8"
    )
    return read_duty(path)


def ramp_and_gusts(folder: Path) -> Duty:
    """From -10 to 45 degC in 20 minutes, still air and 8 m/s in turns of five minutes."""
    times = range(0, 1500, 300)
    return weather(folder, [f"{t},15,1,2,{-10.0 + 55.0 * t / 1200.0},{8.0 * (t // 300 % 2)}" for t in times])


@pytest.mark.nightly
@pytest.mark.parametrize("drawing", one_by_day([BARE, FINNED]), ids=["bare", "fins"])
def test_the_reduced_model_follows_the_elements_through_ramps_and_gusts(tmp_path, drawing):
    """Within 50 mK all the way, the hottest point too, on one space for all of the weather."""
    duty = ramp_and_gusts(tmp_path)
    works = [WORK] * len(duty.segments)
    small, full = (
        simulate_rise(works, drawing, duty, model=model, stop_at_limit=False)
        for model in ("reduced", "elements")
    )
    assert np.abs(small.fluid - full.fluid).max() < 0.05
    assert np.abs(small.hot["gap"] - full.hot["gap"]).max() < 0.05
    assert small.energy_closure < 1e-9


def test_weather_that_stays_is_the_drawing_s(tmp_path):
    rows = [f"{t},15,1,2,30,3" for t in (0, 600, 1200)]
    there = replace(BARE, surroundings=replace(BARE.surroundings, ambient=303.15, air_speed=3.0))
    one = simulate_rise([WORK] * 2, BARE, weather(tmp_path, rows))
    other = simulate_rise([WORK], there, read_duty("sine:15mm:1Hz:2A:1200s"))
    assert one.fluid[-1] == pytest.approx(other.fluid[-1], abs=0.02)


def test_a_damper_at_rest_takes_on_one_weather_after_the_other():
    """Six hours at 30, 5, 45 and 30 degC again: within a tenth of a kelvin of each in turn."""
    degrees = (30.0, 5.0, 45.0, 30.0)
    segments = tuple(
        Segment(21600.0, None, 0, 0.0, (("ambient", t + 273.15), ("air_speed", wind)))
        for t, wind in zip(degrees, (3.0, 8.0, 5.0, 3.0), strict=True)
    )
    still = LoopWork(np.array([293.15]), np.array([0.0]), np.array([0.0]))
    course = simulate_rise([still] * 4, BARE, Duty(segments, "A", "weather"), longest_step=600.0)
    ends = [float(np.interp(21600.0 * (k + 1), course.time, course.fluid)) for k in range(4)]
    assert ends == pytest.approx([t + 273.15 for t in degrees], abs=0.1)


def test_thin_air_carries_less_away():
    """Half the density halves Re and quarters Ra: the film falls by less than the density does."""
    high = replace(BARE, surroundings=replace(BARE.surroundings, altitude=5500.0))
    share = float(body_film(high, 350.0) / body_film(BARE, 350.0))
    density = float(air_at(320.0).kinematic_viscosity / air_at(320.0, 5500.0).kinematic_viscosity)
    assert density == pytest.approx(0.498, abs=0.002)  # the standard atmosphere's pressure there
    assert density < share < 1.0


@pytest.mark.parametrize(
    ("columns", "row", "message"),
    [
        ("air", "30", r"found column 'air'|column 'air'.*expected air_m_s.*km/h"),
        ("air_m_s", "90", r"air_m_s is 90; expected 0 to 50 m/s"),
        ("ambient_degC", "300", r"ambient_degC is 300; expected -50 to 100 degC"),
        ("altitude_m", "-900", r"altitude_m is -900; expected -500 to 9000 m"),
    ],
)
def test_weather_that_cannot_be_is_refused_with_the_remedy(tmp_path, columns, row, message):
    with pytest.raises(InputError, match=message):
        weather(tmp_path, [f"{t},15,1,2,{row}" for t in (0, 600)], columns)


def test_a_network_does_not_take_weather(tmp_path):
    duty = ramp_and_gusts(tmp_path)
    with pytest.raises(InputError, match="expected the model reduced or elements"):
        simulate_rise([WORK] * len(duty.segments), BARE, duty, model="network")
