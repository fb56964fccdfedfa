"""Registry of the jobs: one row with inputs, options, function and report for each job.

All interfaces are generated from these rows: commands and their help, requests and forms of the server,
columns of sweeps, tables of options in the documentation, and functions such as ``mrdamper.heat``. A new job
consists of a module in ``jobs``, a module in ``report`` and a row here.

Rows contain the names of modules as text (``"mrdamper.jobs.thermal.heat:heat"``), so that the table loads no
module. The module ``job`` runs a row. The module ``kinds`` defines the kinds of inputs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from mrdamper.registry.job import Job
from mrdamper.registry.kinds import KINDS, Input, Kind, Output
from mrdamper.results import load

__all__ = ["JOBS", "KINDS", "Input", "Job", "Kind", "Output", "load", "public_names"]

CARD = Input(name="card", kind="card", help="Read this model card.")
CARD_OF_ANY_LAW = replace(CARD, kind="card of any law")
RUNS = Input(name="runs", kind="runs", help="Read these runs: files, folders or patterns.", label="Runs")
PREPARATION = Input(
    name="preparation",
    kind="preparation",
    flag="-",
    required=False,
    help="Prepare the runs with these settings. None selects the settings of the job.",
)
FIT_SETTINGS = Input(
    name="settings",
    kind="settings",
    flag="-",
    required=False,
    help="Use these numerical settings (FitSettings). None selects the default settings.",
)
DRAWING = Input(
    name="drawing",
    kind="drawing",
    flag="--damper",
    key="damper",
    help="Read the dimensions of the damper from this geometry file (TOML).",
    default_help="paper",
    label="Geometry file",
)
DUTY = Input(
    name="duty",
    kind="duty",
    flag="--duty",
    default="sine:15mm:1Hz:2A:1800s",
    required=False,
    help="Apply this load cycle: MOTION:CURRENT:DURATION, or a CSV file with time, motion and current.",
)

_ROWS = (
    Job(
        name="check",
        help="""Check test data before a fit.

        PATH is a file, a folder or a pattern. The command finds problems of single runs, such as noise,
        drift, clipping or a wrong unit, and differences between runs. A fault prevents a fit, a warning makes
        a fit worse, and a note is information.
        """,
        inputs=(replace(RUNS, name="files", kind="files"),),
        run="mrdamper.jobs.check:check",
        options="mrdamper.jobs.options:CheckOptions",
        report="mrdamper.report.check:REPORT",
        files_help="Write check.html, check.json and findings.csv to this folder.",
        outputs=(
            Output(
                name="write_map",
                metavar="FILE",
                help="Write the channel map with which the files were read. It can be edited and used "
                "with --channels.",
            ),
        ),
    ),
    Job(
        name="fit",
        out="card",
        help="""Fit a hysteresis model to test data.

        One model describes all currents and temperatures of the runs. PATH is a file, a folder or a pattern.
        Each run needs time, displacement, force and current or voltage. Temperature is optional.
        """,
        inputs=(
            RUNS,
            Input(
                name="law",
                kind="law",
                flag="--law",
                required=False,
                help="Fit this hysteresis model: chain, series-valve, double-bouc-wen, bouc-wen, "
                "bouc-wen-saturating, spencer, lugre, dahl, bingham, tanh, or a class as FILE.py:CLASS. The "
                "choice auto selects a model by cross-validation.",
                default_help="auto",
                label="Hysteresis model",
            ),
            Input(
                name="fluid",
                kind="fluid",
                flag="--fluid",
                required=False,
                help="Take the temperature dependence from a fluid: paper, lord-mrf-132dg, or a fluid "
                "file. The card marks it as assumed.",
                default_help="none",
                label="Fluid, if the runs have one temperature",
            ),
            PREPARATION,
            FIT_SETTINGS,
        ),
        options="mrdamper.jobs.options:FitOptions",
        run="mrdamper.jobs.fit:fit",
        report="mrdamper.report.identification.report:REPORT",
        files_help="Write card.json, report.html and errors.csv to this folder.",
        out_required=True,
        progress_word="start",
        ctrl_c="writes the best result so far",
    ),
    Job(
        name="evaluate",
        help="Compute the errors of a model on test data.",
        inputs=(CARD_OF_ANY_LAW, RUNS, PREPARATION),
        options="mrdamper.jobs.options:EvaluateOptions",
        run="mrdamper.jobs.evaluate:evaluate",
        report="mrdamper.report.cards.evaluate:REPORT",
        files_help="Write evaluate.html and errors.csv to this folder.",
        progress_word="",
    ),
    Job(
        name="simulate",
        help="Simulate the damper force for a motion.",
        inputs=(
            CARD_OF_ANY_LAW,
            Input(
                name="motion",
                kind="motion",
                help="Simulate this motion: MOTION:CURRENT:DURATION, such as sine:10mm:1Hz:1A:2s, or the "
                "file of a run.",
            ),
        ),
        options="mrdamper.jobs.options:SimulateOptions",
        run="mrdamper.jobs.simulate:simulate",
        report="mrdamper.report.simulate:REPORT",
        files_help="Write simulate.html, simulate.svg, simulate.json and simulate.csv to this folder.",
        progress_word="",
    ),
    Job(
        name="compare",
        help="""Compare two damper models.

        The command compares forces, energy per cycle, response time and parameters within the range of both
        cards. Differences are the second card minus the first.
        """,
        inputs=(
            Input(
                name="first", kind="card of any law", help="Read this card as the reference.", in_answer=False
            ),
            Input(
                name="second",
                kind="card of any law",
                help="Compare this card with the reference.",
                in_answer=False,
            ),
        ),
        run="mrdamper.models.comparison:compare_cards",
        report="mrdamper.report.cards.compare:REPORT",
        files_help="Write compare.html and compare.json to this folder.",
        progress_word="",
    ),
    Job(
        name="cycles",
        help="""Evaluate all cycles of a long record.

        The command computes energy, peak forces, stiffness and temperature of each cycle.
        """,
        inputs=(Input(name="record", kind="record", help="Read this record."),),
        options="mrdamper.jobs.options:CyclesOptions",
        run="mrdamper.jobs.cycles:cycles",
        report="mrdamper.report.cycles:REPORT",
        files_help="Write cycles.csv, cycles.html and summary.json to this folder.",
        progress_word="",
    ),
    Job(
        name="heat",
        help="""Simulate the heating of a damper in a load cycle.

        The command computes temperatures, the time until a limit is reached, the heat flows and the loss of
        force.
        """,
        inputs=(
            CARD,
            DRAWING,
            DUTY,
            Input(
                name="sink",
                kind="sink",
                flag="--sink",
                required=False,
                help="Use the heat sink of this file (TOML table [sink]).",
                default_help="the heat sink of the geometry file",
                label="Heat sink",
                group="More",
            ),
            Input(
                name="calibrate",
                kind="curve",
                flag="--calibrate",
                required=False,
                help="Calibrate the geometry file with a measured heating curve of the same load cycle. "
                "The CSV file has the columns time_s and fluid_degC, body_degC or coil_degC.",
                label="Measured curve for calibration",
                group="More",
            ),
        ),
        options="mrdamper.jobs.options:HeatOptions",
        run="mrdamper.jobs.thermal.heat:heat",
        report="mrdamper.report.thermal.heat:REPORT",
        files_help="Write heat.html, heat.json and heat.csv to this folder.",
        progress_word="step",
    ),
    Job(
        name="derate",
        help="""Compute the permissible current, stroke or duty cycle.

        The command computes the largest value that keeps all temperature limits, for several ambient
        temperatures, air speeds and durations.
        """,
        inputs=(CARD, DRAWING, DUTY),
        options="mrdamper.jobs.options:DerateOptions",
        run="mrdamper.jobs.thermal.derate:derate",
        report="mrdamper.report.thermal.derate:REPORT",
        files_help="Write derate.html, derate.json, derate.csv and derate.h to this folder.",
        progress_word="step",
    ),
    Job(
        name="fluid",
        help="""Fit fluid properties to rheometer data.

        TABLE.csv has the columns temperature_degC and viscosity_mPas, or field_mT (or field_kA_m),
        temperature_degC and yield_stress_kPa.
        """,
        inputs=(
            Input(
                name="tables",
                kind="rheometer table",
                in_answer=True,
                help="Read these rheometer tables.",
                label="Rheometer tables",
            ),
            Input(
                name="like",
                kind="fluid",
                flag="--like",
                default="paper",
                required=False,
                help="Take properties that the tables do not have from this fluid: paper, "
                "lord-mrf-132dg, or a fluid file (TOML).",
                label="Other properties from",
            ),
        ),
        run="mrdamper.jobs.fluid:fluid",
        report="mrdamper.report.fluid:REPORT",
        progress_word="",
        files_help="Write fluid.html, fluid.toml and fluid.svg to this folder.",
    ),
    Job(
        name="track",
        help="""Simulate force tracking with a controller.

        The controllers are designed from the card and need no force sensor. A virtual damper is controlled.
        """,
        inputs=(
            CARD,
            Input(
                name="plant",
                kind="plant",
                flag="--plant",
                default="nominal",
                required=False,
                help="Control this damper: nominal, hard, stiff, ..., a file of a virtual damper (TOML), "
                "or a card (JSON).",
                label="Controlled damper",
            ),
            Input(
                name="targets",
                kind="scenario",
                flag="--target",
                required=False,
                help="Track this target: sine-900N-1Hz, sine-1100N-2Hz, non-periodic, or a scenario "
                "file. Repeatable.",
                default_help="all",
                label="Targets",
                begins=("sine-900N-1Hz",),
            ),
            Input(
                name="unaware",
                kind="card",
                flag="-",
                required=False,
                help="Add the controllers recommended-unaware and paper-unaware from this card, which "
                "was fitted at one temperature.",
            ),
        ),
        options="mrdamper.jobs.options:TrackOptions",
        run="mrdamper.jobs.track:track",
        report="mrdamper.report.track:REPORT",
        files_help="Write track.html, track.json and track.csv to this folder.",
    ),
    Job(
        name="heatsink",
        help="""Optimise an annular-fin heat sink.

        The command searches the Pareto front of fluid temperature and mass within the given limits.
        """,
        inputs=(CARD, DRAWING, DUTY),
        options="mrdamper.jobs.options:HeatsinkOptions",
        run="mrdamper.jobs.thermal.heatsink:heatsink",
        report="mrdamper.report.thermal.heatsink:REPORT",
        files_help="Write heatsink.html, heatsink.json, front.csv and best.toml to this folder.",
    ),
    Job(
        name="export",
        help="""Generate C code, an FMU, or a force map.

        The code is compiled and compared with the model before it is written.
        """,
        inputs=(
            CARD,
            Input(
                name="damper",
                kind="drawing",
                flag="--damper",
                required=False,
                help="Add the thermal model of this geometry file (TOML), which also detects a frozen "
                "temperature sensor.",
                default_help="no thermal model",
                label="Geometry file for the thermal model",
            ),
        ),
        options="mrdamper.jobs.options:ExportOptions",
        run="mrdamper.jobs.export:export",
        report="mrdamper.report.export:REPORT",
        outputs=(
            Output(name="c", metavar="DIR", help="Write C99 source code and its report to this folder."),
            Output(name="fmu", metavar="FILE", help="Write a co-simulation FMU (FMI 2.0) to this file."),
            Output(name="table", metavar="FILE", help="Write a force map (CSV) for simulators to this file."),
            Output(name="matlab", metavar="DIR", help="Write card and force map for MATLAB to this folder."),
        ),
        progress_word="part",
    ),
    Job(
        name="rig",
        out="runs",
        help="""Simulate a test campaign on a virtual rig.

        The virtual damper has other equations than the hysteresis models. The runs include sensor errors.
        """,
        inputs=(
            Input(
                name="preset",
                kind="virtual damper",
                flag="--preset",
                default="nominal",
                required=False,
                help="Test this virtual damper: a preset, or a TOML file with a preset and changed "
                "parameters.",
                label="Damper",
            ),
            Input(
                name="campaign",
                kind="campaign",
                flag="--campaign",
                required=False,
                help="Run this campaign of motions, currents and temperatures: short, or a TOML file.",
                default_help="the campaign of the damper",
                begins="short",
            ),
        ),
        options="mrdamper.jobs.options:RigOptions",
        run="mrdamper.jobs.rig:rig",
        report="mrdamper.report.rig:REPORT",
        files_help="Write the runs (CSV) to this folder, and the exact values to DIR.truth.",
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
        help="Fetch a public data set and print the paths of its files.",
        inputs=(
            Input(
                name="name",
                kind="name",
                help="Fetch the data set with this name. The command data list prints the names.",
            ),
        ),
        run="mrdamper.jobs.public_data.datasets:fetch_data",
        report="mrdamper.report.datasets:FETCHED",
        files_help="Write the files to this folder, each with its channel map.",
        progress_word="set",
    ),
    Job(
        name="demo",
        help="""Run all steps on simulated test data.

        The command compares the results with the values of the paper. It needs no measured data.
        """,
        inputs=(),
        options="mrdamper.jobs.options:DemoOptions",
        run="mrdamper.paper.demo:demo",
        report="mrdamper.paper.report:REPORT",
        files_help="Write the results to this folder.",
        out_default="build/demo",
        progress_word="step",
    ),
    Job(
        name="sweep",
        help="""Run many fits, simulations or optimisations.

        PATH is a file, a folder or a pattern. A model is fitted to each path. With --samples, controllers
        of a
        card are tested on random dampers. With --damper, the heat sinks of several dampers are optimised.
        """,
        inputs=(
            Input(
                name="campaigns",
                kind="campaigns",
                required=False,
                help="Fit a model to each of these files, folders or patterns.",
                label="Campaigns to fit",
                in_answer=False,
            ),
            replace(CARD, flag="--card", required=False, default_help="none", in_answer=False),
            Input(
                name="dampers",
                kind="drawings",
                flag="--damper",
                required=False,
                help="Optimise the heat sink of this damper: paper, or a geometry file. Repeatable.",
                label="Dampers with a heat sink",
            ),
            DUTY,
            Input(
                name="law",
                kind="law",
                flag="--law",
                required=False,
                help="Fit this hysteresis model.",
                default_help="auto",
                label="Hysteresis model",
            ),
        ),
        run="mrdamper.jobs.sweep.sweep:sweep",
        options="mrdamper.jobs.options:SweepOptions",
        report="mrdamper.report.sweep:REPORT",
        checkpoint="mrdamper.jobs.sweep.store:open_store",
        files_help="Write the results to this folder.",
        out_required=True,
        progress_word="task",
        ctrl_c="keeps the finished results",
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
        "Dataset": "mrdamper.report.figures.runs:plot_runs",
        "RigRun": "mrdamper.report.figures.runs:plot_runs",
        "ModelCard": "mrdamper.report.cards.picture:card_figure",
    }
)
"""Function that draws a value, by the name of its class."""


def public_names() -> dict[str, Job]:
    """Return the jobs by their names in Python."""
    return {job.attribute: job for job in JOBS.values()}
