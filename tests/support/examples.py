"""The number of random inputs of slow property tests."""

from __future__ import annotations

from hypothesis import settings

__all__ = ["examples"]

EXAMPLES_REFERENCE = 25


def examples(count: int) -> settings:
    """Return settings for a slow test, with ``count`` random inputs if other tests have 25.

    The Hypothesis profile sets the number for other tests. The number for this test is proportional to it.
    """
    return settings(max_examples=max(count * settings().max_examples // EXAMPLES_REFERENCE, 1))
