"""One day at the laboratory, in the browser: files as they were published, to code that runs on the target.

What is downloaded at the end is taken on without the server: compiled, run on the measured motion, and
compared with what was measured and with what the page said of the card.
"""

from __future__ import annotations

import io
import json
import re
import subprocess
import zipfile

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.support.rigs import answer_of, mrdamper
from tests.web.browser import opened, shoot
from tests.web.served import series_of, served
from tests.web.walking import csv_rows, download, drop_files, map_the_logger, move, place_of, plot

pytestmark = pytest.mark.system

RUN = "ME5mm3Hz_0.50A"
RATE = 1000


@pytest.mark.nightly
@pytest.mark.usefixtures("real_data")
def test_from_the_raw_files_to_compiled_code(browser, tmp_path, real_data, tool):  # noqa: PLR0915 - one way
    compiler = tool("cc")
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed")
    validation = pytest.importorskip("fmpy.validation")
    folder = tmp_path / "damper"
    with served(folder) as client, opened(browser, client.address) as page:
        _bring(page, real_data, tmp_path)
        page.goto("/#/fit")
        page.fill("#fit-card", "press")
        page.get_by_label(RUN).check()
        page.select_option("#fit-law", "series-valve")  # the paper's controller, too, takes it
        page.click("#start-fit")
        page.wait_for_selector("#fit-tiles", timeout=120_000)
        assert page.locator("tr.held", has_text=RUN).count() == 1
        errors = {run["name"]: run for run in csv_rows(folder / "cards" / "press" / "errors.csv")}
        assert errors[RUN]["split"] == "held_out"
        shoot(page, "walk-identify")
        page.get_by_label("Runs", exact=True).select_option("ME5mm3Hz.txt")
        page.click("#evaluate")
        page.get_by_text("press on 5 runs").wait_for()
        shoot(page, "walk-predict")

        page.goto(f"/#/loops?run={RUN}&card=press")
        page.wait_for_selector("#loops-said[data-ms]")
        told, model = series_of(client.ask("GET", f"/api/runs/{RUN}/model?card=press").content)
        assert f"{told['nrmse_percent']:.2f}" in page.inner_text(f"tr:has-text('{RUN}')")
        shoot(page, "walk-loops")

        page.goto("/#/heating?card=press")
        page.wait_for_selector("figure[data-asked]")
        move(page, "Amplitude", 5)
        move(page, "Frequency", 3)
        shoot(page, "walk-heating")

        page.goto("/#/heatsink?card=press")
        page.get_by_label("Thinnest fin, mm").fill("2")
        page.get_by_label("Amplitude, mm").fill("5")
        page.get_by_label("Frequency, Hz").fill("3")
        page.click("#start-sink")
        page.wait_for_selector("#section svg")
        job = next(each for each in client.get("/api/jobs")["jobs"] if each["kind"] == "heatsink")
        front = client.get(f"/api/jobs/{job['id']}")["answer"]["front"]
        figure = plot(page, "Front: click a design")
        figure.locator("canvas.plot-over").click(position=place_of(page, figure, front[0]))
        page.get_by_text(f"By the zone network, with {front[0]['fins']} fin").wait_for()
        shoot(page, "walk-sink")

        page.goto("/#/tracking?card=press")
        page.fill("#track-temperatures-degC", "20")
        page.click("#start-track")
        said = page.get_by_text("its data cover -4.61 to 4.65 mm")  # the usual target moves over 5 mm
        said.wait_for()
        shoot(page, "walk-tracking-refused")
        page.get_by_label("sine-900N-1Hz").uncheck()
        page.get_by_label("sine-1100N-2Hz").check()
        page.click("#start-track")
        page.wait_for_selector("#trace")
        assert page.get_by_text("what the damper can give").is_visible()
        shoot(page, "walk-tracking")

        page.goto("/#/export?card=press")
        assert page.get_by_label("Holds").input_value() == "model"  # the card knows no lag to control with
        page.click("#start-export")
        page.get_by_text("The compiled code gives the model's own bits").wait_for()
        shoot(page, "walk-export")
        archive = download(page, page.get_by_role("link", name=re.compile(r"damper_c\.zip")).click)
        unit = download(page, page.get_by_role("link", name=re.compile(r"damper\.fmu")).click)
        page.goto("/#/jobs")
        newest_first = ["done", "done", "failed", "done", "done", "done"]
        expect(page.locator("td .tag")).to_have_text(newest_first)
        expect(page.locator("#busy")).to_be_hidden()
        shoot(page, "walk-jobs")

    # From here on without the server.
    with zipfile.ZipFile(io.BytesIO(archive)) as files:
        assert files.testzip() is None
        files.extractall(tmp_path)
    place = tmp_path / "damper_c"
    record = json.loads((place / "verification.json").read_text(encoding="utf-8"))
    assert record["passed"] is True
    sources = ("damper.c", "damper_tables.c", "main.c")
    done = subprocess.run(
        [compiler, "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-o", "replay", *sources, "-lm"],
        capture_output=True, text=True, check=False, cwd=place,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    count = told["samples"]
    names = ("displacement_mm", "velocity_mm_s")
    displacement, velocity = (1e-3 * model[name].astype(float) for name in names)
    current = np.full(count, 0.5)
    kelvin = np.full(count, 293.15)
    rows = np.column_stack([np.arange(count) / RATE, displacement, velocity, current, kelvin])
    np.savetxt(
        place / "in.csv", rows, fmt="%.17g", delimiter=",", comments="",
        header="time_s,displacement_m,velocity_m_s,current_A,temperature_K",
    )  # fmt: skip
    subprocess.run([place / "replay", "in.csv", "out.csv"], check=True, cwd=place)
    force = np.array([float(row["force_N"]) for row in csv_rows(place / "out.csv")])

    fmu = tmp_path / "damper.fmu"
    fmu.write_bytes(unit)
    assert validation.validate_fmu(str(fmu)) == []
    table = np.rec.fromarrays(
        list(rows.T), names=["time", "displacement", "velocity", "current", "temperature"]
    )  # type: ignore[call-overload]
    found = fmpy.simulate_fmu(
        str(fmu),
        stop_time=count / RATE,
        output_interval=1.0 / RATE,
        start_values={"use_velocity": True},
        input=table,
        output=["force"],
    )
    unit_force = found["force"][1 : count + 1].astype(np.float32)
    np.testing.assert_array_equal(unit_force, force.astype(np.float32))  # two ways, the same bits

    # On a run that the fit has not seen the compiled model, which takes one step a millisecond, is little
    # farther from the measurement than the force that the page has drawn.
    late = slice(count // 4, None)
    measured, drawn = (model[name][late].astype(float) for name in ("measured_N", "force_N"))
    spread = np.std(measured)
    assert np.sqrt(np.mean((force[late] - drawn) ** 2)) < 0.05 * spread
    drawn_off, compiled_off = (
        100.0 * np.sqrt(np.mean((each - measured) ** 2)) / spread for each in (drawn, force[late])
    )
    print(f"on the run that was held out: drawn {drawn_off:.2f} %, compiled {compiled_off:.2f} % off")
    assert compiled_off < drawn_off + 3.0

    # And the command line goes on where the page has stopped.
    card = folder / "cards" / "press" / "card.json"
    again = answer_of(mrdamper("evaluate", card, folder / "runs" / "ME5mm3Hz.txt", "--json"))
    by_name = {run["name"]: run for run in again["runs"]}
    assert by_name[RUN]["nrmse_percent"] == pytest.approx(told["nrmse_percent"], rel=1e-6)


def _bring(page, real_data, tmp_path):
    """Drop the two raw files and a broken one; say what their channels are."""
    broken = tmp_path / "broken.csv"
    broken.write_text("time_s,displacement_mm,force_N\n0,0,1\n0.001,oops,2\n0.002,0.1,3\n", encoding="utf-8")
    page.goto("/")
    page.wait_for_selector("#drop")
    raw = real_data / "raw"
    drop_files(page, "#drop", [raw / "ME5mm3Hz.txt", raw / "ensaio.A.1.mat", broken])
    page.get_by_text("not understood").nth(2).wait_for()
    assert "line 3" in page.inner_text("tr:has-text('broken.csv')")
    page.get_by_label("Look into ME5mm3Hz.txt").click()
    map_the_logger(page, currents="0, 0.25, 0.5, 0.75, 1", rate=str(RATE))
    page.wait_for_selector("#preview .notice.good")
    shoot(page, "walk-map")
    page.click("#save-map")
    page.get_by_role("link", name="ME5mm3Hz_1.00A").first.wait_for()
    page.get_by_label("Look into ensaio.A.1.mat").click()
    page.get_by_label("dist is").select_option("displacement")
    page.get_by_label("dist in").select_option("mm")
    page.get_by_label("forc is", exact=True).select_option("force")
    page.get_by_label("forc in", exact=True).select_option("N")
    page.get_by_label("Coil voltage, V").fill("3.212")
    page.get_by_label("Sampling rate, Hz").fill("100")
    page.wait_for_selector("#preview .notice.good")
    page.click("#save-map")
    page.get_by_role("link", name="ensaio.A.1", exact=True).first.wait_for()
    shoot(page, "walk-runs")
