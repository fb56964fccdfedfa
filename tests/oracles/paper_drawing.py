"""Solve for three parameters of the paper's geometry (``python -m tests.oracles.paper_drawing``).

The geometry file of the paper contains the printed values. Run the program again if a correlation or the
thermal model changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import root

from mrdamper.arrays import FloatArray
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.temperature_rise import simulate_rise

__all__ = ["CLAIMED_DEGC", "solve_paper_drawing"]

# Temperatures that the paper states without fins after 30 and 35 min, and with five fins after 30 min.
CLAIMED_DEGC = (129.9, 140.0, 76.9)


def solve_paper_drawing(start: DamperDrawing, work: LoopWork) -> tuple[float, float, float]:
    """Return heat capacity and factors of convection and fins that give the temperatures ``CLAIMED_DEGC``."""
    sink = start.sink
    assert sink is not None
    duty = read_duty("sine:15mm:1Hz:2A:2100s")

    def misses(numbers: FloatArray) -> FloatArray:
        capacity, film, multiplier = (float(each) for each in numbers)
        own = replace(start.calibration, heat_capacity=capacity, film=film)
        changed = replace(start, calibration=own, sink=replace(sink, film_multiplier=multiplier))
        bare, finned = (
            simulate_rise([work], each, duty, stop_at_limit=False)
            for each in (changed.with_sink(None), changed)
        )
        found = (bare.fluid_at(1800.0), bare.fluid_at(2100.0), finned.fluid_at(1800.0))
        return np.array(found) - ZERO_CELSIUS_K - CLAIMED_DEGC

    first = [start.calibration.heat_capacity, start.calibration.film, sink.film_multiplier]
    solved = root(misses, first, options={"eps": 1e-4, "xtol": 1e-5})
    return tuple(float(each) for each in solved.x)  # type: ignore[return-value]  # three, as first


if __name__ == "__main__":
    from mrdamper.excitation import Sine
    from mrdamper.thermal.drawing_file import read_drawing
    from tests.thermal.test_paper import rig_work

    print(solve_paper_drawing(read_drawing("paper"), rig_work(Sine(15e-3, 1.0))))
