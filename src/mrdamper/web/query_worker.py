"""The process at a desk: ``python -m mrdamper.web.query_worker FOLDER NICE``.

A question a line on standard input, an answer a line on standard output.

Measured files are parsed here and in the workers, never in the server. Answers are JSON; runs as they are
drawn go to files in the folder's ``.cache`` that the server sends as they are.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import traceback
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from mrdamper.errors import InputError, MrdamperError
from mrdamper.schema import Json
from mrdamper.web.workspace import FAULT, is_full

__all__ = ["answer_to"]

_MOST_MEMORY = 12 << 30  # bytes of addresses; most of them are only mapped


def answer_to(question: Json) -> Json:
    """Return the answer to one question; what is wrong with it as ``refused``."""
    try:
        return {"answer": _ANSWERS[question["ask"]](question)}
    except MrdamperError as fault:
        if is_full(fault.__cause__ or fault):
            return _full(question)
        return {"refused": str(fault)}
    except OSError as fault:
        if is_full(fault):
            return _full(question)
        traceback.print_exc(file=sys.stderr)
        return {"refused": FAULT}
    except MemoryError:
        return {"refused": "needs more memory than there is; use a shorter file"}
    except Exception:
        traceback.print_exc(file=sys.stderr)
        return {"refused": FAULT}


def _full(question: Json) -> Json:
    name = Path(question.get("file") or question.get("place") or "the folder").name
    return {"refused": f"what is drawn of {name} could not be kept", "full": True}


def _look(question: Json) -> Json:
    from mrdamper.jobs.preview import look

    return look(Path(question["file"]), _map(question))


def _glance(question: Json) -> Json:
    from mrdamper.jobs.preview import glance

    return glance(Path(question["file"]), _map(question)) or {"whole": True}


def _ready(_: Json) -> Json:
    import mrdamper.jobs.preview  # noqa: F401 - so that the next question need not wait for it

    return {}


def _cite(question: Json) -> Json:
    from mrdamper.jobs.cite import cite

    return cite(Path(question["card"]))


def _catalogue(_: Json) -> Json:
    from mrdamper.jobs.datasets import catalogue

    return {"sets": catalogue()}


def _keep(question: Json) -> Json:
    from mrdamper.jobs.series import keep_runs

    return keep_runs(Path(question["file"]), Path(question["place"]))


def _findings(question: Json) -> Json:
    from mrdamper.jobs.preview import findings_in

    return findings_in(Path(question["file"]))


def _window(question: Json) -> Json:
    from mrdamper.jobs.series import keep_window

    keep_window(
        Path(question["series"]),
        Path(question["place"]),
        most=question["most"],
        from_s=question["from_s"],
        to_s=question["to_s"],
        samples_of=Path(question["samples_of"]) if question.get("samples_of") else None,
    )
    return {}


def _model(question: Json) -> Json:
    from mrdamper.jobs.series import keep_model

    keep_model(
        Path(question["card"]),
        Path(question["file"]),
        question["run"],
        Path(question["place"]),
        question["name"],
    )
    return {}


def _checked_map(question: Json) -> Json:
    from mrdamper.jobs.preview import channels_toml

    return {"toml": channels_toml(question["map"])}


def _curve(question: Json) -> Json:
    return dict(_quick().curve(Path(question["card"]), question["damper"], **question["options"]))


def _damper(question: Json) -> Json:
    from mrdamper.jobs.heat_preview import damper_facts

    return damper_facts(question["damper"], question["name"])


def _card(question: Json) -> Json:
    from mrdamper.jobs.card_summary import require_card

    require_card(Path(question["card"]))
    return {}


@cache
def _quick() -> Any:  # noqa: ANN401 - a QuickHeat, loaded late
    from mrdamper.jobs.heat_preview import QuickHeat

    return QuickHeat()


def _map(question: Json) -> Json | None:
    given = question.get("map")
    if given is not None and not isinstance(given, dict):
        raise InputError("channel map: expected an object")
    return given


_ANSWERS: dict[str, Callable[[Json], Json]] = {
    "look": _look,
    "glance": _glance,
    "ready": _ready,
    "cite": _cite,
    "catalogue": _catalogue,
    "keep": _keep,
    "findings": _findings,
    "window": _window,
    "model": _model,
    "map": _checked_map,
    "curve": _curve,
    "damper": _damper,
    "card": _card,
}


def _run() -> None:
    os.environ.setdefault("MPLBACKEND", "Agg")
    os.nice(int(sys.argv[2]))
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = _MOST_MEMORY if hard == resource.RLIM_INFINITY else min(_MOST_MEMORY, hard)
    resource.setrlimit(
        resource.RLIMIT_AS, (most if soft == resource.RLIM_INFINITY else min(soft, most), hard)
    )
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what a library prints is no answer
    for line in sys.stdin:
        answers.write(json.dumps(answer_to(json.loads(line)), ensure_ascii=False, allow_nan=False) + "\n")
        answers.flush()


if __name__ == "__main__":
    _run()
