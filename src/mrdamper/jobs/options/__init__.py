"""Options of the jobs: one dataclass for each job.

The options and the help of the command line, the requests and forms of the server, columns of sweeps and
tables of options in the documentation are generated from these classes. This package imports only small
modules, so that ``--help`` is fast. Names from large modules are read on first use (``among``).
"""

from __future__ import annotations

from mrdamper.jobs.options.control import ExportOptions, SimulateOptions, TrackConditions, TrackOptions
from mrdamper.jobs.options.heating import (
    DerateOptions,
    HeatOptions,
    HeatsinkOptions,
)
from mrdamper.jobs.options.reading import FilesReading, LawReading, MapReading, NoOptions, RunsReading
from mrdamper.jobs.options.runs import CheckOptions, CyclesOptions, EvaluateOptions, FitOptions
from mrdamper.jobs.options.studies import DemoOptions, RigOptions, SweepOptions

__all__ = [
    "CheckOptions",
    "CyclesOptions",
    "DemoOptions",
    "DerateOptions",
    "EvaluateOptions",
    "ExportOptions",
    "FilesReading",
    "FitOptions",
    "HeatOptions",
    "HeatsinkOptions",
    "LawReading",
    "MapReading",
    "NoOptions",
    "RigOptions",
    "RunsReading",
    "SimulateOptions",
    "SweepOptions",
    "TrackConditions",
    "TrackOptions",
]
