"""Search of heat sinks: a front is a front, limits hold, and the paper's sink is beaten as promised."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import EnvelopeError, InputError
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing_file import read_drawing, read_sink
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.heatsink import Manufacture
from mrdamper.thermal.materials import MATERIALS
from mrdamper.thermal.model.finite_element import build_field
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import simulate_network
from mrdamper.thermal.sinks import design
from mrdamper.thermal.sinks.design import (
    HeatedDamper,
    SinkDesign,
    confirm,
    front_of,
    lightest_as_cool,
    limits_of,
    search_grid,
    thinned,
)
from mrdamper.thermal.sinks.efficiency import judge_sink
from mrdamper.thermal.sinks.gain import gain_band, spread
from mrdamper.thermal.sinks.variation import read_variation, vary
from mrdamper.thermal.temperature_rise import loads_of
from tests.oracles.freefem import run_freefem, write_freefem

EXAMPLE = Path(__file__).parents[2] / "examples" / "paper_damper.toml"
DRAWING, SINK = read_drawing(EXAMPLE), read_sink(EXAMPLE)

# as in test_efficiency.py: what heats the paper's damper
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
def test_nothing_that_was_tried_beats_a_member_of_the_front(tried):
    front = front_of(tried)
    for member in front:
        assert not any(
            each.mass <= member.mass and each.fluid <= member.fluid and each != member for each in tried
        )
    for each in tried:
        assert any(member.mass <= each.mass and member.fluid <= each.fluid for member in front)


@given(tried=designs, most=st.integers(2, 12))
def test_a_thinned_front_keeps_both_ends_and_its_order(tried, most):
    front = front_of(tried)
    fewer = thinned(front, most)
    assert len(fewer) <= most
    assert (fewer[0], fewer[-1]) == (front[0], front[-1])
    assert list(fewer) == [each for each in front if each in fewer]


@given(tried=designs, fluid=st.floats(300.0, 400.0))
def test_the_lightest_that_is_as_cool_is_the_first_of_the_front_that_is(tried, fluid):
    chosen = lightest_as_cool(front_of(tried), fluid)
    cool = [each.mass for each in tried if each.fluid <= fluid]
    assert (chosen is None) == (not cool)
    if chosen is not None:
        assert chosen.mass == min(cool)
        assert chosen.fluid <= fluid


@pytest.mark.system
def test_the_paper_s_sink_is_beaten_by_eight_kelvin_in_its_envelope(found, reference):
    """84 mm of span, 23 mm of width, no more mass: at least 8 K cooler after 30 minutes."""
    best = found.best
    assert best.sink is not None
    assert best.sink.span <= 0.084 * (1.0 + 1e-9)
    assert best.sink.width <= 0.023 * (1.0 + 1e-9)
    assert best.mass <= reference.mass
    assert reference.fluid - best.fluid >= 8.0


@pytest.mark.system
def test_finite_elements_confirm_it(found, reference):
    pytest.importorskip("skfem")
    reference_field, best_field = confirm(DAMPER, (reference, found.best))
    assert reference_field.fluid - best_field.fluid >= 8.0
    assert {reference_field.model, best_field.model} == {"finite_element"}
    for judged, ours in ((reference_field, reference), (best_field, found.best)):
        assert judged.network_fluid == ours.fluid
        assert abs(judged.fluid - ours.fluid) <= 3.0


@pytest.mark.nightly
def test_freefem_confirms_it(found, tool, tmp_path):
    """An independent program on the same section; steps of 300 s cost it some tenths of a kelvin."""
    tool("FreeFem++")
    pytest.importorskip("skfem")
    ends = []
    for name, sink in (("paper", SINK), ("best", found.best.sink)):
        (tmp_path / name).mkdir()
        model = build_field(DRAWING.with_sink(sink), size=0.02)
        ends.append(run_freefem(write_freefem(model, DAMPER.loads[0], tmp_path / name, step=300.0)).fluid[-1])
    assert ends[0] - ends[1] >= 8.0  # as by zone network and by our elements


@pytest.mark.system
def test_under_the_other_fin_law_and_without_multiplier_it_is_still_cooler(found):
    """The laws disagree on narrow gaps, and the multiplier is a guess there: the gain stays."""
    rows = spread(DAMPER, SINK, found.best.sink)
    assert all(row.reference and row.best for row in rows)
    assert {(row.correlation, row.film_multiplier) for row in rows} == {
        (law, factor) for law in ("annular", "channel", "vdi") for factor in (SINK.film_multiplier, 1.0)
    }
    gains = [row.reference - row.best for row in rows if row.reference and row.best]
    assert min(gains) > 5.0


def test_every_sink_that_was_found_keeps_to_the_limits(found):
    for each in found.designs:
        assert each.sink is not None
        assert PAPER_LIMITS.allow(each.sink, DAMPER.diameter)
        assert each.sink.gap >= PAPER_LIMITS.least_gap - 1e-12 or each.sink.fins == 1


@pytest.mark.nightly
def test_thinner_fins_that_can_be_made_never_make_it_worse():
    """The coarser limit's thicknesses are among the finer one's: the front can only move down."""
    coarse, fine = (
        search_grid(
            DAMPER, limits_of(DRAWING, span=0.04, width=0.015, least_thickness=least, least_gap=5e-3)
        ).best.fluid
        for least in (2e-3, 1e-3)
    )
    assert fine <= coarse


@pytest.mark.system
def test_a_lighter_limit_cuts_the_front_and_leaves_the_rest(found):
    half = search_grid(DAMPER, replace(PAPER_LIMITS, mass=0.5 * found.best.mass))
    assert half.designs == tuple(each for each in found.designs if each.mass <= 0.5 * found.best.mass)


@pytest.mark.nightly
def test_the_finish_and_the_material_are_searched_where_they_are_given():
    """Anodising radiates more at no mass, so that no bare finish is left on the front."""
    limits = limits_of(
        DRAWING,
        span=0.03,
        emissivities=(0.1, 0.85),
        materials=(MATERIALS["aluminium-alloy"], MATERIALS["copper"]),
    )
    front = search_grid(DAMPER, limits).designs
    assert {each.sink.emissivity for each in front if each.sink} == {0.85}
    assert any(each.sink.material.name == "aluminium-alloy" for each in front if each.sink)


def test_evaluation_is_the_network_s(reference):
    """Within the 10 mK that longer steps cost."""
    exact = simulate_network(zone_network(DRAWING), DAMPER.loads, longest_step=10.0)
    assert reference.fluid == pytest.approx(exact.fluid[-1], abs=0.02)
    assert reference.coil == pytest.approx(exact.coil[-1], abs=0.02)
    assert reference.mass == SINK.mass(DAMPER.diameter)


def test_a_long_duty_ends_at_the_steady_temperature():
    heated = HeatedDamper(DRAWING, (replace(DAMPER.loads[0], duration=8 * 3600.0),))
    end = heated.evaluate(SINK)
    steady = heated.settled(end).steady
    assert steady is not None
    assert end.fluid == pytest.approx(steady, abs=0.01)


@pytest.mark.nightly
def test_a_search_that_is_free_of_the_grids_steps_finds_no_better_front(found):
    """480 sinks of NSGA-II are nothing cooler, and come within a few kelvin."""
    pytest.importorskip("pymoo")
    from tests.oracles.sink_evolution import search_freely

    free = search_freely(DAMPER, PAPER_LIMITS, population=24, generations=20, seed=1)
    assert -0.5 < free[-1].fluid - found.best.fluid < 4.0
    assert all(PAPER_LIMITS.allow(each.sink, DAMPER.diameter) for each in free if each.sink)


def test_without_a_sink_the_body_gives_the_envelope():
    limits = limits_of(DRAWING.with_sink(None))
    assert (limits.span, limits.width, limits.mass) == (0.200, 0.023, math.inf)


@pytest.mark.system
def test_on_a_vertical_damper_the_fins_are_discs_with_room_between():
    upright = replace(DRAWING, sink=None, body=replace(DRAWING.body, orientation="vertical"))
    damper = HeatedDamper(upright, DAMPER.loads)
    limits = limits_of(upright, span=0.08)
    front = search_grid(damper, limits).designs
    assert all(each.sink.correlation == "disc" for each in front if each.sink)
    assert all(each.sink.gap >= 0.010 - 1e-9 for each in front if each.sink and each.sink.fins > 1)
    best = front[-1].sink
    assert best is not None
    assert [row.correlation for row in spread(damper, None, best)] == ["disc"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"span": 0.3}, "the span is 300 mm, the body's length 200 mm"),
        ({"mass": 0.0}, "mass is 0 g; expected more than zero"),
        ({"width": -0.01}, "width is -10 mm"),
        ({"least_gap": math.nan}, "least_gap is nan mm"),
        ({"least_thickness": 0.1}, "expected room for one fin"),
        ({"emissivities": (1.5,)}, "an emissivity is 1.5; expected 0 to 1"),
    ],
)
def test_limits_that_cannot_be_are_refused(given, message):
    with pytest.raises(InputError, match=message):
        limits_of(DRAWING, **given)


def test_a_mass_below_the_lightest_sink_is_refused():
    with pytest.raises(InputError, match=r"no sink keeps to them.*mass 1 g"):
        search_grid(DAMPER, limits_of(DRAWING, mass=1e-3))


def test_a_sink_outside_its_correlation_is_left_out_and_counted(monkeypatch):
    """And when all are, the correlation's own message stands."""
    limits = limits_of(DRAWING, span=0.02)

    def refuse_some(self, sink):
        if sink.fins > 2:
            raise EnvelopeError("the correlation holds for less")
        return made(0.1 * sink.fins, 400.0 - sink.fins)

    monkeypatch.setattr(design.HeatedDamper, "evaluate", refuse_some)
    front = search_grid(DAMPER, limits)
    assert 0 < front.outside < front.tried
    assert front.best.fluid == 398.0
    monkeypatch.setattr(design.HeatedDamper, "evaluate", lambda self, sink: refuse_some(self, SINK))
    with pytest.raises(EnvelopeError, match="holds for less"):
        search_grid(DAMPER, limits)


def test_a_gain_s_band_is_what_its_causes_make_of_it(reference):
    """The same sink gains nothing, whatever films and power are; one with more fins gains something."""
    none = gain_band(DAMPER, SINK, SINK, 0.0)
    assert (none.low, none.high, none.better) == (0.0, 0.0, False)
    more = replace(SINK, fins=8, pitch=0.011)
    gain = reference.fluid - DAMPER.evaluate(more).fluid
    band = gain_band(DAMPER, SINK, more, gain)
    assert band.low < gain == band.middle < band.high
    assert band.better
    widest = max(abs(end - gain) for ends in band.causes.values() for end in ends)
    assert (
        widest
        <= max(band.high - gain, gain - band.low)
        <= sum(max(abs(end - gain) for end in ends) for ends in band.causes.values())
    )
    low, high = band.causes["power"]
    assert low < gain < high  # more heat, more to gain


def test_dirt_closes_the_gap_and_tolerance_with_it():
    """Narrow fins lose what wide gaps hardly notice; a closed one is refused, the least gap follows."""
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


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ("sink.width_mm", "expected TABLE.ENTRY=1,2,3"),
        ("width=1,2", "expected TABLE.ENTRY=1,2,3"),
        ("sink.width_mm=a,b", "expected TABLE.ENTRY=1,2,3"),
        ("sink.width_mm=1:2", "expected TABLE.ENTRY=1,2,3"),
        ("sink.width_mm=18", "1 values in"),
        ("sink.width_mm=1:inf:3", "expected 2 to 200 finite ones"),
    ],
)
def test_what_is_no_variation_is_refused(said, message):
    with pytest.raises(InputError, match=message):
        read_variation(said)


def test_a_variation_s_middle_is_the_drawing_itself():
    assert read_variation("sink.width_mm=18:33:4") == ("sink.width_mm", (18.0, 23.0, 28.0, 33.0))
    works = [LoopWork(KELVIN, WATTS, np.full(3, 1300.0))]
    duty = read_duty("sine:15mm:1Hz:2A:1800s")
    found = vary(DRAWING, "sink.width_mm=18,23,28", works, duty)
    assert found.values == (18.0, 23.0, 28.0)
    degrees = [effect.finned for effect in found.effects]
    assert degrees == sorted(degrees, reverse=True)
    whole = judge_sink(DRAWING, SINK, loads_of(works, DRAWING, duty))
    assert found.effects[1].finned == pytest.approx(whole.finned, abs=1e-9)
    with pytest.raises(InputError, match="sink has no key 'widht_mm'; did you mean width_mm"):
        vary(DRAWING, "sink.widht_mm=18,23", works, duty)
