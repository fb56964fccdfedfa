"""A browser for the tests of the pages: Debian's chromium, with an eye on what it asks for."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from tests.web.served import TOKENS

__all__ = ["SCREENS", "SHOTS", "chromium", "contrast", "log_in", "opened", "palettes", "shoot"]

SHOTS = Path(__file__).parents[2] / "build" / "web"
"""Where screenshots go with ``MRDAMPER_SHOTS=1``, to be looked at by whoever changes a page."""

PATIENCE_ms = 60_000  # a loaded machine is not a fault
expect.set_options(timeout=PATIENCE_ms)

SCREENS = ((1280, 800), (768, 1024))

Scheme = Literal["light", "dark"]


@contextmanager
def chromium(program: Path) -> Iterator[Browser]:
    """Start the browser that the machine has; none is downloaded."""
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
        try:
            yield browser
        finally:
            browser.close()


def log_in(context: BrowserContext, address: str) -> None:
    """Trade the server's token for the cookie, as opening the address that it printed does."""
    assert context.request.get(f"{address}?token={TOKENS[address]}").ok


@contextmanager
def opened(
    browser: Browser, address: str, *, size: tuple[int, int] = SCREENS[0], scheme: Scheme = "light"
) -> Iterator[Page]:
    """Open a window; at its end nothing may have gone wrong in it, and no request may have left the host."""
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
        # A refused request is told by the browser, too; the page tells it in words.
        assert [text for text in wrong if "Failed to load resource" not in text] == []
        assert abroad == []
    finally:
        context.close()


def shoot(page: Page, name: str, *, whole: bool = False) -> None:
    """Take a picture of what is on the screen, or of the whole page, where pictures are asked for."""
    if not os.environ.get("MRDAMPER_SHOTS"):
        return
    SHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SHOTS / f"{name}.png", full_page=whole)


def palettes(sheet: str) -> dict[Scheme, dict[str, str]]:
    """Return the colours by name of a style sheet's :root, light first, the dark ones on top of them."""
    blocks = re.findall(r":root([^{]*)\{([^}]*)\}", sheet)
    colours = [
        (where.strip(), dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", text))) for where, text in blocks
    ]
    light = next(found for where, found in colours if not where)
    dark = next(found for where, found in colours if "dark" in where and "," not in where)
    return {"light": light, "dark": {**light, **dark}}


def contrast(ink: str, back: str) -> float:
    """Return the contrast ratio of two colours as WCAG 2 defines it (relative luminance of sRGB)."""
    high, low = sorted((_luminance(ink), _luminance(back)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: str) -> float:
    shares = [int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
