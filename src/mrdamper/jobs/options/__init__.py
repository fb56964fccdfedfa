"""What each job can be told: one declaration a job, from which every face is made.

The command line's options and help, the server's requests and forms, columns of sweeps and tables of options
in the documentation come from these classes. Only light modules are loaded here, so that help answers at
once; names that live in heavy ones are asked for late (``among``).
"""

from __future__ import annotations

from mrdamper.jobs.options.control import ExportOptions, SimulateOptions, TrackConditions, TrackOptions
from mrdamper.jobs.options.heating import (
    DerateOptions,
    HeatOptions,
    HeatsinkOptions,
)
from mrdamper.jobs.options.reading import FilesReading, LawReading, NoOptions, RunsReading
from mrdamper.jobs.options.runs import CheckOptions, CyclesOptions, EvaluateOptions, FitOptions, FluidOptions
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
    "FluidOptions",
    "HeatOptions",
    "HeatsinkOptions",
    "LawReading",
    "NoOptions",
    "RigOptions",
    "RunsReading",
    "SimulateOptions",
    "SweepOptions",
    "TrackConditions",
    "TrackOptions",
]
