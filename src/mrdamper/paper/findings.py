"""Results of the jobs of the demo. The claims and figures are computed from these results."""

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
    """Results of the jobs. The thermal simulations use the preset ``paper`` of the virtual rig."""

    fitted: Identification  # fit of the selected law to runs of the preset ``nominal``
    judged: Assessment  # assessment of this fit
    paper_law: Assessment  # fit of the law of the paper (Bouc-Wen with polynomials) to the same runs
    fluid: Fluid
    warm_up: HeatResult  # heating at 15 mm, 1 Hz, 2 A for 35 min, also above the temperature limit
    small: HeatResult  # heating at 5 mm, 1 Hz
    fast: HeatResult  # heating at 3 mm, 2 Hz
    works: tuple[tuple[str, LoopWork], ...]  # name and dissipated work of these three motions
    sink: HeatsinkResult
    track: TrackResult
