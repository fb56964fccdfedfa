"""What the command line can do the pages can do, too; what they cannot is named in docs/web.md with a reason.

Somebody who adds an option and forgets the page finds it here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from playwright.sync_api import Route, expect

from mrdamper.cli import cli
from mrdamper.data.catalog import list_sets
from mrdamper.jobs.previews.choices import choices
from mrdamper.jobs.previews.runs import glance
from mrdamper.jobs.public_data.datasets import MAPS
from mrdamper.jobs.sweep.plan import KINDS as PLANS
from mrdamper.jobs.sweep.plan import read_plan
from mrdamper.web.forms import all_forms
from mrdamper.web.schemas import order_kinds, read_order, request_fields
from mrdamper.web.spelling import on_page
from tests.web.browser import opened
from tests.web.served import served
from tests.web.walking import STATIC

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[2]

FIELD_OF = {
    "fit": {"runs": "files", "bootstrap": "draws", "term": "terms",
                 "coil_resistance": "coil_resistance_ohm", "paths": "files", "out": "card"},
    "evaluate": {"runs": "files"},
    "check": {"files": "files"},
    "heatsink": {"material": "materials", "emissivity": "emissivities", "front": "members",
             "network_only": "by_field"},
    "track": {"target": "targets", "temperature": "temperatures_degC", "controller": "controllers"},
    "export": {"c": "what", "fmu": "what", "table": "what", "matlab": "what", "report": "what",
               "step": "period_s"},
    "sweep": {"file": "plan"},
}  # fmt: skip
"""Where a field of an order is not named as the option is."""

BY_ROUTE = {"data list": "/api/data", "cite": "/api/cards/{name}/cite"}
"""Commands that are no jobs, but answers to a request."""


def commands(group: click.Group = cli, before: str = "") -> Iterator[tuple[str, click.Command]]:
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            yield from commands(command, f"{before}{name} ")
        else:
            yield f"{before}{name}", command


def only_there() -> set[str]:
    """Return what docs/web.md says is for the command line alone: `sweep --scheduler`, `--json`, `cycles`."""
    text = (ROOT / "docs" / "web.md").read_text(encoding="utf-8")
    section = text.split("## Only on the command line")[1].split("\n## ")[0]
    rows = [line.split("|")[1:3] for line in section.splitlines() if line.startswith("| `")]
    assert all(len(why.strip()) > 20 for _, why in rows)
    found = (
        re.match(r"(?:\w+ )?--[\w-]+|\w+$", each)
        for what, _ in rows
        for each in re.findall(r"`([^`]+)`", what)
    )
    return {each[0] for each in found if each is not None}


OPTIONS = [
    (name, each.name or "", each.opts[-1])
    for name, command in commands()
    for each in command.get_params(click.Context(command))
    if not (isinstance(each, click.Option) and each.is_eager)
]


@pytest.mark.parametrize(("command", "name", "told"), OPTIONS, ids=str)
def test_every_option_has_a_field_or_a_reason(command, name, told):
    if {command, told, f"{command} {told}"} & only_there() or told == "--channels":
        return
    if told == "--resume":  # a request of its own, for kinds that can go on
        assert "resumeJob" in (STATIC / "page_jobs.js").read_text(encoding="utf-8")
        return
    if command in BY_ROUTE:
        assert name == "card"
        return
    kind = command.split()[-1]
    field = FIELD_OF.get(kind, {}).get(name, name)
    fields = {field.name for field in request_fields(kind)}
    assert {field, told.lstrip("-").replace("-", "_")} & fields, f"{command} {told}: add it to {kind}"


def test_every_exception_is_an_option_still():
    known = {f"{command} {told}" for command, _, told in OPTIONS}
    known |= {each for command, _, told in OPTIONS for each in (command, told)}
    assert only_there() <= known


def test_every_command_is_in_the_table_of_pages():
    text = (ROOT / "docs" / "web.md").read_text(encoding="utf-8")
    section = text.split("## What is on which page")[1].split("\n## ")[0]
    assert {name for name, _ in commands()} - {"serve"} - only_there() <= set(
        re.findall(r"`([a-z ]+)`", section)
    )


@pytest.mark.parametrize("kind", order_kinds())
def test_every_kind_of_job_is_asked_for_on_a_page(kind):
    """Its form is drawn from the declarations, so that a field cannot be forgotten."""
    text = "".join(path.read_text(encoding="utf-8") for path in STATIC.glob("page_*.js"))
    text += (STATIC / "more_runs.js").read_text(encoding="utf-8")
    assert re.search(rf'(jobForm|JobPanel)\(app, "{kind}"|^  {kind}: \["', text, re.MULTILINE)


@pytest.mark.parametrize("kind", order_kinds())
def test_every_field_has_words_and_what_it_begins_with_is_taken(kind):
    forms = all_forms(choices())[kind]
    assert [one["name"] for one in forms] == [field.key for field in request_fields(kind)]
    assert all(one["label"].strip() for one in forms)
    begins = {one["name"]: one["begins"] for one in forms if one["begins"] is not None}
    needed = {one["name"]: ["a"] if one["many"] else "a" for one in forms if one["required"]}
    assert read_order(kind, {**begins, **needed}).kind == kind


def test_commands_that_are_no_jobs_have_their_route():
    told = (STATIC / "api.js").read_text(encoding="utf-8")
    assert '"/api/data"' in told
    assert "/cite`" in told


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("--starts", "“Starts”"),
        ("--method varpro", "“Search”: variable projection"),
        ("--channels FILE", "“Map channels”"),
        ("mrdamper evaluate", "Predict on the page Fit"),
        ("--unheard-of", "--unheard-of"),
    ],
)
def test_options_and_commands_are_spelled_as_the_pages_have_them(said, shown):
    assert on_page(said) == shown


def test_the_maps_that_are_installed_are_those_of_the_examples():
    names = {each.channels for each in list_sets()}
    assert {path.name for path in MAPS.iterdir() if path.suffix == ".toml"} == names
    for name in names:
        assert (MAPS / name).read_bytes() == (ROOT / "examples" / name).read_bytes()


# ---------------------------------------------------------------------------------------------- in a browser


@pytest.mark.nightly
def test_a_sweep_is_written_started_and_read(page, site):
    page.goto("/#/sweeps")
    text = page.input_value("#plan-text").replace("draws = 8", "draws = 1").replace("[20, 100]", "[20]")
    page.fill("#plan-text", text)
    page.click("#keep-plan")
    expect(page.locator("#sweep-plan")).to_have_value("tolerance.toml")
    assert (site[0] / "inputs" / "tolerance.toml").read_text() == text
    page.get_by_label("Processes").fill("1")
    page.click("#start-sweep")
    page.locator("#sweep-result").get_by_text("draw-0", exact=True).wait_for(state="attached")  # folded
    assert "rmse feasible" in page.inner_text("#sweep-result")


def test_the_templates_are_plans(page, site):
    """Each is a plan of its kind as it stands, in a folder that has runs and a card."""
    page.goto("/#/sweeps")
    page.locator("details", has_text="Write a plan").evaluate("(details) => (details.open = true)")
    for kind in PLANS:
        page.select_option("#template", kind)
        own = site[0] / "inputs" / f"template-{kind}.toml"
        own.parent.mkdir(exist_ok=True)
        own.write_text(page.input_value("#plan-text"))
        assert read_plan(own).kind == kind


@pytest.mark.nightly
def test_public_data_are_listed_with_their_licence(page):
    page.goto("/#/runs")
    page.click("#public-data summary")
    expect(page.locator("#public-data [data-set]")).to_have_count(len(list_sets()))
    assert "MIT" in page.inner_text("#public-data")


@pytest.mark.nightly
def test_all_runs_are_checked_with_a_report(page):
    page.goto("/#/runs")
    page.click("#check-runs")
    expect(page.locator("#check .verdict")).to_contain_text("27 runs: the runs can be fitted", timeout=30_000)
    assert page.get_by_role("link", name="Open the report of the check").is_visible()


@pytest.mark.nightly
def test_works_to_cite_are_told_and_saved(page):
    page.goto("/#/export")
    page.click("#cite summary")
    page.wait_for_selector("#cite li")
    with page.expect_download() as got:
        page.click("#save-bib")
    assert "@" in got.value.path().read_text()


def test_heating_takes_a_model_and_a_start_temperature(page, site):
    page.goto("/#/heating")
    page.click("#study-more summary")
    page.select_option("#heat-model", "lumped")
    page.get_by_label("Temperature at the start, °C").fill("35")
    page.get_by_label("heat paths by finite elements").uncheck()
    with page.expect_request("**/api/jobs") as sent:
        page.click("#full-study")
    asked = sent.value.post_data_json["options"]
    assert (asked["model"], asked["start_degC"], asked["by_field"]) == ("lumped", 35, False)


@pytest.mark.nightly
def test_tracking_takes_scenarios_and_any_temperature(page, tmp_path):
    scenario = tmp_path / "own.toml"
    scenario.write_text('[target]\nkind = "sine"\n')
    page.goto("/#/tracking")
    with page.expect_file_chooser() as choosing:
        page.get_by_role("button", name="Bring a scenario (TOML)").click()
    choosing.value.set_files(scenario)
    page.get_by_label("own.toml").wait_for()
    page.fill("#track-temperatures-degC", "40, 81.5")
    with page.expect_request("**/api/jobs") as sent:
        page.click("#start-track")
    asked = sent.value.post_data_json["options"]
    assert "own.toml" in asked["targets"]
    assert {40, 81.5} == set(asked["temperatures_degC"])
    page.wait_for_selector("[data-job=track] .notice.fault")  # it has no target worth the name


@pytest.mark.nightly
def test_the_sheet_of_a_large_file_begins_with_its_head(page, site, tmp_path):
    """A head is shown at once as what it is; the whole takes its place when it has been read."""
    large = tmp_path / "large.csv"
    rows = "".join(f"{k / 1e3:.3f},{k % 97},{k % 89},1\n" for k in range(200_000))
    large.write_text("time_s,displacement_mm,force_N,current_A\n" + rows)
    head = glance(large, None)
    assert head is not None
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/api/files/large.csv/look", hold)
    page.route("**/api/files/large.csv/look?head=1", lambda route: route.fulfill(json=head))
    page.goto("/#/runs")
    page.set_input_files("#picker", large)
    page.get_by_label("Look into large.csv").click()
    page.wait_for_selector("#sheet table.sheet")
    expect(page.locator("#preview")).to_contain_text("Seen so far")
    page.unroute("**/api/files/large.csv/look")
    for each in held:
        each.continue_()
    expect(page.locator("#preview")).not_to_contain_text("Seen so far", timeout=20_000)
    assert site[1].ask("DELETE", "/api/files/large.csv").status_code == 200


@pytest.mark.nightly
def test_without_a_connection_nothing_is_fetched_and_the_page_says_so(browser, tmp_path, monkeypatch):
    for name in ("HTTPS_PROXY", "https_proxy"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")
    for name in ("NO_PROXY", "no_proxy"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.delenv("MRDAMPER_DATA", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with served(tmp_path / "away") as client, opened(browser, client.address) as page:
        page.goto("/#/runs")
        page.click("#public-data summary")
        page.locator("#public-data [data-set]").first.click()
        expect(page.locator("[data-job=fetch] .notice.fault")).to_contain_text(
            "no connection to github.com", timeout=30_000
        )
        assert not any((tmp_path / "away" / "runs").iterdir())
