"""Connections that say nothing, or say it slowly, cost the server nothing: it answers others meanwhile."""

from __future__ import annotations

import asyncio
import json
import os
import socket
import time
from contextlib import suppress
from pathlib import Path

import httpx
import pytest

from mrdamper.web.connections import HEAD_S, MOST_OPEN
from mrdamper.web.server import build
from mrdamper.web.workspace import WorkFolder
from tests.support.pace import within_reach
from tests.web.served import TOKENS, call, living, patiently, served

pytestmark = pytest.mark.system

BY_HAND = (
    '{"id": "heat-001", "kind": "heat", "state": "done"}',
    "[]",
    "[" * 100_000,
    '{"id": "heat-001", "kind": "heat", "asked_at": "x", "options": {"files": 3, "tables": 1e999}}',
)
"""Files of jobs: without options, of no object, deep, with odd options."""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return a folder with a file whose name is no UTF-8, and a client of its server."""
    root = tmp_path_factory.mktemp("connections") / "work"
    (root / "runs").mkdir(parents=True)
    (root / "runs" / os.fsdecode(b"D\xe4mpfer.csv")).write_text("time_s\n0\n", encoding="utf-8")
    with served(root) as client:
        yield root, client


def test_half_open_connections_are_bounded_and_cut_off(site):
    client = site[1]
    place = (client.http.base_url.host, client.http.base_url.port)
    held = []
    for k in range(MOST_OPEN + 100):
        one = socket.create_connection(place, timeout=5.0)
        held.append(one)
        if k % 2:
            one.sendall(b"GET /api/state HTTP/1.1\r\nHost: 127")
    begin = time.monotonic()
    assert client.ask("GET", "/api/state").status_code == 200
    assert time.monotonic() - begin < within_reach(1.0)
    assert len(list(Path(f"/proc/{client.process.pid}/fd").iterdir())) < MOST_OPEN + 60
    for one in held[-3:]:
        one.settimeout(HEAD_S + 5.0)
        with suppress(ConnectionResetError):
            assert one.recv(1000) == b""
    for one in held:
        one.close()


def test_every_start_asks_for_a_token_that_is_the_owner_s_alone(tmp_path):
    """Also on this machine; the one that was kept serves the next start, unless others can read it."""
    kept = tmp_path / "work" / ".cache" / "token"
    kept.parent.mkdir(parents=True)
    kept.write_text("k" * 32, encoding="ascii")
    for mode in (0o600, 0o644):
        kept.chmod(mode)
        with served(tmp_path / "work") as client:
            assert (TOKENS[client.address] == "k" * 32) is (mode == 0o600)
            assert client.http.get("/api/state").status_code == 200
            assert httpx.get(f"{client.address}api/state", trust_env=False).status_code == 401
        assert kept.stat().st_mode & 0o777 == 0o600


def test_what_is_no_request_fills_no_log(tmp_path):
    with served(tmp_path / "work") as client:
        place = (client.http.base_url.host, client.http.base_url.port)
        for _ in range(100):
            with socket.create_connection(place, timeout=5.0) as one:
                one.sendall(b"no request\r\n\r\n")
                one.recv(1000)
        client.process.terminate()
        assert client.process.stderr is not None
        assert len(client.process.stderr.read().splitlines()) < 40


@pytest.mark.parametrize("text", BY_HAND, ids=["without-options", "list", "deep", "odd-options"])
def test_a_job_made_by_hand_stops_no_other_answer(site, text):
    root, client = site
    place = root / "results" / f"heat-00{BY_HAND.index(text)}"
    place.mkdir()
    (place / "job.json").write_text(text.replace("heat-001", place.name), encoding="utf-8")
    assert client.ask("GET", "/api/state").status_code == 200
    assert client.ask("GET", f"/api/jobs/{place.name}").status_code in {200, 404}


def test_names_of_any_script_are_taken_and_others_are_told(site):
    _, client = site
    name = "Dämpfer_Prüfstand_20°C_1A.csv"
    for each in (name, "減衰器 試験.csv", "डैम्पर.csv"):
        assert client.ask("PUT", f"/api/files/{each}", content=b"time_s\n0\n").status_code == 201
    state = client.get("/api/state")
    assert name in {row["name"] for row in state["files"]}
    assert state["unnamed"] == ["D\\xe4mpfer.csv"]
    for bad in ("a:b.csv", "tab%09.csv", "back\\slash.csv", "\u202egnp.csv"):
        answer = client.ask("PUT", f"/api/files/{bad}", content=b"x")
        assert answer.status_code in {404, 422}, json.dumps(bad)


def test_a_damper_is_refused_while_another_server_has_it_and_no_name_leads_out(tmp_path):
    """Names are those of folders in dampers/; a link that leads out is none, and neither is a taken one."""
    (tmp_path / "elsewhere").mkdir()
    root = tmp_path / "rig"
    (root / "dampers").mkdir(parents=True)
    (root / "dampers" / "link").symlink_to(tmp_path / "elsewhere")

    async def walk() -> list[int]:
        app = build(root)
        async with living(app):
            said = [
                (await call(app, "POST", "/api/workspaces", body=body)).status
                for body in (b'{"name": "b"}', b'{"name": "b"}', b'{"name": ".."}', b'{"name": "a/b"}')
            ]
            with WorkFolder(root / "dampers" / "b").claim():
                said.append((await call(app, "GET", "/damper/b/api/state")).status)
            for name in ("b", "link", "..", "nothing"):
                said.append((await patiently(app, "GET", f"/damper/{name}/api/state")).status)
            listed = (await call(app, "GET", "/damper/b/api/workspaces")).json
            assert [each["shown"] for each in listed["dampers"]] == ["rig", "b"]
            foreign = {"sec-fetch-site": "cross-site"}
            said.append((await call(app, "GET", "/damper/b/api/state", headers=foreign)).status)
            return said

    assert asyncio.run(walk()) == [201, 409, 422, 422, 422, 200, 404, 404, 404, 403]
