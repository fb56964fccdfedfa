"""HTML page of a result: a first screen with the verdict, followed by sections with the details.

A report declares one ``Page``. All first screens have the same structure: title, verdict, three values with
their uncertainty, a figure, and notes. The sections below are tables and figures. A web page shows the same
first screen and tables together with its own plots.
Pages work offline and can be printed. Names from users are escaped. The same input gives the same bytes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from mrdamper.identify.fit import versions
from mrdamper.report.sections import Picture, Section, Table, draw_all
from mrdamper.runtime.outputs import write_text
from mrdamper.schema import Json

if TYPE_CHECKING:
    from jinja2 import Environment
    from matplotlib.figure import Figure

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Tile:
    """One of the three values of a first screen.

    Attributes
    ----------
    value : number with its unit
    label : name of the value
    band : interval, spread or worst case as text
    """

    value: str
    label: str
    band: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstScreen:
    """The part of a page that is visible without scrolling.

    Attributes
    ----------
    verdict : one sentence with the main result
    tiles : three values with their uncertainty
    subject : one line with the inputs (card, load cycle, model)
    caption : explanation of the figure
    flags : important warnings, each a title and a text
    notes : further notes, one sentence each
    """

    title: str
    verdict: str
    tiles: tuple[Tile, Tile, Tile]
    subject: str = ""
    caption: str = ""
    flags: Sequence[tuple[str, str]] = ()
    notes: Sequence[str] = ()

    @property
    def lines(self) -> list[str]:
        """The verdict and the values as plain text."""
        values = [
            f"{each.value}: {each.label}" + (f" ({each.band})" if each.band else "") for each in self.tiles
        ]
        return [sentence(self.verdict), *values]


@dataclass(frozen=True, slots=True, kw_only=True)
class Page(Generic[Result]):
    """The HTML page of a result.

    Attributes
    ----------
    name : name of the file
    first : the first screen
    picture : returns the figure of the first screen, which is also the result of ``plot()`` in Python
    label : description of the figure for screen readers
    sections : returns the tables and figures below the first screen; a web page also shows the tables
    template : Jinja template of the page; it receives the result (``it``), the sections and ``values``
    values : returns further values for the template
    when : returns False if a result has no page
    """

    name: str
    first: Callable[[Result], FirstScreen]
    label: str
    picture: Callable[[Result], Figure | None] = lambda _: None
    sections: Callable[[Result], Sequence[Section]] = lambda _: ()
    template: str = "sections.html.j2"
    values: Callable[[Result], Mapping[str, object]] = lambda _: {}
    when: Callable[[Result], bool] = lambda _: True

    def render(self, result: Result) -> str:
        """Return the HTML text of the page."""
        picture = Picture(self.label, lambda: self.picture(result))
        values = {"picture": picture, "sections": self.sections(result), **self.values(result)}
        draw_all(list(_pictures_in(values.values())))
        template = environment().get_template(self.template)
        return template.render(it=result, first=self.first(result), **values)

    def web_json(self, result: Result) -> Json:
        """Return the first screen without its figure, and the tables, for a web page."""
        first = self.first(result)
        return {
            **asdict(first),
            "verdict": sentence(first.verdict),
            "flags": [[sentence(lead), sentence(text)] for lead, text in first.flags],
            "notes": [sentence(note) for note in first.notes],
            "tables": [each.web_json() for each in self.sections(result) if isinstance(each, Table)],
        }

    def write(self, result: Result, path: Path) -> None:
        """Write the page."""
        write_text(path, self.render(result))


def _pictures_in(values: Iterable[object]) -> Iterator[Picture]:
    """Generate the pictures among the values of a page, in lists of values, and in values with a picture."""
    for value in values:
        if isinstance(value, list | tuple):
            yield from _pictures_in(value)
        picture = getattr(value, "picture", value)
        if isinstance(picture, Picture):
            yield picture


def sentence(text: str) -> str:
    """Return a text with a capital first letter and a full stop.

    A text that already ends with ".", "!" or "?" is returned unchanged.
    """
    if text.endswith((".", "!", "?")):
        return text
    first = text.partition(" ")[0]
    return f"{text[:1].upper() if first.isalpha() else text[:1]}{text[1:]}."


def count_of(name: str, count: int) -> str:
    """Return a count with the name of the counted things, in singular or plural."""
    return f"{count} {name}{'' if count == 1 else 's'}"


def range_of(values: Sequence[float], unit: str) -> str:
    """Return the range of values as text; a dash without values."""
    if not values:
        return "–"
    low, high = min(values), max(values)
    return f"{high:.4g} {unit}" if low == high else f"{low:.4g} to {high:.4g} {unit}"


def _zoomed(svg: str) -> str:
    """Return the HTML of a figure that is enlarged by a click or a key.

    The CSS variable ``--legible`` is the smallest width of the figure with legible letters on a phone. The
    SVG needs no escaping because Matplotlib has escaped its texts.
    """
    legible_px_per_pt = 0.92  # Letters of 7 points are 6.5 CSS pixels high at this scale.
    width = re.search(r'width="([\d.]+)pt"', svg)
    legible = round(legible_px_per_pt * float(width[1])) if width else 0
    box = '<input type="checkbox" aria-label="enlarge">'
    return f'<label class="zoom" style="--legible: {legible}px">{box}{svg}</label>'


def significant(value: float | None, digits: int = 3) -> str:
    """Format a number with the given number of digits, keeping trailing zeros; "" for NaN."""
    if value is None or not math.isfinite(value):
        return ""
    rounded = float(f"{value:.{digits}g}")
    size = 0 if rounded == 0.0 else math.floor(math.log10(abs(rounded)))
    if not -5 < size < 7:
        return f"{rounded:.{digits}g}"
    return f"{rounded:.{max(digits - 1 - size, 0)}f}"


def environment() -> Environment:
    """Return the template environment. Names from users are escaped, and figures are markup."""
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("mrdamper.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.globals.update(program=versions())
    environment.filters.update(
        svg=lambda svg: Markup(_zoomed(svg)),
        number=lambda value, digits=4: "" if value is None or math.isnan(value) else f"{value:.{digits}g}",
        digits=significant,
        sentence=sentence,
        percent=lambda value: "-" if math.isnan(value) else f"{value:.1f} %",
    )
    return environment
