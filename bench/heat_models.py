"""Heating and heat sinks: what was asked of the models, beside what they do; some eighteen minutes of CPU.

Networks against finite elements, both against closed forms and independent programs, the paper's figures
through a card that is identified on the rig's preset ``paper``, the better sink, and what the first minutes
of a curve foretell. Dampers and fleets are those of the tests; programs that are not installed are left out.
"""

from __future__ import annotations

import math
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from scipy.special import i0, i1, k0, k1

from bench.measure import Asked, Row
from mrdamper.arrays import FloatArray
from mrdamper.jobs.heat import heat_damper
from mrdamper.thermal.cross_check import check_calculix, check_freefem, check_gmsh
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.estimation.network_calibration import NetworkError, calibrate_network, network_error
from mrdamper.thermal.freefem import run_freefem, write_freefem
from mrdamper.thermal.model.finite_element import FieldModel, build_field, discretise, heat_field
from mrdamper.thermal.model.heat_equation import heat_through, settle
from mrdamper.thermal.model.mesh import mesh_section
from mrdamper.thermal.model.network import loss_grid, zone_network
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.section import Block, Edge, Region, Section, Surface, section_of
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import heat_up, steady_state
from mrdamper.thermal.sinks.design import HeatedDamper, confirm, limits_of, search_grid
from mrdamper.thermal.temperature_rise import loads_of, works_of
from tests.support.heated import paper_card
from tests.thermal import test_outlook, test_prediction
from tests.thermal.designs import DRAWING, draw_designs
from tests.thermal.fleet import draw_fleet
from tests.thermal.test_network import one_node

__all__ = ["run"]

BARE = DRAWING.with_sink(None)
HALF_HOUR = read_duty("sine:15mm:1Hz:2A:1800s")
AMBIENT = DRAWING.surroundings.ambient
PARTS = ("fluid", "coil", "wall")
SAME_STEPS = SimpleNamespace(longest=300.0, first=20.0)  # of two meshes that are compared


def fading(kelvin: FloatArray) -> FloatArray:
    """Power that falls with warmth, as an MR damper's does."""
    return np.asarray(95.0 - 0.25 * (np.clip(kelvin, 273.15, 473.15) - AMBIENT))


def constant(watts: float) -> Callable[[FloatArray], FloatArray]:
    return lambda kelvin: np.full_like(kelvin, watts)


DUTY = Load(1800.0, fading, 16.8)


def run() -> list[Row]:
    """Return a row for each model or claim, with the figures that were asked of it."""
    groups = (_network, _reduced, _elements, _account, _limits, _programs, _paper, _sink, _early)
    return [row for group in groups for row in group()]


def _spent(job: Callable[[], object], repeats: int = 5) -> float:
    """Return the least CPU time of some repeats [s], the first not counted."""
    job()
    found = []
    for _ in range(repeats):
        begin = time.process_time()
        job()
        found.append(time.process_time() - begin)
    return min(found)


def _network() -> Iterator[Row]:
    """Judge the network on 16 random designs (0 to 8 fins, 0 to 4 m/s), calibrated on six others."""
    designs = draw_designs(22, seed=7)
    found = calibrate_network(designs[:6], [DUTY])
    before = [network_error(design, [DUTY]) for design in designs[6:]]
    after = [network_error(replace(design, calibration=found.calibration), [DUTY]) for design in designs[6:]]
    network = zone_network(DRAWING)
    spent = _spent(lambda: heat_up(network, [DUTY]))

    def said(errors: list[NetworkError]) -> str:
        rms, most = max(e.fluid_rms for e in errors), max(e.fluid_max for e in errors)
        whole, coil = _rms(e.fluid_rms for e in errors), max(e.coil_max for e in errors)
        return f"fluid RMS {whole:.2f} K (worst design {rms:.2f}), max {most:.2f} K; coil max {coil:.2f} K"

    yield Row(
        "zone network against finite elements, 16 random designs, calibrated on 6 others",
        spent,
        accuracy=f"{said(after)}; uncalibrated: {said(before)}",
        asked=(
            Asked("network: fluid RMS, worst of 16 designs", 1.5, max(e.fluid_rms for e in after), "K"),
            Asked("network: fluid at most", 3.0, max(e.fluid_max for e in after), "K"),
            Asked("network: 30 min", 5.0, 1e3 * spent, "ms"),
        ),
    )


def _rms(values: Iterator[float]) -> float:
    return float(np.sqrt(np.mean(np.square(list(values)))))


def _reduced() -> Iterator[Row]:
    """Hold sixteen unknowns against the finite elements that they come from, on four random designs."""
    missed = dict.fromkeys(PARTS, 0.0)
    for design in draw_designs(4, seed=2):
        model = build_field(design)
        full, small = (heat_through(each.equation, [DUTY]) for each in (model, reduce_field(model)))
        for part in PARTS:
            apart = float(np.abs(getattr(full, part) - getattr(small, part)).max())
            missed[part] = max(missed[part], apart)
    reduced = reduce_field(build_field(DRAWING))
    spent = _spent(lambda: heat_through(reduced.equation, [DUTY]))
    yield Row(
        "reduced model, 16 unknowns, 4 random designs",
        spent,
        accuracy=", ".join(f"{part} {1e3 * missed[part]:.2f} mK" for part in PARTS),
        asked=(
            Asked("reduced: fluid", 10.0, 1e3 * missed["fluid"], "mK"),
            Asked("reduced: coil", 50.0, 1e3 * missed["coil"], "mK"),
            Asked("reduced: 30 min after its build", 50.0, 1e3 * spent, "ms"),
        ),
    )


def _elements() -> Iterator[Row]:
    """Find mesh and time errors of the finite elements, their order, and what 30 min cost."""
    mesh_error = 0.0
    for drawing in (BARE, DRAWING):
        section = section_of(drawing)
        fine = discretise(section, mesh_section(section, 0.005, levels=4))
        courses = [
            heat_through(each.equation, [DUTY], longest_step=SAME_STEPS.longest, first_step=SAME_STEPS.first)
            for each in (build_field(drawing), fine)
        ]
        apart = [np.abs(getattr(courses[0], part) - getattr(courses[1], part)).max() for part in PARTS]
        mesh_error = max(mesh_error, *map(float, apart))
    coarse = build_field(BARE, size=0.04)
    course = heat_through(coarse.equation, [DUTY])
    truth = heat_through(coarse.equation, [DUTY], longest_step=8.0, first_step=0.25)
    late = course.time >= 60.0
    time_error = max(
        float(np.abs(getattr(course, p) - np.interp(course.time, truth.time, getattr(truth, p)))[late].max())
        for p in PARTS
    )
    warm = heat_through(coarse.equation, [Load(300.0, fading, 16.8)]).state[-1]
    load = [Load(480.0, fading, 5.0)]
    ends = [
        heat_through(coarse.equation, load, start=warm, longest_step=step, first_step=step).state[-1]
        for step in (20.0, 10.0, 5.0)
    ]
    order = math.log2(np.abs(ends[0] - ends[1]).max() / np.abs(ends[1] - ends[2]).max())
    spent = _spent(lambda: heat_field(DRAWING, [DUTY]), repeats=3)
    yield Row(
        "finite elements, five fins, 30 min in steps up to 60 s, mesh and assembly included",
        spent,
        accuracy=f"mesh {1e3 * mesh_error:.1f} mK, time {1e3 * time_error:.1f} mK, order {order:.2f}",
        asked=(
            Asked("finite elements: mesh error", 20.0, 1e3 * mesh_error, "mK"),
            Asked("finite elements: time error at 60 s", 50.0, 1e3 * time_error, "mK"),
            Asked("finite elements: order in time", 1.9, order, "-", at_least=True),
            Asked("finite elements: 30 min", 2.0, spent, "s"),
        ),
    )


def _account() -> Iterator[Row]:
    """Close the energy account of every model over heating, rest and heating."""
    loads = [Load(600.0, fading, 16.8), Load(300.0, constant(0.0)), Load(900.0, constant(150.0), 5.0)]
    model = build_field(DRAWING, size=0.016)
    closures = {
        "network": heat_up(zone_network(DRAWING), loads).closure,
        "finite elements": heat_through(model.equation, loads).closure,
        "reduced model": heat_through(reduce_field(model).equation, loads).closure,
    }
    yield Row(
        "energy account",
        accuracy=", ".join(f"{name} {value:.1e}" for name, value in closures.items()),
        asked=(Asked("energy closure, worst of three models", 1e-9, max(closures.values()), "-"),),
    )


def _limits() -> Iterator[Row]:
    """Compare with closed forms: P/C without losses, steady P/UA, one fin by Bessel functions."""
    network = zone_network(DRAWING)
    tight = replace(network, loss_node=(), loss_path=(), watts=np.zeros((0, len(network.grid))))
    late = heat_up(tight, [Load(1800.0, constant(90.0))])
    rate = np.diff(late.temperature[-2:], axis=0)[0] / np.diff(late.time[-2:])
    slope = float(np.abs(rate / (90.0 / network.total_capacity) - 1.0).max())
    steady = abs(float(steady_state(one_node(), Load(1.0, constant(50.0)))[0] - AMBIENT) / 100.0 - 1.0)
    fin = _fin_miss()
    yield Row(
        "closed forms",
        accuracy=f"slope P/C to {slope:.1e}, steady P/UA to {steady:.1e}, fin (finite elements) to {fin:.1e}",
        asked=(
            Asked("adiabatic slope and steady P/UA, relative", 1e-6, max(slope, steady), "-"),
            Asked("one annular fin, relative", 1e-6, fin, "-"),
        ),
    )


def _fin_miss() -> float:
    """Return how far a fin of finite elements is off the exact efficiency (insulated tip), relative."""
    root, tip, thickness, k, film, power = 0.02, 0.05, 1e-3, 20.0, 60.0, 30.0
    regions = (Region("gap", "gap", 1e6, 1e6, 2e6), Region("fins", "fins", k, 1e6, 2e6))
    blocks = (Block(0, 0.015, root, 0.0, thickness), Block(1, root, tip, 0.0, thickness))
    faces = (Edge(0, root, tip, 0.0, 0.0), Edge(0, root, tip, thickness, thickness))
    surface = Surface("outside", 0, 0.0, 0.0, "body convection", "body radiation")
    grid = loss_grid(AMBIENT)
    section = Section(regions, blocks, (surface,), faces, AMBIENT, grid, np.full((1, len(grid)), film))
    model = discretise(section, mesh_section(section, 0.0005))
    theta = settle(model.equation, Load(1.0, constant(power)))
    at_root = float(theta[np.abs(model.nodes[:, 0] - root) < 1e-12].mean())
    a, b = (math.sqrt(2.0 * film / (k * thickness)) * radius for radius in (root, tip))
    exact = 2.0 * a / (b**2 - a**2) * (k1(a) * i1(b) - i1(a) * k1(b)) / (i0(a) * k1(b) + k0(a) * i1(b))
    found = power / (film * 2.0 * math.pi * (tip**2 - root**2) * at_root)
    return abs(found / float(exact) - 1.0)


def _programs() -> Iterator[Row]:
    """Run half an hour on the mesh in use, bare and with five fins, by independent programs."""
    checks = (
        ("FreeFem++", "nonlinear, node by node", 50.0, lambda m, f: check_freefem(m, DUTY, f).worst_K),
        (
            "ccx",
            "equal step, node by node",
            100.0,
            lambda m, f: check_calculix(m, DUTY, f, step=30.0, steps=60).worst_K,
        ),
        (
            "gmsh",
            "its mesh, our solver, means",
            20.0,
            lambda m, f: check_gmsh(m, DUTY, f, corner=5e-4).worst_K,
        ),
    )
    for program, how, bar, check in checks:
        name = f"{program}: {how}"
        if shutil.which(program) is None:
            yield Row(name, accuracy="not installed")
            continue
        worst = 1e3 * max(_in_folder(check, build_field(drawing)) for drawing in (BARE, DRAWING))
        yield Row(name, accuracy=f"{worst:.1f} mK", asked=(Asked(name, bar, worst, "mK"),))


def _in_folder(check: Callable[[FieldModel, Path], float], model: FieldModel) -> float:
    with tempfile.TemporaryDirectory() as folder:
        return check(model, Path(folder))


def _paper() -> Iterator[Row]:
    """Compute the paper's temperatures and force losses with the card that its sines on the rig lead to."""
    run = heat_damper(paper_card(), DRAWING, read_duty("sine:15mm:1Hz:2A:2100s"), past_limit=True)
    bare, fins = run.bare, run.rise
    assert bare is not None
    found = {
        "bare, 30 min": (129.9, bare.fluid_at(1800.0) - 273.15),
        "bare, 35 min": (140.0, bare.fluid_at(2100.0) - 273.15),
        "five fins, 30 min": (76.9, fins.fluid_at(1800.0) - 273.15),
    }
    losses = {}
    for name, claim, drawing in (("five fins", 15.7, DRAWING), ("bare", 25.9, BARE)):
        end = heat_damper(paper_card(), drawing, HALF_HOUR, past_limit=True).rise.force_loss_percent
        assert end is not None
        losses[name] = (claim, end)
    said = [f"{name} {ours:.2f} degC ({paper})" for name, (paper, ours) in found.items()]
    said += [f"force loss, {name} {ours:.2f} % ({paper})" for name, (paper, ours) in losses.items()]
    yield Row(
        "the paper's heating, card identified on the preset paper (its claim in brackets)",
        accuracy=", ".join(said),
        asked=(
            *(Asked(f"paper: {name}, off", 0.5, abs(a - b), "K") for name, (a, b) in found.items()),
            *(
                Asked(f"paper: force loss, {name}, off", 0.3, abs(a - b), "%")
                for name, (a, b) in losses.items()
            ),
        ),
    )


def _sink() -> Iterator[Row]:
    """Search the coolest sink in the paper's envelope; confirm by finite elements and FreeFem++."""
    card = paper_card()
    damper = HeatedDamper(DRAWING, tuple(loads_of(works_of(card.damper, HALF_HOUR), DRAWING, HALF_HOUR)))
    begin = time.process_time()
    search = search_grid(damper, limits_of(DRAWING, span=0.084))
    spent = time.process_time() - begin
    paper, best = confirm(damper, (damper.evaluate(DRAWING.sink), search.best))
    sink = best.sink
    assert sink is not None
    gains = {
        "network": paper.network_fluid - best.network_fluid,
        "finite elements": paper.fluid - best.fluid,
    }
    if shutil.which("FreeFem++") is not None:
        ends = []
        for each in (DRAWING.sink, sink):
            with tempfile.TemporaryDirectory() as folder:
                model = build_field(DRAWING.with_sink(each), size=0.02)
                theirs = run_freefem(write_freefem(model, damper.loads[0], Path(folder), step=60.0))
                ends.append(float(theirs.fluid[-1]))
        gains["FreeFem++"] = ends[0] - ends[1]
    said = f"{sink.fins} fins of {1e3 * sink.thickness:.3g} mm at {1e3 * sink.pitch:.3g} mm, "
    said += f"{best.mass:.3f} kg: {best.fluid - 273.15:.1f} degC against {paper.fluid - 273.15:.1f} of "
    said += f"{paper.mass:.3f} kg; cooler by "
    yield Row(
        "better than the paper's sink, 84 mm, 23 mm, no more mass",
        spent,
        accuracy=said + ", ".join(f"{gain:.1f} K ({name})" for name, gain in gains.items()),
        asked=tuple(
            Asked(f"sink: cooler at 30 min, {name}", 10.0, gain, "K", at_least=True)
            for name, gain in gains.items()
        ),
    )


def _early() -> Iterator[Row]:
    """Foretell 30 min from the first minutes: of unknown dampers, and of drawn ones off their drawing."""
    fleet = draw_fleet(200, test_prediction.FLEET_SEED)
    for minutes in (5.0, 10.0, 15.0):
        rmse, inside = test_prediction.scores(fleet, minutes)
        name = f"unknown dampers, 200, from {minutes:.0f} min"
        asked = (
            Asked(f"{name}: RMSE", 3.0, rmse, "K"),
            Asked(f"{name}: 90 % interval holds", 85.0, 100.0 * inside, "%", at_least=True),
            Asked(f"{name}: 90 % interval holds", 95.0, 100.0 * inside, "%"),
        )
        said = f"RMSE {rmse:.2f} K, 90 % interval holds for {100.0 * inside:.1f} %"
        yield Row(name, accuracy=said, asked=asked if minutes == 10.0 else ())
    for name, drawing in (("bare", BARE), ("five fins", DRAWING)):
        for minutes in (5.0, 10.0):
            found = test_outlook.score(drawing, 100, minutes, seed=4)
            yield Row(
                f"drawn dampers off their drawing, {name}, 100, from {minutes:.0f} min",
                accuracy=f"RMSE {found.rmse:.2f} K, 90 % interval holds for {100.0 * found.inside:.0f} %, "
                f"{found.width:.1f} K wide",
            )
