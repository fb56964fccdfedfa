"""The page of ``mrdamper cycles``: how energy, force, stiffness and temperature go over the cycles."""

from __future__ import annotations

from matplotlib.figure import Figure

from mrdamper.data.cycle_groups import Groups
from mrdamper.report.figures.style import HELD_OUT, INK, TRAINING, WIDE, drawing_style, svg_of
from mrdamper.report.page import environment
from mrdamper.schema import Json

__all__ = ["TITLES", "render_cycles"]

TITLES = {
    "energy_J": "energy per cycle, J",
    "highest_force_N": "highest force, N",
    "lowest_force_N": "lowest force, N",
    "stiffness_N_per_mm": "secant stiffness, N/mm",
    "temperature_degC": "mean temperature, °C",
    "amplitude_mm": "amplitude, mm",
    "period_s": "period, s",
    "model_energy_J": "the model's energy per cycle, J",
    "model_highest_force_N": "its highest force, N",
    "model_lowest_force_N": "its lowest force, N",
    "error_N": "the model's RMS error, N",
    "error_percent": "its RMS error, % of the cycle's spread of force",
    "mean_error_N": "its mean error, N",
}
_PANELS = (
    ("energy_J",),
    ("highest_force_N", "lowest_force_N"),
    ("error_N", "mean_error_N"),
    ("stiffness_N_per_mm",),
    ("temperature_degC",),
)
_BESIDE = {
    "energy_J": "model_energy_J",
    "highest_force_N": "model_highest_force_N",
    "lowest_force_N": "model_lowest_force_N",
}


def render_cycles(answer: Json, groups: Groups) -> str:
    """Return the page's HTML."""
    template = environment().get_template("cycles.html.j2")
    return template.render(it=answer, titles=TITLES, picture=_over_cycles(answer, groups))


def _over_cycles(answer: Json, groups: Groups) -> str:
    """Return a panel for each figure over the number of the cycle: the groups' means, and their range.

    The model's are dashed.
    """
    figures = answer["figures"]
    known = set(figures) if isinstance(figures, dict) else set()
    panels = [panel for panel in _PANELS if panel[0] in known]
    if not panels:
        return ""
    height = 1.35 * len(panels) + 0.4
    with drawing_style():
        figure = Figure(figsize=(WIDE, height))
        rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axes, panel in zip(rows, panels, strict=True):
            for name, colour in zip(panel, (TRAINING, HELD_OUT), strict=False):
                k = groups.names.index(name)
                least, most = groups.least[:, k], groups.most[:, k]
                if groups.size > 1:
                    axes.fill_between(groups.number, least, most, color=colour, alpha=0.25, linewidth=0)
                mark = "." if len(groups.count) < 2 else ""
                axes.plot(groups.number, groups.mean[:, k], mark or "-", color=colour, linewidth=1.0)
                beside = _BESIDE.get(name, "")
                if beside in known:
                    model = groups.mean[:, groups.names.index(beside)]
                    axes.plot(groups.number, model, mark or "--", color=INK, linewidth=0.9)
            said = "; ".join(TITLES[name] for name in panel)
            if _BESIDE.get(panel[0]) in known:
                said += "; the model's dashed"
            axes.set_title(said[0].upper() + said[1:], loc="left", pad=3)
        rows[-1].set_xlabel("cycle", labelpad=1.5)
        figure.subplots_adjust(
            left=0.075, right=0.99, top=1.0 - 0.22 / height, bottom=0.36 / height, hspace=0.28
        )
        return svg_of(figure, "Figures over the cycles")
