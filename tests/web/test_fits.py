"""Table of fits: sorting, filter, and repeated fits."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.support.cards import write_card_of
from tests.support.rigs import mrdamper
from tests.web.browser import opened, shoot
from tests.web.served import served
from tests.web.walking import plot

pytestmark = pytest.mark.nightly

FITS, ACTIONS = 50, 3
CAMPAIGN = (
    'motions = ["sine5mm1Hz"]\ncurrents_A = [0, 1, 2]\ntemperatures_degC = [20]\nsteps = false\n'
    "held_out_temperatures_degC = []\nheld_out_motions = []\n"
)


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """Return a folder with three runs and 50 cards, and a client of its server."""
    root = tmp_path_factory.mktemp("fits") / "damper"
    campaign = tmp_path_factory.mktemp("asked") / "campaign.toml"
    campaign.write_text(CAMPAIGN, encoding="utf-8")
    assert mrdamper("rig", "--campaign", campaign, "--out", root / "runs").returncode == 0
    for k in range(FITS):
        (root / "cards" / f"fit-{k:02d}").mkdir(parents=True)
        write_card_of(root / "cards" / f"fit-{k:02d}" / "card.json")
    with served(root) as client:
        client.read_all()
        yield root, client


def test_fit_table_keeps_order_and_filter(browser, many):
    """Order and filter are stored in the address."""
    _, client = many
    with opened(browser, client.address) as page:
        page.goto("/#/fit")
        names = page.locator("#fits tbody td.name b")
        page.get_by_role("button", name="Sort by fit").click()
        expect(names.first).to_have_text("fit-00")
        page.get_by_role("button", name="Sort by fit").click()
        expect(names.first).to_have_text("fit-49")
        page.get_by_label("Find", exact=True).fill("fit-13")
        expect(names).to_have_count(1)
        shoot(page, "fits", whole=True)
        with opened(browser, client.address) as other:
            other.goto(page.url)
            expect(other.locator("#fits tbody td.name b")).to_have_text(["fit-13"])


def test_fit_shows_worst_runs_and_repeats(browser, many):
    """The page shows the worst runs of a fit, and Again fills the form with its options."""
    _, client = many
    asked = {"law": "bouc-wen"}
    job = client.job("fit", card="quick", **asked)
    assert client.ended(job, 200.0)["state"] == "done"
    client.job("check")
    with opened(browser, client.address) as page:
        page.goto(f"/#/fit?job={job}")
        page.wait_for_selector("#loops-said[data-ms]")
        runs = client.get(f"/api/jobs/{job}")["answer"]["runs"]
        worst = max(runs, key=lambda run: run["nrmse_percent"])
        expect(
            page.get_by_role("group", name="Runs drawn").get_by_label(worst["name"], exact=True)
        ).to_be_checked()
        assert plot(page, "Residual over time").is_visible()
        page.select_option("#fit-law", "double-bouc-wen")
        page.get_by_label("Again with the options of quick").click()
        expect(page.locator("#fit-law")).to_have_value("bouc-wen")
        expect(page.locator("#fit-card")).to_have_value("damper")
        shoot(page, "fit-view", whole=True)
