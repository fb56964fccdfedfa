"""Browsers and served folders for the tests of the pages."""

from __future__ import annotations

import pytest

from tests.support.cards import write_card_of
from tests.support.rigs import mrdamper
from tests.web.browser import chromium, opened
from tests.web.served import served


@pytest.fixture(scope="module")
def browser(tool):
    with chromium(tool("chromium")) as started:
        yield started


@pytest.fixture(scope="session")
def site(tmp_path_factory):
    """Return a folder with runs of the virtual rig and a card, and a client of its server."""
    root = tmp_path_factory.mktemp("pages") / "damper"
    (root / "cards" / "strong").mkdir(parents=True)
    write_card_of(root / "cards" / "strong" / "card.json")
    assert mrdamper("rig", "--campaign", "short", "--out", root / "runs").returncode == 0
    with served(root) as client:
        client.read_all()
        yield root, client


@pytest.fixture
def page(browser, site):
    with opened(browser, site[1].address) as window:
        yield window
