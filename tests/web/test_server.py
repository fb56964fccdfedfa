"""The server answers requests for files, plots and heating like the command line."""

from __future__ import annotations

import asyncio
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mrdamper.data.prepare import prepare_run
from mrdamper.data.readers import read_runs
from mrdamper.data.records import Dataset
from mrdamper.errors import InputError
from mrdamper.identify.fit import fit_law
from mrdamper.identify.fit_data import FitData
from mrdamper.models.card_schema import write_card
from mrdamper.web.context import Dampers
from mrdamper.web.queries import QueryLine
from mrdamper.web.schemas import ORDER_JOBS, request_fields
from tests.support.campaigns import short_runs, write_csv, write_runs
from tests.support.cards import PAPER_DRAWING, write_heated_card
from tests.support.rigs import answer_of, command, mrdamper
from tests.web.served import series_of, served
from tests.web.walking import sine_columns

pytestmark = pytest.mark.system


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return write_runs(tmp_path_factory.mktemp("files") / "runs", short_runs())


@pytest.fixture
def clean(plain_site):
    """Return the server with an empty folder."""
    root, client = plain_site
    for part in ("runs", "inputs", "cards"):
        for path in (root / part).iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    return root, client


# ------------------------------------------------------------------------------------------- initial state


@pytest.mark.parametrize("kind", ORDER_JOBS)
def test_request_defaults_equal_job_defaults(kind):
    orders = {field.name: field for field in request_fields(kind)}
    for option in ORDER_JOBS[kind].fields:
        assert option.option.local or orders[option.name].default == option.default, option.name
        described = replace(option.option, help=option.help)
        assert option.option.local or orders[option.name].option == described


# ------------------------------------------------------------------------------------------- files and runs


def test_uploaded_run_keeps_its_samples(clean, tmp_path):
    _, client = clean
    sine = sine_columns()
    content = write_csv(tmp_path / "run.csv", sine).read_bytes()
    assert client.ask("PUT", "/api/files/run 1.csv", content=content).status_code == 201
    (run,) = client.read_all()
    assert (run["name"], run["file"], run["usable"]) == ("run 1", "run 1.csv", True)
    assert run["motion"] == "sine 5 mm 1 Hz"
    assert run["peak_velocity_mm_s"] == pytest.approx(31.4, rel=0.01)  # 2 pi times 5 mm times 1 Hz
    header, columns = series_of(client.ask("GET", "/api/runs/run 1/series").content)
    assert header["n"] == header["samples"] == len(sine["time_s"])
    assert header["step_s"] == pytest.approx(0.005)
    sine["command_A"] = sine.pop("current_A")
    assert set(columns) == {*sine, "velocity_mm_s"}
    for name, measured in sine.items():
        np.testing.assert_allclose(columns[name], measured.astype(np.float32), rtol=2e-7, atol=1e-6)
    inner = slice(20, -20)
    expected = 10.0 * np.pi * np.cos(2.0 * np.pi * sine["time_s"])
    np.testing.assert_allclose(columns["velocity_mm_s"][inner], expected[inner], atol=0.1)


def test_invalid_file_shows_error_and_columns(clean):
    _, client = clean
    text = "time_s,displacement_mm,load,current_A\n0,0,1,1\n0.01,1,2,1\n0.02,oops,3,1\n"
    client.ask("PUT", "/api/files/broken.csv", content=text.encode())
    client.ask("PUT", "/api/files/mute.csv", content=text.replace("oops", "2").encode())
    broken, mute = (client.get(f"/api/files/{name}.csv/look") for name in ("broken", "mute"))
    assert "broken.csv" in broken["error"]
    assert "oops" in broken["error"]
    assert "force" in mute["error"]  # The column `load` has no unit, and the server does not guess a unit.
    roles = {column["name"]: column["guess"]["role"] for column in mute["columns"]}
    names = {"time_s": "time", "displacement_mm": "displacement", "load": "force", "current_A": "current"}
    assert roles == names
    states = {row["name"]: row["state"] for row in client.get("/api/state")["files"]}
    assert states == {"broken.csv": "unreadable", "mute.csv": "unreadable"}
    assert client.get("/api/runs")["runs"] == []


def test_changed_run_file_is_read_again(clean, tmp_path):
    root, client = clean
    write_csv(root / "runs" / "run.csv", sine_columns())
    assert client.read_all()[0]["samples"] == 800
    write_csv(tmp_path / "longer.csv", sine_columns(seconds=6.0))
    shutil.copy(tmp_path / "longer.csv", root / "runs" / "run.csv")
    assert client.read_all()[0]["samples"] == 1200
    assert client.ask("DELETE", "/api/files/run.csv").status_code == 200
    assert client.read_all() == []
    assert client.ask("GET", "/api/runs/run/series").status_code == 404


# ------------------------------------------------------------------------------------------- channel maps


MAP = {
    "channel": {
        "time": {"index": 1, "unit": "s"},
        "displacement": {"index": 2, "unit": "mm"},
        "force": {"name": "c", "unit": "V", "gain": 100.0, "sign": -1},
    },
    "constant": {"voltage_V": 1.5},
}


def silent_file(path):
    time, travel, force, *_ = sine_columns().values()
    np.savetxt(path, np.column_stack([time, travel, -0.01 * force]), "%.9g", header="a b c", comments="")


def test_saved_channel_map_works_on_command_line(clean, tmp_path):
    root, client = clean
    silent_file(root / "runs" / "silent.txt")
    assert client.get("/api/files/silent.txt/look")["error"]
    tried = client.ask("PUT", "/api/channels", json={"files": ["silent.txt"], "map": MAP}).json()
    assert tried["saved"] is False
    (preview,) = tried["previews"]
    assert preview["error"] is None
    roles = {column["name"]: column["role"] for column in preview["columns"]}
    assert roles == {"a": "time", "b": "displacement", "c": "force"}
    assert preview["runs"][0]["force_range_N"] == pytest.approx([-462.8, 462.8], abs=0.5)
    assert not (root / "runs" / "silent.txt.channels.toml").exists()
    body = {"files": ["silent.txt"], "map": MAP, "save": True}
    assert client.ask("PUT", "/api/channels", json=body).json()["saved"] is True
    (run,) = client.read_all()
    assert (run["command"], run["command_unit"]) == (1.5, "V")
    assert client.get("/api/files/silent.txt/look")["map"] == MAP
    told = answer_of(mrdamper("check", root / "runs" / "silent.txt", "--json"))
    assert told["files"][0]["runs"] == ["silent"]
    client.ask("PUT", "/api/channels", json={"files": ["silent.txt"], "map": None, "save": True})
    assert not (root / "runs" / "silent.txt.channels.toml").exists()
    assert client.read_all() == []


def test_unsuitable_channel_map_is_not_saved(clean, tmp_path):
    root, client = clean
    silent_file(root / "runs" / "silent.txt")
    (root / "runs" / "two.txt").write_text("a b\n1 2\n3 4\n", encoding="utf-8")
    order = {"files": ["silent.txt", "two.txt"], "map": MAP, "save": True}
    answer = client.ask("PUT", "/api/channels", json=order).json()
    assert answer["saved"] is False
    assert [preview["error"] is None for preview in answer["previews"]] == [True, False]
    assert not list((root / "runs").glob("*.toml"))
    wrong = {"channel": {"forse": {"index": 1}}}
    refused = client.ask("PUT", "/api/channels", json={"files": ["silent.txt"], "map": wrong})
    assert refused.status_code == 422
    assert "force" in refused.json()["error"]  # The message suggests the nearest name.


def test_error_on_page_equals_error_of_evaluate(clean, runs, tmp_path):
    """The model is plotted at the samples of the run, so the error equals ``mrdamper evaluate``."""
    root, client = clean
    shutil.copy(runs[3], root / "runs")
    (root / "cards" / "mine").mkdir(parents=True)
    card = root / "cards" / "mine" / "card.json"
    write_card(fit_law(FitData.prepare(Dataset(short_runs())), "dahl").card(), card)
    client.read_all()
    name = runs[3].stem
    header, model = series_of(client.ask("GET", f"/api/runs/{name}/model?card=mine").content)
    (told,) = answer_of(mrdamper("evaluate", card, runs[3], "--json"))["runs"]
    assert header["rmse_N"] == pytest.approx(told["rmse_N"], rel=1e-9)
    scored = prepare_run(read_runs(runs[3]).runs[0]).scored_from
    error = (model["force_N"] - model["measured_N"])[scored:].astype(np.float64)
    assert np.sqrt(np.mean(error**2)) == pytest.approx(told["rmse_N"], rel=1e-3)
    query = "max=64&from_s=0.5&to_s=2"
    _, few = series_of(client.ask("GET", f"/api/runs/{name}/model?card=mine&{query}").content)
    _, same = series_of(client.ask("GET", f"/api/runs/{name}/series?{query}").content)
    np.testing.assert_array_equal(few["time_s"], same["time_s"])
    np.testing.assert_array_equal(few["measured_N"], same["force_N"])
    assert client.ask("GET", f"/api/runs/{name}/model?card=nobody").status_code == 404


# ------------------------------------------------------------------------------------------- heating


def test_uploaded_geometry_is_used_for_heating(clean):
    root, client = clean
    write_heated_card(root / "cards" / "plain")
    drawing = PAPER_DRAWING.read_text(encoding="utf-8").replace("ambient_degC = 20", "ambient_degC = 33")
    assert client.ask("PUT", "/api/inputs/mine.toml", content=drawing.encode()).status_code == 201
    assert client.get("/api/dampers/mine.toml")["ambient_degC"] == pytest.approx(33.0)
    assert client.get("/api/dampers/paper")["sink"]["fins"] == 5
    curve = client.ask("POST", "/api/heat/curve", json={"card": "plain", "damper": "mine.toml"}).json()
    assert curve["curve"]["fluid_degC"][0] == pytest.approx(33.0)
    assert client.ask("GET", "/api/inputs/mine.toml").text == drawing
    client.ask("PUT", "/api/inputs/bad.toml", content=b"[body]\n")
    bad = client.ask("GET", "/api/dampers/bad.toml")
    assert bad.status_code == 422
    assert "outer_diameter_mm" in bad.json()["error"]


# ------------------------------------------------------------------------------------------- queries


def test_request_succeeds_after_worker_death():
    """If the process of a query dies, this query raises an error. The next query gets a new process."""

    def children() -> set[int]:
        lists = Path("/proc/self/task").glob("*/children")
        return {int(pid) for path in lists for pid in path.read_text().split()}

    async def kill_a_query() -> None:
        queries, others = QueryLine(), children()
        asked = asyncio.create_task(queries.ask("damper", {"damper": "paper", "shown": "paper"}))
        while not (started := children() - others):
            await asyncio.sleep(0.01)
        os.kill(started.pop(), signal.SIGKILL)
        with pytest.raises(InputError, match="the reader stopped"):
            await asked
        assert await queries.ask("damper", {"damper": "paper", "shown": "paper"})

    asyncio.run(kill_a_query())


# ------------------------------------------------------------------------------------------ command ``serve``


def test_unusable_address_ends_server_with_message(plain_site, tmp_path):
    _, client = plain_site
    port = client.address.rstrip("/").rpartition(":")[2]
    for options, said in (
        (("--port", port), "another --port"),
        (("--host", "0.0.0.0"), "--token"),
        (("--token", "short"), "16"),
    ):
        run = mrdamper("serve", "--folder", tmp_path / "other", *options)
        assert run.returncode == 3
        assert said in run.stderr
        assert "Traceback" not in run.stderr


@pytest.mark.nightly
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_ends_server_without_traceback(tmp_path, number):
    """Ctrl-C sends SIGINT. A service manager stops the server with SIGTERM."""
    with served(tmp_path / "work") as client:
        client.get("/api/state")
        client.process.send_signal(number)
        assert client.process.wait(timeout=10.0) == 0
        assert client.process.stderr is not None
        assert client.process.stderr.read() == ""


def test_damper_that_failed_to_open_is_not_locked(tmp_path):
    """A damper can be opened as soon as the cause of a first failure has been removed."""
    dampers = Dampers(tmp_path, most_upload=1, local=True)
    dampers.add("second")
    obstacle = tmp_path / "dampers" / "second" / "runs" / ".upload-1"
    obstacle.mkdir(parents=True)  # The server expects a file here and cannot delete a folder.
    with pytest.raises(OSError, match=r"\.upload-1") as fault:
        dampers.find("second")
    obstacle.rmdir()
    assert dampers.find("second").folder.runs == obstacle.parent
    assert fault.tb is not None  # The traceback keeps all objects of the first attempt.
    asyncio.run(dampers.close())


def test_missing_web_library_message_states_install_command(tmp_path):
    code = f"import sys; sys.modules['fastapi'] = None; {command()[2]}"
    run = subprocess.run(
        [sys.executable, "-c", code, "serve", "--folder", str(tmp_path)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 3
    assert "pip install 'mrdamper[web]'" in run.stderr
