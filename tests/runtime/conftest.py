"""Fixture of a preloaded process that runs commands, for tests that kill and interrupt commands."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.cards import write_card_of
from tests.support.kills import CAMPAIGN, Nursery


@pytest.fixture(scope="session")
def nursery(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nursery]:
    """Start a process that runs commands in a folder with runs and a card (``tests/support/kills.py``)."""
    folder = tmp_path_factory.mktemp("nursery")
    (folder / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    write_card_of(folder / "card.json")
    with Nursery(folder) as running:
        assert running.run("rig", "--campaign", "campaign.toml", "--out", "runs") == 0, running.said
        yield running
