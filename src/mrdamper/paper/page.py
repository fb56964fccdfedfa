"""The demo's report: one HTML file that opens offline and goes through the paper figure by figure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import get_args

from mrdamper.paper.claims import Claim, Origin
from mrdamper.paper.figures import Section
from mrdamper.report.page import environment

__all__ = ["render_paper"]


def render_paper(
    sections: Sequence[Section],
    claims: Sequence[Claim],
    files: Sequence[tuple[str, str]],
    *,
    target: str,
    quick: bool,
    fingerprint: str,
    seed: int,
    versions: Mapping[str, str],
) -> str:
    """Return the page's HTML.

    Parameters
    ----------
    files : what lies beside the page, with what it is
    target : what was proved of the C code and the FMU
    """
    origins = Counter(claim.origin for claim in claims)
    return (
        environment()
        .get_template("paper.html.j2")
        .render(
            sections=sections,
            way=[section.plates[0] for section in sections if section.on_the_way],
            claims=[[claim for claim in claims if claim.row in section.rows] for section in sections],
            origins=[(origin, origins[origin]) for origin in get_args(Origin) if origins[origin]],
            judged=[claim for claim in claims if claim.verdict is not None],
            contradictions=[claim for claim in claims if claim.contradiction],
            calibrated=[claim for claim in claims if claim.origin == "calibrated to this figure"],
            files=files,
            target=target,
            quick=quick,
            fingerprint=fingerprint,
            seed=seed,
            versions=versions,
        )
    )
