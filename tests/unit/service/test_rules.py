"""The rules for commands, cell by cell and limit by limit, without an axis: expected results are written by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.image import Mode
from gantryctl.machine import default_machine
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.reason import ClearedBy, Reason, Reasons
from gantryctl.program.alarms.words import Words
from gantryctl.service.command.arming import Armed
from gantryctl.service.command.rules import (
    Situation,
    check_allowed,
    check_fresh,
    check_setting,
    counts,
    first_levels,
    resets_locked,
    setting_ranges,
)
from gantryctl.service.protocol.limits import KeyLimits
from gantryctl.service.protocol.messages import Identity, Message, MessageRefused
from gantryctl.service.protocol.roles import Action, Role
from gantryctl.units import rad

PAGE = Identity("page", "anna", Role.OPERATOR, "console", "anna")
OTHER = Identity("other", "bela", Role.OPERATOR, "console", "bela")
SERVICE = PAGE._replace(role=Role.SERVICE)
BLOCKED = Reasons([Reason(Code.CFG_CAN_02, {"why": "never was"}, ClearedBy.COMMISSIONING)])
VALUES: dict[str, dict[str, Any]] = {
    "set": {"tag": "override_percent", "value": 50.0}, "power": {"on": True}, "arm": {"action": "brake_test"},
    "take": {"over": False},
}  # fmt: skip


def situation(**other: Any) -> Situation:
    """A moment in which PAGE, who has control, may do everything."""
    return Situation(
        **{
            "epoch": 7, "time_s": 0.1, "issued_s": 0.0, "round_trip_s": 0.05, "keys": KeyLimits(0.2, 0.15),
            "holder": PAGE, "mode": Mode.NONE, "paused": False, "armed": None, "second_person": False,
            "shutdown": False, "journal_keeps": True, "blocked_by": Reasons(), "untestable": None,
            "reset_locked": False, **other,
        }
    )  # fmt: skip


def message(kind: str, epoch: int | None = 7, **values: Any) -> Message:
    return Message(kind, 1, "1-0000000000000000", epoch, {**VALUES.get(kind, {}), **values})


def fresh(kind: str, epoch: int | None = 7, **other: Any) -> str:
    try:
        check_fresh(message(kind, epoch), situation(**other))
    except MessageRefused as refused:
        return str(refused.refusal.code)
    return ""


def allowed(kind: str, who: Identity = PAGE, *, values: dict[str, Any] | None = None, **other: Any) -> str:
    try:
        check_allowed(message(kind, **(values or {})), who, situation(**other))
    except MessageRefused as refused:
        return str(refused.refusal.code)
    return ""


# --- fresh: what the sender saw -----------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "limit_s"), [("move", 0.5), ("power", 0.5), ("jog", 0.2), ("renew", 0.2)])
def test_a_command_names_a_frame_no_older_than_its_limit(kind: str, limit_s: float) -> None:
    assert fresh(kind, time_s=limit_s) == ""
    assert fresh(kind, time_s=limit_s + 0.001) == "SEC-02"


@pytest.mark.parametrize("kind", ["move", "jog", "note"])
def test_a_frame_that_the_connection_never_had_is_refused_by_that_name(kind: str) -> None:
    with pytest.raises(MessageRefused) as refused:
        check_fresh(message(kind), situation(issued_s=math.nan))
    assert refused.value.refusal.code == "SEC-02"
    assert refused.value.refusal.values["reason"] is Words.FRAME_UNKNOWN


@pytest.mark.parametrize(("epoch", "code"), [(6, "SEC-03"), (7, ""), (8, "SEC-03"), (None, "")])
def test_a_command_is_of_the_present_epoch_or_of_none(epoch: int | None, code: str) -> None:
    assert fresh("move", epoch) == code


def test_only_a_press_asks_for_the_round_trip() -> None:
    assert fresh("jog", round_trip_s=0.15) == ""
    for slow_s in (0.151, math.inf, math.nan):
        assert fresh("jog", round_trip_s=slow_s) == "SEC-13"
        assert fresh("move", round_trip_s=slow_s) == ""


def test_a_sign_of_life_with_an_old_frame_counts_as_not_sent() -> None:
    assert counts(message("renew"), situation(time_s=0.2))
    assert not counts(message("renew"), situation(time_s=0.201))
    assert counts(message("alive"), situation(time_s=0.5))
    assert not counts(message("alive"), situation(time_s=0.501))
    # Everything else is refused, and not dropped.
    assert counts(message("move"), situation(time_s=9.0))


# --- allowed: role, control, moment -------------------------------------------------------------------


NEEDS_CONTROL = {
    "power", "mode", "jog", "renew", "increment", "move", "move_by", "halt", "reset", "set", "give", "brake_test",
    "commission_begin",
}  # fmt: skip
NEEDS_NONE = {"take", "arm", "note", "acknowledge", "alive"}


@pytest.mark.parametrize("kind", sorted(NEEDS_CONTROL | NEEDS_NONE))
@pytest.mark.parametrize("holder", [None, OTHER])
def test_what_changes_the_axis_needs_control(kind: str, holder: Identity | None) -> None:
    assert allowed(kind, SERVICE, holder=holder) == ("SEC-07" if kind in NEEDS_CONTROL else "")


MOVES = {
    "power",
    "mode",
    "jog",
    "renew",
    "increment",
    "move",
    "move_by",
    "halt",
    "reset",
    "set",
    "give",
    "take",
}


@pytest.mark.parametrize("role", [Role.VIEWER, Role.ADMIN])
@pytest.mark.parametrize(
    "kind", sorted(MOVES | {"note", "acknowledge", "arm", "brake_test", "commission_begin"})
)
def test_who_watches_or_looks_after_users_moves_nothing(kind: str, role: Role) -> None:
    who = PAGE._replace(role=role)
    assert allowed(kind, who, holder=who) == "SEC-01"


def test_an_operator_neither_tests_the_brake_nor_commissions() -> None:
    for kind in ("brake_test", "commission_begin"):
        assert allowed(kind, PAGE) == "SEC-01"
    assert allowed("arm", PAGE) == "SEC-01"
    assert allowed("set", PAGE, values={"tag": "acc_setting_deg_s2"}) == "SEC-01"
    for kind in MOVES:
        assert allowed(kind, PAGE) == ""


def test_switching_off_waits_for_nobody() -> None:
    for other in ({"holder": OTHER}, {"journal_keeps": False}, {"shutdown": True}, {"blocked_by": BLOCKED}):
        assert allowed("power", values={"on": False}, **other) == ""


@pytest.mark.parametrize("kind", ["move", "move_by", "jog", "increment", "power", "brake_test"])
@pytest.mark.parametrize(
    ("other", "code"), [({"journal_keeps": False}, "JRN-02"), ({"shutdown": True}, "SYS-07")]
)
def test_nothing_begins_without_a_journal_or_while_the_service_ends(
    kind: str, other: dict[str, Any], code: str
) -> None:
    assert allowed(kind, SERVICE, **other) == code


@pytest.mark.parametrize("kind", ["renew", "halt", "mode", "reset", "acknowledge"])
def test_what_begins_nothing_goes_on_without_a_journal(kind: str) -> None:
    assert allowed(kind, journal_keeps=False) == ""


def test_a_line_of_the_shift_log_needs_the_journal() -> None:
    assert allowed("note", holder=None) == ""
    assert allowed("note", holder=None, journal_keeps=False) == "JRN-02"


def test_an_override_that_sets_a_standing_motion_going_is_a_motion() -> None:
    for other, code in (({"journal_keeps": False}, "JRN-02"), ({"shutdown": True}, "SYS-07")):
        assert allowed("set", paused=True, **other) == code
        assert allowed("set", paused=False, **other) == ""
        assert allowed("set", values={"tag": "increment_deg"}, paused=True, **other) == ""


def test_a_reason_against_power_stops_power_and_the_brake_test() -> None:
    assert allowed("power", blocked_by=BLOCKED) == "PWR-04"
    armed = Armed(Action.BRAKE_TEST, SERVICE, 7, 10.0)
    assert allowed("brake_test", SERVICE, blocked_by=BLOCKED, armed=armed) == "PWR-04"
    assert allowed("move", blocked_by=BLOCKED) == ""  # without power the program refuses it


def test_a_brake_test_is_armed_and_can_be_made_here() -> None:
    armed = Armed(Action.BRAKE_TEST, SERVICE, 7, 10.0)
    assert allowed("brake_test", SERVICE) == "SEC-10"
    assert allowed("brake_test", SERVICE, armed=armed._replace(action=Action.RESET_LOCKED)) == "SEC-10"
    assert allowed("brake_test", SERVICE, armed=armed) == ""
    assert allowed("brake_test", SERVICE, armed=armed, untestable=Words.NO_JOURNAL) == "CTL-14"
    assert allowed("brake_test", PAGE, armed=armed) == "SEC-01"


def test_a_locked_reset_is_armed_and_of_the_service_role() -> None:
    armed = Armed(Action.RESET_LOCKED, SERVICE, 7, 10.0)
    assert allowed("reset", SERVICE, reset_locked=True) == "SEC-10"
    assert allowed("reset", SERVICE, reset_locked=True, armed=armed) == ""
    assert allowed("reset", SERVICE) == ""
    # An operator's reset clears the rest; `Permit` and program keep what is locked.
    assert allowed("reset", PAGE, reset_locked=True) == ""
    for who, locked, found in ((SERVICE, True, True), (SERVICE, False, False), (PAGE, True, False)):
        assert resets_locked(who, situation(reset_locked=locked)) is found


@pytest.mark.parametrize(
    ("kind", "mode", "code"),
    [
        ("jog", Mode.CONTINUOUS, ""), ("jog", Mode.INCREMENTAL, "CTL-16"), ("jog", Mode.NONE, ""),
        ("increment", Mode.INCREMENTAL, ""), ("increment", Mode.CONTINUOUS, "CTL-16"), ("increment", Mode.NONE, ""),
        ("move", Mode.INCREMENTAL, ""),
    ],
)  # fmt: skip
def test_a_key_does_what_its_mode_says(kind: str, mode: Mode, code: str) -> None:
    assert allowed(kind, mode=mode) == code


# --- settings ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "tag", ["speed_setting_deg_s", "increment_deg", "override_percent", "acc_setting_deg_s2"]
)
def test_a_setting_keeps_both_ends_of_its_range(tag: str) -> None:
    allowed_range = setting_ranges(default_machine(), 6.0)[tag]
    low, high = allowed_range.low, allowed_range.high
    for value in (low, high):
        check_setting(value, allowed_range)
    for value in (math.nextafter(low, -1e9), math.nextafter(high, 1e9), -high, math.nan, math.inf):
        with pytest.raises(MessageRefused):
            check_setting(value, allowed_range)


def test_the_ranges_of_the_reference_machine() -> None:
    """0.6 to 6 deg/s (0.1 to 1 r/min) and 0.393 deg/s2 of the paper; a travel of 360 deg; override 0 to 100 %."""
    found = {tag: (each.low, each.high) for tag, each in setting_ranges(default_machine(), 6.0).items()}
    assert found["speed_setting_deg_s"] == (0.6, 6.0)
    assert found["increment_deg"] == (0.001, 360.0)
    assert found["override_percent"] == (0.0, 100.0)
    assert found["acc_setting_deg_s2"] == pytest.approx((0.0393, 0.393), rel=1e-3)


@pytest.mark.parametrize(
    ("last_deg_s", "begins_deg_s"), [(None, 0.6), (0.0, 0.6), (2.5, 2.5), (6.0, 4.0), (-3.0, 0.6)]
)
def test_the_speed_of_the_last_run_within_the_limits_of_this_one(
    last_deg_s: float | None, begins_deg_s: float
) -> None:
    last = None if last_deg_s is None else rad(last_deg_s)
    assert first_levels(default_machine(), 4.0, last).speed_rad_s == pytest.approx(
        rad(begins_deg_s), rel=1e-12
    )


@pytest.mark.parametrize(
    ("last_deg", "begins_deg"),
    [
        (None, 1.0),
        (2.0, 2.0),
        (0.0, 1.0),
        (-2.0, 1.0),
        (361.0, 1.0),
        (0.002, 0.002),
        (0.001, 0.001),
        (360.0, 360.0),
    ],
)
def test_the_increment_of_the_last_run_where_it_still_fits(last_deg: float | None, begins_deg: float) -> None:
    last = None if last_deg is None else rad(last_deg)
    levels = first_levels(default_machine(), 4.0, None, last)
    assert levels.increment_rad == pytest.approx(rad(begins_deg), rel=1e-12)
    assert levels.override == 1.0


@pytest.mark.parametrize("last_deg", [None, 0.5, 0.3])
def test_the_first_increment_of_a_small_travel_is_within_it(last_deg: float | None) -> None:
    """A mirror of 0.4 deg: one degree could never be set there."""
    whole = default_machine()
    mirror: Any = SimpleNamespace(
        speed=whole.speed, virtual_axis=whole.virtual_axis, axis=SimpleNamespace(pos_min_deg=-0.2, pos_max_deg=0.2)
    )  # fmt: skip
    levels = first_levels(mirror, 4.0, None, None if last_deg is None else rad(last_deg))
    assert levels.increment_rad == pytest.approx(rad(0.3 if last_deg == 0.3 else 0.4), rel=1e-12)


@pytest.mark.parametrize("kind", ["move", "jog", "halt", "set", "mode", "give"])
def test_a_lock_that_service_may_reset_asks_nothing_of_its_other_commands(kind: str) -> None:
    """Only the reset itself must be armed."""
    locked = situation(holder=SERVICE, reset_locked=True)
    check_allowed(message(kind), SERVICE, locked)
    with pytest.raises(MessageRefused):
        check_allowed(message("reset"), SERVICE, locked)


def test_times_of_a_refusal_are_told_in_ms() -> None:
    with pytest.raises(MessageRefused) as slow:
        check_fresh(message("jog"), situation(round_trip_s=0.25))
    assert slow.value.refusal.values == pytest.approx({"measured": 250.0, "limit": 150.0})
    with pytest.raises(MessageRefused) as old:
        check_fresh(message("move"), situation(time_s=0.75))
    reason = str(old.value.refusal.values["reason"])
    assert "750 ms" in reason
    assert "500 ms" in reason
