"""The jobs, one row each: what they read, take, do, and how their results are shown.

Every face is made from these rows: commands and their help, the server's requests and forms, columns of
sweeps, the tables of options in the documentation, and ``mrdamper.heat(...)`` in Python. A new job is a
module in ``jobs``, one in ``report``, and a row here.

Rows name modules as text (``"mrdamper.jobs.thermal.heat:heat"``), so that reading the table loads nothing.
What is done with a row is the business of ``job``, what jobs read that of ``kinds``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from mrdamper.registry.job import Job
from mrdamper.registry.kinds import KINDS, Input, Kind, Output
from mrdamper.results import load

__all__ = ["JOBS", "KINDS", "Input", "Job", "Kind", "Output", "load", "public_names"]

CARD = Input(name="card", kind="card", help="The model card.")
CARD_OF_ANY_LAW = replace(CARD, kind="card of any law")
RUNS = Input(name="runs", kind="runs", help="Files, folders or patterns of runs.", label="Runs")
PREPARATION = Input(
    name="preparation",
    kind="preparation",
    flag="-",
    required=False,
    help="How runs are prepared; None: as the job does by itself.",
)
FIT_SETTINGS = Input(
    name="settings",
    kind="settings",
    flag="-",
    required=False,
    help="FitSettings, the numerical settings of the fit; None: the default ones.",
)
DRAWING = Input(
    name="drawing",
    kind="drawing",
    flag="--damper",
    key="damper",
    help="The drawing of the damper (TOML), or the paper's.",
    default_help="paper",
    label="Damper's drawing",
)
DUTY = Input(
    name="duty",
    kind="duty",
    flag="--duty",
    default="sine:15mm:1Hz:2A:1800s",
    required=False,
    help="MOTION:COMMAND:DURATION, or a CSV of time, motion and command.",
)

_ROWS = (
    Job(
        name="check",
        help="""Tell what is wrong with runs before they are fitted, and how their files were understood.

        PATH: files, folders or patterns of runs. Exit code 5 when a run has a fault.
        """,
        inputs=(replace(RUNS, name="files", kind="files"),),
        run="mrdamper.jobs.check:check",
        options="mrdamper.jobs.options:CheckOptions",
        report="mrdamper.report.check:REPORT",
        files_help="For check.html, check.json, findings.csv.",
        outputs=(
            Output(
                name="write_map",
                metavar="FILE",
                help="Write the channel map by which the files were read, to be corrected and kept.",
            ),
        ),
    ),
    Job(
        name="fit",
        out="card",
        help="""Fit one hysteresis law to measured runs over all currents and temperatures at once.

        PATH: files, folders or patterns of runs.
        """,
        inputs=(
            RUNS,
            Input(
                name="law",
                kind="law",
                flag="--law",
                required=False,
                help="chain, series-valve, double-bouc-wen, bouc-wen, bouc-wen-saturating, spencer, lugre, "
                "dahl, bingham, tanh; auto (chosen by what is left out); or file.py:Class.",
                default_help="auto",
                label="Law",
            ),
            Input(
                name="fluid",
                kind="fluid",
                flag="--fluid",
                required=False,
                help="Take temperature laws from a fluid (paper, lord-mrf-132dg, a file), marked as assumed.",
                default_help="none",
                label="Fluid, where runs do not tell",
            ),
            PREPARATION,
            FIT_SETTINGS,
        ),
        options="mrdamper.jobs.options:FitOptions",
        run="mrdamper.jobs.fit:fit",
        report="mrdamper.report.identification.report:REPORT",
        files_help="For card.json, report.html, errors.csv.",
        out_required=True,
        progress_word="start",
        ctrl_c="keeps the best",
    ),
    Job(
        name="evaluate",
        help="Score a model card on runs that it has not seen.",
        inputs=(CARD_OF_ANY_LAW, RUNS, PREPARATION),
        options="mrdamper.jobs.options:EvaluateOptions",
        run="mrdamper.jobs.evaluate:evaluate",
        report="mrdamper.report.cards.evaluate:REPORT",
        files_help="For evaluate.html, errors.csv.",
        progress_word="",
    ),
    Job(
        name="simulate",
        help="Simulate a card's force along a motion: in words, a measured run, or a frame.",
        inputs=(
            CARD_OF_ANY_LAW,
            Input(
                name="motion",
                kind="motion",
                help="MOTION:COMMAND:DURATION, such as sine:10mm:1Hz:1A:2s, or a run's file.",
            ),
        ),
        options="mrdamper.jobs.options:SimulateOptions",
        run="mrdamper.jobs.simulate:simulate",
        report="mrdamper.report.simulate:REPORT",
        files_help="For simulate.html, simulate.svg, simulate.json, simulate.csv.",
        progress_word="",
    ),
    Job(
        name="compare",
        help="""Compare two dampers, or one before and after: forces, energy, response, numbers.

        Differences are second minus first, inside what both were identified on.
        """,
        inputs=(
            Input(name="first", kind="card of any law", help="The card before.", in_answer=False),
            Input(name="second", kind="card of any law", help="The card after.", in_answer=False),
        ),
        run="mrdamper.models.comparison:compare_cards",
        report="mrdamper.report.cards.compare:REPORT",
        files_help="For compare.html, compare.json.",
        progress_word="",
    ),
    Job(
        name="cycles",
        help="Count the cycles of a record: energy, peak forces, stiffness and temperature of each.",
        inputs=(Input(name="record", kind="record", help="The record's file."),),
        options="mrdamper.jobs.options:CyclesOptions",
        run="mrdamper.jobs.cycles:cycles",
        report="mrdamper.report.cycles:REPORT",
        files_help="For cycles.csv, cycles.html, summary.json.",
        progress_word="",
    ),
    Job(
        name="heat",
        help="Tell how hot a damper gets under a duty, how soon, and where the heat goes.",
        inputs=(
            CARD,
            DRAWING,
            DUTY,
            Input(
                name="sink",
                kind="sink",
                flag="--sink",
                required=False,
                help="A heat sink (TOML table [sink]) in place of the drawing's.",
                default_help="the drawing's",
                label="Heat sink of the study",
                group="More",
            ),
            Input(
                name="calibrate",
                kind="curve",
                flag="--calibrate",
                required=False,
                help="A curve measured under this duty (time_s and fluid_degC, body_degC or coil_degC): it "
                "corrects the drawing and narrows the interval.",
                label="Measured curve, to calibrate by",
                group="More",
            ),
        ),
        options="mrdamper.jobs.options:HeatOptions",
        run="mrdamper.jobs.thermal.heat:heat",
        report="mrdamper.report.thermal.heat:REPORT",
        files_help="For heat.html, heat.json, heat.csv.",
        progress_word="step",
    ),
    Job(
        name="derate",
        help="Tell the largest current (stroke, duty) that keeps every limit, over ambient, wind and time.",
        inputs=(CARD, DRAWING, DUTY),
        options="mrdamper.jobs.options:DerateOptions",
        run="mrdamper.jobs.thermal.derate:derate",
        report="mrdamper.report.thermal.derate:REPORT",
        files_help="For derate.html, derate.json, derate.csv, derate.h.",
        progress_word="step",
    ),
    Job(
        name="fluid",
        help="Fit viscosity and yield-stress laws to rheometer tables.\n\nTABLE.csv: temperature_degC and "
        "viscosity_mPas, or field_mT (field_kA_m), temperature_degC and yield_stress_kPa.",
        inputs=(
            Input(
                name="tables",
                kind="rheometer table",
                in_answer=True,
                help="Rheometer tables.",
                label="Rheometer tables",
            ),
            Input(
                name="like",
                kind="fluid",
                flag="--like",
                default="paper",
                required=False,
                help="Fluid that gives what the tables do not hold: paper, lord-mrf-132dg, or a fluid.toml.",
                label="What they do not hold, from",
            ),
        ),
        run="mrdamper.jobs.fluid:fluid",
        report="mrdamper.report.fluid:REPORT",
        progress_word="",
        files_help="For fluid.html, fluid.toml and fluid.svg.",
    ),
    Job(
        name="track",
        help="Track forces on a virtual damper with controllers made from a card, without a force sensor.",
        inputs=(
            CARD,
            Input(
                name="plant",
                kind="plant",
                flag="--plant",
                default="nominal",
                required=False,
                help="The damper that is tracked: nominal, hard, stiff, ..., a virtual damper (TOML), or a "
                "card (JSON).",
                label="Damper to be controlled",
            ),
            Input(
                name="targets",
                kind="scenario",
                flag="--target",
                required=False,
                help="sine-900N-1Hz, sine-1100N-2Hz, non-periodic, or a scenario (may be repeated).",
                default_help="all",
                label="Targets",
                begins=("sine-900N-1Hz",),
            ),
            Input(
                name="unaware",
                kind="card",
                flag="-",
                required=False,
                help="Identified at one temperature: adds recommended-unaware and paper-unaware.",
            ),
        ),
        options="mrdamper.jobs.options:TrackOptions",
        run="mrdamper.jobs.track:track",
        report="mrdamper.report.track:REPORT",
        files_help="For track.html, track.json, track.csv.",
    ),
    Job(
        name="heatsink",
        help="Search annular-fin heat sinks: the coolest damper for the least mass, inside limits.",
        inputs=(CARD, DRAWING, DUTY),
        options="mrdamper.jobs.options:HeatsinkOptions",
        run="mrdamper.jobs.thermal.heatsink:heatsink",
        report="mrdamper.report.thermal.heatsink:REPORT",
        files_help="For heatsink.html, heatsink.json, front.csv, best.toml.",
    ),
    Job(
        name="export",
        help="Export a card as C source, FMU, force map or for MATLAB. The code is compared with the model "
        "before it is written.",
        inputs=(
            CARD,
            Input(
                name="damper",
                kind="drawing",
                flag="--damper",
                required=False,
                help="The drawing (TOML): adds the thermal model, and tells a frozen thermometer.",
                default_help="no thermal model",
                label="Drawing, for the thermal model",
            ),
        ),
        options="mrdamper.jobs.options:ExportOptions",
        run="mrdamper.jobs.export:export",
        report="mrdamper.report.export:REPORT",
        outputs=(
            Output(name="c", metavar="DIR", help="Write C99 source and its report there."),
            Output(name="fmu", metavar="FILE", help="Write a co-simulation FMU (FMI 2.0)."),
            Output(name="table", metavar="FILE", help="Write a force map (CSV) for simulators."),
            Output(name="matlab", metavar="DIR", help="Write card and force map for MATLAB there."),
        ),
        progress_word="part",
    ),
    Job(
        name="rig",
        out="runs",
        help="Run a campaign of tests on the virtual rig: a damper whose physics is none of the laws.",
        inputs=(
            Input(
                name="preset",
                kind="virtual damper",
                flag="--preset",
                default="nominal",
                required=False,
                help="Virtual damper: a preset, or a file (TOML) with a preset and changed parameters.",
                label="Damper",
            ),
            Input(
                name="campaign",
                kind="campaign",
                flag="--campaign",
                required=False,
                help="Motions, currents, temperatures, sensors (short, or TOML).",
                default_help="the damper's usual one",
                begins="short",
            ),
        ),
        options="mrdamper.jobs.options:RigOptions",
        run="mrdamper.jobs.rig:rig",
        report="mrdamper.report.rig:REPORT",
        files_help="For the runs (CSV); the truth goes to DIR.truth beside it.",
        out_required=True,
    ),
    Job(
        name="data list",
        python="list_data",
        help="List the public data sets.",
        inputs=(),
        run="mrdamper.jobs.public_data.datasets:list_data",
        report="mrdamper.report.datasets:LISTED",
        progress_word="",
    ),
    Job(
        name="data fetch",
        out="runs",
        python="fetch_data",
        help="Fetch a public data set and print where its files lie.",
        inputs=(Input(name="name", kind="name", help="Of the set, as the list has it."),),
        run="mrdamper.jobs.public_data.datasets:fetch_data",
        report="mrdamper.report.datasets:FETCHED",
        files_help="For the set's files, each with its channel map.",
        progress_word="set",
    ),
    Job(
        name="demo",
        help="Run every job on the virtual rig and compare with the paper (no measured data needed).",
        inputs=(),
        options="mrdamper.jobs.options:DemoOptions",
        run="mrdamper.paper.demo:demo",
        report="mrdamper.paper.report:REPORT",
        files_help="Where to.",
        out_default="build/demo",
        progress_word="step",
    ),
    Job(
        name="sweep",
        help="""Fit many campaigns, track random dampers, or search heat sinks for several dampers.

        PATH: files, folders or patterns of runs, each fitted by itself. With --samples or --damper a card
        is tracked on random dampers or heats each damper instead.
        """,
        inputs=(
            Input(
                name="campaigns",
                kind="campaigns",
                required=False,
                help="Files, folders or patterns of runs to fit.",
                label="Campaigns to fit",
                in_answer=False,
            ),
            replace(CARD, flag="--card", required=False, default_help="none", in_answer=False),
            Input(
                name="dampers",
                kind="drawings",
                flag="--damper",
                required=False,
                help="Search the heat sink of this damper: paper, or a geometry file (may be repeated).",
                label="Dampers that get a heat sink",
            ),
            DUTY,
            Input(
                name="law",
                kind="law",
                flag="--law",
                required=False,
                help="Hysteresis model of the fits.",
                default_help="auto",
                label="Law",
            ),
        ),
        run="mrdamper.jobs.sweep.sweep:sweep",
        options="mrdamper.jobs.options:SweepOptions",
        report="mrdamper.report.sweep:REPORT",
        checkpoint="mrdamper.jobs.sweep.store:open_store",
        files_help="For the results.",
        out_required=True,
        progress_word="task",
        ctrl_c="keeps the results",
    ),
)

JOBS: Mapping[str, Job] = {row.name: row for row in _ROWS}
"""The jobs by name, in the order of the help."""

QUERIES: Mapping[str, str] = MappingProxyType(
    {
        "preview": "mrdamper.jobs.previews.runs:look",
        "preview_head": "mrdamper.jobs.previews.runs:glance",
        "findings": "mrdamper.jobs.previews.runs:findings_in",
        "channels": "mrdamper.jobs.channel_map:channels_toml",
        "runs": "mrdamper.jobs.previews.series:keep_runs",
        "window": "mrdamper.jobs.previews.series:keep_window",
        "model": "mrdamper.jobs.previews.series:keep_model",
        "heat_curve": "mrdamper.jobs.previews.heat:QuickHeat.curve",
        "damper": "mrdamper.jobs.previews.heat:damper_facts",
        "drawn": "mrdamper.jobs.previews.heat:draw_damper",
        "card": "mrdamper.jobs.previews.card:require_card",
        "catalogue": "mrdamper.jobs.public_data.datasets:catalogue",
    }
)
"""Function that answers a query, by name. Queries are short computations for web pages."""

PICTURES: Mapping[str, str] = MappingProxyType(
    {
        "Dataset": "mrdamper.report.figures.runs:measured_loops",
        "RigRun": "mrdamper.report.figures.runs:measured_loops",
        "ModelCard": "mrdamper.report.cards.picture:card_figure",
    }
)
"""Function that draws a value, by the name of its class."""


def public_names() -> dict[str, Job]:
    """Return the jobs by their names in Python."""
    return {job.attribute: job for job in JOBS.values()}
