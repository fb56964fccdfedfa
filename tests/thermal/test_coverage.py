"""For random dampers, 90 % intervals of heating time and heat sink gain have a coverage of 85 to 95 %.

``python -m tests.thermal.test_coverage 40 5`` prints both coverages for 40 dampers with 5 perturbations each.
The dampers were not used to choose constants because their seeds are odd. The reference time is computed by
the reduced model of a damper with perturbed power, capacity, losses, and conduction of fluid and coil.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.excitation import Sine
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty, segment_of, stroke_of
from mrdamper.thermal.estimation.interval import predict_interval
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.limits import first_time
from mrdamper.thermal.model.finite_element import build_field, discretise
from mrdamper.thermal.model.heat_equation import simulate_field
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.surfaces import fin_uncertainty
from mrdamper.thermal.sinks.design import HeatedDamper
from mrdamper.thermal.sinks.effects import gain_band
from mrdamper.thermal.temperature_rise import simulate_rise
from tests.thermal.bodies import HALF_HOUR_S, HeatedBody, draw_body, odd_bodies

_REACHED = 0.7  # The unperturbed damper reaches the limit after this fraction of the load
_90 = 1.645  # Half width of a 90 % interval of the normal distribution, divided by the standard deviation


def _times(factor: float, load: Load) -> Callable[[FloatArray], FloatArray]:
    """Return the power of a load multiplied by a factor."""
    return lambda kelvin: np.asarray(factor * load.power(kelvin))


def off_its_drawing(body: HeatedBody, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return time [s] and hottest gap temperature [K] of a damper with perturbed parameters."""

    def factor(spread: float) -> float:
        return math.exp(spread * rng.standard_normal())

    whole = build_field(body.drawing)
    loss, capacity, fluid, coil = factor(0.25), factor(0.10), factor(0.30), factor(0.30)
    conducts = {"gap": fluid, "chamber": fluid, "coil": coil}
    regions = tuple(
        replace(
            each,
            volumetric_heat=capacity * each.volumetric_heat,
            conductivity_r=conducts.get(each.role, 1.0) * each.conductivity_r,
            conductivity_z=conducts.get(each.role, 1.0) * each.conductivity_z,
        )
        for each in whole.section.regions
    )
    surfaces = tuple(
        replace(each, emissivity=loss * each.emissivity, mount=loss * each.mount)
        for each in whole.section.surfaces
    )
    section = replace(whole.section, regions=regions, surfaces=surfaces, films=loss * whole.section.films)
    model = reduce_field(discretise(section, whole.mesh))
    load = replace(body.load, power=_times(factor(0.10), body.load), duration=2.0 * HALF_HOUR_S)
    course = simulate_field(model.equation, [load])
    return course.time, course.hottest("gap")


def hold_times(seed: int, draws: int) -> list[bool]:
    """Return, for each perturbed damper, whether its time to the fluid limit is inside the interval."""
    body, rng = draw_body(seed), np.random.default_rng(5000 + seed)
    drawing = body.drawing
    kelvin = np.linspace(233.15, 473.15, 40)
    work = LoopWork(kelvin, body.load.power(kelvin), np.ones(40))
    command = math.sqrt(body.load.coil_W / drawing.coil.resistance)
    motion = Sine(drawing.stroke.amplitude, drawing.stroke.frequency)
    duty = Duty((segment_of(motion, command, 2.0 * HALF_HOUR_S),), "A", "drawn")
    body = replace(body, drawing=replace(drawing, stroke=stroke_of(duty)))
    plain = simulate_rise([work], drawing, duty, stop_at_limit=False)
    limit = float(np.interp(_REACHED * HALF_HOUR_S, plain.time, plain.hot["gap"]))
    filling = replace(drawing.filling, valid_K=(drawing.filling.valid_K[0], limit))
    limited = replace(drawing, filling=filling)
    rise = simulate_rise([work], limited, duty, stop_at_limit=False)
    told = predict_interval([work], limited, duty, rise).to_limit
    held = []
    for _ in range(draws):
        time, hottest = off_its_drawing(body, rng)
        reached = first_time(time, hottest, limit)
        held.append(told.low_s <= (math.inf if reached is None else reached) <= told.high_s)
    return held


def another_sink(drawing: DamperDrawing, sink: HeatSink) -> HeatSink:
    """Return a heat sink with 1.5 times the number of fins, which are thinner and 10 % wider."""
    fins = max(round(1.5 * sink.fins), sink.fins + 1)
    span = max(sink.span, 0.3 * drawing.body.length)
    return replace(sink, fins=fins, thickness=1e-3, pitch=(span - 1e-3) / (fins - 1), width=1.1 * sink.width)


def hold_gains(seed: int, draws: int) -> list[bool]:
    """Return, for each random damper with fins, whether the gain of a better sink is inside its interval."""
    body, rng = draw_body(seed), np.random.default_rng(7000 + seed)
    drawing, sink = body.drawing, body.drawing.sink
    if sink is None or sink.fins < 2:
        return []
    best = another_sink(drawing, sink)
    damper = HeatedDamper(drawing, (body.load,))
    gain = damper.evaluate(sink).fluid - damper.evaluate(best).fluid
    band = gain_band(damper, sink, best, gain)
    film, narrower = math.log1p(fin_uncertainty(drawing.with_sink(best))), math.log(best.gap / sink.gap)
    held = []
    for _ in range(draws):
        of_fins, of_body, of_power, by_gap = rng.standard_normal(4) / _90
        power = 1.0 + 0.165 * of_power
        load = replace(body.load, power=_times(power, body.load), coil_W=power * body.load.coil_W)
        own = replace(drawing.calibration, film=math.exp(math.log1p(0.15) * of_body))
        truth = HeatedDamper(replace(drawing, calibration=own), (load,))
        fins = [
            replace(each, film_multiplier=each.film_multiplier * math.exp(film * of_fins + more))
            for each, more in ((sink, 0.0), (best, 0.12 * by_gap * abs(narrower)))
        ]
        found = truth.evaluate(fins[0]).fluid - truth.evaluate(fins[1]).fluid
        held.append(band.low <= found <= band.high)
    return held


@pytest.mark.release
def test_heating_intervals_cover_90_percent():
    """The coverage is 85 to 95 %, with a tolerance of two standard errors.

    There are about 240 samples of the time to a limit and about 240 of the gain of a heat sink.
    """
    times = [each for seed in odd_bodies(40) for each in hold_times(seed, 6)]
    gains = [each for seed in odd_bodies(20) for each in hold_gains(seed, 20)]
    for held in (times, gains):
        spread = 2.0 * math.sqrt(0.9 * 0.1 / len(held))
        assert 0.85 - spread <= np.mean(held) <= 0.95 + spread


if __name__ == "__main__":
    bodies, count = map(int, sys.argv[1:])
    for name, hold in (("time to the limit", hold_times), ("gain of a sink", hold_gains)):
        found = [each for seed in odd_bodies(bodies) for each in hold(seed, count)]
        print(f"{name}: holds in {100.0 * np.mean(found):.1f} % of {len(found)}", flush=True)
