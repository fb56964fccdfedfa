"""Access control: other sites, DNS rebinding, paths outside the folder, endless bodies, links."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.web.security import ListenAddress
from mrdamper.web.server import build
from mrdamper.web.workspace import NotThereError, WorkFolder
from tests.support.cards import write_heated_card
from tests.web.served import Answer, call, living

pytestmark = pytest.mark.system

SECRET = "the key of the safe"
CSV = b"time_s,displacement_mm,force_N,current_A\n0,0,0,1\n0.01,1,5,1\n"
TOKEN = "correct-horse-battery-staple"


@pytest.fixture
def folder(tmp_path):
    """Return a work folder; its parent contains a secret."""
    (tmp_path / "secret.csv").write_text(SECRET, encoding="utf-8")
    root = tmp_path / "work"
    WorkFolder(root)
    (root / "runs" / "a.csv").write_bytes(CSV)
    (root / "cards" / "one").mkdir()
    write_heated_card(root / "cards" / "one")
    job = root / "results" / "check-001"
    job.mkdir()
    told = {
        "id": "check-001",
        "kind": "check",
        "options": {},
        "state": "done",
        "asked_at": "2026-01-01T00:00:00Z",
    }
    (job / "job.json").write_text(json.dumps(told), encoding="utf-8")
    (job / "check.html").write_text("<p>fine", encoding="utf-8")
    return root


def ask(folder, method, path, *, address=None, most_upload=200_000_000, **options) -> Answer:
    async def one() -> Answer:
        async with living(build(folder, address, most_upload=most_upload)) as app:
            return await call(app, method, path, **options)

    return asyncio.run(one())


def snapshot(folder: Path) -> dict[str, bytes]:
    kept = [path for path in folder.rglob("*") if ".cache" not in path.parts and path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in kept}


# ------------------------------------------------------------------------------------------- who may come in


def test_public_host_without_token_is_refused():
    with pytest.raises(InputError, match="--token"):
        ListenAddress("0.0.0.0")
    ListenAddress("0.0.0.0", TOKEN)


@pytest.mark.parametrize("token", ["", "short", "with\nbreak-in-its-text"])
def test_short_or_unprintable_token_is_refused(token):
    with pytest.raises(InputError, match="16 or more"):
        ListenAddress("127.0.0.1", token)


@pytest.mark.parametrize(
    "host",
    ["evil.example", "127.0.0.1.evil.example", "localhost.evil.example:8765", "evil.example@127.0.0.1", "",
     "127.0.0.1:x", "127.0.0.1/", "127.0.0.1 evil.example", "[::1", "192.168.0.7:8765"],
)  # fmt: skip
def test_dns_rebinding_is_refused(folder, host):
    """In DNS rebinding the name evil.example resolves to 127.0.0.1."""
    answer = ask(folder, "GET", "/api/state", headers={"host": host})
    assert answer.status == 403
    assert "files" not in answer.json


def test_public_server_accepts_address_not_foreign_name():
    address = ListenAddress("0.0.0.0", TOKEN)
    assert address.knows("192.168.0.7:8765")
    assert not address.knows("evil.example:8765")


FOREIGN = [
    {"origin": "https://evil.example"},
    {"origin": "null"},
    {"origin": "http://127.0.0.1:9999"},
    {"origin": "http://localhost:8765"},  # The host differs from the host of the request.
    {"origin": "ftp://127.0.0.1:8765"},
    {"sec-fetch-site": "cross-site"},
    {"sec-fetch-site": "same-site"},
]


@pytest.mark.parametrize("headers", FOREIGN)
@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("PUT", "/api/files/b.csv", CSV),
        ("DELETE", "/api/files/a.csv", b""),
        ("POST", "/api/jobs", b'{"kind": "check", "options": {}}'),
        ("DELETE", "/api/jobs/check-001", b""),
    ],
)
def test_other_site_cannot_write(folder, headers, method, path, body):
    before = snapshot(folder)
    assert ask(folder, method, path, headers=headers, body=body).status == 403
    assert snapshot(folder) == before


def test_other_site_may_only_link(folder):
    elsewhere = {"sec-fetch-site": "cross-site"}
    assert ask(folder, "GET", "/api/state", headers=elsewhere).status == 403
    assert ask(folder, "GET", "/", headers=elsewhere).status == 200


def test_own_page_may_write(folder):
    own = {"origin": "http://127.0.0.1:8765", "sec-fetch-site": "same-origin"}
    assert ask(folder, "PUT", "/api/files/b.csv", headers=own, body=CSV).status == 201
    assert (folder / "runs" / "b.csv").read_bytes() == CSV


@pytest.mark.parametrize("path", ["/", "/api/state", "/static/style.css", "/api/files/a.csv/look"])
def test_request_without_token_is_refused(folder, path):
    address = ListenAddress("127.0.0.1", TOKEN)
    assert ask(folder, "GET", path, address=address).status == 401
    for wrong in (f"Bearer {TOKEN}x", f"Bearer {TOKEN[:-1]}", TOKEN, "Bearer "):
        assert ask(folder, "GET", path, address=address, headers={"authorization": wrong}).status == 401
    assert ask(folder, "GET", path, address=address, query="token=wrong").status == 401


def test_token_gives_http_only_cookie(folder):
    address = ListenAddress("127.0.0.1", TOKEN)
    assert (
        ask(folder, "GET", "/api/state", address=address, headers={"authorization": f"Bearer {TOKEN}"}).status
        == 200
    )
    traded = ask(folder, "GET", "/loops", address=address, query=f"token={TOKEN}&run=a")
    assert traded.status == 303
    assert traded.headers["location"] == "/loops?run=a"
    cookie = traded.headers["set-cookie"]
    assert TOKEN not in cookie
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    own = {"cookie": cookie.split(";")[0]}
    assert ask(folder, "GET", "/api/state", address=address, headers=own).status == 200


def test_token_redirect_stays_on_server(folder):
    traded = ask(
        folder, "GET", "//evil.example/", address=ListenAddress("127.0.0.1", TOKEN), query=f"token={TOKEN}"
    )
    assert traded.headers.get("location", "/").startswith("/evil.example")


@pytest.mark.parametrize("method", ["TRACE", "CONNECT", "OPTIONS", "PATCH"])
def test_other_methods_are_refused(folder, method):
    assert ask(folder, method, "/api/state").status in {405, 404}


def test_answers_have_security_headers(folder):
    for path in ("/", "/api/state", "/api/nothing", "/api/files/nothing/look", "/static/nothing.js"):
        headers = ask(folder, "GET", path).headers
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
        (303, "GET", "/", {"query": f"token={TOKEN}", "address": ListenAddress("127.0.0.1", TOKEN)}),
        (401, "GET", "/api/state", {"address": ListenAddress("127.0.0.1", TOKEN)}),
        (403, "GET", "/", {"headers": {"host": "evil.example"}}),
        (403, "POST", "/api/jobs", {"headers": {"origin": "https://evil.example"}}),
        (404, "GET", "/api/runs/none/series", {}),
        (405, "TRACE", "/", {}),
        (409, "POST", "/api/jobs", {"body": b'{"kind": "fit", "options": {"card": "one"}}'}),
        (413, "PUT", "/api/files/big.csv", {"most_upload": 10, "body": CSV}),
        (413, "POST", "/api/jobs", {"body": b" " * 2_000_000}),
        (422, "PUT", "/api/files/run.exe", {"body": CSV}),
        (500, "GET", "/api/runs", {}),
    ],
)
def test_errors_have_security_headers(folder, monkeypatch, capsys, status, method, path, options):
    from mrdamper.web.run_index import RunIndex

    def broken(_self: RunIndex) -> None:
        raise RuntimeError(SECRET)

    monkeypatch.setattr(RunIndex, "runs", broken)
    answer = ask(folder, method, path, **options)
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
    told = capsys.readouterr().err
    assert (SECRET in told) == (status == 500)  # Only the terminal shows the traceback.
    assert ("fault of mrdamper" in answer.json["error"]) == (status == 500)


# ------------------------------------------------------------------------------------------- names


NAMES = [
    "..", ".", "../secret.csv", "..%2fsecret.csv", "..\\secret.csv", "../../secret.csv", "....//secret.csv",
    "/etc/passwd", "//etc/passwd", "%2e%2e%2fsecret.csv", "a.csv/../../../secret.csv", "a.csv\0.txt",
    "runs/../../secret.csv", ".cache", ".upload-x", "a.csv/", "~/.bashrc", "C:\\secret.csv",
]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_names_stay_inside_folder(folder, name):
    """Decoded and encoded names use the same check."""
    before = snapshot(folder.parent)

    async def all_of_them() -> list[Answer]:
        async with living(build(folder)) as app:
            reads = ["/api/files/{}/look", "/api/inputs/{}", "/api/cards/{}", "/api/cards/one/files/{}",
                     "/api/jobs/check-001/files/{}", "/api/jobs/{}/files/job.json", "/api/dampers/{}",
                     "/static/{}", "/{}"]  # fmt: skip
            found = [await call(app, "GET", place.format(name)) for place in reads]
            for place in ("/api/files/{}", "/api/inputs/{}", "/api/cards/{}"):
                found.append(await call(app, "PUT", place.format(name), body=b"x,y\n"))
                found.append(await call(app, "DELETE", place.format(name)))
            order = {"card": "one", "damper": name, "duty": name}
            found.append(await call(app, "POST", "/api/heat/curve", body=json.dumps(order).encode()))
            for kind, options in (
                ("check", {"files": [name]}),
                ("evaluate", {"card": name}),
                ("fit", {"card": name}),
                ("compare", {"first": "one", "second": name}),
                ("cycles", {"record": name}),
                ("cycles", {"record": "a.csv", "channels": name}),
            ):
                order = {"kind": kind, "options": options}
                found.append(await call(app, "POST", "/api/jobs", body=json.dumps(order).encode()))
            return found

    answers = asyncio.run(all_of_them())
    assert not [answer for answer in answers if SECRET.encode() in answer.body or b"root:" in answer.body]
    assert not [answer for answer in answers if answer.status >= 500]
    pages = [answer for answer in answers if answer.status < 300]
    assert all(answer.headers["content-type"].startswith("text/html") for answer in pages)  # index.html
    after = snapshot(folder.parent)
    assert {key: after[key] for key in before} == before
    assert after.keys() == before.keys()


@pytest.mark.parametrize("name", NAMES)
def test_job_inputs_stay_inside_folder(folder, name):
    """The process of a job checks the names in its options in the same way."""
    work = WorkFolder(folder)
    for look_up in (work.run_file, work.record, work.channel_map, work.card, work.input):
        with pytest.raises(NotThereError):
            look_up(name)


@given(name=st.text(alphabet=st.characters(codec="utf-8"), max_size=12) | st.sampled_from(NAMES))
def test_new_names_stay_in_their_folder(tmp_path_factory, name):
    root = tmp_path_factory.getbasetemp() / "names"
    folder = WorkFolder(root)
    try:
        path = folder.new(folder.runs, name)
    except InputError:
        return
    assert path.parent == folder.runs
    assert path.resolve().parent == folder.runs.resolve()
    assert not path.name.startswith(".")


def test_outside_link_is_not_followed(folder):
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
        answer = ask(folder, "GET", path)
        assert answer.status == 404, path
        assert SECRET.encode() not in answer.body
    state = ask(folder, "GET", "/api/state").json
    assert [row["name"] for row in state["files"]] == ["a.csv"]
    assert [row["path"] for job in state["jobs"] for row in job["files"]] == ["check.html"]


def test_upload_replaces_link(folder):
    secret = folder.parent / "secret.csv"
    (folder / "runs" / "link.csv").symlink_to(secret)
    assert ask(folder, "PUT", "/api/files/link.csv", body=CSV).status == 201
    assert secret.read_text(encoding="utf-8") == SECRET
    assert not (folder / "runs" / "link.csv").is_symlink()


def test_folder_with_outside_link_is_refused(tmp_path):
    (tmp_path / "work").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "work" / "runs").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="leads out"):
        WorkFolder(tmp_path / "work")


# ------------------------------------------------------------------------------------------- sizes


@pytest.mark.parametrize("stated", [True, False])
def test_large_upload_leaves_no_file(folder, stated):
    body = b"1,2,3,4\n" * 5000
    headers = {"content-length": str(len(body))} if stated else {}
    answer = ask(
        folder, "PUT", "/api/files/big.csv", most_upload=20_000, headers=headers, body=body, pieces=20
    )
    assert answer.status == 413
    assert sorted(path.name for path in (folder / "runs").iterdir()) == ["a.csv"]


def test_wrong_content_length_is_detected(folder):
    body = b"1,2,3,4\n" * 5000
    lie = {"content-length": "10"}
    answer = ask(folder, "PUT", "/api/files/big.csv", most_upload=20_000, headers=lie, body=body, pieces=20)
    assert answer.status == 413
    assert not (folder / "runs" / "big.csv").exists()


@pytest.mark.parametrize("path", ["/api/jobs", "/api/heat/curve", "/api/nothing"])
def test_endless_request_is_refused(folder, path):
    assert ask(folder, "POST", path, body=b" " * 3_000_000, pieces=30).status == 413


@pytest.mark.parametrize(
    "body",
    [b"", b"[]", b"{", b"\xff\xfe", b"[" * 100_000, b'{"kind": ["a"]}', b'{"kind": "check", "options": 3}',
     b'{"kind": "heat", "options": {"card": "one", "ambient_degC": NaN}}',
     b'{"kind": "heat", "options": {"card": "one", "ambient_degC": 1e999}}',
     b'{"kind": "check", "options": {"unknown": 1}}'],
)  # fmt: skip
def test_invalid_order_reports_error(folder, body):
    answer = ask(folder, "POST", "/api/jobs", body=body)
    assert answer.status == 422
    assert answer.json["error"]
    assert len(answer.body) < 2000
    assert [path.name for path in (folder / "results").iterdir()] == ["check-001"]


def test_unknown_suffix_is_refused(folder):
    for name in ("page.html", "array.npy", "run.csv.channels.toml", "script.py", "run"):
        assert ask(folder, "PUT", f"/api/files/{name}", body=b"x").status == 422
    assert sorted(path.name for path in (folder / "runs").iterdir()) == ["a.csv"]


# ------------------------------------------------------------------------------------------- what is inside


def test_report_is_sent_with_sandbox(folder):
    for path in ("/api/jobs/check-001/files/check.html", "/api/cards/one"):
        policy = ask(folder, "GET", path).headers["content-security-policy"]
        assert policy.startswith("sandbox")
        assert "allow-scripts" not in policy
        assert "default-src 'none'" in policy
        assert "script-src" not in policy


def test_python_law_never_runs(folder, tmp_path):
    mark = tmp_path / "it_ran"
    law = tmp_path / "law.py"
    law.write_text(f"open({str(mark)!r}, 'w')\n", encoding="utf-8")
    (folder / "runs" / "numpy.py").write_text(f"open({str(mark)!r}, 'w')\n", encoding="utf-8")
    for value in (f"{law}:Law", "law.py:Law", "../law.py:Law"):
        order = {"kind": "fit", "options": {"card": "x", "law": value}}
        assert ask(folder, "POST", "/api/jobs", body=json.dumps(order).encode()).status == 422
    card = json.loads((folder / "cards" / "one" / "card.json").read_text(encoding="utf-8"))
    card["python_law"] = f"{law}:Law"
    assert ask(folder, "PUT", "/api/cards/two", body=json.dumps(card).encode()).status == 422
    assert not (folder / "cards" / "two").exists()
    assert not mark.exists()
