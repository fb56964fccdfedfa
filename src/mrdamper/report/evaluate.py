"""Output of the command ``evaluate``: errors of a model card on measured runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from statistics import fmean, median

from matplotlib.figure import Figure
from rich.console import Console

from mrdamper.identify.evaluate import row
from mrdamper.identify.scores import RunError
from mrdamper.jobs.evaluate import EvaluateResult
from mrdamper.models.card_draws import INTERVAL_PROBABILITY
from mrdamper.report.base import Report, csv_file, print_notes
from mrdamper.report.figures.runs import errors_figure, interval_figure
from mrdamper.report.identification.scores import (
    error_table,
    show_errors,
    show_summaries,
    summaries,
)
from mrdamper.report.page import FirstScreen, Page, Tile, count_of
from mrdamper.report.sections import Picture, Section


def _fields(result: EvaluateResult) -> dict[str, object]:
    return {
        "law": result.law,
        "runs": _rows(result),
        "summary": summaries(result.errors),
        "promised": result.promised,
        "force_band": _band(result),
        # Posterior samples of the coefficients yield 90 % intervals of forces and coefficients.
        "posterior": {
            "probability": INTERVAL_PROBABILITY,
            "interval_width_N": median(each.width_N for each in result.forces),
            "coefficients": result.coefficients,
        }
        if result.forces
        else None,
        "notes": result.notes,
    }


def _rows(result: EvaluateResult) -> list[dict[str, object]]:
    rows = [row(error) for error in result.errors]
    for each, interval in zip(rows, result.forces, strict=False):
        each |= {"rmse_interval_N": list(interval.rmse_N), "interval_width_N": interval.width_N}
    return rows


def _interval_sentences(result: EvaluateResult) -> Iterator[str]:
    if result.forces:
        width = median(each.width_N for each in result.forces)
        yield (
            f"90 % interval of the modelled force: mean width {width:.3g} N, median of the runs, from the "
            "uncertainty of the parameters"
        )


def _stated_errors(result: EvaluateResult) -> Iterator[str]:
    """Yield sentences that compare the errors with those stated in the model card."""
    for split, errors in result.promised.items():
        if errors["runs"]:
            yield (
                f"errors stated in the card for {errors['runs']} {split.replace('_', '-')} runs: "
                f"{errors['median_nrmse_percent']:.1f} % median, {errors['worst_nrmse_percent']:.1f} % worst"
            )
    found = _new_runs(result)
    if result.band is not None and found:
        band, sizes = result.band, [each.nrmse_percent for each in found]
        yield (
            f"expected error of new runs: {band.expected_nrmse_percent:.1f} % median, "
            f"{band.worst_nrmse_percent:.1f} % worst; in these runs: {median(sizes):.1f} % and "
            f"{max(sizes):.1f} %"
        )
        inside = [each.in_band_percent for each in found if each.in_band_percent is not None]
        yield (
            f"{100.0 * band.share:.0f} % force band: contains {fmean(inside):.0f} % of the samples, "
            f"{min(inside):.0f} % in the worst run"
        )


def _new_runs(result: EvaluateResult) -> list[RunError]:
    return [each for each in result.errors if each.split == "held_out"]


def _band(result: EvaluateResult) -> dict[str, object] | None:
    """Return the card's force band, and the percentage of samples within this band."""
    if result.band is None:
        return None
    inside = [each.in_band_percent for each in _new_runs(result) if each.in_band_percent is not None]
    return {
        **asdict(result.band),
        "found_in_band_percent": fmean(inside) if inside else None,
        "lowest_in_band_percent": min(inside, default=None),
    }


def _show(result: EvaluateResult, console: Console) -> None:
    show_errors(result.errors, result.law, console)
    show_summaries(result.errors, console)
    for line in (*_stated_errors(result), *_interval_sentences(result)):
        console.print(line)
    print_notes(result.notes, console)


def _first(result: EvaluateResult) -> FirstScreen:
    found, band = _new_runs(result) or list(result.errors), result.band
    sizes, rms = [each.nrmse_percent for each in found], [each.rmse_N for each in found]
    known = "" if band is None else f". The expected error is {band.expected_nrmse_percent:.1f} %"
    inside = [each.in_band_percent for each in found if each.in_band_percent is not None]
    runs = count_of("run", len(found))
    return FirstScreen(
        title="Evaluation of runs",
        subject=f"A card of the model {result.law}, on {runs}.",
        verdict=f"The median error of {runs} is {median(sizes):.1f} % of the standard deviation of the force"
        f"{known}",
        tiles=(
            Tile(f"{median(sizes):.1f} %", "error, median", f"worst {max(sizes):.1f} %"),
            Tile(f"{median(rms):.3g} N", "RMS error, median", f"{min(rms):.3g} to {max(rms):.3g} N"),
            Tile(
                f"{fmean(inside):.0f} %",
                "of the samples are in the force band of the card",
                f"lowest run {min(inside):.0f} %",
            )
            if inside
            else Tile("–", "the card has no force band"),
        ),
        caption="Error of each run, the worst run first",
        notes=[*_stated_errors(result), *_interval_sentences(result), *result.notes],
    )


def _sections(result: EvaluateResult) -> list[Section]:
    """Return the table of runs, and the intervals of forces and coefficients."""
    heading = "90 % intervals of coefficients and of the forces of the worst runs"
    errors = error_table(result.errors, {each.name: each for each in result.forces})
    return [errors, Picture(heading, lambda: _intervals(result))]


def _intervals(result: EvaluateResult) -> Figure | None:
    panel_count_max = 8  # The figure shows force intervals of only the worst runs.
    if not result.forces:
        return None
    error = {each.name: each.nrmse_percent for each in result.errors}
    worst = sorted(result.forces, key=lambda each: -error[each.name])[:panel_count_max]
    return interval_figure(worst, result.coefficients, result.command_unit)


REPORT: Report[EvaluateResult] = Report(
    fields=_fields,
    show=_show,
    page=Page(
        name="evaluate.html",
        first=_first,
        picture=lambda result: errors_figure(result.errors),
        label="Error by run",
        sections=_sections,
    ),
    files=(csv_file("errors.csv", _rows),),
    rows=_rows,
)
