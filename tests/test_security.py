"""The package executes no code from files. The tests analyse the syntax of its source.

SECURITY.md lists the guarantees and names these tests.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "mrdamper"

# Modules and functions that create objects from data or execute text
MODULES = {
    *("pickle", "cPickle", "_pickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "code", "codeop"),
    *("yaml", "ruamel", "jsonpickle", "xmlrpc", "numexpr", "sympy", "pandas", "torch"),
}
BUILTINS = {"eval", "exec", "compile", "__import__", "execfile"}
ATTRIBUTES = {
    *("extractall", "unpack_archive", "mktemp", "read_pickle", "to_pickle", "fromregex", "import_module"),
    *("exec_module", "load_module", "run_path", "run_module", "create_subprocess_shell", "getoutput"),
}
OF_MODULES = {"os": {"system", "popen"}, "np": {"load"}, "numpy": {"load"}}
NETWORK = {
    *("socket", "ssl", "urllib.request", "urllib3", "http.client", "http.server", "requests", "httpx"),
    *("aiohttp", "pooch", "distributed", "dask", "uvicorn", "ftplib", "smtplib", "socketserver"),
    "webbrowser",
}
KEYWORDS = {"allow_pickle", "shell"}

# Only these modules import a module by a computed name or execute a file. The value is the reason.
ALLOWED = {
    "data/formats/objects.py: allow_pickle=": "with allow_pickle=False",
    "data/formats/objects.py: load": "arrays of numbers alone: numpy refuses objects",
    "data/formats/table.py: import_module": "an optional library, by a name in the source",
    "models/card_draws.py: allow_pickle=": "with allow_pickle=False",
    "models/card_draws.py: load": "arrays of numbers alone: numpy refuses objects",
    "results.py: import_module": "modules of the package, by names in its own tables",
    "web/queries.py: import_module": "queries of pages, by the names in the registry's table",
    "models/python_law.py: exec_module": "--law FILE.py:CLASS, which a person gives on the command line",
}


@cache
def sources() -> dict[str, list[ast.AST]]:
    """Return the syntax nodes of each module by the path of the module in the package."""
    return {
        path.relative_to(PACKAGE).as_posix(): [*ast.walk(ast.parse(path.read_bytes()))]
        for path in PACKAGE.rglob("*.py")
    }


def module_of(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    if isinstance(node, ast.ImportFrom) and node.module:
        yield node.module


def findings(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """Generate the forbidden calls in the syntax nodes of a module."""
    for node in nodes:
        yield from (f"import {name}" for name in module_of(node) if name.split(".")[0] in MODULES)
        if isinstance(node, ast.ImportFrom):
            refused = ATTRIBUTES | OF_MODULES.get(node.module or "", set())
            yield from (alias.name for alias in node.names if alias.name in refused)
        if isinstance(node, ast.Name) and node.id in BUILTINS:
            yield node.id
        if isinstance(node, ast.Attribute):
            of = OF_MODULES.get(node.value.id, set()) if isinstance(node.value, ast.Name) else set()
            if node.attr in ATTRIBUTES | of:
                yield node.attr
        if isinstance(node, ast.keyword) and node.arg in KEYWORDS:
            yield f"{node.arg}="


def test_source_executes_no_code_from_files():
    assert len(sources()) > 100
    found = {f"{name}: {what}" for name, nodes in sources().items() for what in findings(nodes)}
    assert found == set(ALLOWED)


def test_only_listed_modules_open_connections():
    found = {
        name
        for name, nodes in sources().items()
        for node in nodes
        for module in module_of(node)
        if any(module == each or module.startswith(f"{each}.") for each in NETWORK)
    }
    assert found == {
        "jobs/public_data/__init__.py",  # The command ``data fetch`` uses HTTPS with a fixed commit.
        "jobs/sweep/tasks.py",  # The command ``sweep --scheduler`` connects to a Dask cluster.
        "web/server.py",  # The command ``serve`` needs connections.
        "web/security.py",  # This module looks up the name of this computer.
    }


def test_tests_named_in_security_page_exist():
    """The page names a test for each guarantee, as a path and a name."""
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", text)
    assert len(named) > 20
    missing = [
        f"{file}::{name}"
        for file, name in named
        if not (ROOT / file).is_file() or f"def {name}(" not in (ROOT / file).read_text(encoding="utf-8")
    ]
    assert missing == []
