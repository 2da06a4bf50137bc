"""How many examples a dear property is tried with."""

from __future__ import annotations

from hypothesis import settings


def examples(count: int) -> int:
    """So many in the profile `fresh`, which is the slow suite's; half of them in the fast suite."""
    return count if settings.get_current_profile_name() == "fresh" else count // 2
