"""Targets: documents that people and programs write, as text and as edits of a sound one.

A document that is accepted is written and read again: it must come back the same.
"""

from __future__ import annotations

import glob
import json
import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar
from unittest import mock

from fuzz.contract import folder, promised, require, written
from fuzz.edits import Draws, edited, toml_of
from fuzz.seeds import card_documents, text, toml_texts
from mrdamper.control.scenario import read_scenario
from mrdamper.data.channels import read_channel_map
from mrdamper.data.proposal.recordings import runs_in
from mrdamper.data.tables import read_tables
from mrdamper.jobs.sweep import plan as sweep_plan
from mrdamper.models.card_schema import card_from_json, card_text, read_card
from mrdamper.models.card_signature import signed
from mrdamper.models.fluids.fluid_file import find_fluid
from mrdamper.thermal.drawing_file import drawing_of, sink_of
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.damper import damper_to_toml, read_damper

__all__ = ["campaign", "card", "channel_map", "drawing", "fluid", "scenario", "sweep", "virtual_damper"]

_EDITS = 1  # a first byte of 1: what follows are edits of the kept document that the next byte chooses

Made = TypeVar("Made")

_LINES = 40  # of the run that a channel map is tried on


def _document(content: bytes, name: str) -> bytes:
    """Return the TOML that bytes stand for: themselves, or edits of a kept document."""
    if content[:1] != bytes([_EDITS]):
        return content
    draws = Draws(content[1:])
    return toml_of(edited(draws.pick(_kept(name)), draws)).encode("utf-8", "surrogatepass")


@cache
def _kept(name: str) -> list[dict[str, Any]]:
    return [tomllib.loads(text) for text in toml_texts(name)]


def _taking(
    name: str, read: Callable[[Path], Made], text_of: Callable[[Made], str] | None = None
) -> Callable[[bytes], None]:
    """Return the target of a kind of document; one with ``text_of`` is written again and read back."""

    def take(content: bytes) -> None:
        path = written(f"{name}.toml", _document(content, name))
        with promised(f"{name}.toml"):
            made = read(path)
            if text_of is not None:
                again = written(f"{name}.toml", text_of(made).encode())
                require(read(again) == made, f"the {name} does not come back the same")

    return take


fluid = _taking("fluid", find_fluid)
scenario = _taking("scenario", read_scenario)
campaign = _taking("campaign", Campaign.from_toml, Campaign.to_toml)
virtual_damper = _taking("virtual_damper", read_damper, damper_to_toml)


def channel_map(content: bytes) -> None:
    """A channel map, and what it makes of a run."""
    path = written("map.toml", _document(content, "channel_map"))
    with promised("map.toml"):
        chosen = read_channel_map(path)
        run = folder() / "run.csv"
        if not run.exists():
            run.write_bytes(text("run.csv", _LINES))
        with promised("run"):
            runs_in(read_tables(run, chosen.file), chosen, run)


def card(content: bytes) -> None:
    """A model card."""
    if content[:1] == bytes([_EDITS]):
        draws = Draws(content[1:])
        # signed, so that what is behind the signature is reached
        content = json.dumps(signed(edited(draws.pick(card_documents()), draws))).encode()
    path = written("card.json", content)
    with promised("card.json"):
        read = read_card(path)
        again = card_text(read)
        require(card_text(card_from_json(json.loads(again))) == again, "the card does not come back the same")


def drawing(content: bytes) -> None:
    """A damper's drawing, and the sink in it."""
    text = _document(content, "drawing").decode("utf-8", "replace")
    with promised("drawing.toml"):
        drawing_of(text, "drawing.toml")
    with promised("drawing.toml"):
        sink_of(text, "drawing.toml")


def sweep(content: bytes) -> None:
    """A sweep's plan; its patterns find files of this folder only."""
    path = written("sweep.toml", _document(content, "sweep"))
    with mock.patch.object(glob, "glob", _no_walk), promised():  # such as /** would walk the machine
        found = sweep_plan.read_plan(path)
        require(len({task.name for task in found.tasks}) == len(found.tasks), "two tasks of one name")
        require(len(found.fingerprint) == 64, "no fingerprint")


def _no_walk(pattern: str, **_options: object) -> list[str]:
    return [pattern] if "\0" not in pattern and Path(pattern).name.count("*") < 2 else []
