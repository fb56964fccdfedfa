"""Several dampers on one server with separate files."""

from __future__ import annotations

import shutil

import pytest
from playwright.sync_api import expect

from tests.support.cards import write_card_of
from tests.web.browser import opened, shoot
from tests.web.served import served
from tests.web.walking import a_sine_run

pytestmark = pytest.mark.nightly

NAME = "Dämpfer 2 (RD-8040)"


def test_dampers_have_separate_files(browser, tmp_path):
    """A second damper gets its own runs and fits, and it can be removed and restored."""
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
        write_card_of(own / "cards" / "soft" / "card.json")
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
