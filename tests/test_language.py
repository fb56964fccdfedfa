"""Texts are plain technical English, with limits for rare words, prepositions and long sentences.

``tests/support/language_limits.txt`` lists the packages above the limits, with their measured values.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]


def lines_of(name: str) -> list[str]:
    lines = (ROOT / "tests/support" / name).read_text(encoding="utf-8").splitlines()
    return [line for line in lines if not line.startswith("#")]


UNPLAIN = re.compile(rf"\b(?:{'|'.join(lines_of('unplain_words.txt'))})\b", re.IGNORECASE)
OPENING = re.compile(
    r"\.\.\.|(of|by|in|at|from|for|to|below|above|beyond|between|over|with|without|on|behind|among|until|after|"
    r"before|up|per|against|than|as|but|while|where|when|whose|which|that|so|and|or|not|also|likewise)\b",
    re.IGNORECASE,
)
LIMITS = (6.0, 8.0)  # Unplain words per 1,000 words of a package; comments that open with a preposition [%]
PRESENT = {
    package: (float(words), float(openings))
    for package, words, openings in (line.split() for line in lines_of("language_limits.txt"))
}
PAGES = [*(ROOT / "docs").rglob("*.md"), *(ROOT / f"{n}.md" for n in ("README", "CONTRIBUTING", "SECURITY"))]


def package_of(path: Path) -> str:
    return "/".join(path.relative_to(ROOT).parent.parts[:3])


def comments_of(source: str, tree: Iterable[ast.AST]) -> Iterator[str]:
    """Generate the comments outside of multi-line strings. Two blanks separate code and comment."""
    inside: set[int] = set()
    for node in tree:
        if isinstance(node, ast.Constant | ast.JoinedStr) and node.end_lineno != node.lineno:
            inside.update(range(node.lineno, (node.end_lineno or 0) + 1))
    for number, line in enumerate(source.splitlines(), start=1):
        comment = re.search(r"(?:^ *|  )(#.*)", line) if "#" in line and number not in inside else None
        if comment is not None:
            yield comment[1]


@cache
def texts() -> dict[str, tuple[list[str], list[str]]]:
    """Return the docstrings and comments of each package."""
    found: dict[str, tuple[list[str], list[str]]] = {}
    for path in (*(ROOT / "src").rglob("*.py"), *(ROOT / "tests").rglob("*.py")):
        source, (docstrings, comments) = path.read_text("utf-8"), found.setdefault(package_of(path), ([], []))
        documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
        tree = [*ast.walk(ast.parse(source))]
        nodes = [node for node in tree if isinstance(node, documented)]
        docstrings += filter(None, map(ast.get_docstring, nodes))
        written = [text.lstrip("#").strip() for text in comments_of(source, tree)]
        comments += [text for text in written if re.match(r"(?!noqa|type:|fmt|---|!).", text)]
    return found


def measure(package: str) -> tuple[float, float]:
    docstrings, comments = texts()[package]
    prose = " ".join((*docstrings, *comments))
    openings = sum(OPENING.match(comment) is not None for comment in comments)
    words = max(len(re.findall(r"[A-Za-z']+", prose)), 200)
    return 1000 * len(UNPLAIN.findall(prose)) / words, 100 * openings / max(len(comments), 20)


def prose_of(page: Path) -> str:
    text = re.sub(r"```.*?```", " ", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r"\]\([^)]*\)", "]", re.sub(r"^(\||#|%|    |\s*\$).*$", "\n\n", text, flags=re.MULTILINE))


def test_packages_have_plain_words():
    limits = {package: PRESENT.get(package, LIMITS) for package in texts()}
    measured = {package: measure(package) for package in texts()}
    above = [package for package in texts() if any(np.greater(measured[package], limits[package]))]
    assert {package: measured[package] for package in above} == {}


def test_documentation_has_plain_words_and_short_sentences():
    prose = "\n\n".join(prose_of(page) for page in PAGES)
    paragraphs = re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.)\s)", prose)
    sentences = [s for p in paragraphs for s in re.split(r"(?<=[.!?:])\s+(?=[A-Z`*\[])", " ".join(p.split()))]
    lengths = [len(sentence.split()) for sentence in sentences if len(sentence.split()) >= 4]
    assert 1000 * len(UNPLAIN.findall(prose)) / len(re.findall(r"[A-Za-z']+", prose)) <= 3.0
    assert sum(length > 25 for length in lengths) <= 0.12 * len(lengths)
    assert sum(length > 40 for length in lengths) <= 0.01 * len(lengths)


if __name__ == "__main__":
    for name in sorted(texts()):
        print(f'    "{name}": ({measure(name)[0]:.1f}, {measure(name)[1]:.1f}),')
