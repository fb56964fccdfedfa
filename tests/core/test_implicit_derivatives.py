"""The hand-written C derivatives of the implicit laws agree with difference quotients of the force."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.excitation import Harmonics, drive
from mrdamper.models.laws import LAWS

STATES = 1000
SAMPLES = 12
STEP_RATIO = 1e-5  # Step of the difference quotients, divided by the coefficient

# Limits of random coefficients. The logarithm of a positive coefficient is distributed uniformly.
VALVE = {
    **{
        "stiffness": (0.0, 2e3),
        "offset": (-100.0, 100.0),
        "yield_force": (20.0, 2e3),
        "thinning": (0.1, 8.0),
    },
    **{"thinning_exponent": (0.2, 1.0), "yield_velocity": (5e-4, 3e-2), "position_gain": (-5.0, 5.0)},
    **{"gap_stiffness": (1e5, 3e7), "gap": (1e-5, 1e-3), "gap_corner": (1e-5, 2e-4)},
    **{"leak_damping": (300.0, 1e5), "leak_exponent": (0.5, 1.2)},
}
CHAIN = {
    **VALVE,
    **{"thinning_force": (10.0, 800.0), "reference_speed": (0.1, 1.0), "orifice": (10.0, 800.0)},
    **{"asymmetry": (-0.3, 0.3), "flow_asymmetry": (-0.3, 0.3), "position_curvature": (-20.0, 20.0)},
    **{"bristle_share": (0.1, 0.9), "bristle_stiffness": (1e5, 1e7), "bristle_spread": (0.2, 1.5)},
    **{"friction_force": (5.0, 100.0), "friction_stiffness": (1e5, 1e7), "static_excess": (0.1, 1.0)},
    **{"fade_velocity": (0.01, 0.2), "memory_force": (5.0, 100.0), "memory_stiffness": (1e4, 1e6)},
    **{"gas_force": (50.0, 500.0), "gas_length": (0.1, 0.3), "play": (1e-5, 4e-4), "creep": (1e-7, 1e-5)},
    **{"knee": (0.1, 1.0), "cavity_length": (0.03, 0.2), "cavity_force": (200.0, 2e3)},
    **{"bubble_length": (1e-4, 1e-2), "bypass": (1e-5, 1e-3)},
}
# These coefficients are zero in half of the states, which disables their terms.
OPTIONAL = (
    *("thinning", "thinning_force", "orifice", "asymmetry", "flow_asymmetry", "position_curvature"),
    *("bristle_share", "bristle_spread", "friction_force", "static_excess", "memory_force", "gas_force"),
    *("play", "creep", "knee", "cavity_length", "bypass"),
)


def random_coefficients(name: str, draw: np.random.Generator) -> FloatArray:
    """Return random coefficients of shape (STATES, m). In a third of the states, the dashpot is linear."""
    table = np.tile([c.default or 0.0 for c in LAWS[name].coefficients], (STATES, 1))
    for key, (lower, upper) in (CHAIN if name == "chain" else VALVE).items():
        column = table[:, LAWS[name].names.index(key)]
        column[:] = draw.uniform(lower, upper, STATES)
        if lower > 0.0:
            column[:] = np.exp(draw.uniform(np.log(lower), np.log(upper), STATES))
        if key in OPTIONAL:
            column[draw.random(STATES) < 0.5] = 0.0
        if key == "leak_exponent":
            column[draw.random(STATES) < 1.0 / 3.0] = 1.0
    return table


def random_records(draw: np.random.Generator) -> list[core.Record]:
    """Return one short motion of four sines per state, at three sample rates."""
    records = []
    for state in range(STATES):
        rate_Hz = (500.0, 1000.0, 2000.0)[state % 3]
        frequencies_Hz = np.exp(draw.uniform(np.log(0.3), np.log(12.0), 4))
        sizes, phases = draw.uniform(5e-4, 1e-2, 4), draw.uniform(0.0, 2.0 * np.pi, 4)
        motion = Harmonics(tuple(sizes), tuple(frequencies_Hz), tuple(phases))
        records.append(
            core.open_record(drive(motion, duration=SAMPLES / rate_Hz, rate_Hz=rate_Hz, command=0.0))
        )
    return records


@pytest.mark.parametrize("name", ["series-valve", "chain"])
def test_implicit_derivatives_match_central_differences(name):
    """The derivatives at the last sample of 1,000 random runs agree within 3e-4."""
    draw, law = np.random.default_rng(0), LAWS[name].kernel or 0
    records, values = random_records(draw), random_coefficients(name, draw)
    ends, nothing = [record.samples - 1 for record in records], [np.zeros(r.samples) for r in records]
    size = np.array([np.abs(force).max() for force in core.forces(law, records, values)])

    def last_force(table: FloatArray) -> FloatArray:
        return np.array([force[-1] for force in core.forces(law, records, table)])

    places = [LAWS[name].names.index(key) for key in (CHAIN if name == "chain" else VALVE)]
    sums = core.gram_sums(law, records, nothing, ends, values[None], places)[0]
    derivatives = sums[:, :-1, -1] / -last_force(values)[:, None]
    for place, derivative in zip(places, derivatives.T, strict=True):
        step = np.zeros_like(values)
        step[:, place] = STEP_RATIO * values[:, place]
        change = (last_force(values + step) - last_force(values - step)) / (2.0 * STEP_RATIO)
        error = np.abs(derivative * values[:, place] - change) / (np.abs(change) + 0.01 * size)
        assert error.max() < 1e-3, LAWS[name].names[place]
