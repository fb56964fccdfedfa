"""The job of ``mrdamper cite``: what to cite for a card: its law, terms, method, data, and the program.

Only works that the documentation names are given (docs/laws.md, docs/decisions). Their authors, titles and
years agree with the reference lists of other publications; the works themselves were not all at hand.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mrdamper.data.catalog import DataSet, list_sets
from mrdamper.models.card import ModelCard


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A work that can be cited."""

    key: str  # of the BibTeX entry
    authors: tuple[str, ...]  # family names as printed, with initials where known
    year: str  # "" where it has none
    title: str
    where: str = ""  # journal with volume and pages, or an address
    doi: str = ""
    kind: str = "article"  # BibTeX entry type

    def text(self) -> str:
        """Return the citation as a sentence."""
        year = f" ({self.year})" if self.year else ""
        parts = [f"{', '.join(self.authors)}{year}: {self.title}", self.where]
        said = ". ".join(part for part in parts if part) + "."
        return f"{said} doi:{self.doi}." if self.doi else said

    def bibtex(self) -> str:
        """Return the citation as a BibTeX entry."""
        fields = {
            "author": " and ".join(name if "," in name else f"{{{name}}}" for name in self.authors),
            "title": f"{{{self.title}}}",
            "year": self.year,
            "journal" if self.kind == "article" else "howpublished": self.where,
            "doi": self.doi,
        }
        lines = [f"  {name} = {{{value}}}" for name, value in fields.items() if value]
        return f"@{self.kind}{{{self.key},\n" + ",\n".join(lines) + "\n}"


_BOUC = Source(
    key="bouc1967",
    authors=("Bouc, R.",),
    year="1967",
    title="Forced vibration of mechanical systems with hysteresis",
    where="Proc. 4th Conf. on Nonlinear Oscillation, Prague",
    kind="misc",
)
_WEN = Source(
    key="wen1976",
    authors=("Wen, Y.-K.",),
    year="1976",
    title="Method for random vibration of hysteretic systems",
    where="J. Eng. Mech. Div. (ASCE) 102(2), 249-263",
)
_DAHL = Source(
    key="dahl1968",
    authors=("Dahl, P. R.",),
    year="1968",
    title="A solid friction model",
    where="The Aerospace Corporation, TOR-0158(3107-18)-1",
    kind="misc",
)
_STANWAY = Source(
    key="stanway1987",
    authors=("Stanway, R.", "Sproston, J. L.", "Stevens, N. G."),
    year="1987",
    title="Non-linear modelling of an electro-rheological vibration damper",
    where="J. Electrostatics 20(2), 167-184",
)
_KWOK = Source(
    key="kwok2006",
    authors=("Kwok, N. M.", "Ha, Q. P.", "Nguyen, T. H.", "Li, J.", "Samali, B."),
    year="2006",
    title="A novel hysteretic model for magnetorheological fluid dampers and parameter identification using "
    "particle swarm optimization",
    where="Sensors and Actuators A 132(2), 441-451",
)
_LUGRE = Source(
    key="canudas1995",
    authors=("Canudas de Wit, C.", "Olsson, H.", "Åström, K. J.", "Lischinsky, P."),
    year="1995",
    title="A new model for control of systems with friction",
    where="IEEE Trans. Automatic Control 40(3), 419-425",
)
_SPENCER = Source(
    key="spencer1997",
    authors=("Spencer, B. F.", "Dyke, S. J.", "Sain, M. K.", "Carlson, J. D."),
    year="1997",
    title="Phenomenological model for magnetorheological dampers",
    where="J. Eng. Mech. 123(3), 230-238",
)
_GOLUB = Source(
    key="golub1973",
    authors=("Golub, G. H.", "Pereyra, V."),
    year="1973",
    title="The differentiation of pseudo-inverses and nonlinear least squares problems whose "
    "variables separate",
    where="SIAM J. Numerical Analysis 10(2), 413-432",
)
_KAUFMAN = Source(
    key="kaufman1975",
    authors=("Kaufman, L.",),
    year="1975",
    title="A variable projection method for solving separable nonlinear least squares problems",
    where="BIT 15, 49-57",
)

LAW_SOURCES: dict[str, tuple[Source, ...]] = {
    "bouc-wen": (_BOUC, _WEN),
    "bouc-wen-saturating": (_BOUC, _WEN),
    "double-bouc-wen": (_BOUC, _WEN),
    "dahl": (_DAHL,),
    "bingham": (_STANWAY,),
    "tanh": (_KWOK,),
    "lugre": (_LUGRE,),
    "spencer": (_SPENCER, _BOUC, _WEN),
    "series-valve": (),
    "chain": (),
}
"""What a law goes back to; a law that is this project's own cites the program."""

_OURS = {
    "bouc-wen-saturating": "the force that saturates in velocity is mrdamper's own",
    "double-bouc-wen": "two elements on one curve: mrdamper's own",
    "series-valve": "the law as a whole is mrdamper's own",
    "chain": "the law as a whole is mrdamper's own",
}

METHOD_SOURCES: dict[str, tuple[Source, ...]] = {"varpro": (_GOLUB, _KAUFMAN)}
"""What a method goes back to. ``genetic`` is the program of others: see ``_PROGRAMS``."""

_PROGRAMS = {"genetic": "pymoo"}


@dataclass(frozen=True, slots=True)
class Citation:
    """A work, and what it is cited for."""

    reason: str
    source: Source


@dataclass(frozen=True, slots=True)
class CiteResult:
    """What to cite for a card."""

    law: str
    citations: tuple[Citation, ...]
    notes: tuple[str, ...]


def cite(card: ModelCard) -> CiteResult:
    """Return what to cite for a card: the program, and where law, method and data are from."""
    found = tuple(Citation(reason, source) for reason, source in _sources(card))
    return CiteResult(card.damper.law.name, found, tuple(_notes(card)))


def _sources(card: ModelCard) -> Iterator[tuple[str, Source]]:
    """Yield what each work is cited for, and the work."""
    version = card.evidence.versions.get("mrdamper", "")
    yield (
        "program",
        Source(
            key="mrdamper",
            authors=("the mrdamper authors",),
            year="",
            title=f"mrdamper {version}".strip(),
            where="software",
            kind="misc",
        ),
    )
    for source in LAW_SOURCES.get(card.damper.law.name, ()):
        yield f"law {card.damper.law.name}", source
    method = card.evidence.method
    for source in METHOD_SOURCES.get(method, ()):
        yield f"method {method}", source
    if method in _PROGRAMS:
        name = _PROGRAMS[method]
        yield (
            f"method {method}",
            Source(
                key=name,
                authors=(f"the {name} authors",),
                year="",
                title=name,
                where="software",
                kind="misc",
            ),
        )
    for data in _data_sets(card):
        yield (
            "data",
            Source(
                key=data.name,
                authors=(data.repository.partition("/")[0],),
                year="",
                title=data.title,
                where=f"github.com/{data.repository} at commit {data.commit}, licence {data.licence}",
                doi=data.doi,
                kind="misc",
            ),
        )


def _data_sets(card: ModelCard) -> list[DataSet]:
    """Return the public data sets that a card's source files belong to."""
    named = {Path(source).name for source in card.sources}
    return [data for data in list_sets() if named & {file.name for file in data.files}]


def _notes(card: ModelCard) -> list[str]:
    """Say what no list of works can."""
    said = []
    name = card.damper.law.name
    if card.python_law is not None:
        said.append(f"the law is {card.python_law}: cite where you have it from")
    if name in _OURS:
        said.append(f"{name}: {_OURS[name]}: cite the program")
    public = {file.name for data in _data_sets(card) for file in data.files}
    own = [source for source in card.sources if Path(source).name not in public]
    if own:
        files = f"{', '.join(own[:3])}{', ...' if len(own) > 3 else ''}"
        said.append(f"data, as the card names it: {files}")
    if card.damper.assumed:
        laws = ", ".join(card.damper.assumed)
        said.append(
            f"temperature laws of {laws} are assumed from a fluid: its file names the source of each number"
        )
    return said
