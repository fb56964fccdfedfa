"""The heat sink search finds the Pareto front within limits and a better sink than the paper has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.thermal.drawing_file import read_drawing, read_sink
from mrdamper.thermal.heatsink import Manufacture
from mrdamper.thermal.model.finite_element import build_field
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import simulate_network
from mrdamper.thermal.sinks.design import (
    HeatedDamper,
    SinkDesign,
    confirm,
    front_of,
    limits_of,
    search_grid,
)
from mrdamper.thermal.sinks.effects import gain_band
from tests.oracles.freefem import run_freefem, write_freefem

EXAMPLE = Path(__file__).parents[2] / "examples" / "paper_damper.toml"
DRAWING, SINK = read_drawing(EXAMPLE), read_sink(EXAMPLE)

# Power [W] of the damper in the reference paper at three temperatures [K], as in test_efficiency.py
KELVIN, WATTS = np.array([293.15, 353.15, 413.15]), np.array([73.4, 62.0, 53.9])
DAMPER = HeatedDamper(DRAWING, (Load(1800.0, lambda kelvin: np.interp(kelvin, KELVIN, WATTS), 16.8),))
PAPER_LIMITS = limits_of(DRAWING, span=0.084)


@pytest.fixture(scope="module")
def found():
    return search_grid(DAMPER, PAPER_LIMITS)


@pytest.fixture(scope="module")
def reference():
    return DAMPER.evaluate(SINK)


def made(mass: float, fluid: float) -> SinkDesign:
    return SinkDesign(None, mass, fluid, fluid, fluid)


designs = st.lists(
    st.builds(made, st.floats(0.0, 1.0), st.floats(300.0, 400.0)), min_size=1, max_size=40
)  # fmt: skip


@given(tried=designs)
def test_no_design_is_better_than_pareto_front(tried):
    front = front_of(tried)
    for member in front:
        assert not any(
            each.mass <= member.mass and each.fluid <= member.fluid and each != member for each in tried
        )
    for each in tried:
        assert any(member.mass <= each.mass and member.fluid <= each.fluid for member in front)


@pytest.mark.system
def test_best_heat_sink_is_eight_kelvin_cooler(found, reference):
    """Within the paper's length (84 mm), width (23 mm) and mass, the fluid is 8 K cooler after 30 min."""
    best = found.best
    assert best.sink is not None
    assert best.sink.span <= 0.084 * (1.0 + 1e-9)
    assert best.sink.width <= 0.023 * (1.0 + 1e-9)
    assert best.mass <= reference.mass
    assert reference.fluid - best.fluid >= 8.0


@pytest.mark.system
def test_finite_elements_confirm_heat_sink_gain(found, reference):
    pytest.importorskip("skfem")
    reference_field, best_field = confirm(DAMPER, (reference, found.best))
    assert reference_field.fluid - best_field.fluid >= 8.0
    assert {reference_field.model, best_field.model} == {"finite_element"}
    for judged, ours in ((reference_field, reference), (best_field, found.best)):
        assert judged.network_fluid == ours.fluid
        assert abs(judged.fluid - ours.fluid) <= 3.0


@pytest.mark.nightly
def test_freefem_confirms_heat_sink_gain(found, tool, tmp_path):
    """FreeFEM solves the heat equation in the same section. Steps of 300 s cause errors of tenths of 1 K."""
    tool("FreeFem++")
    pytest.importorskip("skfem")
    ends = []
    for name, sink in (("paper", SINK), ("best", found.best.sink)):
        (tmp_path / name).mkdir()
        model = build_field(DRAWING.with_sink(sink), size=0.02)
        ends.append(run_freefem(write_freefem(model, DAMPER.loads[0], tmp_path / name, step=300.0)).fluid[-1])
    assert ends[0] - ends[1] >= 8.0  # The other two models also give 8 K.


def test_designed_sinks_respect_limits(found):
    for each in found.designs:
        assert each.sink is not None
        assert PAPER_LIMITS.allow(each.sink, DAMPER.diameter)
        assert each.sink.gap >= PAPER_LIMITS.least_gap - 1e-12 or each.sink.fins == 1


@pytest.mark.nightly
def test_mass_limit_removes_heavier_sinks(found):
    half = search_grid(DAMPER, replace(PAPER_LIMITS, mass=0.5 * found.best.mass))
    assert half.designs == tuple(each for each in found.designs if each.mass <= 0.5 * found.best.mass)


def test_sink_evaluation_agrees_with_network(reference):
    """The search uses longer time steps, which cause differences of up to 10 mK."""
    exact = simulate_network(zone_network(DRAWING), DAMPER.loads, longest_step=10.0)
    assert reference.fluid == pytest.approx(exact.fluid[-1], abs=0.02)
    assert reference.coil == pytest.approx(exact.coil[-1], abs=0.02)
    assert reference.mass == SINK.mass(DAMPER.diameter)


@pytest.mark.nightly
def test_sinks_of_vertical_damper_have_wide_gaps():
    upright = replace(DRAWING, sink=None, body=replace(DRAWING.body, orientation="vertical"))
    damper = HeatedDamper(upright, DAMPER.loads)
    limits = limits_of(upright, span=0.08)
    front = search_grid(damper, limits).designs
    assert all(each.sink.gap >= 0.010 - 1e-9 for each in front if each.sink and each.sink.fins > 1)


def test_heat_sink_gain_interval_contains_gain(reference):
    """The gain of a sink against itself is exactly zero. A sink with more fins has a positive gain."""
    none = gain_band(DAMPER, SINK, SINK, 0.0)
    assert (none.low, none.high, none.better) == (0.0, 0.0, False)
    more = replace(SINK, fins=8, pitch=0.011)
    gain = reference.fluid - DAMPER.evaluate(more).fluid
    band = gain_band(DAMPER, SINK, more, gain)
    assert band.low < gain == band.middle < band.high
    assert band.better


def test_fouling_and_tolerance_reduce_fin_gap():
    """Fouling reduces the cooling of narrow gaps most and can close a gap. The minimum gap increases."""
    dirty = replace(DRAWING, manufacture=Manufacture(tolerance=0.4e-3, fouling=0.8e-3))
    lost = []
    for sink in (SINK, replace(SINK, fins=12, thickness=1e-3, pitch=7e-3)):
        clean, closed = (HeatedDamper(each.with_sink(sink), DAMPER.loads) for each in (DRAWING, dirty))
        lost.append(closed.evaluate(sink).fluid - clean.evaluate(sink).fluid)
    assert 0.0 <= lost[0] < 0.3
    assert lost[1] > 1.0
    assert limits_of(dirty).least_gap == pytest.approx(5e-3)
    with pytest.raises(InputError, match=r"gap of 1\.9 mm is closed by 2 mm of tolerance and dirt"):
        dirty.with_sink(replace(SINK, pitch=4.9e-3))
