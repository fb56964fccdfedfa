"""Many tabs of one browser share its connections."""

from __future__ import annotations

import time

import pytest
from playwright.sync_api import expect

from tests.support.campaigns import short_runs, write_runs
from tests.support.pace import within_reach
from tests.web.browser import log_in
from tests.web.served import served

pytestmark = pytest.mark.nightly

TABS = 12  # A browser opens six connections to a server.
_REQUEST_MAX_S = 0.5


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    root = tmp_path_factory.mktemp("tabs") / "damper"
    (root / "runs").mkdir(parents=True)
    write_runs(root / "runs", short_runs())
    with served(root) as one:
        one.read_all()
        yield one


def test_many_tabs_get_fast_answers(browser, client):
    """Each tab follows the same fit; the slowest request and Cancel take less than 0.5 s."""
    job = client.job("fit", card="long", law="chain")
    client.until(job, {"running"})
    with browser.new_context(base_url=client.address) as context:
        log_in(context, client.address)
        tabs = [context.new_page() for _ in range(TABS)]
        for tab in tabs:
            tab.goto("/#/model")
            tab.wait_for_selector("[data-job=fit] progress")
        waits = [
            tab.evaluate(
                """async (address) => {
                  const began = performance.now();
                  await (await fetch(address)).text();
                  return performance.now() - began;
                }""",
                address,
            )
            / 1e3
            for tab in tabs
            for address in ("/api/state", "/api/runs", "/api/changes", "/api/forms")
        ]
        begin = time.monotonic()
        with tabs[-1].expect_response("**/cancel") as answered:
            tabs[-1].get_by_role("button", name="Cancel").click()
        assert answered.value.ok
        cancelled_s = time.monotonic() - begin
        for tab in tabs:
            expect(tab.locator("[data-job=fit] progress")).to_have_count(0, timeout=30_000)
    print(f"{TABS} tabs: worst request {max(waits):.2f} s, Cancel answered in {cancelled_s:.2f} s")
    assert max(waits) < within_reach(_REQUEST_MAX_S)
    assert cancelled_s < within_reach(_REQUEST_MAX_S)
    assert client.ended(job)["state"] == "cancelled"
