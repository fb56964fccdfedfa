"""Test tiers (fast, system, nightly, release), and fixtures for programs and real runs.

The marks of a test define its tier: ``release``, ``nightly``, ``system``, or ``fast`` without a mark. A test
that requires a program (fixture ``tool``) is at least in ``system``. A test is skipped if its program or data
are missing. With ``MRDAMPER_REQUIRE_TOOLS=1`` (as in ``.ci/run``), the test then fails.

Property tests generate new examples in every run. A failing example is stored in ``.hypothesis`` and tried
first. ``--hypothesis-profile=nightly`` generates eight times as many examples.
"""

from __future__ import annotations

import gc
import os
import random
import shutil
import signal
from collections.abc import Callable, Generator
from pathlib import Path

import pytest
from hypothesis import is_hypothesis_test, settings
from xdist.scheduler import LoadScopeScheduling  # type: ignore[import-untyped]

from mrdamper.runtime import pool

os.environ["MPLBACKEND"] = "Agg"
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # The tests run in one process per core.

gc.disable()  # Most objects that the collection creates exist until the end of the session.

# nohup disables SIGINT and SIGHUP, and child processes inherit this. The tests need both signals.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

# Examples have no time limit because other programs can slow the machine down.
settings.register_profile("usual", max_examples=12, deadline=None, print_blob=True)
settings.register_profile("nightly", settings.get_profile("usual"), max_examples=100)
settings.load_profile("usual")

_MARK_OF_FIXTURE = {"tool": "tool", "real_data": "data"}
_SHARE_SESSIONS = {
    "campaigns": {f"tests/acceptance/test_{name}.py" for name in ("tempered_rig", "tracking")},
    "plain_site": {f"tests/web/test_{name}.py" for name in ("server", "worker")},
    "site": {f"tests/web/test_{name}.py" for name in ("pages", "view", "workbench")},
}
"""Modules that share the fixtures of a session run on one worker."""
_TIERS = ("release", "nightly", "system")  # A test with several marks is in the first of these tiers.


def _tools_are_required() -> bool:
    return os.environ.get("MRDAMPER_REQUIRE_TOOLS") == "1"


def _do_without(reason: str) -> None:
    if _tools_are_required():
        pytest.fail(f"{reason} (MRDAMPER_REQUIRE_TOOLS=1)", pytrace=False)
    pytest.skip(reason)


@pytest.fixture(autouse=True)
def _signals_stay() -> Generator[None]:
    """Restore the signal handlers after each test because commands in this process replace them."""
    kept = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for each, handler in kept.items():
        if signal.getsignal(each) is not handler:
            signal.signal(each, handler)


@pytest.fixture(scope="session")
def tool() -> Callable[[str], Path]:
    """Return a function that finds a program. A test without its program is skipped or fails."""

    def find(name: str) -> Path:
        found = shutil.which(name)
        if found is None:
            _do_without(f"the program {name!r} is not installed")
        return Path(str(found))

    return find


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Return the folder of real runs (``dev/``, ``raw/``). A test without this folder is skipped or fails."""
    named = os.environ.get("MRDAMPER_DATA", "")
    if not named:
        _do_without("MRDAMPER_DATA does not name the folder of real runs")
    folder = Path(named)
    for part in ("dev", "raw"):
        if not (folder / part).is_dir():
            _do_without(f"MRDAMPER_DATA={named} has no folder {part}/")
    return folder


@pytest.fixture(autouse=True)
def _seeds() -> None:
    """Seed the generator of Python's ``random``, which third-party code uses."""
    random.seed(0)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Add marks to tests according to their fixtures, and a mark with their tier."""
    for item in items:
        for fixture in getattr(item, "fixturenames", ()):
            if fixture in _MARK_OF_FIXTURE:
                item.add_marker(_MARK_OF_FIXTURE[fixture])
        if item.get_closest_marker("tool") and not any(map(item.get_closest_marker, _TIERS)):
            item.add_marker("system")
        if is_hypothesis_test(getattr(item, "obj", None)):
            item.add_marker("property")
        tier = next((each for each in _TIERS if item.get_closest_marker(each)), "fast")
        item.add_marker(f"tier_{tier}")


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """Exclude the collected tests from garbage collection, which then runs rarely."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 50)
    gc.enable()


def _scope(nodeid: str) -> str:
    module = nodeid.partition("::")[0]
    return next((name for name, modules in _SHARE_SESSIONS.items() if module in modules), module)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """Schedule tests of one module, and of modules that share fixtures, on one worker."""
    if config.getvalue("dist") != "loadscope":
        return None
    scheduler = LoadScopeScheduling(config, log)
    scheduler._split_scope = _scope
    return scheduler


@pytest.fixture(autouse=True)
def _one_core_in_fast_tests(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Limit the pools of a fast test to one core, so that no process is started."""
    if request.node.get_closest_marker("tier_fast"):
        monkeypatch.setattr(pool, "usable_cores", lambda: 1)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Report a test that was skipped for a missing program or data as failed if tools are required."""
    report = yield
    needs_something = any(item.get_closest_marker(mark) for mark in _MARK_OF_FIXTURE.values())
    if report.skipped and not hasattr(report, "wasxfail") and needs_something and _tools_are_required():
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        report.outcome = "failed"
        report.longrepr = f"{item.nodeid}: {reason} (MRDAMPER_REQUIRE_TOOLS=1)"
    return report
