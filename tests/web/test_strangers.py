"""Names that contain markup are shown as text."""

from __future__ import annotations

import json
import re

import pytest
from playwright.sync_api import Dialog, expect

from tests.support.cards import write_card_of
from tests.web.browser import opened
from tests.web.served import served
from tests.web.walking import VIEWS

pytestmark = pytest.mark.nightly

MARKUP = "<img src=x onerror='window.ran = 1'>"


@pytest.fixture(scope="module")
def haunted(tmp_path_factory):
    """Return a folder whose items have names with markup, and a client."""
    root = tmp_path_factory.mktemp("strangers") / "damper"
    for place in ("runs", "records", "inputs", "cards", "results"):
        (root / place).mkdir(parents=True)
    name = MARKUP.replace("/", "")
    rows = "".join(f"{0.01 * k:.2f},{k % 7},{k % 5},1,{k}\n" for k in range(60))
    table = f"time_s,displacement_mm,force_N,current_A,{MARKUP}\n{rows}"
    for place in ("runs", "records"):
        (root / place / f"{name}.csv").write_text(table, encoding="utf-8")
    (root / "inputs" / f"{name}.toml").write_text(f'motions = ["{MARKUP}"]\n', encoding="utf-8")
    for card in ("one", name):
        (root / "cards" / card).mkdir()
        write_card_of(root / "cards" / card / "card.json")
    for number, kind in enumerate(("check", "fit", "sweep"), start=1):
        job = root / "results" / f"{kind}-{number:03d}"
        job.mkdir()
        record = {
            "id": job.name,
            "kind": kind,
            "options": {"card": MARKUP},
            "state": "failed",
            "message": MARKUP,
        }
        times = dict.fromkeys(("asked_at", "started_at", "ended_at"), "2026-01-01T00:00:00Z")
        (job / "job.json").write_text(json.dumps({**record, **times, "card": MARKUP}), encoding="utf-8")
        (job / f"{name}.html").write_text("<script>window.ran = 1</script>", encoding="utf-8")
    with served(root) as client:
        client.read_all()
        yield root, client


def test_markup_names_stay_text(browser, haunted):
    with opened(browser, haunted[1].address) as page:
        asked: list[str] = []

        def refuse(box: Dialog) -> None:
            asked.append(box.message)
            box.dismiss()

        page.on("dialog", refuse)
        for name, address in VIEWS:
            page.goto(f"/#/{address}")
            page.wait_for_selector(f"[data-shown={name}] h1")
            if "Files" in address or name == "jobs":
                expect(page.locator("main")).to_contain_text("onerror='window.ran = 1'>")
            page.wait_for_timeout(250)
            assert page.locator("main img, main script").count() == 0, address
        page.goto("/#/data?view.tab=Files")
        page.get_by_label(re.compile("Look into <img")).click()
        page.wait_for_selector("#save-map")  # The heads of columns contain markup, too.
        assert MARKUP in page.inner_text("#sheet")
        assert page.locator("main img").count() == 0
        assert page.evaluate("window.ran") is None
        assert asked == []
