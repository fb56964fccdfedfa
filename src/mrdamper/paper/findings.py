"""Results of the demo's jobs, from which claims and figures are computed."""

from __future__ import annotations

from dataclasses import dataclass

from mrdamper.identify.assess import Assessment
from mrdamper.identify.fit import Identification
from mrdamper.jobs.thermal.heat import HeatResult
from mrdamper.jobs.thermal.heatsink import HeatsinkResult
from mrdamper.jobs.track import TrackResult
from mrdamper.models.fluids.fluid import Fluid
from mrdamper.thermal.dissipation import LoopWork


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """Results of the jobs. The thermal simulations use the preset ``paper`` of the rig."""

    fitted: Identification  # preset nominal, selected law
    judged: Assessment
    paper_law: Assessment  # the same runs, one Bouc-Wen law with polynomials as in the paper
    fluid: Fluid
    warm_up: HeatResult  # 15 mm, 1 Hz, 2 A for 35 min, past the limit, with and without fins
    small: HeatResult  # 5 mm, 1 Hz
    fast: HeatResult  # 3 mm, 2 Hz
    works: tuple[tuple[str, LoopWork], ...]  # the same three motions
    sink: HeatsinkResult
    track: TrackResult
