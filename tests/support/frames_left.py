"""Whether a refusal leaves frames behind that Python never collects."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable

import pytest


class _Canary:
    """A local variable of a frame."""


def leaves_frames(refuse: Callable[[], object], error: type[Exception]) -> bool:
    """Run what is refused in a frame of its own; True if that frame is still there afterwards."""
    seen: list[weakref.ref[_Canary]] = []

    def caller() -> None:
        canary = _Canary()
        seen.append(weakref.ref(canary))
        with pytest.raises(error) as caught:
            refuse()
        assert caught.value  # the error and its frames hold each other: a cycle for the collector

    caller()
    gc.collect()
    return seen[0]() is not None
