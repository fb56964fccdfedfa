"""Selection of cases for fast and for nightly tests."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def one_by_day(cases: Iterable[Any], day: int = 1) -> list[Any]:
    """Return cases for ``parametrize``: the first ``day`` cases are fast, all others are nightly tests."""
    given = list(cases)
    return [*given[:day], *(pytest.param(case, marks=pytest.mark.nightly) for case in given[day:])]
