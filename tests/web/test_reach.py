"""Every option of the command line has a field on a page, or docs/web.md states why it has no field."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from mrdamper.cli import cli
from mrdamper.jobs.previews.choices import choices
from mrdamper.web.forms import all_forms
from mrdamper.web.schemas import ORDER_JOBS, read_order, request_fields
from tests.web.walking import STATIC

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[2]

FIELD_OF = {
    "fit": {"runs": "files", "term": "terms", "paths": "files", "out": "card"},
    "evaluate": {"runs": "files"},
    "check": {"files": "files"},
    "heatsink": {"material": "materials", "emissivity": "emissivities", "front": "members",
             "network_only": "by_field"},
    "track": {"target": "targets", "temperature": "temperatures_degC", "controller": "controllers"},
    "export": {"c": "what", "fmu": "what", "table": "what", "matlab": "what",
               "step": "period_s"},
    "sweep": {"campaigns": "files"},
}  # fmt: skip
"""Names of request fields that differ from the option."""


def commands(group: click.Group = cli, before: str = "") -> Iterator[tuple[str, click.Command]]:
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            yield from commands(command, f"{before}{name} ")
        else:
            yield f"{before}{name}", command


def only_there() -> set[str]:
    """Return the options that docs/web.md lists as available only on the command line."""
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
def test_command_line_options_are_in_forms_or_explained(command, name, told):
    if {command, told, f"{command} {told}"} & only_there() or told == "--channels":
        return
    if told == "--resume":  # Resuming a sweep is a separate request on the pages.
        assert "resumeButton" in (STATIC / "page_jobs.js").read_text(encoding="utf-8")
        return
    kind = command.split()[-1]
    field = FIELD_OF.get(kind, {}).get(name, name)
    fields = {field.name for field in request_fields(kind)}
    assert {field, told.lstrip("-").replace("-", "_")} & fields, f"{command} {told}: add it to {kind}"


def test_documented_command_line_options_exist():
    known = {f"{command} {told}" for command, _, told in OPTIONS}
    known |= {each for command, _, told in OPTIONS for each in (command, told)}
    assert only_there() <= known


def test_web_documentation_names_every_command():
    text = (ROOT / "docs" / "web.md").read_text(encoding="utf-8")
    section = text.split("## What is on which page")[1].split("\n## ")[0]
    assert {name for name, _ in commands()} - {"serve"} - only_there() <= set(
        re.findall(r"`([a-z ]+)`", section)
    )


@pytest.mark.parametrize("kind", ORDER_JOBS)
def test_every_job_kind_has_page(kind):
    """The program builds the form from the declarations of the job, so a page needs no list of fields."""
    text = "".join(path.read_text(encoding="utf-8") for path in STATIC.glob("page_*.js"))
    assert re.search(rf'formOf\("{kind}"|startButton\(\s*"{kind}"|^\s+{kind}: "', text, re.MULTILINE)


@pytest.mark.parametrize("kind", ORDER_JOBS)
def test_initial_form_values_are_valid(kind):
    forms = all_forms(choices())[kind]
    assert [one["name"] for one in forms] == [field.key for field in request_fields(kind)]
    assert all(one["label"].strip() for one in forms)
    begins = {one["name"]: one["begins"] for one in forms if one["begins"] is not None}
    needed = {one["name"]: ["a"] if one["many"] else "a" for one in forms if one["required"]}
    assert read_order(kind, {**begins, **needed}).kind == kind
