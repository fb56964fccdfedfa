"""The demo: the main job on the embedded default, the virtual rig's ``nominal`` damper.

The rig is physics that is none of the laws; its runs are written as any laboratory would write them and
identified with temperatures and a motion held out; the paper's plain law is fitted beside the usual one.
"""

from __future__ import annotations

import time
from pathlib import Path

from mrdamper.app import answers
from mrdamper.app.answers import Json
from mrdamper.app.api import assess, fit, versions
from mrdamper.app.jobs import FitOptions, read_dataset, run_identification
from mrdamper.app.outputs import staged, write_json
from mrdamper.app.rig_job import write_campaign
from mrdamper.identify.variable_projection import Report
from mrdamper.rig.campaign import Campaign
from mrdamper.rig.plant import find_preset

__all__ = ["demo"]

_LABEL = "simulated: virtual rig, damper nominal; not measured"


def demo(out: Path, *, quick: bool = False, seed: int = 0, report: Report | None = None) -> Json:
    """Run the main job on the virtual rig: a campaign, the identification, errors on what was held out.

    ``quick`` takes three currents, four temperatures and two motions.
    """
    clock = time.process_time()
    campaign = _quick() if quick else Campaign()
    with staged(out) as beside:
        runs, truth = beside / "runs", beside / "runs.truth"
        runs.mkdir()
        truth.mkdir()
        write_campaign(runs, truth, find_preset("nominal"), campaign, seed=seed)
        dataset = read_dataset([runs], None)
        options = FitOptions(seed=seed, hold_out=campaign.hold_out)
        first = run_identification(
            dataset,
            beside,
            out,
            options,
            sources=(_LABEL,),
            simulated=_LABEL,
            report=report,
            title="Demo on the virtual rig",
        )
        laws = [answers.line(first)]
        if not first["cancelled"]:
            other = fit(
                dataset, "bouc-wen", temperature="paper", seed=seed, hold_out=options.hold_out, report=report
            )
            if not other.result.cancelled:
                laws.append(answers.line(answers.identification(other, assess(other), out, ())))
        answer: Json = {
            **first,
            "simulated": True,
            "runs_are": _LABEL,
            "laws": laws,
            "claims": [],
            "cpu_s": round(time.process_time() - clock, 3),
            "report": str(out / "report.html"),
            "summary_file": str(out / "summary.json"),
            "versions": versions(),
        }
        write_json(beside / "summary.json", answer)
    return answer


def _quick() -> Campaign:
    """Return a campaign of 30 runs that still has a temperature and a motion to hold out."""
    return Campaign(
        motions=("sine5mm1Hz", "nonperiodic"),
        currents_A=(0.0, 1.0, 2.0),
        temperatures_degC=(20.0, 60.0, 80.0, 120.0),
        held_out_temperatures_degC=(60.0,),
        held_out_motions=(),
    )
