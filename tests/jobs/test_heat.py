"""The command ``heat`` computes temperatures from a card and a geometry file, or prints one message."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from mrdamper.errors import InputError
from mrdamper.jobs.options import HeatOptions
from mrdamper.jobs.thermal.heat import heat
from mrdamper.models.card_schema import read_card
from mrdamper.registry import JOBS
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from tests.support.campaigns import paper_card
from tests.support.cards import PAPER_DRAWING, write_heated_card
from tests.support.heated import predict_rise
from tests.support.rigs import answer_of, mrdamper

pytestmark = pytest.mark.system


def heating(
    card: Path, damper: Path, *, options: HeatOptions | None = None, out: Path | None = None, **given: Any
) -> Any:
    """Run the job ``heat``, by default with the fast thermal network, and return its answer as JSON."""
    named = {"card": card, "drawing": damper, **given}
    return JOBS["heat"].perform(named, options or HeatOptions(model="network"), out=out)[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("heat")
    write_heated_card(place)
    return place


@pytest.fixture(scope="module")
def shown(folder):
    return mrdamper(
        "heat", folder / "card.json", "--damper", PAPER_DRAWING, "--out", folder / "out", "--json"
    )


@pytest.fixture(scope="module")
def answer(shown) -> Any:
    return answer_of(shown)


def changed(folder: Path, old: str, new: str, name: str = "changed.toml") -> Path:
    text = PAPER_DRAWING.read_text(encoding="utf-8")
    assert old in text
    (folder / name).write_text(text.replace(old, new, 1), encoding="utf-8")
    return folder / name


# ------------------------------------------------------------------------------------- values in the paper


@pytest.mark.nightly
def test_heating_with_fitted_card_agrees_with_paper():
    """Temperatures agree with the paper within 0.5 K, losses of force within 0.3 percentage points."""
    card, drawing = paper_card(), read_drawing(PAPER_DRAWING)
    run = heat(card, drawing, read_duty("sine:15mm:1Hz:2A:2100s"), HeatOptions(past_limit=True))
    assert run.bare is not None
    assert run.bare.fluid_at(1800.0) - 273.15 == pytest.approx(129.9, abs=0.5)
    assert run.bare.fluid_at(2100.0) - 273.15 == pytest.approx(140.0, abs=0.5)
    assert run.rise.fluid_at(1800.0) - 273.15 == pytest.approx(76.9, abs=0.5)
    for rise, loss in ((run.rise, 15.7), (run.bare, 25.9)):
        at_half_an_hour = np.interp(1800.0, rise.time, rise.peak_force_N)
        cold = np.interp(293.15, rise.fluid, rise.peak_force_N)
        assert 100.0 * (1.0 - at_half_an_hour / cold) == pytest.approx(loss, abs=0.3)
        assert rise.energy_closure <= 1e-9


# --------------------------------------------------------------------------------- contents of the answer


def test_heating_without_sink_is_simulated(answer):
    bare = answer["without_sink"]
    assert bare["curve"]["fluid_degC"][-1] > answer["curve"]["fluid_degC"][-1] + 30.0
    assert "fin convection" in answer["paths_W"]
    assert "fin convection" not in bare["paths_W"]


def test_temperature_limits_refer_to_hottest_points(answer):
    """The hottest points of fluid and coil are at least as hot as the mean of the part."""
    rows = {row["part"]: row for row in answer["without_sink"]["limits"]}
    assert [rows[name]["limit_degC"] for name in ("fluid", "coil", "seals")] == [130.0, 155.0, 150.0]
    for name, mean in (("fluid", "fluid"), ("coil", "coil")):
        hot = np.array(answer["without_sink"]["hot_degC"][name])
        assert (hot >= np.array(answer["without_sink"]["curve"][f"{mean}_degC"]) - 1e-9).all()


def test_heating_page_has_figures_without_external_files(answer, folder):
    page = (folder / "out" / "heat.html").read_text(encoding="utf-8")
    # The last lines of the page state the source of the card.
    assert "fingerprint of its training runs" in page
    assert "mrdamper 0." in page
    assert re.findall(r'(?:src|href)="https?://', page) == []
    pictures = re.findall(r"<svg.*?</svg>", page, flags=re.DOTALL)
    labels = [re.search(r'aria-label="([^"]*)"', picture) for picture in pictures]
    assert [label[1] for label in labels if label] == [
        "Temperatures over time", "Temperature field at the end", "Heat flows", "Loss of force",
        "The damper to scale",
    ]  # fmt: skip
    for picture in pictures:
        ET.fromstring(picture)
    assert "not reached" in page


def test_fins_in_figure_are_to_scale(folder):
    """The distance between fins in the figure equals the distance in the geometry file."""
    page = (folder / "out" / "heat.html").read_text(encoding="utf-8")
    picture = re.search(r'<svg[^>]*aria-label="The damper to scale".*?</svg>', page, flags=re.DOTALL)
    assert picture is not None
    boxes = []
    for path in re.finditer(
        r'<path[^>]*?\bd="([^"]*)"[^>]*?style="fill: (#\w+)', picture[0], flags=re.DOTALL
    ):
        numbers = np.array(re.findall(r"[ML] (-?[\d.]+) (-?[\d.]+)", path[1].replace("\n", " ")), dtype=float)
        boxes.append((path[2], numbers))
    fins = sorted(
        {tuple(box.min(axis=0)) + tuple(box.max(axis=0)) for colour, box in boxes if colour == "#c3cad1"}
    )
    body = np.concatenate([box for colour, box in boxes if colour == "#5c646c"])
    length = np.ptp(body[:, 0])
    left = sorted({fin[0] for fin in fins if fin[3] - fin[1] > 20.0})
    assert len(left) == 5
    assert np.diff(left) / length == pytest.approx(np.full(4, 20.0 / 200.0), abs=1e-3)
    long = [fin for fin in fins if fin[3] - fin[1] > 20.0]
    tall = max(fin[3] for fin in long) - min(fin[1] for fin in long)
    assert tall / length == pytest.approx(92.0 / 200.0, abs=2e-3)


def test_sink_option_replaces_heat_sink_of_geometry(folder):
    sink = folder / "sink.toml"
    sink.write_text("[sink]\nfins = 2\nwidth_mm = 10\nthickness_mm = 2\npitch_mm = 30\n", encoding="utf-8")
    found = heating(folder / "card.json", PAPER_DRAWING, sink=sink)
    assert found["sink"] == "2 fins, 10 mm wide, 2 mm thick at 30 mm pitch, aluminium-alloy"
    assert found["correlations"]["fins"] == "annular fins, Tsubouchi and Masuda"


def test_heating_curve_ends_at_fluid_limit(folder):
    """The curve without a heat sink ends when the mean fluid temperature reaches 130 degC."""
    bare = changed(folder, "fins = 5", "fins = 0")
    ended: Any = heating(folder / "card.json", bare, duty="sine:15mm:1Hz:2A:3000s", options=HeatOptions())
    past = HeatOptions(past_limit=True)
    gone_on: Any = heating(folder / "card.json", bare, duty="sine:15mm:1Hz:2A:3000s", options=past)
    assert (ended["sink"], ended["without_sink"]) == (None, None)
    assert ended["curve"]["fluid_degC"][-1] == pytest.approx(130.0, abs=1e-6)
    assert ended["time_to_limit_s"] == pytest.approx(gone_on["time_to_limit_s"], abs=1.0)
    # The hottest point reaches the limit before the mean temperature, at which the curve ends.
    assert ended["time_to_limit_s"] < ended["curve"]["time_s"][-1]
    early, late = ended["time_to_limit_interval_s"]
    assert early < ended["time_to_limit_s"] < (late or np.inf)
    assert gone_on["curve"]["time_s"][-1] == pytest.approx(3000.0)
    assert gone_on["curve"]["fluid_degC"][-1] > 135.0
    assert any("reaches its limit, 130 degC" in note for note in ended["notes"])
    page = mrdamper("heat", folder / "card.json", "--damper", bare, "--duty", "sine:15mm:1Hz:2A:3000s")
    assert f"reached after {ended['time_to_limit_s'] / 60:.1f} min" in page.stdout


def test_assumed_temperature_dependence_is_marked(folder):
    card = write_heated_card(folder, "assumed.json", assumed=True)
    found: Any = heating(card, PAPER_DRAWING, out=folder / "assumed")
    assert found["assumed"] == ["viscosity", "yield_force"]
    page = (folder / "assumed" / "heat.html").read_text(encoding="utf-8")
    assert "The temperature dependence is assumed" in page


def test_temperatures_outside_card_range_are_noted(folder):
    card = read_card(folder / "card.json")
    drawing, duty = read_drawing(PAPER_DRAWING).with_sink(None), read_duty("sine:15mm:1Hz:2A:600s")
    run = heat(card, drawing, duty, HeatOptions(start_degC=-10.0))
    assert any("identified from 20.0 to 130.0 degC, and beyond that its temp" in note for note in run.notes)
    held = replace(card, damper=replace(card.damper, temperature_range=(288.15, 408.15)))
    run = heat(held, drawing, duty, HeatOptions(start_degC=-10.0))
    assert any("below 15 or above 135 degC its coefficients keep" in note for note in run.notes)
    assert heat(card, drawing, duty).notes == ()


def test_damper_at_rest_has_no_force_loss(folder):
    (folder / "rest.csv").write_text(
        "time_s,amplitude_mm,frequency_Hz,current_A\n0,0,0,2\n600,0,0,2\n", encoding="utf-8"
    )
    found: Any = heating(
        folder / "card.json", PAPER_DRAWING, duty=str(folder / "rest.csv"), out=folder / "rest"
    )
    assert found["force_loss_percent"] is None
    assert set(found["peak_force_N"]) == {None}
    assert found["energy_J"]["mechanical"] == 0.0
    assert found["curve"]["coil_degC"][-1] > found["curve"]["fluid_degC"][-1] > 20.0


@pytest.mark.nightly
def test_repeated_heating_simulation_gives_identical_page(folder):
    for name in ("one", "two"):
        heating(folder / "card.json", PAPER_DRAWING, out=folder / name)
    one, two = ((folder / name / "heat.html").read_bytes() for name in ("one", "two"))
    assert one == two


# ------------------------------------------------------------------------------------- uncertainty


def test_heating_interval_contains_curve_and_time(folder):
    bare = changed(folder, "fins = 5", "fins = 0", "open.toml")
    found: Any = heating(folder / "card.json", bare, duty="sine:15mm:1Hz:2A:3600s")
    soonest, latest = found["time_to_limit_interval_s"]
    assert soonest < found["time_to_limit_s"] < latest
    interval, curve = found["interval"], found["curve"]
    assert interval["probability"] == 0.9
    assert interval["time_s"][-1] == pytest.approx(3600.0)
    for edge, side in (("low", 1.0), ("high", -1.0)):
        at = np.interp(curve["time_s"], interval["time_s"], interval[f"{edge}_degC"])
        assert (side * (np.array(curve["fluid_degC"]) - at) >= -1e-6).all()
    short: Any = heating(folder / "card.json", bare, duty="sine:15mm:1Hz:2A:600s")
    assert short["time_to_limit_interval_s"] == [None, None]


@pytest.fixture(scope="module")
def astray(folder) -> tuple[Path, float]:
    """Return a file with 8 min of heating of a perturbed damper, and the final temperature [degC]."""
    drawing = read_drawing(PAPER_DRAWING)
    winding = replace(drawing.coil.material, conductivity=0.8 * drawing.coil.material.conductivity)
    own = replace(drawing.calibration, heat_capacity=1.25, film=1.1)
    damper = replace(drawing, calibration=own, coil=replace(drawing.coil, material=winding))
    truth = predict_rise(read_card(folder / "card.json"), damper, longest_step=10.0)
    time = np.arange(0.0, 480.5, 2.0)
    seen = PchipInterpolator(truth.time, truth.fluid_degC)(time)
    seen = seen + 0.3 * np.random.default_rng(0).standard_normal(len(time))
    path = folder / "warm_up.csv"
    rows = "\n".join(f"{t:g},{degrees:.3f}" for t, degrees in zip(time, seen, strict=True))
    path.write_text(f"time_s,fluid_degC\n{rows}\n", encoding="utf-8")
    return path, float(truth.fluid_degC[-1])


@pytest.fixture(scope="module")
def calibrated(folder, astray) -> Any:
    return answer_of(
        mrdamper(
            "heat", folder / "card.json", "--damper", PAPER_DRAWING, "--calibrate", astray[0],
            "--out", folder / "fitted", "--json",
        )
    )  # fmt: skip


@pytest.mark.nightly
def test_first_minutes_of_heating_predict_final_temperature(calibrated, answer, astray):
    """Calibration with 8 min of data narrows the interval to a fifth. The prediction is within 2 K."""
    width = {}
    for name, found in (("drawing", answer), ("curve", calibrated)):
        low, high = found["interval"]["low_degC"][-1], found["interval"]["high_degC"][-1]
        width[name] = high - low
        assert low < found["curve"]["fluid_degC"][-1] < high
    assert width["curve"] < 0.2 * width["drawing"]
    assert calibrated["curve"]["fluid_degC"][-1] == pytest.approx(astray[1], abs=2.0)
    assert abs(answer["curve"]["fluid_degC"][-1] - astray[1]) > 3.0


@pytest.mark.nightly
def test_calibration_reports_errors_and_correlation(calibrated):
    told = calibrated["calibration"]
    assert (told["place"], told["from_s"], told["to_s"]) == ("fluid", 0.0, 480.0)
    assert 0.0 < told["heat_capacity_error"] < 0.05 * told["heat_capacity"]
    assert 0.0 < told["film_error"] < 0.2 * told["film"]
    assert told["correlation"] < -0.5
    assert told["noise_K"] == pytest.approx(0.3, rel=0.25)
    assert told["entries"]["calibration"]["heat_capacity"] == pytest.approx(1.25, rel=0.05)


@pytest.mark.nightly
def test_calibrated_geometry_reproduces_heating_curve(calibrated, folder):
    """``heat`` accepts the calibrated geometry file and reproduces the calibrated curve."""
    assert calibrated["drawing"] == str(folder / "fitted" / "calibrated.toml")
    start = HeatOptions(start_degC=calibrated["calibration"]["start_degC"])
    again: Any = heating(folder / "card.json", folder / "fitted" / "calibrated.toml", options=start)
    assert again["curve"]["fluid_degC"] == pytest.approx(calibrated["curve"]["fluid_degC"], abs=1e-3)
    assert again["calibration"] is None


def test_implausible_heating_curve_is_rejected(folder):
    path = folder / "contact.csv"
    rows = "".join(f"{20 * k},{20 + 30 * (k % 2)}\n" for k in range(25))
    path.write_text(f"time_s,fluid_degC\n{rows}", encoding="utf-8")
    run = mrdamper(
        "heat", folder / "card.json", "--damper", PAPER_DRAWING, "--calibrate", path, "--out", folder / "none"
    )
    assert (run.returncode, run.stdout) == (4, "")
    assert "contact.csv: this damper under this duty is" in run.stderr
    assert not (folder / "none").exists()


# ------------------------------------------------------------------------------------------ rejected inputs


@pytest.mark.parametrize(
    ("duty", "message"),
    [
        ("sine:15mm:1Hz:2V:1800s", "its command is in V, the card's in A; expected the same unit"),
        ("sine:15:1Hz:2A:1800s", "sine"),
        ("sine:15mm:1Hz:2A", "there is no duration after the command 2A"),
        ("sine:15mm:1Hz:2A:1e9s", "it lasts 1e+09 s; expected at most 1e+06 s"),
        ("sine:150mm:4Hz:2A:1800s", "is at"),
    ],
)
def test_invalid_load_cycle_is_rejected(folder, duty, message):
    with pytest.raises(InputError, match=re.escape(message)):
        heating(folder / "card.json", PAPER_DRAWING, duty=duty, options=HeatOptions(past_limit=True))


def test_larger_heat_capacity_slows_heating(folder):
    """With 50 % more heat capacity, the damper is cooler after 10 min."""
    card, duty = folder / "card.json", "sine:15mm:1Hz:2A:600s"
    quick = HeatOptions(with_sink=False)
    table = "[heat_capacity]\nrange_degC = [20, 140]\ndamper_J_K = [1450, 2.5]\n\n[body]"
    ends = [
        heating(card, drawing, duty=duty, options=quick)
        for drawing in (PAPER_DRAWING, changed(folder, "[body]", table, "stored.toml"))
    ]
    assert ends[1]["curve"]["fluid_degC"][-1] < ends[0]["curve"]["fluid_degC"][-1] - 3.0
    assert ends[1]["energy_closure"] < 1e-9
