"""The installed Chromium for tests of the pages, with checks for errors and for requests to other hosts."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from tests.web.served import TOKENS

__all__ = ["SCREENS", "SHOTS", "chromium", "log_in", "opened", "shoot"]

SHOTS = Path(__file__).parents[2] / "build" / "web"
"""Folder of the screenshots that ``MRDAMPER_SHOTS=1`` writes."""

PATIENCE_ms = 60_000  # Other programs can slow the machine down.
expect.set_options(timeout=PATIENCE_ms)

SCREENS = ((1280, 800), (768, 1024))

Scheme = Literal["light", "dark"]


@contextmanager
def chromium(program: Path) -> Iterator[Browser]:
    """Start the installed browser, without a download."""
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
        try:
            yield browser
        finally:
            browser.close()


def log_in(context: BrowserContext, address: str) -> None:
    """Exchange the token of the server for a cookie, like the first visit of the printed address."""
    assert context.request.get(f"{address}?token={TOKENS[address]}").ok


@contextmanager
def opened(
    browser: Browser, address: str, *, size: tuple[int, int] = SCREENS[0], scheme: Scheme = "light"
) -> Iterator[Page]:
    """Open a browser window. At the end, check that no error and no request to other hosts occurred."""
    context = browser.new_context(
        base_url=address,
        viewport={"width": size[0], "height": size[1]},
        color_scheme=scheme,
        accept_downloads=True,
    )
    log_in(context, address)
    page = context.new_page()
    page.set_default_timeout(PATIENCE_ms)
    wrong: list[str] = []
    abroad: list[str] = []
    page.on("pageerror", lambda fault: wrong.append(str(fault)))
    page.on("console", lambda said: wrong.append(said.text) if said.type in {"error", "warning"} else None)
    page.on(
        "request",
        lambda asked: None if asked.url.startswith((address, "blob:", "data:")) else abroad.append(asked.url),
    )
    try:
        yield page
        # The browser also reports rejected requests, which the page shows as messages.
        assert [text for text in wrong if "Failed to load resource" not in text] == []
        assert abroad == []
    finally:
        context.close()


def shoot(page: Page, name: str, *, whole: bool = False) -> None:
    """Save a screenshot of the window or of the whole page if ``MRDAMPER_SHOTS`` is set."""
    if not os.environ.get("MRDAMPER_SHOTS"):
        return
    SHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SHOTS / f"{name}.png", full_page=whole)
