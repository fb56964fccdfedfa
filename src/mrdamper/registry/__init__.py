"""Registry of the jobs: the table ``JOBS`` has one row (``Job``) for each job.

All interfaces are generated from this table and from the inputs and options in ``jobs.options``. To add a
job, write a module in ``jobs``, a module in ``report``, a class in ``jobs.options`` and a row in this table.

A row names the function of a job as text (``"mrdamper.jobs.thermal.heat:heat"``). Therefore this package can
be imported without the modules of the jobs. The module ``job`` runs the job of a row.
"""

from __future__ import annotations

from collections.abc import Mapping

from mrdamper.registry.job import Job

__all__ = ["JOBS", "QUERIES", "Job"]

_ROWS = (
    Job(
        name="check",
        help="""Check test data before a fit.

        PATH is a file, a folder or a pattern. The command finds problems of single runs, such as noise,
        drift, clipping or a wrong unit, and differences between runs. A fault prevents a fit, a warning makes
        a fit worse, and a note is information.
        """,
        run="mrdamper.jobs.check:check",
        report="mrdamper.report.check:REPORT",
        progress_word="run",
        files_help="Write check.html, check.json and findings.csv to this folder.",
    ),
    Job(
        name="fit",
        out="card",
        help="""Fit a hysteresis model to test data.

        One model describes all currents and temperatures of the runs. PATH is a file, a folder or a pattern.
        Each run needs time, displacement, force and current or voltage. Temperature is optional.
        """,
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
        run="mrdamper.jobs.evaluate:evaluate",
        report="mrdamper.report.evaluate:REPORT",
        files_help="Write evaluate.html and errors.csv to this folder.",
    ),
    Job(
        name="simulate",
        help="Simulate the damper force for a motion.",
        run="mrdamper.jobs.simulate:simulate",
        report="mrdamper.report.simulate:REPORT",
        files_help="Write simulate.html, simulate.json and simulate.csv to this folder.",
    ),
    Job(
        name="compare",
        help="""Compare two damper models.

        The command compares forces, energy per cycle, response time and parameters within the range that both
        cards cover. A difference is the value of the second card minus the value of the first card.
        """,
        run="mrdamper.models.comparison:compare_cards",
        report="mrdamper.report.compare:REPORT",
        files_help="Write compare.html and compare.json to this folder.",
    ),
    Job(
        name="cycles",
        help="""Evaluate all cycles of a long record.

        The command computes energy, peak forces, stiffness and temperature of each cycle.
        """,
        run="mrdamper.jobs.cycles:cycles",
        report="mrdamper.report.cycles:REPORT",
        files_help="Write cycles.csv, cycles.html and summary.json to this folder.",
    ),
    Job(
        name="heat",
        help="""Simulate the heating of a damper in a load cycle.

        The command computes temperatures, the time until a temperature limit is reached, heat flows, and the
        loss of damper force.
        """,
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
        run="mrdamper.jobs.fluid:fluid",
        report="mrdamper.report.fluid:REPORT",
        files_help="Write fluid.html and fluid.toml to this folder.",
    ),
    Job(
        name="track",
        help="""Simulate force tracking with a controller.

        The controllers are designed from the card. Most of them need no force sensor. The controlled damper
        is simulated.
        """,
        run="mrdamper.jobs.track:track",
        report="mrdamper.report.track:REPORT",
        progress_word="run",
        files_help="Write track.html, track.json and track.csv to this folder.",
    ),
    Job(
        name="heatsink",
        help="""Optimise an annular-fin heat sink.

        The command searches for the designs with the best compromises between fluid temperature and mass
        (Pareto front). All designs are within the given limits.
        """,
        run="mrdamper.jobs.thermal.heatsink:heatsink",
        report="mrdamper.report.thermal.heatsink:REPORT",
        progress_word="run",
        files_help="Write heatsink.html, heatsink.json, front.csv and best.toml to this folder.",
    ),
    Job(
        name="export",
        help="""Generate C code, an FMU, or a force map.

        The code is compiled and compared with the model before it is written.
        """,
        run="mrdamper.jobs.export:export",
        report="mrdamper.report.export:REPORT",
        progress_word="part",
    ),
    Job(
        name="rig",
        out="runs",
        help="""Simulate a test campaign on a virtual rig.

        The equations of the virtual damper differ from the hysteresis models of fits. The runs include sensor
        errors.
        """,
        run="mrdamper.jobs.rig:rig",
        report="mrdamper.report.rig:REPORT",
        progress_word="run",
        files_help="Write the runs (CSV) to DIR, and the values without sensor errors to DIR.truth.",
        out_required=True,
    ),
    Job(
        name="data list",
        help="List the public data sets.",
        run="mrdamper.jobs.public_data:list_data",
        report="mrdamper.report.datasets:LISTED",
    ),
    Job(
        name="data fetch",
        out="runs",
        help="Fetch a public data set and print the paths of its files.",
        run="mrdamper.jobs.public_data:fetch_data",
        report="mrdamper.report.datasets:FETCHED",
        files_help="Write the files to this folder, each with its channel map.",
        progress_word="set",
    ),
    Job(
        name="demo",
        help="""Run all steps on simulated test data.

        The command compares the results with the values in the reference paper. It needs no measured data.
        """,
        run="mrdamper.paper.demo:demo",
        report="mrdamper.paper.report:REPORT",
        files_help="Write the results to this folder.",
        out_default="build/demo",
        progress_word="step",
    ),
    Job(
        name="sweep",
        help="""Run many fits, simulations or optimisations.

        PATH is a file, a folder or a pattern. A model is fitted to each path. With --samples, controllers of
        a card are tested on random dampers. With --damper, the heat sinks of several dampers are optimised.
        """,
        run="mrdamper.jobs.sweep.sweep:sweep",
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

QUERIES: Mapping[str, str] = {
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
}
"""Functions that answer the queries, by name of the query. Queries are short computations for web pages."""
