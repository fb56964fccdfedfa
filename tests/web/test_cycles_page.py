"""Cycles in the browser: a record is chosen, counted, stopped, drawn over its life and saved."""

from __future__ import annotations

import csv
import io
from math import pi

import numpy as np
import polars as pl
import pytest
from playwright.sync_api import expect

from mrdamper.registry import JOBS
from tests.web.browser import opened, shoot
from tests.web.served import served
from tests.web.walking import download, plot, saved_table

pytestmark = pytest.mark.system

OF_CYCLE, CYCLES, STEP_S = 100, 600, 2e-3
FADE = 0.3  # of the force, over the record


def write_record(path, *, names=("time_s", "displacement_mm", "force_N", "current_A"), newton=1.0):
    """Write a record of sines whose force fades from 900 N on, warming by 30 K; one row has no force."""
    k = np.arange(OF_CYCLE * (CYCLES + 1))
    life = k / len(k)
    force = 900.0 * (1.0 - FADE * life) * np.cos(2.0 * pi * k / OF_CYCLE) / newton
    force[len(k) // 2] = np.nan
    columns = [STEP_S * k, 10.0 * np.sin(2.0 * pi * k / OF_CYCLE), force, np.ones(len(k))]
    frame = pl.DataFrame(dict(zip(names, columns, strict=True)))
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".parquet":
        frame.with_columns(temperature_degC=20.0 + 30.0 * life).write_parquet(path)
    else:
        frame.write_csv(path)
    return path


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """Return a folder with two long records, and a client of its server."""
    root = tmp_path_factory.mktemp("cycles") / "damper"
    write_record(root / "records" / "endurance.parquet")
    write_record(root / "records" / "other names.csv", names=("a", "b", "c", "d"), newton=1e3)
    with served(root) as client:
        yield root, client


@pytest.fixture
def page(browser, rig):
    with opened(browser, rig[1].address) as window:
        yield window


def count(page):
    page.click("#start-cycles")
    page.wait_for_selector("#cycles-tiles")


@pytest.mark.nightly
def test_a_record_is_counted_and_drawn_over_its_life(page, rig):
    """What the page draws is in the folder's table, and is what the command says."""
    root, client = rig
    page.goto("/#/cycles")
    page.select_option("#cycles-record", "endurance.parquet")
    count(page)
    said = page.inner_text("#cycles-result")
    assert f"{CYCLES - 1} cycles took up" in said  # one that the break touches is left out
    assert "left out at breaks: 1" in said
    expect(page.locator("#cycles-result")).to_contain_text("lack a number")
    job = next(each for each in client.get("/api/jobs")["jobs"] if each["kind"] == "cycles")
    place = root / "results" / job["id"]
    rows = list(csv.DictReader(io.StringIO((place / "cycles.csv").read_text(encoding="utf-8"))))
    header, drawn = saved_table(page, plot(page, "Energy per cycle"))
    assert header[0] == "cycle, number"
    assert [float(row[1]) for row in drawn] == pytest.approx(
        [float(row["energy_J"]) for row in rows], rel=1e-6
    )
    change = float(page.locator("tr", has_text="energy per cycle").inner_text().split("\t")[6])
    assert change == pytest.approx(-100.0 * FADE, abs=0.5)
    for title in ("Peak forces", "Secant stiffness", "Mean temperature"):
        assert plot(page, title).is_visible()
    figure = plot(page, "Peak forces")
    assert b"highest force" in download(page, figure.get_by_role("button", name="SVG").click)
    assert download(page, figure.get_by_role("button", name="PNG").click).startswith(b"\x89PNG")
    shoot(page, "cycles", whole=True)
    with page.context.expect_page() as waiting:
        page.get_by_role("link", name="Open the report").click()
    waiting.value.wait_for_load_state()
    assert "energy per cycle" in waiting.value.inner_text("body")
    told = JOBS["cycles"].perform({"record": root / "records" / "endurance.parquet"})[1]
    answer = client.get(f"/api/jobs/{job['id']}")["answer"]
    assert {name: answer[name] for name in ("cycles", "energy_J", "figures")} == {
        name: told[name] for name in ("cycles", "energy_J", "figures")
    }
    page.reload()  # and it is found again
    page.wait_for_selector("#cycles-tiles")
