"""The HTML page of a result: a first screen that answers, then what the answer rests on.

A report declares one ``Page``. Its first screen is the same in every report: title, verdict, three figures
with their band, the picture, caveats. What follows are its sections, tables and more pictures. A web page
shows the same first screen and tables beside plots of its own.
Pages open offline, print well, and hold names that users chose as text. The same input gives the same bytes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from mrdamper.errors import spelled
from mrdamper.identify.fit import versions
from mrdamper.report.sections import Section, Table
from mrdamper.runtime.outputs import write_text
from mrdamper.schema import Json

if TYPE_CHECKING:
    from jinja2 import Environment
    from matplotlib.figure import Figure

Result = TypeVar("Result")
_LEGIBLE = 0.92  # CSS pixels for a point of a figure: its letters of 7 points have 6.5 pixels


@dataclass(frozen=True, slots=True)
class Tile:
    """One of the three figures of a first screen."""

    value: str  # with its unit
    label: str  # what it is
    band: str = ""  # its interval, spread or worst case, in words


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstScreen:
    """What a reader sees before scrolling.

    Attributes
    ----------
    verdict : one sentence that answers the user's question
    tiles : three figures with their band
    subject : what was computed from what (card, duty, model), one line
    caption : how to read the picture
    flags : what would mislead if it were overlooked, as (lead, text)
    notes : further caveats, one sentence each
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
        """The verdict and the figures as plain text."""
        told = [
            f"{each.value}: {each.label}" + (f" ({each.band})" if each.band else "") for each in self.tiles
        ]
        return [sentence(self.verdict), *told]


@dataclass(frozen=True, slots=True, kw_only=True)
class Page(Generic[Result]):
    """The HTML page of a result.

    Attributes
    ----------
    name : of its file
    first : the first screen
    picture : the picture of the first screen, which ``plot()`` gives in Python; None: nothing to draw
    label : what the picture shows, for readers who hear the page
    sections : what follows, tables and pictures; a web page shows the tables, too
    template : lays them out; one of its own has the result (``it``), the sections and ``values``
    values : further values for that template
    when : whether there is a page
    output : of the job's outputs, where the page has an option of its own; empty: it lies in the named folder
    """

    name: str
    first: Callable[[Result], FirstScreen]
    label: str
    picture: Callable[[Result], Figure | None] = lambda _: None
    sections: Callable[[Result], Sequence[Section]] = lambda _: ()
    template: str = "sections.html.j2"
    values: Callable[[Result], Mapping[str, object]] = lambda _: {}
    when: Callable[[Result], bool] = lambda _: True
    output: str = ""

    def render(self, result: Result) -> str:
        """Return the page's HTML."""
        first, picture = self.first(result), self._svg(result)
        template = environment().get_template(self.template)
        told = {"it": result, "first": first, "picture": picture, "sections": self.sections(result)}
        return template.render(**told, **self.values(result))

    def shown(self, result: Result) -> Json:
        """Return the first screen, but for its picture, and the tables, as a web page lays them out."""
        first = self.first(result)
        return {
            **asdict(first),
            "verdict": sentence(first.verdict),
            "flags": [[sentence(lead), sentence(text)] for lead, text in first.flags],
            "notes": [sentence(note) for note in first.notes],
            "tables": [each.shown() for each in self.sections(result) if isinstance(each, Table)],
        }

    def _svg(self, result: Result) -> str:
        from mrdamper.report.figures.style import drawing_style, svg_of  # loads Matplotlib

        with drawing_style():
            figure = self.picture(result)
            return "" if figure is None else svg_of(figure, self.label)

    def figure(self, result: Result) -> Figure | None:
        """Return the picture; the caller sets the style of drawing."""
        return self.picture(result)

    def write(self, result: Result, path: Path) -> None:
        """Write the page."""
        write_text(path, self.render(result))


def sentence(text: str) -> str:
    """Return a text as a sentence: a word at its beginning capitalised, a full stop at its end.

    A text that is a sentence already is left alone: a user's name may begin it.
    """
    if text.endswith((".", "!", "?")):
        return text
    first = text.partition(" ")[0]
    return f"{text[:1].upper() if first.isalpha() else text[:1]}{text[1:]}."


def _zoomed(svg: str) -> str:
    """Return one of our own figures, whose texts Matplotlib has escaped, to be enlarged by click or key.

    ``--legible`` is the least width at which its letters can be read on a phone.
    """
    width = re.search(r'width="([\d.]+)pt"', svg)
    legible = round(_LEGIBLE * float(width[1])) if width else 0
    box = '<input type="checkbox" aria-label="enlarge">'
    return f'<label class="zoom" style="--legible: {legible}px">{box}{svg}</label>'


def significant(value: float | None, digits: int = 3) -> str:
    """Return a number with so many digits, its zeros among them; "" for what is none."""
    if value is None or not math.isfinite(value):
        return ""
    rounded = float(f"{value:.{digits}g}")
    size = 0 if rounded == 0.0 else math.floor(math.log10(abs(rounded)))
    if not -5 < size < 7:
        return f"{rounded:.{digits}g}"
    return f"{rounded:.{max(digits - 1 - size, 0)}f}"


def environment() -> Environment:
    """Return the templates with the filters they use: a user's names are text, figures are markup."""
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("mrdamper.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        finalize=lambda value: spelled(value) if type(value) is str else value,
    )
    environment.globals["program"] = versions()
    environment.filters["svg"] = lambda svg: Markup(_zoomed(svg))
    environment.filters["number"] = lambda value, digits=4: (
        "" if value is None or math.isnan(value) else f"{value:.{digits}g}"
    )
    environment.filters["digits"] = significant
    environment.filters["sentence"] = sentence
    environment.filters["percent"] = lambda value: "-" if math.isnan(value) else f"{value:.1f} %"
    return environment
