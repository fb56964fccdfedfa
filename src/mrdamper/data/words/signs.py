"""Statements of the direction in which a force or a displacement is positive.

Examples: ``compression positive``, ``Zug positiv, ausfahren negativ``, ``(+ = tension)``, ``pull = plus``.
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
# "+ = out", "tension (+)", "+ve is pull", "Druck = minus", "Druck +, Zug -", "stroke, + elongation".
_SIGN = (
    r"\({0}(?:ve)?\)|(?<![\w+-])(?:{0}ve\b|(?:{0}|{1}\b)\s*(?=[=:]))|(?:(?<=[=:>])|(?<=\bis))\s*(?:{0}|{1}\b)(?!\s?[\d.]|\w)"
    r"|(?:(?<=[^\W\d])|(?<=[^\W\d] )){0}(?=\s*(?:[,;)|]|/(?!\s*-)|$))"
)
_LEADING_PLUS = r"|(?:^|(?<=[,;:(|\t])|\b(?:polarit\w+|signe?|segno|vorzeichen))\s*\+\s?(?=[^\W\d])"
_SIGNS = {
    "positive": re.compile(_SIGN.format(r"\+", "plus") + _LEADING_PLUS, re.IGNORECASE),
    "negative": re.compile(_SIGN.format(r"[-\u2013\u2212]", "minus"), re.IGNORECASE),
}
# (sign, roles) -> words of a direction. "Retracted" applies to displacement, "tension" to force.
_DIRECTIONS = {
    (1, _MOTION): r"exten[ds]|extensi|estension|[eé]longa|ausfahr|ausgefahr|ausfeder|heraus|roztaž|wysu[wn]"
    r"|sortant|выдви|伸|out(?:wards?)?\b",
    (1, _FORCE): r"tension\b|tensile|tra[çc][cç]?[aãi]|traction|trazion|zug|tah\b|rozciąg|pull|растяг|растяж"
    r"|拉|引張",
    (1, _ROLES): r"rebound",
    (-1, _MOTION): r"retract|einfahr|eingefahr|einfeder|hinein|zasun|wsu[wn]|rentrant|втяг|inwards?\b"
    r"|(?:rod|moves?|goes) in\b(?! (?:ext|com|ten|the))",
    (-1, _FORCE): r"druck|tlak|push|thrust",
    (-1, _ROLES): r"compress|compres|kompres|stlač|ścisk|stauch|jounce|bump|сжат|压|圧縮",
}
_DIRECTION_FORMS = {
    key: re.compile(rf"(?:\b|(?=[^\x00-\u02ff]))(?:{words})\w*", re.IGNORECASE)
    for key, words in _DIRECTIONS.items()
}
_CLAUSES = re.compile(r"[,;.()|，；。]|\s/\s|\b(?:and|und|et|e|y|a|i)\b", re.IGNORECASE)
_EXPLAINED = re.compile(r"([^,;.()]*)(\([^()]*\))")
_NO_SIGN = re.compile(r"peak|max|min\b|offset|spitze|limit|pressure", re.IGNORECASE)


def signs_in(lines: Iterable[str]) -> Mapping[str, int]:
    """Return the signs of force and displacement: 1 if extension is positive, -1 if compression is positive.

    A role without a statement, or with contradictory statements, is missing.
    """
    found = dict.fromkeys(pair for line in lines for pair in _signs_of_line(line))
    return {role: sign for role, sign in found if (role, -sign) not in found}


def _signs_of_line(line: str) -> list[tuple[str, int]]:
    # A single minus may be the mark of an empty cell.
    for word, form in _SIGNS.items() if re.search("[+=]|ve\\b|minus", line) else ():
        line = form.sub(f" {word} ", line)
    # A direction in parentheses can explain the direction before it: "rod out (tension) is positive".
    line = _EXPLAINED.sub(lambda m: m[0] if _polarities_in(m[2]) or not _directions_in(m[1]) else m[1], line)
    polarities = _polarities_in(line)
    if not polarities or _NO_SIGN.search(line):
        return []
    found = []
    clauses = [(clause, directions) for clause in _clauses_of(line) if (directions := _directions_in(clause))]
    for clause, directions in clauses:
        own = _polarities_in(clause) or polarities
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


def _polarities_in(text: str) -> list[int]:
    return [sign for sign, form in _POLARITIES.items() if form.search(text)]


def _directions_in(text: str) -> list[tuple[int, tuple[str, ...]]]:
    return [key for key, form in _DIRECTION_FORMS.items() if form.search(text)]


def _roles_in(text: str) -> tuple[str, ...]:
    """Return the roles that a text names, without the words of directions."""
    for form in _DIRECTION_FORMS.values():
        text = form.sub(" ", text)
    return tuple(role for role in _ROLES if speaks_of(text, role))
