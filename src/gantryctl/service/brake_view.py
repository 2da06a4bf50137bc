"""What the tags say of the brake test: under way, last, due."""

from __future__ import annotations

from typing import Any


class BrakeView:
    """Brake test of one axis as values of tags."""

    def fast(self) -> dict[str, float]:
        """The 20 Hz tags."""
        return {
            "brake_test_phase": 0,
            "brake_test_left_s": 0.0,
            "brake_test_torque_nm": 0.0,
            "brake_test_moved_deg": 0.0,
        }

    def slow(self) -> dict[str, Any]:
        """Those that are sent on change."""
        return {
            "brake_test_available": False,
            "brake_test_blocked": "not testable here: use the drive's own function",
            "brake_test_level_nm": None,
            "brake_test_limit_deg": None,
            "brake_test_result": "none",
            "brake_test_text": "",
            "brake_test_plus_nm": None,
            "brake_test_minus_nm": None,
            "brake_tested_at": "",
            "brake_test_due_at": "",
            "brake_test_cycles_left": None,
            "brake_test_overdue": False,
        }
