"""Fast tests compile exports without optimisation, ``tests/jobs/test_export.py`` with optimisation."""

from __future__ import annotations

import pytest

from mrdamper.codegen import fmu, verify


@pytest.fixture(autouse=True)
def _unoptimised(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if not request.node.get_closest_marker("nightly"):
        for module in (verify, fmu):
            monkeypatch.setattr(module, "FLAGS", ("-std=c99", "-O0", "-ffp-contract=off"))
