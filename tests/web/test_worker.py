"""Jobs of the server run in processes that end after Cancel, after an error, and with the server."""

from __future__ import annotations

import json
import os
import shutil
import signal
import time

import pytest

from tests.support.campaigns import short_runs, write_runs
from tests.support.cards import write_card_of, write_heated_card
from tests.support.rigs import mrdamper
from tests.web.served import Client, is_alive, python_processes_of, served, wait_until

pytestmark = pytest.mark.system

LONG = {"law": "chain"}  # This fit takes much longer than the test.


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return write_runs(tmp_path_factory.mktemp("files") / "runs", short_runs()[:3])


def a_folder(root, runs):
    for part in ("runs", "cards"):
        shutil.rmtree(root / part, ignore_errors=True)
    shutil.copytree(runs[0].parent, root / "runs")
    write_heated_card(root / "cards" / "plain", temperature_dependent=False)
    write_card_of(root / "cards" / "strong" / "card.json")
    return root


@pytest.fixture
def folder(tmp_path, runs):
    return a_folder(tmp_path / "work", runs)


@pytest.fixture(scope="module")
def shared(plain_site, runs):
    """Return a folder with runs and cards, and a client of its server."""
    a_folder(plain_site[0], runs)
    plain_site[1].read_all()
    return plain_site


@pytest.fixture
def idle(shared):
    """Return the shared server without running jobs."""
    yield shared
    client = shared[1]
    for job in client.get("/api/state")["jobs"]:
        client.ask("POST", f"/api/jobs/{job['id']}/cancel")
        client.ended(job["id"])


def a_long_fit(client: Client, name: str = "long") -> tuple[str, int]:
    """Start a fit that takes minutes, wait for its start, and return its ID and process."""
    job_id = client.job("fit", card=name, **LONG)
    pid = int(client.until(job_id, {"running"})["pid"])
    wait_until(lambda: client.get(f"/api/jobs/{job_id}")["progress"] is not None, 30.0)
    return job_id, pid


@pytest.mark.nightly
def test_cancel_keeps_best_fit(idle):
    folder, client = idle
    job_id, pid = a_long_fit(client, "kept")
    assert is_alive(pid)
    assert client.ask("POST", f"/api/jobs/{job_id}/cancel").status_code == 200
    wait_until(lambda: not is_alive(pid), 8.0)
    job = client.ended(job_id, 3.0)
    assert job["state"] == "cancelled"
    if job["answer"] is None:  # The fit may have no result yet on a slow machine.
        assert not (folder / "cards" / "kept").exists()
    else:
        assert job["answer"]["cancelled"] is True
        card = json.loads((folder / "cards" / "kept" / "card.json").read_text(encoding="utf-8"))
        assert "cancelled" in card["notes"]
    assert not list(folder.rglob(".mrdamper-*"))


@pytest.mark.nightly
def test_job_of_dead_process_counts_as_failed(idle):
    _, client = idle
    job_id, pid = a_long_fit(client)
    os.kill(pid, signal.SIGKILL)
    job = client.ended(job_id, 5.0)
    assert job["state"] == "failed"
    assert "ended by itself" in job["message"]
    again = client.job("check")  # Other jobs continue.
    assert client.ended(again)["state"] == "done"


@pytest.mark.nightly
def test_third_simultaneous_job_waits(folder):
    with served(folder) as client:
        first, _ = a_long_fit(client, "first")
        second, _ = a_long_fit(client, "second")
        third = client.job("check")
        time.sleep(0.5)
        assert client.get(f"/api/jobs/{third}")["state"] == "queued"
        fourth = client.job("check")
        client.ask("POST", f"/api/jobs/{fourth}/cancel")
        assert client.get(f"/api/jobs/{fourth}")["state"] == "cancelled"  # A waiting job ends immediately.
        client.ask("POST", f"/api/jobs/{first}/cancel")
        assert client.ended(third)["state"] == "done"
        assert client.get(f"/api/jobs/{second}")["state"] in {"running", "done"}
        assert [job["id"] for job in client.get("/api/state")["jobs"]] == [fourth, third, second, first]
    assert python_processes_of(folder) == []


@pytest.mark.nightly
def test_stopped_server_ends_its_processes(folder):
    with served(folder) as client:
        second = mrdamper("serve", "--port", "0", "--folder", folder)
        assert second.returncode == 3
        assert "another server" in second.stderr
        job_id, pid = a_long_fit(client)
        waiting = client.job("fit", card="other", **LONG)
    wait_until(lambda: not is_alive(pid), 1.0)
    assert python_processes_of(folder) == []
    with served(folder) as client:
        assert client.get(f"/api/jobs/{job_id}")["state"] == "interrupted"
        assert client.get(f"/api/jobs/{waiting}")["state"] == "interrupted"


@pytest.mark.nightly
def test_only_ended_jobs_are_removed(idle):
    folder, client = idle
    job_id, _ = a_long_fit(client)
    assert client.ask("DELETE", f"/api/jobs/{job_id}").status_code == 409
    client.ask("POST", f"/api/jobs/{job_id}/cancel")
    client.ended(job_id)
    wait_until(lambda: client.ask("DELETE", f"/api/jobs/{job_id}").status_code == 200, 3.0)
    assert client.ask("GET", f"/api/jobs/{job_id}").status_code == 404
    assert not (folder / "results" / job_id).exists()
    after = client.job("check")
    assert after.rpartition("-")[2] > job_id.rpartition("-")[2]  # The name of the removed job stays reserved.
    client.ended(after)
    (thrown,) = client.get("/api/trash")["trash"]
    assert thrown["names"][-1] == f"results/{job_id}"
    client.ask("POST", f"/api/trash/{thrown['id']}/restore", json={})
    assert client.get(f"/api/jobs/{job_id}")["state"] == "cancelled"


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("heatsink", {"card": "strong", "by_field": True, "members": 200}),
        ("track", {"card": "strong"}),
        ("export", {"card": "strong"}),
        ("rig", {}),
        ("demo", {"quick": True}),
    ],
)
def test_cancelled_job_leaves_no_partial_files(idle, kind, options):
    root, client = idle
    before = {path.name for path in (root / "runs").iterdir()}
    job_id = client.job(kind, **options)
    pid = int(client.until(job_id, {"running"})["pid"])
    time.sleep(1.5)  # The job is now computing.
    client.ask("POST", f"/api/jobs/{job_id}/cancel")
    assert client.ended(job_id, 5.0)["state"] == "cancelled"
    wait_until(lambda: not is_alive(pid), 6.0)
    assert not [path for path in root.rglob(".mrdamper-*") if ".cache" not in path.parts]
    if kind == "rig":
        assert {path.name for path in (root / "runs").iterdir()} == before
