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
from mrdamper.thermal.heatsink import HeatSink, Manufacture
from mrdamper.thermal.materials import MATERIALS
from mrdamper.thermal.model.finite_element import build_field
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.surfaces import fin_uncertainty
from mrdamper.thermal.model.transient import simulate_network
from mrdamper.thermal.sinks import design
from mrdamper.thermal.sinks.design import (
    HeatedDamper,
    SinkDesign,
    SinkLimits,
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
SHORT = (replace(DAMPER.loads[0], duration=90.0),)
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


# ------------------------------------------------------------------------------- limits, to the last bit

LIMITS = SinkLimits(
    span=0.08, width=0.02, mass=0.5, least_thickness=1e-3, least_gap=3e-3,
    materials=(MATERIALS["copper"],), emissivities=(0.0, 1.0),
)  # fmt: skip


@pytest.mark.parametrize("name", ["span", "width", "least_thickness", "least_gap", "mass"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_every_limit_is_above_zero(name, value):
    with pytest.raises(InputError, match=f"sink limits: {name} is"):
        replace(LIMITS, **{name: value})


def test_a_span_may_be_one_fin_and_a_search_needs_a_material_and_a_finish():
    assert replace(LIMITS, least_thickness=0.08).most_fins(0.08) == 1
    with pytest.raises(InputError, match="no material or no emissivity"):
        replace(LIMITS, materials=())
    with pytest.raises(InputError, match="no material or no emissivity"):
        replace(LIMITS, emissivities=())
    with pytest.raises(InputError, match=r"an emissivity is -0\.1"):
        replace(LIMITS, emissivities=(0.5, -0.1))


@pytest.mark.parametrize("fins", [1, 2, 3, 7, 24])
def test_as_many_fins_fit_as_were_laid_side_by_side(fins: int):
    """Thicknesses and gaps of whole tenths of a millimetre, added up in floating point or not."""
    for thickness in np.arange(0.6e-3, 4e-3, 0.7e-3):
        for gap in np.arange(2.1e-3, 9e-3, 1.3e-3):
            added = sum([thickness + gap] * (fins - 1)) + thickness
            for span in (added, fins * thickness + (fins - 1) * gap, round(added, 9)):
                limits = replace(LIMITS, span=span, least_gap=gap, least_thickness=1e-4)
                assert limits.most_fins(thickness) == fins
                assert replace(limits, span=0.9999 * span).most_fins(thickness) == fins - 1


def test_a_sink_is_allowed_up_to_each_limit_and_not_beyond():
    sink = HeatSink(fins=3, width=0.02, thickness=1e-3, pitch=0.0395, material=MATERIALS["copper"])
    limits = replace(LIMITS, mass=sink.mass(0.046), least_gap=0.0385)
    assert sink.span == pytest.approx(limits.span)
    assert limits.allow(sink, 0.046)
    for name, factor in (("span", 0.999), ("width", 0.999), ("mass", 0.999), ("least_thickness", 1.001)):
        assert not replace(limits, **{name: factor * getattr(limits, name)}).allow(sink, 0.046), name
    assert not replace(limits, least_gap=0.03851).allow(sink, 0.046)
    assert replace(limits, least_gap=0.05).allow(replace(sink, fins=1), 0.046)  # it has no gap
    # a gap of twice the width is a groove, a wider one is not
    narrow = replace(limits, least_gap=1e-3)
    assert narrow.allow(replace(sink, width=0.01925), 0.046)
    assert not narrow.allow(replace(sink, width=0.0192), 0.046)
    assert narrow.widest_pitch(3, 0.02, 1e-3) == pytest.approx(0.0395)  # by the span
    assert narrow.widest_pitch(3, 0.01, 1e-3) == pytest.approx(0.021)  # by the groove


def test_the_grid_is_every_number_of_fins_with_four_widths_and_thicknesses_and_two_pitches():
    """Widths and pitches of whole tenths of a millimetre, but for the greatest width."""
    limits = replace(LIMITS, width=0.01234, span=0.0303)
    sinks = list(design._grid(SINK, limits))
    assert {each.width for each in sinks} == {0.0049, 0.0074, 0.0098, 0.01234}
    assert {each.thickness for each in sinks} == {1e-3, 1.5e-3, 2e-3, 3e-3}
    assert {each.emissivity for each in sinks} == {0.0, 1.0}
    assert {each.material.name for each in sinks} == {"copper"}
    thin = [each for each in sinks if each.thickness == 1e-3 and each.width == 0.0098]
    assert {each.fins for each in thin} == set(range(1, 9))
    assert len({(each.fins, each.pitch) for each in thin if each.fins == 3}) == 2
    assert sorted({each.pitch for each in thin if each.fins == 3}) == [0.0087, 0.0146]
    assert {each.pitch for each in thin if each.fins == 8} == {0.0041, 4e-3}  # the least gap at least
    assert {each.film_multiplier for each in sinks} == {SINK.film_multiplier}
    assert all(limits.allow(each, 0.046) for each in sinks)


def test_of_two_that_are_as_cool_the_lighter_one_is_on_the_front():
    assert front_of([made(0.2, 350.0), made(0.1, 350.0)]) == (made(0.1, 350.0),)
    assert front_of([made(0.1, 351.0), made(0.1, 350.0)]) == (made(0.1, 350.0),)
    assert lightest_as_cool([made(0.1, 350.0)], 350.0) == made(0.1, 350.0)


def test_a_front_is_thinned_to_two_at_the_least_and_evenly_in_temperature():
    front = [made(0.1 * k, 400.0 - 10.0 * k) for k in range(11)]
    assert [each.fluid for each in thinned(front, 3)] == [400.0, 350.0, 300.0]
    assert thinned(front[:3], 3) == tuple(front[:3])
    with pytest.raises(InputError, match="1 members are asked for; expected 2 or more"):
        thinned(front, 1)


def test_without_fins_in_the_drawing_a_damper_has_those_of_a_plain_sink():
    """Its law, its finish and its metal; a sink of the drawing's own gives them else."""
    bare = DRAWING.with_sink(None)
    assert HeatedDamper(bare, DAMPER.loads).pattern.correlation == "annular"
    limits = limits_of(bare, least_gap=1e-3, least_thickness=2e-3)
    assert (limits.least_gap, limits.least_thickness) == (1e-3, 2e-3)
    assert (limits.materials, limits.emissivities) == ((MATERIALS["aluminium-alloy"],), (0.3,))
    own = limits_of(DRAWING)
    assert (own.span, own.width) == pytest.approx((SINK.span, SINK.width))
    assert own.mass == SINK.mass(DAMPER.diameter)
    assert limits_of(DRAWING, span=0.2).span == 0.2  # the whole body


class Kept(dict[str, object]):
    """A memory of finished pieces."""

    def recall(self, key: str):
        return self.get(key)

    def keep(self, key: str, value: object) -> None:
        self[key] = value


def test_a_search_that_is_taken_up_again_tries_nothing_twice(monkeypatch):
    """Pieces of fifty: progress counts them, and a memory of them is enough."""
    tried, seen = [], []

    def count(self, sink):
        tried.append(sink)
        return made(0.01 * len(tried), 400.0 - len(tried))

    monkeypatch.setattr(design.HeatedDamper, "evaluate", count)
    memory = Kept()
    first = search_grid(
        DAMPER,
        PAPER_LIMITS,
        memory=memory,
        on_progress=lambda update: seen.append((update.done, update.total)),
    )
    assert len(tried) == len(set(tried)) == first.tried
    assert seen == [(done, first.tried) for done in range(0, first.tried, 50)]
    again = search_grid(DAMPER, PAPER_LIMITS, memory=memory)
    assert len(tried) == first.tried
    assert again.designs == first.designs
    assert 0.0 <= again.cpu_s < 5.0
    changed = search_grid(DAMPER, replace(PAPER_LIMITS, emissivities=(0.8,)), memory=memory)
    assert len(tried) == first.tried + changed.tried  # those are other sinks


def test_elements_that_were_run_are_not_run_again(monkeypatch):
    ran = []

    class Course:
        fluid, coil = np.array([300.0, 350.0]), np.array([300.0, 360.0])

    def run(drawing, loads):
        ran.append(drawing.sink)
        return None, Course

    monkeypatch.setattr(design, "heat_field", run)
    seen, memory = [], Kept()
    designs = (made(0.1, 351.0), replace(made(0.2, 350.0), sink=SINK))
    for _ in range(2):
        judged = confirm(
            DAMPER,
            designs,
            memory=memory,
            on_progress=lambda update: seen.append((update.done, update.total)),
        )
    assert ran == [None, SINK]
    assert seen == [(0, 2), (1, 2)] * 2
    assert [(each.fluid, each.coil, each.network_fluid) for each in judged] == [
        (350.0, 360.0, 351.0),
        (350.0, 360.0, 350.0),
    ]


# --------------------------------------------------------------------------------------- what a gain hangs on


def test_each_cause_moves_a_gain_as_the_network_says():
    """Fins' film by its doubt, the body's by 15 %, power by 16.5 %, the gap's ratio to the power of 0.12."""
    best = replace(SINK, fins=10, pitch=0.009)
    still = HeatedDamper(DRAWING.with_sink(SINK), SHORT)

    def gain(damper: HeatedDamper, of_both: float = 1.0, of_best: float = 1.0) -> float:
        one, other = (
            replace(each, film_multiplier=each.film_multiplier * factor)
            for each, factor in ((SINK, of_both), (best, of_both * of_best))
        )
        return damper.evaluate(one).fluid - damper.evaluate(other).fluid

    def with_film(factor: float) -> HeatedDamper:
        own = DRAWING.calibration
        return replace(still, drawing=replace(DRAWING, calibration=replace(own, film=factor * own.film)))

    def with_power(factor: float) -> HeatedDamper:
        load = still.loads[0]
        more = replace(load, power=lambda kelvin: factor * load.power(kelvin), coil_W=factor * load.coil_W)
        return replace(still, loads=(more,))

    fins, gaps = 1.0 + fin_uncertainty(DRAWING.with_sink(best)), (0.017 / 0.006) ** 0.12
    expected = {
        "film of the fins": [gain(still, 1.0 / fins), gain(still, fins)],
        "film of the bare body": [gain(with_film(1.0 / 1.15)), gain(with_film(1.15))],
        "power": [gain(with_power(0.835)), gain(with_power(1.165))],
        "film over the gap": [gain(still, 1.0, 1.0 / gaps), gain(still, 1.0, gaps)],
    }
    here = gain(still)
    band = gain_band(still, SINK, best, here)
    assert band.causes.keys() == expected.keys()
    for name, ends in expected.items():
        assert band.causes[name] == pytest.approx(ends, abs=1e-6), name
    below, above = (
        math.hypot(*(max(sign * (end(ends) - here), 0.0) for ends in expected.values()))
        for sign, end in ((-1.0, min), (1.0, max))
    )
    assert (band.low, band.high) == pytest.approx((here - below, here + above), abs=1e-6)
    for reference in (None, replace(SINK, fins=1)):  # no gap to compare with
        assert "film over the gap" not in gain_band(still, reference, best, here).causes


def test_a_draught_does_to_the_reference_what_its_multiplier_does():
    damper = HeatedDamper(DRAWING, SHORT)
    rows = spread(damper, SINK, replace(SINK, fins=8, pitch=0.011))
    assert (rows[0].correlation, rows[0].film_multiplier) == ("annular", SINK.film_multiplier)
    assert rows[-1].film_multiplier == 1.0
    assert 0.02 < rows[-1].air_speed < 2.0
    assert rows[-1].reference == pytest.approx(rows[0].reference, abs=0.01)
    windy = replace(DRAWING, surroundings=replace(DRAWING.surroundings, air_speed=1.0))
    blown, plain = HeatedDamper(windy, SHORT), replace(SINK, film_multiplier=1.0)
    for each, reference in ((damper, None), (damper, plain), (blown, SINK)):
        speeds = {row.air_speed for row in spread(each, reference, SINK)}
        assert speeds == {each.drawing.surroundings.air_speed}


def test_a_variation_has_two_values_to_two_hundred_and_whole_fins():
    many = ",".join(str(k) for k in range(1, 202))
    assert len(read_variation(f"sink.width_mm={many.rpartition(',')[0]}")[1]) == 200
    assert len(read_variation("sink.width_mm=1:200:200")[1]) == 200
    assert read_variation("sink.width_mm=5:6:2") == ("sink.width_mm", (5.0, 6.0))
    for said in (many, "1:2:201", "1:2:1", "1:2:0"):
        with pytest.raises(InputError, match="expected 2 to 200 finite ones"):
            read_variation(f"sink.width_mm={said}")
    works, duty = [LoopWork(KELVIN, WATTS, np.full(3, 1300.0))], read_duty("sine:15mm:1Hz:2A:600s")
    found = vary(DRAWING, "sink.fins=3,5", works, duty)
    assert [each.sink.fins for each in found.effects] == [3, 5]
    with pytest.raises(InputError, match=r"sink\.fins = 3\.5; expected whole numbers of fins"):
        vary(DRAWING, "sink.fins=3,3.5", works, duty)
    with pytest.raises(InputError, match="it has no heat sink"):
        vary(DRAWING, "sink.fins=0,3", works, duty)
