"""Messages in the words of the pages: where the command line would name an option, the name of the field.

Jobs speak of options (``--starts``), because a terminal is where they are read most. What the pages show is
turned here, on its way out, and nowhere else; files in the folder keep the words of the command line. A test
holds that every option in a message has a field of the name that stands here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

__all__ = ["COMMANDS", "FIELDS", "SPOKEN", "in_page_words", "spoken"]

FIELDS: Mapping[str, str] = MappingProxyType(
    {
        "channels": "Map channels",
        "controller": "Controllers",
        "correlation": "Law of the fins",
        "damper": "Drawing",
        "film-multiplier": "Factor on that law",
        "flip-force": "turn the sign of the force",
        "fluid": "Fluid, where runs do not tell",
        "hold-out": "Hold out",
        "law": "Law",
        "material": "Material",
        "method": "Search",
        "name": "Prefix of names",
        "one-command": "accept runs at one current only",
        "particle-fraction": "Volume share of iron",
        "resume": "Resume",
        "session-offsets": "each session has its own constant force",
        "starts": "Starts",
        "step": "Period",
        "temperature": "Temperature",
        "workers": "Processes",
    }
)
"""Option of the command line to the words beside its field."""

COMMANDS: Mapping[str, str] = MappingProxyType(
    {
        "check": "Check on the page Runs",
        "heat": "the page Heating",
        "identify": "the page Identify",
        "predict": "Predict on the page Identify",
        "rig": "the virtual rig on the page Runs",
        "sink": "the page Heat sink",
        "sweep": "the page Sweeps",
        "track": "the page Tracking",
    }
)
"""Command to where the pages have it."""

# Where a field's name would not make a sentence.
_PHRASES: tuple[tuple[str, str], ...] = (
    ("; choose another --out", ""),
    (". Choose another --out", ""),
    ("choose another --out", "start a new job"),
    ("Pass --resume to go on with it, or another --out", "Press Resume to go on with it, or start a new job"),
    ("the same command with --resume goes on", "Resume goes on"),
    ("or begin anew without --resume", "or start a new job"),
    ("--resume goes on", "Resume goes on"),
    ("--resume keeps", "Resume keeps"),
    ("expected --c DIR, --fmu FILE or --table FILE", "tick what to make"),
    ("; leave out --no-verify", ""),
    (", or pass --no-verify, which writes the C", ". The command line, with --no-verify, writes the C"),
)
_PASSED = re.compile(r"\b([Pp]ass|[Gg]ive|[Ss]ay|[Uu]se)(?= (?:another |fewer |more )?--)")
_VALUED = re.compile(r"--(?P<option>[a-z][a-z-]*[a-z]) (?P<value>none|auto|varpro|genetic|cma|paper)\b")
_OPTION = re.compile(r"--(?P<option>[a-z][a-z-]*[a-z])\b(?: (?:DIR|FILE|NAME|CARD|NUMBER)(?:\.toml)?\b)?")
_COMMAND = re.compile(rf"\bmrdamper ({'|'.join(COMMANDS)})\b(?! *--)")
_VALUES = {"varpro": "variable projection", "cma": "CMA-ES"}
_VERBS = {"pass": "set", "give": "set", "say": "tick", "use": "set"}

SPOKEN = frozenset(
    {
        "effect",
        "error",
        "found",
        "message",
        "notes",
        "problems",
        "remedy",
        "said",
        "scored",
        "sentence",
        "text",
        "words",
    }
)
"""Keys of answers under which sentences stand; under others stand names, which are never touched."""


def in_page_words(text: str) -> str:
    """Return a message with fields of the pages in place of options of the command line."""
    if "--" not in text and "mrdamper " not in text:
        return text
    for theirs, ours in _PHRASES:
        text = text.replace(theirs, ours)
    text = _PASSED.sub(_verb, text)
    text = _VALUED.sub(lambda m: f"{_field(m['option'], m[0])}: {_VALUES.get(m['value'], m['value'])}", text)
    text = _OPTION.sub(lambda m: _field(m["option"], m[0]), text)
    return _COMMAND.sub(lambda m: COMMANDS[m[1]], text)


def spoken(answer: Any, *, inside: bool = False) -> Any:  # noqa: ANN401 - whatever JSON holds
    """Return an answer whose sentences are in the words of the pages."""
    if isinstance(answer, str):
        return in_page_words(answer) if inside else answer
    if isinstance(answer, dict):
        return {key: spoken(value, inside=key in SPOKEN) for key, value in answer.items()}
    if isinstance(answer, list) and answer and isinstance(answer[0], str | dict | list):
        return [spoken(each, inside=inside) for each in answer]
    return answer


def _field(option: str, as_it_was: str) -> str:
    return f"“{FIELDS[option]}”" if option in FIELDS else as_it_was


def _verb(found: re.Match[str]) -> str:
    word = found[1]
    ours = _VERBS[word.lower()]
    return ours.capitalize() if word[0].isupper() else ours
