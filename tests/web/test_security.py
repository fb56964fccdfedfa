"""Access control of the server: other sites, DNS rebinding, outside paths, large uploads and links."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.web.run_index import RunIndex
from mrdamper.web.security import ListenAddress
from mrdamper.web.server import build
from mrdamper.web.workspace import NotThereError, WorkFolder
from tests.support.cards import write_heated_card
from tests.web.served import started

pytestmark = pytest.mark.system

SECRET = "the key of the safe"
CSV = b"time_s,displacement_mm,force_N,current_A\n0,0,0,1\n0.01,1,5,1\n"
TOKEN = "correct-horse-battery-staple"
LOCKED = ListenAddress("127.0.0.1", TOKEN)


@pytest.fixture
def folder(tmp_path):
    """Return a work folder whose parent folder contains a secret."""
    (tmp_path / "secret.csv").write_text(SECRET, encoding="utf-8")
    root = tmp_path / "work"
    WorkFolder(root)
    (root / "runs" / "a.csv").write_bytes(CSV)
    write_heated_card(root / "cards" / "one")
    job = root / "results" / "check-001"
    job.mkdir()
    record = {
        "id": job.name,
        "kind": "check",
        "options": {},
        "state": "done",
        "asked_at": "2026-01-01T00:00:00Z",
    }
    (job / "job.json").write_text(json.dumps(record), encoding="utf-8")
    (job / "check.html").write_text("<p>fine", encoding="utf-8")
    return root


@pytest.fixture
def ask(folder):
    """Return a function that calls the server of the folder."""
    with started(build(folder, most_upload=20_000)) as asking:
        yield asking


@pytest.fixture
def ask_locked(folder):
    """Return a function that calls a server that requires a token."""
    with started(build(folder, LOCKED)) as asking:
        yield asking


def snapshot(folder: Path) -> dict[str, bytes]:
    kept = [path for path in folder.rglob("*") if ".cache" not in path.parts and path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in kept}


# -------------------------------------------------------------------------------------- access by other sites


@pytest.mark.parametrize(
    ("host", "token", "words"),
    [
        ("0.0.0.0", None, "--token"),
        ("127.0.0.1", "", "16 or more"),
        ("127.0.0.1", "short", "16 or more"),
        ("127.0.0.1", "with\nbreak-in-its-text", "16 or more"),
    ],
)
def test_unsafe_listen_address_is_rejected(host, token, words):
    """A public host requires a token. A token must be long and printable."""
    with pytest.raises(InputError, match=words):
        ListenAddress(host, token)


@pytest.mark.parametrize(
    "host",
    ["evil.example", "127.0.0.1.evil.example", "localhost.evil.example:8765", "evil.example@127.0.0.1", "",
     "127.0.0.1:x", "127.0.0.1/", "127.0.0.1 evil.example", "[::1", "192.168.0.7:8765"],
)  # fmt: skip
def test_dns_rebinding_is_rejected(ask, host):
    """In DNS rebinding, the name evil.example resolves to 127.0.0.1."""
    answer = ask("GET", "/api/state", headers={"host": host})
    assert answer.status == 403
    assert "files" not in answer.json
    public = ListenAddress("0.0.0.0", TOKEN)
    assert public.is_named_by(host) == (host == "192.168.0.7:8765")


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "https://evil.example"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1:9999"},
        {"origin": "http://localhost:8765"},  # The host of the origin differs from the host of the request.
        {"origin": "ftp://127.0.0.1:8765"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ],
)
def test_other_site_cannot_change_files(folder, ask, headers):
    before = snapshot(folder)
    for method, path, body in (
        ("PUT", "/api/files/b.csv", CSV),
        ("DELETE", "/api/files/a.csv", b""),
        ("POST", "/api/jobs", b'{"kind": "check", "options": {}}'),
        ("DELETE", "/api/jobs/check-001", b""),
    ):
        assert ask(method, path, headers=headers, body=body).status == 403, path
    assert snapshot(folder) == before


def test_other_site_may_only_link_to_page(folder, ask):
    elsewhere = {"sec-fetch-site": "cross-site"}
    assert ask("GET", "/api/state", headers=elsewhere).status == 403
    assert ask("GET", "/", headers=elsewhere).status == 200
    own = {"origin": "http://127.0.0.1:8765", "sec-fetch-site": "same-origin"}
    assert ask("PUT", "/api/files/b.csv", headers=own, body=CSV).status == 201
    assert (folder / "runs" / "b.csv").read_bytes() == CSV


def test_request_without_token_is_rejected(ask_locked):
    for path in ("/", "/api/state", "/static/style.css", "/api/files/a.csv/look"):
        assert ask_locked("GET", path).status == 401
        for wrong in (f"Bearer {TOKEN}x", f"Bearer {TOKEN[:-1]}", TOKEN, "Bearer "):
            assert ask_locked("GET", path, headers={"authorization": wrong}).status == 401
        assert ask_locked("GET", path, query="token=wrong").status == 401


def test_token_is_exchanged_for_http_only_cookie(ask_locked):
    """The response sets a cookie and redirects to an address on the same server."""
    assert ask_locked("GET", "/api/state", headers={"authorization": f"Bearer {TOKEN}"}).status == 200
    traded = ask_locked("GET", "/loops", query=f"token={TOKEN}&run=a")
    assert traded.status == 303
    assert traded.headers["location"] == "/loops?run=a"
    assert "default-src 'self'" in traded.headers["content-security-policy"]
    cookie = traded.headers["set-cookie"]
    assert TOKEN not in cookie
    assert {"httponly", "samesite=strict"} <= set(cookie.lower().split("; "))
    assert ask_locked("GET", "/api/state", headers={"cookie": cookie.split(";")[0]}).status == 200
    away = ask_locked("GET", "//evil.example/", query=f"token={TOKEN}")
    assert away.headers["location"].startswith("/evil.example")


def test_responses_have_security_headers(ask):
    for path in ("/", "/api/state", "/api/nothing", "/api/files/nothing/look", "/static/nothing.js"):
        headers = ask("GET", path).headers
        assert headers["x-content-type-options"] == "nosniff", path
        assert headers["referrer-policy"] == "no-referrer"
        policy = headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "unsafe" not in policy
        if path.startswith("/api/"):
            assert headers["cache-control"] == "no-store"


@pytest.mark.parametrize(
    ("status", "method", "path", "options"),
    [
        (403, "GET", "/", {"headers": {"host": "evil.example"}}),
        (403, "POST", "/api/jobs", {"headers": {"origin": "https://evil.example"}}),
        (404, "GET", "/api/runs/none/series", {}),
        (405, "TRACE", "/", {}),
        (405, "OPTIONS", "/api/state", {}),
        (405, "PATCH", "/api/state", {}),
        (409, "POST", "/api/jobs", {"body": b'{"kind": "fit", "options": {"card": "one"}}'}),
        (413, "PUT", "/api/files/big.csv", {"body": 500 * CSV}),
        (413, "POST", "/api/jobs", {"body": b" " * 3_000_000, "pieces": 30}),
        (413, "POST", "/api/heat/curve", {"body": b" " * 3_000_000, "pieces": 30}),
        *(
            (422, "PUT", f"/api/files/{name}", {"body": CSV})
            for name in ("page.html", "array.npy", "run.csv.channels.toml", "script.py", "run")
        ),
        (500, "GET", "/api/runs", {}),
    ],
)
def test_error_responses_have_security_headers(ask, monkeypatch, capsys, status, method, path, options):
    def broken(_self: RunIndex) -> None:
        raise RuntimeError(SECRET)

    monkeypatch.setattr(RunIndex, "runs", broken)
    answer = ask(method, path, **options)
    assert answer.status == status
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["referrer-policy"] == "no-referrer"
    assert "default-src 'self'" in answer.headers["content-security-policy"]
    assert answer.headers["content-type"] == "application/json"
    assert (
        {"error", "status"} <= set(answer.json) <= {"error", "status", "place", "found", "expected", "remedy"}
    )
    assert SECRET not in answer.body.decode()
    assert "Traceback" not in answer.body.decode()
    printed = capsys.readouterr().err
    assert (SECRET in printed) == (status == 500)  # The traceback is printed to the terminal and not sent.
    assert ("fault of mrdamper" in answer.json["error"]) == (status == 500)


# ------------------------------------------------------------------------------------------- names and paths


NAMES = [
    "..", ".", "../secret.csv", "..%2fsecret.csv", "..\\secret.csv", "../../secret.csv", "....//secret.csv",
    "/etc/passwd", "//etc/passwd", "%2e%2e%2fsecret.csv", "a.csv/../../../secret.csv", "a.csv\0.txt",
    "runs/../../secret.csv", ".cache", ".upload-x", "a.csv/", "~/.bashrc", "C:\\secret.csv",
]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_requested_file_names_cannot_leave_folder(folder, ask, name):
    """Decoded names, encoded names, and names in the options of a job use the same check."""
    before = snapshot(folder.parent)
    reads = ["/api/files/{}/look", "/api/inputs/{}", "/api/cards/{}", "/api/cards/one/files/{}",
             "/api/jobs/check-001/files/{}", "/api/jobs/{}/files/job.json", "/api/dampers/{}",
             "/damper/{}/api/state", "/static/{}", "/{}"]  # fmt: skip
    answers = [ask("GET", path.format(name)) for path in reads]
    for path in ("/api/files/{}", "/api/inputs/{}", "/api/cards/{}"):
        answers.append(ask("PUT", path.format(name), body=b"x,y\n"))
        answers.append(ask("DELETE", path.format(name)))
    heating = {"card": "one", "damper": name, "duty": name}
    answers.append(ask("POST", "/api/heat/curve", body=json.dumps(heating).encode()))
    for kind, options in (
        ("check", {"files": [name]}),
        ("evaluate", {"card": name}),
        ("fit", {"card": name}),
        ("compare", {"first": "one", "second": name}),
        ("cycles", {"record": name}),
        ("cycles", {"record": "a.csv", "channels": name}),
    ):
        answers.append(ask("POST", "/api/jobs", body=json.dumps({"kind": kind, "options": options}).encode()))
    assert not [answer for answer in answers if SECRET.encode() in answer.body or b"root:" in answer.body]
    assert not [answer for answer in answers if answer.status >= 500]
    pages = [answer for answer in answers if answer.status < 300]
    # Only index.html is returned.
    assert all(answer.headers["content-type"].startswith("text/html") for answer in pages)
    assert snapshot(folder.parent) == before
    work = WorkFolder(folder)
    for look_up in (work.run_file, work.record, work.channel_map, work.card, work.input):
        with pytest.raises(NotThereError):
            look_up(name)


@given(name=st.text(alphabet=st.characters(codec="utf-8"), max_size=12) | st.sampled_from(NAMES))
def test_new_file_names_cannot_leave_folder(tmp_path_factory, name):
    root = tmp_path_factory.getbasetemp() / "names"
    folder = WorkFolder(root)
    try:
        path = folder.new(folder.runs, name)
    except InputError:
        return
    assert path.parent == folder.runs
    assert path.resolve().parent == folder.runs.resolve()
    assert not path.name.startswith(".")


def test_link_to_outside_is_not_followed(folder, ask):
    """A link to a file outside is neither read nor listed, and an upload replaces the link."""
    secret = folder.parent / "secret.csv"
    (folder / "runs" / "link.csv").symlink_to(secret)
    (folder / "inputs" / "link.toml").symlink_to(secret)
    (folder / "results" / "check-001" / "link.csv").symlink_to(secret)
    (folder / "cards" / "out").symlink_to(folder.parent)
    (folder / "cards" / "one" / "link.csv").symlink_to(secret)
    for path in (
        "/api/files/link.csv/look",
        "/api/inputs/link.toml",
        "/api/jobs/check-001/files/link.csv",
        "/api/cards/one/files/link.csv",
        "/api/cards/out/files/secret.csv",
    ):
        answer = ask("GET", path)
        assert answer.status == 404, path
        assert SECRET.encode() not in answer.body
    state = ask("GET", "/api/state").json
    assert [row["name"] for row in state["files"]] == ["a.csv"]
    assert [row["path"] for job in state["jobs"] for row in job["files"]] == ["check.html"]
    assert ask("PUT", "/api/files/link.csv", body=CSV).status == 201
    assert secret.read_text(encoding="utf-8") == SECRET
    assert not (folder / "runs" / "link.csv").is_symlink()


def test_folder_with_outside_link_is_rejected(tmp_path):
    (tmp_path / "work").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "work" / "runs").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="leads out"):
        WorkFolder(tmp_path / "work")


# ------------------------------------------------------------------------------------------- sizes of uploads


@pytest.mark.parametrize("length", [None, "40000", "10"])
def test_too_large_upload_leaves_no_file(folder, ask, length):
    """The limit applies to the received bytes, not to the stated length."""
    headers = {} if length is None else {"content-length": length}
    answer = ask("PUT", "/api/files/big.csv", headers=headers, body=b"1,2,3,4\n" * 5000, pieces=20)
    assert answer.status == 413
    assert sorted(path.name for path in (folder / "runs").iterdir()) == ["a.csv"]


@pytest.mark.parametrize(
    "body",
    [b"", b"[]", b"{", b"\xff\xfe", b"[" * 100_000, b'{"kind": ["a"]}', b'{"kind": "check", "options": 3}',
     b'{"kind": "heat", "options": {"card": "one", "ambient_degC": NaN}}',
     b'{"kind": "heat", "options": {"card": "one", "ambient_degC": 1e999}}',
     b'{"kind": "check", "options": {"unknown": 1}}'],
)  # fmt: skip
def test_invalid_job_request_returns_error(folder, ask, body):
    answer = ask("POST", "/api/jobs", body=body)
    assert answer.status == 422
    assert answer.json["error"]
    assert len(answer.body) < 2000
    assert [path.name for path in (folder / "results").iterdir()] == ["check-001"]


# ------------------------------------------------------------------------------------------ contents of files


def test_report_is_sent_with_sandbox(ask):
    for path in ("/api/jobs/check-001/files/check.html", "/api/cards/one"):
        policy = ask("GET", path).headers["content-security-policy"]
        assert policy.startswith("sandbox")
        assert "allow-scripts" not in policy
        assert "default-src 'none'" in policy
        assert "script-src" not in policy


def test_uploaded_python_law_never_runs(folder, ask, tmp_path):
    mark = tmp_path / "it_ran"
    law = tmp_path / "law.py"
    law.write_text(f"open({str(mark)!r}, 'w')\n", encoding="utf-8")
    (folder / "runs" / "numpy.py").write_text(f"open({str(mark)!r}, 'w')\n", encoding="utf-8")
    for value in (f"{law}:Law", "law.py:Law", "../law.py:Law"):
        order = {"kind": "fit", "options": {"card": "x", "law": value}}
        assert ask("POST", "/api/jobs", body=json.dumps(order).encode()).status == 422
    card = json.loads((folder / "cards" / "one" / "card.json").read_text(encoding="utf-8"))
    card["python_law"] = f"{law}:Law"
    assert ask("PUT", "/api/cards/two", body=json.dumps(card).encode()).status == 422
    assert not (folder / "cards" / "two").exists()
    assert not mark.exists()
