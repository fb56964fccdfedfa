"""How many examples a property test draws."""

from __future__ import annotations

from hypothesis import settings

__all__ = ["examples"]

_USUAL = 25  # of the profile "usual", tests/conftest.py


def examples(count: int) -> settings:
    """Return settings that draw ``count`` examples in ``make test``, and twenty times as many at night.

    For a test whose one example costs much; the others draw as many as the profile says.
    """
    return settings(max_examples=count * settings().max_examples // _USUAL)
