"""Mutation testing: the share of small faults in a room that its fast tests see.

``python -m tests.mutation`` draws 200 mutants by a fixed seed from identify, models, thermal, control, data.
Each is one change of one operator, comparison or constant. It is given to the fast tests of its room, in a
process of its own that ends at the first failure. Nothing in the tree is touched: the process imports the
changed source in place of one module (this file is its pytest plugin, by ``-p tests.mutation``).

A mutant is killed when a test fails or the limit of processor time is passed. One that changes nothing that
can be seen is listed by hand in ``tests/mutation_equivalent.txt`` and not counted. What survives is printed.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib.abc
import importlib.machinery
import importlib.util
import os
import random
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType

__all__ = ["main", "mutants_of"]

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "mrdamper"
EQUIVALENT = Path(__file__).with_name("mutation_equivalent.txt")
ROOMS = ("identify", "models", "thermal", "control", "data")
SAMPLE, SEED, LIMIT_S = 200, 18, 300  # of CPU: a busy machine kills no mutant
_VARIABLE = "MRDAMPER_MUTANT"  # module=file

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
    return Mutant(path, node.lineno, name, source)


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


# ------------------------------------------------------------------------------------ the plugin


class _InPlace(importlib.abc.MetaPathFinder):
    """Finds one module in another file than its own."""

    def __init__(self, module: str, file: str) -> None:
        self.module, self.file = module, file

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        del path, target
        return (
            importlib.util.spec_from_file_location(fullname, self.file) if fullname == self.module else None
        )


if _VARIABLE in os.environ:
    sys.meta_path.insert(0, _InPlace(*os.environ[_VARIABLE].split("=", 1)))


# ------------------------------------------------------------------------------------ the sample


def drawn(rooms: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """Return a sample of the rooms' mutants, as many of each room; packages' faces have none."""
    rng, found = random.Random(seed), list[Mutant]()
    for room in rooms:
        every = [
            make
            for path in sorted((SOURCE / room).rglob("*.py"))
            if path.name != "__init__.py"
            for make in mutants_of(path)
        ]
        found += [make() for make in rng.sample(every, min(len(every), count // len(rooms)))]
    return found


def is_killed(mutant: Mutant, limit_s: int) -> bool:
    """Tell whether the fast tests of its room see the mutant."""
    with tempfile.TemporaryDirectory(prefix="mrdamper-mutant-") as name:
        file = Path(name) / mutant.path.name
        file.write_text(mutant.source, encoding="utf-8")
        module = ".".join(mutant.path.relative_to(SOURCE.parent).with_suffix("").parts)
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-p",
            "tests.mutation",
            "-p",
            "no:cacheprovider",
            "-p",
            "no:xdist",
        ]
        command += ["-q", "-x", "--no-header", "-m", "tier_fast", str(ROOT / "tests" / mutant.room)]
        environment = {**os.environ, _VARIABLE: f"{module}={file}", "PYTHONDONTWRITEBYTECODE": "1"}
        try:
            done = subprocess.run(
                command, cwd=ROOT, env=environment, capture_output=True, timeout=20 * limit_s, check=False,
                preexec_fn=partial(resource.setrlimit, resource.RLIMIT_CPU, (limit_s, limit_s)),
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return True
    return done.returncode != 0


def main() -> None:
    """Draw, run and print: what survived, then killed of counted by room."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.mutation", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument(
        "rooms", nargs="*", metavar="ROOM", help=f"of {', '.join(ROOMS)}; all of them when none is named"
    )
    parser.add_argument("--sample", type=int, default=SAMPLE, help="mutants in all")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--limit", type=int, default=LIMIT_S, help="seconds of CPU for one mutant")
    given = parser.parse_args()
    equivalent = {
        line for line in EQUIVALENT.read_text(encoding="utf-8").splitlines() if not line.startswith("#")
    }
    counted: dict[str, list[bool]] = {}
    for mutant in drawn(given.rooms or ROOMS, given.sample, given.seed):
        if mutant.name in equivalent:
            continue
        killed = is_killed(mutant, given.limit)
        counted.setdefault(mutant.room, []).append(killed)
        if not killed:
            print(f"survived, line {mutant.line}: {mutant.name}", flush=True)
    counted["all"] = [killed for kills in counted.values() for killed in kills]
    for room, kills in counted.items():
        share = 100.0 * sum(kills) / max(1, len(kills))
        print(f"{room}: {sum(kills)} of {len(kills)} killed, {share:.0f} %")


if __name__ == "__main__":
    main()
