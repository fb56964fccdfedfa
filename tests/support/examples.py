"""Number of examples of property tests."""

from __future__ import annotations

from hypothesis import settings

__all__ = ["examples"]

_USUAL = 25  # Value of the profile "usual" in tests/conftest.py.


def examples(count: int) -> settings:
    """Return settings with ``count`` examples, and twenty times as many in nightly tests.

    These settings are for tests with slow examples. Other tests use the number of the profile.
    """
    return settings(max_examples=count * settings().max_examples // _USUAL)
