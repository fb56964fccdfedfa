"""Base classes of the results of jobs: summary, picture, table and output files.

The modules that create reports are imported when a result is displayed, because jobs do not need them.
"""

from __future__ import annotations

from importlib import import_module
from operator import attrgetter
from typing import TYPE_CHECKING, Any, ClassVar

from mrdamper.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from pathlib import Path

    import polars
    from matplotlib.figure import Figure

_REPR_LINES_MAX = 8


def load(name: str) -> Any:  # noqa: ANN401 - any object
    """Import a module and return its attribute, for a name ``module:attribute``."""
    module, _, attribute = name.partition(":")
    return attrgetter(attribute)(import_module(module))


class Picture:
    """Base class of values with a picture, which notebooks display."""

    __slots__ = ()
    _picture: ClassVar[str]  # function that draws the value, as ``module:function``

    def plot(self) -> Figure:
        """Return the picture as a Matplotlib figure.

        Raises
        ------
        InputError
            The value has no picture.
        """
        figure = self._figure()
        if figure is None:
            remedy = "Use summary(), save() or to_frame()"
            raise InputError("there is no picture", place=type(self).__name__, remedy=remedy)
        return figure

    def _figure(self) -> Figure | None:
        label = type(self).__name__
        figure: Figure | None = load("mrdamper.report.figures.style:displayable")(self._draw, label)
        return figure

    def _draw(self) -> Figure | None:
        """Return the picture, or None if there is no picture."""
        figure: Figure = load(self._picture)(self)
        return figure

    def _repr_html_(self) -> str:
        figure = self._figure()
        svg = "" if figure is None else vars(figure)["_repr_svg_"]()
        from html import escape  # Only notebooks need this slow import.

        svg = svg.replace("<svg", '<svg style="max-width: 100%; height: auto"', 1)
        return f"<pre>{escape(repr(self))}</pre>{svg}"


class JobResult(Picture):
    """Base class of the results of all jobs."""

    __slots__ = ()
    _job: ClassVar[str]  # Name of the job.

    def summary(self) -> str:
        """Return the main values of the result in a few lines of text."""
        return "\n".join(self._row().reported.lines(self))

    def save(self, folder: str | Path) -> dict[str, Any]:
        """Write all files of the report into a folder; return the JSON answer with the file paths."""
        answer: dict[str, Any] = self._row().save(self, folder)
        return answer

    def to_frame(self) -> polars.DataFrame:
        """Return the result as a table.

        Raises
        ------
        MissingExtraError
            Polars is not installed.
        InputError
            The result has no table.
        """
        try:
            import polars
        except ImportError as error:
            raise MissingExtraError.for_package("Results as tables", "polars", "rig-files") from error
        rows = self._row().reported.rows
        if rows is None:
            raise InputError("there is no table", place=type(self).__name__, remedy="Use its fields")
        return polars.DataFrame(list(rows(self)))

    def __repr__(self) -> str:
        return "\n".join([f"<{type(self).__name__}>", *self.summary().splitlines()[:_REPR_LINES_MAX]])

    def _draw(self) -> Figure | None:
        draw = self._row().reported.figure
        figure: Figure | None = None if draw is None else draw(self)
        return figure

    def _row(self) -> Any:  # noqa: ANN401 - a registry row
        return load("mrdamper.registry:JOBS")[self._job]
