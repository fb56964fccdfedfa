"""Number of random examples of property tests."""

from __future__ import annotations

from hypothesis import settings

__all__ = ["examples"]

EXAMPLES_REFERENCE = 25


def examples(count: int) -> settings:
    """Return settings for a test with slow examples: ``count`` for each 25 of the profile, at least one.

    Other property tests use the number of the profile.
    """
    return settings(max_examples=max(count * settings().max_examples // EXAMPLES_REFERENCE, 1))
