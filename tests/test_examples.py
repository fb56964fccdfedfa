"""The scripts in ``examples`` run unchanged and print the expected values."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mrdamper
from mrdamper.models.card_schema import write_card
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import find_preset

pytestmark = pytest.mark.system

FOLDER = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(FOLDER.glob("*.py"))


def said_by(script: str, *arguments: str | Path) -> str:
    run = subprocess.run(
        [sys.executable, FOLDER / script, *arguments], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    return run.stdout


def number(pattern: str, said: str) -> float:
    """Return the number at the only match of a pattern in the output."""
    found = re.findall(pattern, said)
    assert len(found) == 1, said
    return float(found[0])


@pytest.fixture(scope="module")
def card(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the path of a card that was fitted to a small campaign."""
    tests = Campaign(
        motions=("sine15mm1Hz", "sine5mm1Hz", "nonperiodic"),
        currents_A=(0.0, 1.0, 2.0),
        temperatures_degC=(20.0, 120.0),
    )
    path = tmp_path_factory.mktemp("card") / "card.json"
    runs = [run for run, _ in measure(find_preset("nominal"), tests)]
    write_card(mrdamper.fit(runs, "double-bouc-wen").card(), path)
    return path


def test_every_example_script_is_tested():
    here = Path(__file__).read_text(encoding="utf-8")
    assert [script.name for script in SCRIPTS if f'"{script.name}"' not in here] == []
    assert [script.name for script in SCRIPTS if len(script.read_text("utf-8").splitlines()) > 170] == []


@pytest.mark.nightly
def test_real_damper_example_is_accurate(real_data):
    said = said_by("fit_real_data.py", real_data / "dev")
    assert number(r"held_out: median ([\d.]+) %", said) < 6.0
    assert number(r"chirp: ([\d.]+) %", said) < 17.0


@pytest.mark.nightly
def test_custom_law_example_is_fitted():
    """The fitted error is 4.8 %. The fit takes 50 s of CPU time because a law in Python is slow."""
    assert number(r"error ([\d.]+) %", said_by("custom_law.py")) < 6.0


def test_rheometer_example_selects_arrhenius():
    """From 20 to 100 degC, the viscosity decreases by 69.4 %, as docs/fluid.md states."""
    said = said_by("rheometer_fit.py")
    assert said.startswith("arrhenius")
    assert number(r"arrhenius .* falls by ([\d.]+)", said) == pytest.approx(69.4, abs=0.1)


@pytest.mark.nightly
def test_heat_sink_example_halves_mass(card):
    said = said_by("heat_sink_study.py", card)
    coolest = [float(found) for found in re.findall(r"coolest ([\d.]+) degC", said)]
    assert coolest == sorted(coolest)
    assert number(r"1 mm or more: .* from (\d+) g", said) < 0.5 * number(r"as drawn .* (\d+) g", said)


@pytest.mark.nightly
def test_recommended_controller_is_best_when_hot(card):
    said = said_by("controller_comparison.py", card)
    hot = {
        name: number(rf"100 degC {name} +RMS +([\d.]+) N", said)
        for name in ("recommended", "paper", "paper-unaware")
    }
    assert hot["recommended"] < 0.3 * hot["paper"] < 0.3 * hot["paper-unaware"]


@pytest.mark.nightly
def test_quarter_car_example_improves_comfort_and_load():
    """Body acceleration and tyre load decrease by more than 10 % compared with zero current."""
    said = said_by("quarter_car.py")
    comfort, load = (
        [float(found) for found in re.findall(pattern, said)] for pattern in (r"body ([\d.]+)", r"tyre (\d+)")
    )
    assert comfort[1] < 0.9 * comfort[0]
    assert load[1] < 0.9 * load[0]


@pytest.mark.nightly
def test_quarter_car_example_uses_given_card(card):
    """With a given card (file of a fitted damper), a larger current also reduces the suspension travel."""
    said = said_by("quarter_car.py", card)
    rattle = [float(found) for found in re.findall(r"rattle space ([\d.]+) mm", said)]
    assert rattle[1] < rattle[0]


@pytest.mark.nightly
def test_mean_damper_power_depends_on_tyre_only():
    """A linear damper dissipates k_t S / 4 on average. S is the one-sided spectrum of a white road velocity.

    The power does not depend on the rest of the car because the road excites it only through the tyre.
    """
    names = runpy.run_path(str(FOLDER / "quarter_car.py"))
    step = names["STEP_S"]

    class WhiteRoad:
        def displacement(self, t):
            speed = np.random.default_rng(1).standard_normal(len(t)) * 0.02
            return np.cumsum(speed) * step

    car = names["QuarterCar"]()
    for damping in (1000.0, 4000.0):
        ride = names["drive"](car, lambda _, z, c=damping: c * (z[1] - z[3]), WhiteRoad(), 100.0)
        v = ride.states[:, 1] - ride.states[:, 3]
        spectrum = 2.0 * 0.02**2 * step
        assert np.mean(ride.force * v) == pytest.approx(car.tyre_N_m * spectrum / 4.0, rel=0.1)


@pytest.mark.nightly
def test_fmu_example_runs_in_fmpy(card, tool):
    tool("cc")
    pytest.importorskip("fmpy")
    said = said_by("fmu_in_fmpy.py", card)
    assert number(r"force up to ([\d.]+) N", said) == pytest.approx(600.0, rel=0.1)
