"""Plain data for JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Dataclasses, enums, arrays and tuples as dicts, lists, strings and numbers."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {
            f"{key:g}" if isinstance(key, float) else str(key): plain(part) for key, part in value.items()
        }
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    # JSON has no word for nan and inf (RFC 8259, section 6); null says that there is no figure.
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
