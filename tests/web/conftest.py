"""Browsers for tests of the pages, and servers of folders with runs and cards."""

from __future__ import annotations

import pytest

from tests.support.cards import write_card_of
from tests.support.rigs import mrdamper
from tests.web.browser import chromium, opened
from tests.web.served import served

CAMPAIGN = """
motions = ["sine5mm1Hz", "sine3mm2Hz"]
currents_A = [0, 1, 2]
temperatures_degC = [20, 60, 100]
held_out_temperatures_degC = [60]
held_out_motions = []
duration_s = 2.0
"""


@pytest.fixture(scope="module")
def browser(tool):
    with chromium(tool("chromium")) as started:
        yield started


@pytest.fixture(scope="session")
def site(tmp_path_factory):
    """Return a folder with runs of the virtual rig and a card, and a client of its server."""
    root = tmp_path_factory.mktemp("pages") / "damper"
    write_card_of(root / "cards" / "strong" / "card.json")
    campaign = root.with_suffix(".toml")
    campaign.write_text(CAMPAIGN, encoding="utf-8")
    assert mrdamper("rig", "--campaign", campaign, "--out", root / "runs").returncode == 0
    with served(root) as client:
        yield root, client


@pytest.fixture(scope="session")
def plain_site(tmp_path_factory):
    """Return an empty folder for all tests of a session, and a client of its server."""
    root = tmp_path_factory.mktemp("site") / "work"
    with served(root) as client:
        yield root, client


@pytest.fixture
def page(browser, site):
    """Return a browser window for the server of ``site``. A module may define another ``site``."""
    with opened(browser, site[1].address) as window:
        yield window
