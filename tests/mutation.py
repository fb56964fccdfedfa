"""Mutation testing: the share of small faults in a room that the tests see.

``python -m tests.mutation`` draws 200 mutants by a fixed seed from identify, models, thermal, control, data.
Each is one change of one operator, comparison or constant. It is given, in a fork of this process that ends
at the first failure, to the tests that execute the changed line, the quickest first, until these take
``--tests-s`` seconds of processor time without a change: the score is a lower bound. Which those are, and
what they take, a run of the tests under ``--record`` has kept. Nothing in the tree is touched: the fork and
all that it starts import the changed source in place of one module.

A mutant is *killed* when a test fails, when a file of tests that builds what it tests cannot be collected, or
when it interrupts the tests (``KeyboardInterrupt`` where none was asked for), and by nothing else: one that
cannot be imported by itself (``not imported``) and one that takes several times the processor time of its
tests (``limit``) are counted by themselves. The score is killed of all. One that changes nothing that can be
seen is listed by hand in ``tests/mutation_equivalent.txt`` and not counted. What is not killed is printed.
"""

from __future__ import annotations

import argparse
import ast
import base64
import copy
import json
import os
import random
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from itertools import accumulate
from math import ceil
from pathlib import Path
from typing import NoReturn

import coverage
import pytest

__all__ = ["main", "mutants_of"]

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "mrdamper"
EQUIVALENT = Path(__file__).with_name("mutation_equivalent.txt")
ROOMS = ("identify", "models", "thermal", "control", "data")
SEE_THEM = ("jobs", "core", "rig", "cli", "oracles")
RECORDED = ROOT / "build" / "mutation" / "contexts"
TAKEN = RECORDED.with_name("seconds.json")  # by test
SAMPLE, SEED, TESTS_S = 200, 18, 20.0
STARTING_S, SLOWER = 30, 5  # a mutant's limit of CPU, beside what its tests take (a busy machine kills none)
_LIBRARIES = (  # that most tests import
    "numpy", "scipy.integrate", "scipy.interpolate", "scipy.optimize", "scipy.signal", "scipy.sparse.linalg",
    "scipy.stats", "pydantic", "ht",
)  # fmt: skip
_TAKEN: dict[str, float] = {}
_CHILDREN = "COVERAGE_PROCESS_CONFIG"  # by which coverage tells processes how they are measured

_SWAPPED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult, ast.Pow: ast.Mult, ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn,
    ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And, ast.USub: ast.UAdd, ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change of one source file."""

    path: Path
    line: int
    name: str  # the file, the line's text, the change
    source: str
    inside: tuple[int, ...] | None  # the lines of the statement, when a test that executes them is told by it

    @property
    def room(self) -> str:
        return self.path.relative_to(SOURCE).parts[0]


# ------------------------------------------------------------------------------------ what can be changed


def mutants_of(path: Path) -> list[Callable[[], Mutant]]:
    """Return what makes each mutant of a file; annotations, docstrings and messages are left alone."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    return [
        partial(_mutant, path, text, tree, node, changed, parent)
        for node, parent in _code(tree)
        for changed in _changes(node)
    ]


def _mutant(
    path: Path, text: str, tree: ast.Module, node: ast.expr, changed: ast.expr, parent: ast.AST
) -> Mutant:
    shown = parent if isinstance(parent, ast.expr) else node
    before, kept = ast.unparse(shown), dict(vars(node))
    vars(node).update(vars(changed))
    after, source = ast.unparse(shown), ast.unparse(tree)
    vars(node).update(kept)
    line = text.splitlines()[node.lineno - 1].strip()
    name = f"{path.relative_to(SOURCE).as_posix()}: {line}: {before} -> {after}"
    return Mutant(path, node.lineno, name, source, _inside(tree, node.lineno))


def _inside(tree: ast.Module, line: int) -> tuple[int, ...] | None:
    """Return the lines of the innermost statement at a line of a function's body, or None outside of such."""
    around = [
        each
        for each in ast.walk(tree)
        if isinstance(each, ast.FunctionDef) and each.body[0].lineno <= line <= (each.end_lineno or 0)
    ]
    if not around or any("cache" in ast.unparse(each) for found in around for each in found.decorator_list):
        return None
    statements = [
        each
        for each in ast.walk(around[-1])
        if isinstance(each, ast.stmt) and each.lineno <= line <= (each.end_lineno or 0)
    ]
    least = min(statements, key=lambda each: (each.end_lineno or 0) - each.lineno)
    if hasattr(least, "body"):  # the head of a block, not what is in it
        return (line, least.lineno)
    return tuple(range(least.lineno, (least.end_lineno or 0) + 1))


def _code(node: ast.AST) -> Iterator[tuple[ast.expr, ast.AST]]:
    """Yield each expression of code, and what it is part of."""
    for field, value in ast.iter_fields(node):
        if field in {"annotation", "returns", "decorator_list", "bases", "type_params"}:
            continue
        if isinstance(node, ast.Assign) and any(
            getattr(each, "id", "") == "__all__" for each in node.targets
        ):
            continue
        if isinstance(node, (ast.Raise, ast.JoinedStr)):  # the words of a message
            continue
        if isinstance(node, ast.keyword) and node.arg == "strict":  # of a zip whose lengths are equal
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.expr):
                yield child, node
            if isinstance(child, ast.AST):
                yield from _code(child)


def _changes(node: ast.expr) -> Iterator[ast.expr]:
    """Yield changed copies of one expression."""
    match node:
        case ast.BinOp() | ast.BoolOp() | ast.UnaryOp() if type(node.op) in _SWAPPED:
            if not _is_text(node) and not _is_union(node):
                yield _with(node, op=_SWAPPED[type(node.op)]())
        case ast.Compare(ops=[op]) if type(op) in _SWAPPED:
            yield _with(node, ops=[_SWAPPED[type(op)]()])
        case ast.Constant(value=bool() as value):
            yield _with(node, value=not value)
        case ast.Constant(value=int() | float() as value):
            yield _with(node, value=value + 1)


def _with(node: ast.expr, **changes: object) -> ast.expr:
    changed = copy.copy(node)
    vars(changed).update(changes)
    return changed


def _is_text(node: ast.expr) -> bool:
    return any(
        isinstance(each, ast.JoinedStr) or (isinstance(each, ast.Constant) and isinstance(each.value, str))
        for each in ast.walk(node)
    )


def _is_union(node: ast.expr) -> bool:
    """Tell whether this is a union of types such as ``int | float``."""
    names = (ast.Name, ast.BinOp, ast.BitOr, ast.Load, ast.Constant)
    return (
        isinstance(node, ast.BinOp)
        and isinstance(node.op, ast.BitOr)
        and all(isinstance(each, names) for each in ast.walk(node))
    )


# ------------------------------------------------------------------------------------ which tests see a line


def _switch(name: str) -> None:
    """Credit what runs from here on, in this process and in those that it starts, to a test or a file."""
    running = coverage.Coverage.current()
    if running is None:
        return
    running.switch_context(name)
    kept = json.loads(base64.b64decode(os.environ[_CHILDREN]))
    os.environ[_CHILDREN] = base64.b64encode(json.dumps({**kept, "context": name}).encode()).decode()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, bool | None, bool | None]:
    """Credit what a test runs to it, and keep the processor time that it takes (``--record``)."""
    _switch(item.nodeid)
    begun = time.process_time()
    try:
        return (yield)
    finally:
        _TAKEN[item.nodeid] = time.process_time() - begun


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(
    fixturedef: pytest.FixtureDef[object], request: pytest.FixtureRequest
) -> Generator[None, object, object]:
    """Credit what several tests share to all tests of the file."""
    test = request._pyfuncitem.nodeid
    if fixturedef.scope != "function":
        _switch(test.partition("::")[0])
    try:
        return (yield)
    finally:
        _switch(test)


@pytest.hookimpl
def pytest_sessionfinish() -> None:
    """Keep what each test takes (``--record``)."""
    TAKEN.write_text(json.dumps({**_taken(), **_TAKEN}), encoding="utf-8")


def _taken() -> dict[str, float]:
    """Return the seconds of processor time that each test has taken when it was recorded."""
    return dict(json.loads(TAKEN.read_text(encoding="utf-8"))) if TAKEN.is_file() else {}


def record(tests: Sequence[str]) -> int:
    """Run tests (by default those by day that see the rooms) and add what they execute to what is kept."""
    tests = tests or [*(f"tests/{room}" for room in (*ROOMS, *SEE_THEM)), "-m", "tier_fast or tier_system"]
    RECORDED.parent.mkdir(parents=True, exist_ok=True)
    run = [sys.executable, "-m", "coverage", "run", f"--data-file={RECORDED}", "-m", "pytest", "-q"]
    done = subprocess.run([*run, "-p", "tests.mutation", *tests], cwd=ROOT, check=False)
    join = [sys.executable, "-m", "coverage", "combine", "--append", "--quiet", f"--data-file={RECORDED}"]
    subprocess.run(join, cwd=ROOT, check=True)
    return done.returncode


def seen_by(mutant: Mutant, recorded: coverage.CoverageData) -> set[str]:
    """Return the tests, and the files whose tests all, execute the mutant's line.

    A line outside of functions, or in one that keeps what it has returned, is seen by all of its module's.
    """
    lines = recorded.contexts_by_lineno(str(mutant.path))
    if mutant.inside is None:
        return {test for tests in lines.values() for test in tests} - {""}
    return {test for line in mutant.inside for test in lines.get(line, ())} - {""}


# ------------------------------------------------------------------------------------ the sample

_FINDER = """
import importlib.util, sys
class InPlace:
    def find_spec(self, name, path=None, target=None):
        return importlib.util.spec_from_file_location(name, {file!r}) if name == {module!r} else None
sys.meta_path.insert(0, InPlace())
"""


def drawn(rooms: Sequence[str], count: int, seed: int) -> list[tuple[str, Mutant]]:
    """Return a sample of the mutants of rooms, as many of each; a package's face has none.

    A room is the beginning of paths in the package: ``data``, ``data/diagnosis``, ``models/card``.
    """
    rng, found = random.Random(seed), list[tuple[str, Mutant]]()
    for room in rooms:
        every = [
            make
            for path in sorted(SOURCE.rglob("*.py"))
            if path.relative_to(SOURCE).as_posix().startswith(room) and path.name != "__init__.py"
            for make in mutants_of(path)
        ]
        found += [(room, make()) for make in rng.sample(every, min(len(every), count // len(rooms)))]
    return found


def _quickest(seen: set[str], room: str, tests_s: float) -> dict[str, float]:
    """Return the tests that fill so many seconds with what each has taken, the quickest of the room first."""
    taken = {test: s for test, s in _taken().items() if seen & {test, test.partition("::")[0]}}
    order = sorted(taken, key=lambda test: (not test.startswith(f"tests/{room}/"), taken[test]))
    begun = accumulate((taken[test] for test in order), initial=0.0)
    return {test: taken[test] for test, since in zip(order, begun, strict=False) if since < tests_s}


def outcome(mutant: Mutant, tests: Mapping[str, float]) -> str:
    """Return what becomes of a mutant: killed, survived, not imported, limit (of CPU), or no test."""
    if not tests:
        return "no test"
    with tempfile.TemporaryDirectory(prefix="mrdamper-mutant-") as name:
        place, module = Path(name), ".".join(mutant.path.relative_to(SOURCE.parent).with_suffix("").parts)
        file = place / "mutant" / mutant.path.name  # hides no module of Python
        file.parent.mkdir()
        file.write_text(mutant.source, encoding="utf-8")
        finder = _FINDER.format(file=str(file), module=module)
        (place / "sitecustomize.py").write_text(finder, encoding="utf-8")  # every process here begins with it
        limit_s = STARTING_S + SLOWER * ceil(sum(tests.values()))
        child = os.fork()
        if not child:
            _run_tests(place, finder, module, list(tests), limit_s)
        status = _waited(child, time.monotonic() + 20 * limit_s)
        said = (place / "said").read_text(encoding="utf-8")
    if os.WIFSIGNALED(status):
        return "limit"
    found = re.search(r"^(?:FAILED|ERROR) (tests/\S+)|^!+ (KeyboardInterrupt) !+$", said, re.MULTILINE)
    if found and os.WEXITSTATUS(status) in {1, 2, 4}:  # 2, 4: not collected, or interrupted
        return f"killed by {found[1] or found[2]}"
    return {0: "survived", 5: "no test"}.get(os.WEXITSTATUS(status), "not imported")


def _run_tests(place: Path, finder: str, module: str, tests: Sequence[str], limit_s: int) -> NoReturn:
    """Give a mutant to its tests, in a child of this process, which has imported nothing of the package."""
    plain = ["-p", "no:cacheprovider", "-p", "no:xdist", "-q", "-x", "--tb=no", "--no-header"]
    done = 3
    try:
        os.setpgid(0, 0)
        resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))
        into = os.open(place / "said", os.O_WRONLY | os.O_CREAT)
        os.dup2(into, 1)
        os.dup2(into, 2)
        os.environ |= {"PYTHONPATH": str(place), "PYTHONDONTWRITEBYTECODE": "1"}
        exec(finder, {})  # as every process that this one starts does
        import_module(module)
        done = pytest.main([*plain, *tests])
    finally:
        sys.stdout.flush()
        os._exit(done)


def _waited(child: int, until: float) -> int:
    """Return how a child has ended; what it has left running ends, and so does one that is late."""
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        late = time.monotonic() > until
        if ended or late:
            with suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)
        if ended:
            return status
        time.sleep(0.01 if not late else 0.1)


def _unchanged(mutant: Mutant) -> Mutant:
    return replace(mutant, source=mutant.path.read_text(encoding="utf-8"))


def main() -> int:
    """Draw, run and print: what was not killed, then what became of all, by room."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.mutation", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument(
        "rooms", nargs="*", metavar="ROOM", help=f"of {', '.join(ROOMS)}, or a part such as data/diagnosis"
    )
    parser.add_argument("--sample", type=int, default=SAMPLE, help="mutants in all")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument(
        "--tests-s", type=float, default=TESTS_S, help="of a mutant's tests, so many seconds of the quickest"
    )
    parser.add_argument("--part", default="1/1", help="the K-th of N parts of the sample, as K/N")
    parser.add_argument("--verbose", action="store_true", help="print the test that kills, too")
    parser.add_argument(
        "--record", nargs=argparse.REMAINDER, metavar="TESTS", help="keep which tests execute which line"
    )
    given = parser.parse_args()
    if given.record is not None:
        return record(given.record)
    recorded = coverage.CoverageData(str(RECORDED))
    recorded.read()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for library in _LIBRARIES:
        import_module(library)
    equivalent = EQUIVALENT.read_text(encoding="utf-8").splitlines()
    part, parts = map(int, given.part.split("/"))
    counted: dict[str, Counter[str]] = {}
    for room, mutant in drawn(given.rooms or ROOMS, given.sample, given.seed)[part - 1 :: parts]:
        if mutant.name in equivalent:
            continue
        tests = _quickest(seen_by(mutant, recorded), mutant.room, given.tests_s)
        if room not in counted:
            found = outcome(_unchanged(mutant), tests)
            if found not in {"survived", "no test"}:
                parser.exit(2, f"without a change: {found}; the tests must pass first\n")
        found = outcome(mutant, tests)
        kind = found.partition(" by ")[0]
        counted.setdefault(room, Counter())[kind] += 1
        if kind != "killed" or given.verbose:
            print(f"{found}, line {mutant.line}: {mutant.name}", flush=True)
    counted["all"] = sum(counted.values(), Counter[str]())
    for room, kinds in counted.items():
        rest = "".join(f", {kinds[each]} {each}" for each in kinds if each != "killed")
        share = 100.0 * kinds["killed"] / max(1, kinds.total())
        print(f"{room}: {kinds['killed']} of {kinds.total()} killed{rest}: {share:.0f} %")
    return 0


if __name__ == "__main__":
    sys.exit(main())
