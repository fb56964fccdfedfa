"""Peers solve the same problem: the controllers' and the heating's contenders give our answer, or are out."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from bench import controller, heating, page, peers, startup
from bench.measure import Row, table
from bench.plain import PlainBank
from mrdamper.control.controllers import controllers_for
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.transient import simulate_network
from tests.thermal.designs import DRAWING

RESULTS = json.loads(page.RESULTS.read_text(encoding="utf-8"))
PAPER = controllers_for(controller.DAMPER)["paper"]


# ------------------------------------------------------------------------------- the controller


def test_the_plain_bank_is_the_paper_s_controller():
    """Written without the kernel's tables and estimators' checks, it gives the same commands to 1 mA."""
    told = controller._told(PAPER)[:600]
    plain = PlainBank(controller.DAMPER, PAPER)
    found = np.array([plain.step(row[0], row[2], row[3]) for row in told.tolist()])
    _, current, flags = PAPER.run(PAPER.start(), told)
    feasible = (flags & 1024) == 0
    assert np.abs(found - current)[feasible].max() < 1e-3
    assert np.ptp(current) > 0.5


def test_a_controller_that_answers_otherwise_is_disqualified():
    contenders = [
        controller._Contender("ours", lambda told: controller._in_c(PAPER, told), 20_000, PAPER),
        controller._Contender("idle", lambda told: lambda: np.zeros(len(told)), 2_000, PAPER),
    ]
    ours, idle = controller._side_by_side("paper", contenders)
    assert (ours.state, ours.ratio) == ("", 1.0)
    assert (idle.state, idle.ratio) == ("disqualified", None)


# ------------------------------------------------------------------------------- the heating


@pytest.mark.parametrize("method", ["LSODA", "BDF"])
def test_scipy_s_solvers_find_the_network_s_course(method):
    """The same rate under another method: 5 mK after every five minutes, by steps of 10 s."""
    network = zone_network(DRAWING)
    theirs = heating._means(network, heating.scipy_on(network, heating.DUTY, method, 1e-8)())
    ours = heating._at_marks(simulate_network(network, [heating.DUTY], longest_step=10.0))
    assert np.abs(theirs - ours).max() < 5e-3
    assert np.ptp(ours) > 10.0


def test_a_solver_that_errs_by_more_than_a_thermocouple_is_disqualified():
    truth = np.zeros((3, 6))
    jobs = {"mrdamper": lambda: truth, "quick": lambda: truth + 0.2}
    ours, quick = heating._side_by_side("g", jobs, truth, repeats=2)
    assert (ours.state, quick.state, quick.ratio) == ("", "disqualified", None)


# ------------------------------------------------------------------------------- the start


def test_peers_that_are_not_there_are_gaps(monkeypatch, tmp_path):
    monkeypatch.setattr(peers, "FOLDER", tmp_path / "none")
    assert set(peers.versions().values()) == {"absent"}
    jobs = startup._jobs(tmp_path)
    assert all("--peers" in jobs[f"import {name}"].fault for name in peers.PEERS)


def test_the_small_card_is_scored_on_the_small_run(tmp_path):
    jobs = startup._jobs(tmp_path)
    job = jobs["mrdamper predict, a small card"]
    job.start()
    assert job.fault == ""
    assert len(job.cpu) == 1


# ------------------------------------------------------------------------------- what is kept


PROMISED = {
    "startup": {
        "import mrdamper, CPU": 30.0,
        "mrdamper --help, CPU": 200.0,
        "mrdamper predict, a small card, CPU": 500.0,
    },
    "controller": {
        "paper, C loop, one step": 200.0,
        "paper, Python extension, one step": 400.0,
        "recommended, C loop, one step": 1000.0,
        "recommended, Python extension, one step": 2000.0,
    },
    "heating": {"network: 30 min": 5.0},
}


@pytest.mark.parametrize("name", PROMISED)
def test_the_kept_results_hold_the_figures_that_were_asked(name):
    asked = {each["figure"]: each["bar"] for row in RESULTS[name] for each in row.get("asked", ())}
    assert PROMISED[name].items() <= asked.items()


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("startup", {"control", "sysidentpy", "pybamm", "pybop"}),
        ("controller", {"FMU in FMPy", "plain NumPy"}),
        ("heating", {"LSODA", "BDF"}),
        ("simulation", {"odeint", "solve_ivp", "numba", "JAX", "diffrax", "CVODE", "Octave", "rk4.c"}),
        ("identification", {"pymoo", "PyGAD", "CMA-ES", "differential_evolution", "lmfit"}),
    ],
)
def test_every_peer_that_was_named_has_its_row(name, wanted):
    """Installed or not: an absent one is a gap that is seen."""
    contenders = " ".join(row["contender"] for row in RESULTS[name])
    assert [each for each in wanted if each not in contenders] == []


def test_an_idle_row_never_gets_a_ratio_in_a_table():
    row = replace(Row("peer", 1.0, ratio=2.0), state="disqualified")
    assert "| out |" in table("t", [row, Row("ours", 1.0, ratio=1.0)])
