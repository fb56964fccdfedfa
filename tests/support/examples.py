"""Number of examples of property tests."""

from __future__ import annotations

from hypothesis import settings

__all__ = ["examples"]

EXAMPLES_REFERENCE = 25


def examples(count: int) -> settings:
    """Return settings with ``count`` examples for each 25 of the profile, at least one.

    These settings are for tests with slow examples. Other tests use the number of the profile.
    """
    return settings(max_examples=max(count * settings().max_examples // EXAMPLES_REFERENCE, 1))
