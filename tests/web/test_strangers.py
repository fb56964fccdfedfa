"""Attacks in a browser: requests of another site, and names that contain markup."""

from __future__ import annotations

import json
import re
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from playwright.sync_api import Dialog, expect

from tests.support.cards import write_card_of
from tests.web.browser import log_in, opened
from tests.web.served import served
from tests.web.test_security import CSV, snapshot
from tests.web.walking import VIEWS

pytestmark = pytest.mark.nightly

MARKUP = "<img src=x onerror='window.ran = 1'>"

EVIL = """<!DOCTYPE html><title>elsewhere</title>
<form id="form" method="post" target="told" enctype="text/plain" action="{server}/api/jobs">
<input name='{{"kind": "check", "options": {{}}, "x": "' value='"}}'></form><iframe name="told"></iframe>
<img src="{server}/api/state"><iframe src="{server}/#/jobs"></iframe>"""

TRIED = """async (server) => {
  const told = [];
  for (const [method, path, mode] of [
    ["POST", "/api/jobs", "no-cors"], ["POST", "/api/jobs", "cors"], ["PUT", "/api/files/b.csv", "cors"],
    ["DELETE", "/api/files/a.csv", "cors"], ["GET", "/api/state", "cors"], ["GET", "/api/state", "no-cors"],
  ]) {
    const body = method === "GET" ? undefined : '{"kind": "check", "options": {}}';
    try {
      const answer = await fetch(server + path, { method, mode, body, credentials: "include" });
      told.push([answer.type, answer.status, await answer.text().catch(() => "")]);
    } catch (fault) { told.push([fault.name, 0, ""]); }
  }
  document.getElementById("form").submit();
  await new Promise((done) => setTimeout(done, 500));
  return told;
}"""


@pytest.fixture(scope="module")
def haunted(tmp_path_factory):
    """Return a folder whose items have names with markup, and a client."""
    root = tmp_path_factory.mktemp("strangers") / "damper"
    for place in ("runs", "records", "inputs", "cards", "results"):
        (root / place).mkdir(parents=True)
    name = MARKUP.replace("/", "")
    rows = "".join(f"{0.01 * k:.2f},{k % 7},{k % 5},1,{k}\n" for k in range(60))
    table = f"time_s,displacement_mm,force_N,current_A,{MARKUP}\n{rows}"
    (root / "runs" / "a.csv").write_bytes(CSV)
    for place in ("runs", "records"):
        (root / place / f"{name}.csv").write_text(table, encoding="utf-8")
    (root / "inputs" / f"{name}.toml").write_text(f'motions = ["{MARKUP}"]\n', encoding="utf-8")
    for card in ("one", name):
        (root / "cards" / card).mkdir()
        write_card_of(root / "cards" / card / "card.json")
    for number, kind in enumerate(("check", "fit", "sweep"), start=1):
        job = root / "results" / f"{kind}-{number:03d}"
        job.mkdir()
        told = {
            "id": job.name,
            "kind": kind,
            "options": {"card": MARKUP},
            "state": "failed",
            "message": MARKUP,
        }
        times = dict.fromkeys(("asked_at", "started_at", "ended_at"), "2026-01-01T00:00:00Z")
        (job / "job.json").write_text(json.dumps({**told, **times, "card": MARKUP}), encoding="utf-8")
        (job / f"{name}.html").write_text("<script>window.ran = 1</script>", encoding="utf-8")
    with served(root) as client:
        client.read_all()
        yield root, client


@pytest.fixture(scope="module")
def elsewhere(haunted):
    """Return the address of another site whose page sends requests to the server."""
    page = EVIL.format(server=haunted[1].address.rstrip("/")).encode()

    class Site(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("content-type", "text/html")
            self.end_headers()
            self.wfile.write(page)

        def log_message(self, *_: object) -> None:
            pass

    site = ThreadingHTTPServer(("127.0.0.1", 0), Site)
    threading.Thread(target=site.serve_forever, daemon=True).start()
    yield f"http://localhost:{site.server_port}/"
    site.shutdown()
    site.server_close()


def test_other_site_in_browser_is_refused(browser, haunted, elsewhere):
    """The server refuses forms and simple requests of other sites, which browsers allow."""
    root, client = haunted
    before = snapshot(root)
    with browser.new_context() as context:
        log_in(context, client.address)
        page = context.new_page()
        page.goto(client.address)  # The user has the workbench open.
        page.wait_for_selector("#drop")
        stranger = context.new_page()
        refused: list[int] = []
        stranger.on(
            "response", lambda answer: refused.append(answer.status) if "/api/" in answer.url else None
        )
        stranger.goto(elsewhere)
        told = stranger.evaluate(TRIED, client.address.rstrip("/"))
        assert all(kind in {"opaque", "TypeError"} for kind, _, _ in told)
        assert not any(text for _, _, text in told)
        assert refused
        assert set(refused) <= {403, 404, 405}
        assert [frame.url for frame in stranger.frames if "#/jobs" in frame.url and frame.title()] == []
    assert snapshot(root) == before


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


def test_script_in_report_never_runs(browser, haunted):
    root, client = haunted
    with browser.new_context(base_url=client.address) as context:
        log_in(context, client.address)
        page = context.new_page()
        name = next(path.name for path in (root / "results" / "check-001").glob("*.html"))
        page.goto(
            f"/api/jobs/check-001/files/{name.replace(' ', '%20').replace('<', '%3C').replace('>', '%3E')}"
        )
        assert page.evaluate("window.ran") is None
        assert "window.ran" in page.content()
