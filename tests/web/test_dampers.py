"""Several dampers on one server, each with its own work; and what runs are called by who chooses them."""

from __future__ import annotations

import shutil
import tomllib

import pytest
from playwright.sync_api import expect

from tests.support.tracked import write_a_card
from tests.web.browser import opened, shoot
from tests.web.served import served
from tests.web.walking import a_sine_run

pytestmark = pytest.mark.nightly

NAME = "Dämpfer 2 (RD-8040)"


def test_each_damper_has_its_own_work(browser, tmp_path):
    """A second damper is made on the page, given a run and left again; each has its own runs and fits."""
    root = tmp_path / "first"
    (root / "runs").mkdir(parents=True)
    a_sine_run(root / "runs" / "one.csv", 300.0)
    with served(root) as client, opened(browser, client.address) as page:
        page.goto("/")
        page.locator("#folder", has_text="first").click()
        page.locator("#new-damper").fill(NAME)
        shoot(page, "dampers")
        page.get_by_role("button", name="Create").click()
        expect(page.locator("#folder")).to_have_text(NAME)
        expect(page.get_by_text("No runs yet")).to_be_visible()
        second = tmp_path / "second.csv"
        a_sine_run(second, 500.0)
        page.locator("#picker").set_input_files(second)
        page.get_by_role("link", name="second", exact=True).first.click()
        expect(page.locator("#view-runs, [data-shown=loops] figure").first).to_be_visible()
        own = root / "dampers" / NAME
        assert (own / "runs" / "second.csv").is_file()
        shutil.copytree(own, tmp_path / "seen by the command line", ignore=shutil.ignore_patterns(".*"))
        page.goto(page.url.split("#")[0] + "#/fit")
        (own / "cards" / "soft").mkdir()
        write_a_card(own / "cards" / "soft" / "card.json")  # by hand
        expect(page.get_by_text("soft", exact=True).first).to_be_visible()
        shoot(page, "damper-second")
        page.locator("#folder").click()
        page.get_by_role("link", name="first", exact=True).click()
        expect(page.locator("#folder")).to_have_text("first")
        expect(page.get_by_role("link", name="one", exact=True).first).to_be_visible()
        expect(page.get_by_role("link", name="second", exact=True)).to_have_count(0)
        page.locator("#folder").click()
        page.get_by_label(f"Remove {NAME}").click()
        page.locator("#toasts").get_by_role("button", name="Put back").wait_for()
        assert not own.exists()
        page.locator("#toasts").get_by_role("button", name="Put back").click()
        page.locator("#folder").click()
        expect(page.get_by_role("link", name=NAME)).to_be_visible()
        assert (own / "runs" / "second.csv").is_file()


def test_runs_are_tagged_chosen_by_tag_and_a_spoiled_file_of_tags_is_told(browser, tmp_path):
    """Tags are a TOML file beside the runs, which may be written by hand; Identify chooses by them."""
    runs = tmp_path / "damper" / "runs"
    runs.mkdir(parents=True)
    for k in range(4):
        a_sine_run(runs / f"run{k}.csv", 300.0 + k, current_A=float(k % 2))
    tags = runs / "tags.toml"
    with served(tmp_path / "damper") as client, opened(browser, client.address) as page:
        client.read_all()
        page.goto("/#/runs")
        page.get_by_label("Command", exact=True).select_option("1.00 A")
        page.get_by_label("Tag for the runs below").fill("wärm")
        page.get_by_role("button", name="Tag", exact=True).click()
        page.get_by_label("Take wärm off run1").click()
        expect(page.get_by_label("Take wärm off run1")).to_have_count(0)
        assert tomllib.loads(tags.read_text()) == {"run3.csv": {"run3": ["wärm"]}}
        tags.write_text('["run0.csv"]\nrun0 = ["by hand"]\n["run3.csv"]\nrun3 = ["wärm"]\n')
        page.get_by_label("Command", exact=True).select_option("")
        expect(page.get_by_label("Take by hand off run0")).to_be_visible()
        shoot(page, "runs-tagged", whole=True)
        page.get_by_label("Tag", exact=True).select_option("wärm")
        page.goto("/#/fit")
        page.locator("#choose-tag").select_option("wärm")
        expect(page.locator("#chosen-runs summary")).to_contain_text("1 of 4 runs")
        tags.write_text("[[")
        page.goto("/#/runs")
        expect(page.get_by_text("Tags are not shown: tags.toml")).to_be_visible()
        refused = client.ask("PUT", "/api/tags", json={"runs": {"run0.csv": ["run0"]}, "tag": "x"})
        assert refused.status_code == 422
        assert tags.read_text() == "[["
