"""Statements of the direction in which a force or a displacement is positive.

Examples: ``compression positive``, ``Zug positiv, ausfahren negativ``, ``load cell positive in compression``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from mrdamper.data.words.headers import speaks_of

_MOTION, _FORCE = ("displacement",), ("force",)
_ROLES = (*_MOTION, *_FORCE)
_POLARITIES = {
    1: re.compile(r"\bposit|\bkladn|\bdodat|\bполож|正", re.IGNORECASE),
    -1: re.compile(r"\bnegat|\bz[áa]porn|\bujemn|\bотриц|负|負", re.IGNORECASE),
}
# (sign, roles) -> words of a direction. "Retracted" applies to displacement, "tension" to force.
_DIRECTIONS = {
    (1, _MOTION): r"exten[ds]|extensi|estension|ausfahr|ausfeder|roztaž|wysu[wn]|выдви|伸",
    (1, _FORCE): r"tension\b|tensile|tra[çc][cç]?[aãi]|traction|trazion|zug|tah\b|rozciąg|pull|растяг|растяж"
    r"|拉|引張",
    (1, _ROLES): r"rebound",
    (-1, _MOTION): r"retract|einfahr|einfeder|zasun|wsu[wn]|втяг",
    (-1, _FORCE): r"druck|tlak|push|thrust",
    (-1, _ROLES): r"compress|compres|kompres|stlač|ścisk|stauch|jounce|bump|сжат|压|圧縮",
}
_DIRECTION_FORMS = {
    key: re.compile(rf"(?:\b|(?=[^\x00-\u02ff]))(?:{words})\w*", re.IGNORECASE)
    for key, words in _DIRECTIONS.items()
}
_CLAUSES = re.compile(r"[,;.()|，；。]|\b(?:and|und|et|e|y|a|i)\b", re.IGNORECASE)
_NO_SIGN = re.compile(r"peak|max|min\b|offset|spitze|limit|pressure", re.IGNORECASE)


def signs_in(lines: Iterable[str]) -> Mapping[str, int]:
    """Return the signs of force and displacement: 1 if extension is positive, -1 if compression is positive.

    A role without a statement, or with contradictory statements, is missing.
    """
    found = dict.fromkeys(pair for line in lines for pair in _signs_of_line(line))
    return {role: sign for role, sign in found if (role, -sign) not in found}


def _signs_of_line(line: str) -> list[tuple[str, int]]:
    polarities = [sign for sign, form in _POLARITIES.items() if form.search(line)]
    if not polarities or _NO_SIGN.search(line):
        return []
    found = []
    clauses = [(clause, directions) for clause in _clauses_of(line) if (directions := _directions_in(clause))]
    for clause, directions in clauses:
        own = [sign for sign, form in _POLARITIES.items() if form.search(clause)] or polarities
        if len(own) == 1 and len({sign for sign, _ in directions}) == 1:
            roles = (len(clauses) > 1 and _roles_in(clause)) or directions[0][1]
            roles = roles if len(roles) == 1 else _roles_in(line) or roles
            found += [(role, own[0] * directions[0][0]) for role in roles]
    return found


def _clauses_of(line: str) -> list[str]:
    """Return the clauses of a line. A role after a direction begins a new clause."""
    clauses = []
    for part in _CLAUSES.split(line):
        clauses.append("")
        for word in part.split():
            if _roles_in(word) and _directions_in(clauses[-1]):
                clauses.append("")
            clauses[-1] += f" {word}"
    return clauses


def _directions_in(text: str) -> list[tuple[int, tuple[str, ...]]]:
    return [key for key, form in _DIRECTION_FORMS.items() if form.search(text)]


def _roles_in(text: str) -> tuple[str, ...]:
    """Return the roles that a text names, without the words of directions."""
    for form in _DIRECTION_FORMS.values():
        text = form.sub(" ", text)
    return tuple(role for role in _ROLES if speaks_of(text, role))
