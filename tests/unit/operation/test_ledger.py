"""Ledger of a real machine: what is not wired or not in the drive keeps power off until a person accepts it by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.commissioning import Commissioning
from gantryctl.drives.od.facts import ObjectFact
from gantryctl.errors import CommandRefused
from gantryctl.machine import Machine, with_values
from gantryctl.machine.rules.reaction import permitted_speed_deg_s
from gantryctl.operation.ledger import Proofs, Standing
from gantryctl.operation.ledger.acceptance import (
    ledger_path,
    store_acceptances,
)
from gantryctl.operation.ledger.inputs import SAFETY_INPUTS
from gantryctl.operation.ledger.judging import impossible, lacks, ledger, unproven, unset
from gantryctl.operation.ledger.kept_facts import facts_path, load_facts
from gantryctl.operation.ledger.rows import INCREMENTS_PER_TURN
from gantryctl.operation.opening import new_machine
from gantryctl.operation.proofs import (
    bus_reasons,
)
from gantryctl.operation.run import AxisRun
from gantryctl.operation.store import StateStore
from gantryctl.wiring import canopen as canopen_wiring
from gantryctl.wiring.virtual import virtual_node

from .ledger_bench import (
    ALL_PROVEN,
    EPOS,
    FACTS,
    REAL,
    SILENT,
    VIRTUAL,
    accepted,
    changed,
    facts_of_virtual,
    put_virtual_drive,
    row_of,
    without,
)

pytestmark = pytest.mark.can


def test_what_is_wired_has_its_object_and_nothing_lacks_on_the_shipped_machine() -> None:
    rows = {row.what: row for row in ledger(REAL, FACTS)}
    assert [rows[name].standing for name in SAFETY_INPUTS] == [Standing.OBJECT] * 6
    assert rows["estop_ok"].text == "estop_ok: has it by 60FD bit 16"
    assert rows["drive_follows_command"].by == "6041 bit 12"
    # What a drive does when nobody speaks to it is shown by the drive alone, never by a name.
    assert {row.what for row in unproven(rows.values())} == {
        "stops_without_commands", "stops_without_controller", "keeps_brake",
    }  # fmt: skip
    assert lacks(rows.values()) == impossible(rows.values()) == ()
    assert all(row.standing in (Standing.OBJECT, Standing.PROVEN) for row in ledger(REAL, FACTS, ALL_PROVEN))


def test_of_a_drive_that_nobody_has_asked_only_the_inputs_are_known() -> None:
    assert [row.what for row in ledger(REAL, None)] == [*SAFETY_INPUTS, "drive_follows_command"]


@pytest.mark.parametrize("name", SAFETY_INPUTS)
def test_each_safety_input_that_is_not_wired_keeps_power_off(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str
) -> None:
    put_virtual_drive(monkeypatch)
    machine = without(name)
    with StateStore(machine, tmp_path) as store:
        store.store_retained(new_machine(VIRTUAL).retained)  # its zero is set
        with pytest.raises(CommandRefused, match=rf"^CFG-CAN-04 · .*: {name} · Wire or set up") as refused:
            AxisRun(machine, store)
        assert "gantryctl commission accept --lack NAME --by PERSON --because TEXT" in str(refused.value)
        # Commissioning moves the machine too.
        with pytest.raises(CommandRefused, match="CFG-CAN-04"):
            AxisRun(machine, store, commissioning=True)
        work = Commissioning(machine, store, tmp_path, lambda line: None, lambda step: True)
        with pytest.raises(CommandRefused, match="CFG-CAN-04"):
            work.start(again=False)
        facts = load_facts(facts_path(store.directory, machine))
        assert facts is not None
        store_acceptances(ledger_path(store.directory, machine), (accepted(machine, name, facts),))
        work.start(again=False)
        with pytest.raises(CommandRefused, match="CFG-CAN-02"):  # the next thing that lacks: the proofs
            AxisRun(machine, store)


def test_bits_of_a_drive_without_digital_inputs_are_no_inputs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sparse = lambda machine: virtual_node(VIRTUAL, quirks=["sparse"])[0]  # noqa: E731
    monkeypatch.setattr(canopen_wiring, "can_link", sparse)
    with StateStore(REAL, tmp_path) as store:
        drive = canopen_wiring.canopen_drive(REAL)
        try:
            (reason,) = bus_reasons(REAL, store, drive, commissioning=True)
        finally:
            drive.close()
    assert reason.code == "CFG-CAN-04"
    assert str(reason.values["lacks"]) == "; ".join(
        f"{name} (the drive has no 60FD)" for name in SAFETY_INPUTS
    )


@pytest.mark.parametrize("mappable", [True, False])
def test_an_input_that_no_telegram_carries_is_lacking(mappable: bool) -> None:
    """An emergency stop that is read once at the start protects nobody."""
    place = (0x60FD, 0)
    facts = replace(FACTS, objects=FACTS.objects | {place: replace(FACTS.objects[place], mappable=mappable)})
    standing = Standing.OBJECT if mappable else Standing.LACKING
    assert {row_of(name, facts).standing for name in SAFETY_INPUTS} == {standing}


PERSON, FILE, NOBODY = "a person", "a key of the file", "nobody"
TORQUE = with_values(REAL, {"can.torque_limit_in_drive_nm": 385.0})


@pytest.mark.parametrize(
    ("what", "objects", "machine", "proofs", "who"),
    [
        ("estop_ok", {}, without("estop_ok"), Proofs(), PERSON),
        ("runs_csv", {"o60FF": None}, REAL, Proofs(), NOBODY),
        ("maps_telegrams", {"o1600": None}, REAL, Proofs(), NOBODY),
        ("stops_without_commands", {"o1016_1": None, "o1400_5": None}, REAL, Proofs(), NOBODY),
        ("stops_without_commands", {}, REAL, Proofs(), "silence"),
        ("limits_torque", {"o6072": 1000}, REAL, Proofs(), FILE),
        ("limits_torque", {"o6072": None}, REAL, Proofs(), FILE),
        ("limits_torque", {"o6072": None}, TORQUE, Proofs(), PERSON),
        ("limits_torque", {"o6072": None}, TORQUE, Proofs(frozenset(), frozenset({"torque"})), "torque"),
        ("limits_speed", {"o6080": 1140}, REAL, Proofs(), FILE),
        ("ramps_quick_stop", {"o6085": None}, REAL, Proofs(), "ramp"),
        ("ramps_quick_stop", {"o6085": None}, REAL, Proofs(frozenset(), frozenset({"ramp"})), "ramp"),
        # Passed, and no figure of it was kept.
        ("ramps_quick_stop", {"o6085": None}, REAL, Proofs(frozenset({"ramp"})), "ramp"),
        ("keeps_brake", {}, REAL, Proofs(), "silence"),
        # One watch of the drive is enough.
        ("keeps_brake", {"o1016_1": None}, REAL, Proofs(), "silence"),
        ("keeps_brake", {}, REAL, Proofs(frozenset(), frozenset({"silence"})), "silence"),
        ("knows_counts", {"o608F_1": 65536}, REAL, Proofs(), FILE),
        ("knows_counts", {"o608F_1": None}, REAL, Proofs(), "sign"),
        ("knows_counts", {"o608F_1": None}, REAL, ALL_PROVEN, PERSON),
        ("knows_speed_unit", {"o60A9": 0x00B4_4700}, REAL, Proofs(), FILE),
        ("knows_speed_unit", {"o60A9": None}, REAL, Proofs(), "sign"),
        ("takes_plain_sync", {"o1019": 10}, REAL, Proofs(), NOBODY),
        # A cycle of 4 ms.
        ("takes_late_commands", {"o1007": 3999}, REAL, Proofs(), FILE),
        ("is_heard", {"o1014": 0x80}, REAL, Proofs(), NOBODY),
    ],
)
def test_each_lack_is_for_one_to_end(
    what: str, objects: dict[str, int | None], machine: Machine, proofs: Proofs, who: str
) -> None:
    """By a name, a key, a step of commissioning, or by nobody; and nobody else is told to."""
    row = row_of(what, changed(FACTS, **objects), machine, proofs)
    assert row.lacking
    assert row.by == ""
    assert (row.acceptable, row.by_file) == (who is PERSON, who is FILE)
    assert row.proof == ("" if who in (PERSON, FILE, NOBODY) else who)
    groups = (lacks, unset, impossible, unproven)
    assert [bool(group([row])) for group in groups] == [
        who is PERSON, who is FILE, who is NOBODY, bool(row.proof)
    ]  # fmt: skip


# --- a silent controller --------------------------------------------------------------------------------------


def test_a_heartbeat_alone_costs_angle_and_limits_the_speed() -> None:
    """5.4 deg/s2: 36 / 10.8 = 3.33 deg, and 6 deg/s x 150 ms = 0.90 deg: 4.23 deg, of 4 permitted.

    v^2 / 10.8 + 0.15 v = 4 has the root 5.81 deg/s, told and enforced to the tenth below.
    """
    slow = with_values(REAL, {"can.heartbeat_alone_ms": 150.0})
    row = row_of("stops_without_commands", changed(FACTS, o1400_5=None), slow)
    assert (row.standing, str(row.by)) == (Standing.MADE_UP, "1016:01, step silence")
    assert row.speed_max_deg_s == 5.8
    assert "no 1400:05" in str(row.detail)
    # 0.67 deg are left for the delay: 111 ms at 6 deg/s.
    assert (
        "150 ms, then its ramp: 4.23 deg from 6 deg/s; permitted 4 deg: not faster than 5.8 deg/s; "
        "111 ms allow 6 deg/s" in str(row.detail)
    )
    # 100 ms, the default where the heartbeat is alone: 3.93 deg.
    row = row_of("stops_without_controller", changed(FACTS, o1400_5=None, o1016_1=127 << 16 | 100))
    assert (row.standing, row.speed_max_deg_s) == (Standing.PROVEN, None)
    assert "100 ms, then its ramp: 3.93 deg" in str(row.detail)


def test_a_drive_that_watches_the_heartbeat_alone_gets_the_shorter_time_where_it_takes_it() -> None:
    """EPOS4 has no 1400:05. Set up, it holds 100 ms; one that takes at least 120 ms keeps the 150 of both watches."""
    assert facts_of_virtual(EPOS).value(0x1016, 1) == 127 << 16 | 100
    assert FACTS.value(0x1016, 1) == 127 << 16 | 150
    least = dict(changed(FACTS, o1400_5=None).objects)
    least[0x1016, 1] = replace(least[0x1016, 1], low=127 << 16 | 120, default=0)
    row = row_of("stops_without_controller", canopen_wiring.set_up_facts(REAL, replace(FACTS, objects=least)))
    assert row.speed_max_deg_s == 5.8


def test_a_deadline_alone_stops_the_axis_of_a_dead_controller() -> None:
    """6 deg/s x 50 ms + 3.33 deg = 3.63 deg."""
    row = row_of("stops_without_controller", changed(FACTS, o1016_1=None))
    assert (row.standing, str(row.by)) == (Standing.MADE_UP, "1400:05, step silence")
    assert "no 1016:01" in str(row.detail)
    assert "3.63 deg from 6 deg/s" in str(row.detail)
    assert row.speed_max_deg_s is None


def test_a_watchdog_stops_the_axis_of_a_drive_that_watches_nothing() -> None:
    """A contact in the emergency-stop chain: 80 ms at 6 deg/s are 0.48 deg, then torque off and brake.

    It closes in 150 ms, in which the check moment (1.08 deg/s2) drives: 0.91 deg to 6.16 deg/s, and from there at
    8.80 deg/s2: 2.16 deg. 3.55 deg in all.
    """
    what = "stops_without_controller"
    row = row_of(what, SILENT)
    assert (row.standing, row.proof, row.acceptable) == (Standing.LACKING, "", False)
    fitted = with_values(REAL, {"can.io.node": 9, "can.io.outputs.watchdog": 3})
    row = row_of(what, SILENT, fitted, Proofs())
    assert (row.standing, row.proof, row.acceptable) == (Standing.LACKING, "watchdog", False)
    assert "the watchdog relay at 6200 bit 3 of node 9 is to be proven; 100 ms" in str(row.detail)
    proven = Proofs(frozenset({"sign", "watchdog"}), measured={"silent_stop_s": 0.08})
    row = row_of(what, SILENT, fitted, proven)
    assert (row.standing, str(row.by)) == (
        Standing.MADE_UP, "the watchdog relay at 6200 bit 3 of node 9, step watchdog",
    )  # fmt: skip
    assert "80 ms, then torque off and brake: 3.55 deg from 6 deg/s" in str(row.detail)
    assert str(row_of("keeps_brake", SILENT, fitted, proven).by) == "step watchdog"
    failed = Proofs(frozenset({"sign"}), frozenset({"watchdog"}))
    assert "step watchdog has failed" in str(row_of(what, SILENT, fitted, failed).detail)


def test_a_node_that_takes_the_enable_off_is_a_watchdog() -> None:
    """Before it is proven its heartbeat time counts: 150 ms at 6 deg/s and the way of above, 3.97 deg in all."""
    fitted = with_values(REAL, {"can.io.node": 9, "can.io.outputs.drive_enable": 3})
    row = row_of("stops_without_controller", SILENT, fitted, Proofs())
    assert (row.standing, row.proof, row.acceptable) == (Standing.LACKING, "watchdog", False)
    assert "the enable relay at 6200 bit 3 of node 9 (1016, 6206, 6207) is to be proven; 150 ms" in str(
        row.detail
    )
    assert "3.97 deg from 6 deg/s" in str(row.detail)
    proven = Proofs(frozenset({"sign", "watchdog"}), measured={"silent_stop_s": 0.05})
    row = row_of("stops_without_commands", SILENT, fitted, proven)
    assert str(row.by) == "the enable relay at 6200 bit 3 of node 9 (1016, 6206, 6207), step watchdog"
    assert "50 ms, then torque off and brake: 3.37 deg from 6 deg/s" in str(row.detail)


def test_a_failed_silence_is_lacking() -> None:
    failed = Proofs(frozenset({"sign"}), frozenset({"silence"}))
    for what in ("stops_without_commands", "stops_without_controller", "keeps_brake"):
        assert row_of(what, proofs=failed).text == f"{what}: lacking (step silence has failed)"


# --- limits and ramp ------------------------------------------------------------------------------------------


def test_a_torque_limit_of_the_makers_tool_is_shown_by_a_pulse() -> None:
    facts = changed(FACTS, o6072=None)
    entered = with_values(REAL, {"can.torque_limit_in_drive_nm": 385.0})
    assert not row_of("limits_torque", facts).acceptable
    shown = Proofs(frozenset({"silence", "sign", "torque"}), measured={"torque_limit_nm": 200.0})
    assert "what lies above 200 N m is not shown" in str(
        row_of("limits_torque", facts, entered, shown).detail
    )
    whole = Proofs(frozenset({"silence", "sign", "torque"}), measured={"torque_limit_nm": 385.0})
    assert row_of("limits_torque", facts, entered, whole).standing is Standing.PROVEN


def test_a_torque_limit_that_stays_lower_makes_the_stops_wrong() -> None:
    row = row_of("limits_torque", changed(FACTS, o6072=1000))
    assert (row.standing, row.acceptable) == (Standing.LACKING, False)
    assert "6072 stays 1000, wanted 1498" in str(row.detail)  # 385 of 257 N m


def test_a_measured_ramp_goes_into_the_stops() -> None:
    """4 deg/s2: 36 / 8 = 4.5 deg and 0.36 deg in 60 ms; v^2 / 8 + 0.06 v = 4 at 5.42 deg/s."""
    facts = changed(FACTS, o6085=None)
    row = row_of("ramps_quick_stop", facts)
    assert (row.standing, row.proof) == (Standing.LACKING, "ramp")
    measured = Proofs(frozenset({"silence", "sign", "ramp"}), measured={"quick_stop_dec_deg_s2": 4.0})
    # A figure of a step that has not passed shows nothing.
    unproven = Proofs(frozenset({"silence", "sign"}), measured={"quick_stop_dec_deg_s2": 4.0})
    assert row_of("ramps_quick_stop", facts, proofs=unproven).standing is Standing.LACKING
    row = row_of("ramps_quick_stop", facts, proofs=measured)
    assert (row.standing, str(row.by), row.speed_max_deg_s) == (Standing.PROVEN, "step ramp", 5.4)
    assert "4.86 deg from 6 deg/s" in str(row.detail)
    # The silence of the controller ends with the same ramp: 4.5 + 0.3 deg.
    assert "4.80 deg from 6 deg/s" in str(row_of("stops_without_controller", facts, proofs=measured).detail)


def test_what_is_read_only_is_judged_by_its_value() -> None:
    right = changed(FACTS, o605A=2, o605C=1, o605D=1, o605E=2)
    assert all(row.standing in (Standing.OBJECT, Standing.PROVEN) for row in ledger(REAL, right, ALL_PROVEN))
    # Held instead of switched off after the ramp: the ramp is the same.
    assert row_of("ramps_quick_stop", changed(FACTS, o605A=6)).standing is Standing.OBJECT
    for option in (0, 1, 5):
        assert row_of("ramps_quick_stop", changed(FACTS, o605A=option)).standing is Standing.LACKING
    # A fault without a ramp: 0.3 deg in 50 ms, then torque off and brake.
    assert "torque off and brake" in str(row_of("stops_without_controller", changed(FACTS, o605E=0)).detail)
    # 605B is asked for nothing.
    assert ledger(REAL, changed(FACTS, o605B=0), ALL_PROVEN) == ledger(REAL, FACTS, ALL_PROVEN)


def test_nobody_commands_the_brake_without_60fe() -> None:
    owner = with_values(REAL, {"brake.owner": "object_60FE"})
    assert str(row_of("keeps_brake", machine=owner).by) == "60FE:01"
    row = row_of("keeps_brake", changed(FACTS, o60FE_1=None), owner)
    assert (row.standing, row.acceptable, row.proof) == (Standing.LACKING, False, "")


def test_a_brake_at_an_output_of_the_controller_is_commanded_there() -> None:
    wired = {"brake.owner": "controller_output", "can.io.node": 9, "can.io.outputs.brake_release": 4}
    row = row_of("keeps_brake", machine=with_values(REAL, wired), proofs=Proofs())
    assert (row.standing, row.by) == (Standing.OBJECT, "6200 bit 4 of node 9")


def test_scales_that_contradict_the_machine_are_lacking() -> None:
    assert row_of("knows_counts", changed(FACTS, o608F_1=65536)).standing is Standing.LACKING
    assert row_of("knows_speed_unit", changed(FACTS, o60A9=0x00B4_4700)).standing is Standing.LACKING
    # Missing, they are shown by a short motion.
    no_608f, shown = (
        changed(FACTS, o608F_1=None),
        replace(ALL_PROVEN, measured={INCREMENTS_PER_TURN: 524288.0}),
    )
    assert str(row_of("knows_counts", no_608f, proofs=shown).by) == "step sign"
    in_turns = with_values(REAL, {"can.velocity_unit": "0.1 r/min"})
    assert str(row_of("knows_counts", no_608f, in_turns).by) == "step sign"
    # Position and speed in the same increments agree whatever their number in a turn is.
    row = row_of("knows_counts", no_608f)
    assert (row.standing, row.acceptable, row.proof) == (Standing.LACKING, True, "")
    assert row_of("knows_counts", changed(FACTS, o608F_1=None), proofs=Proofs()).proof == "sign"


@pytest.mark.parametrize("held", [0x83, 0x8000_0080, 0x8000_0082, 0, 0x2000_0082])
def test_emergency_messages_that_nobody_hears_are_told_with_their_cost(held: int) -> None:
    row = row_of("is_heard", changed(FACTS, o1014=held))
    assert (row.standing, row.by) == (Standing.MADE_UP, "6041")
    assert f"1014 stays {held:X}h, wanted 82h: its emergency messages are not heard" in str(row.detail)


def test_a_window_as_long_as_the_cycle_drops_no_command() -> None:
    row = row_of("takes_late_commands", changed(FACTS, o1007=4000))
    assert (row.standing, row.by) == (Standing.MADE_UP, "[control] scan_period_ms")
    assert "a command that comes within the cycle counts" in str(row.detail)
    narrow = row_of("takes_late_commands", changed(FACTS, o1007=2000))
    assert "dropped, that of a stop too: [control] scan_period_ms must fit in" in str(narrow.detail)


def test_a_drive_that_takes_what_is_written_has_no_row_of_sync_window_or_messages() -> None:
    told = {"takes_plain_sync", "takes_late_commands", "is_heard"}
    right = changed(FACTS, o1019=0, o1007=0, o1014=0x82)
    without_any = changed(FACTS, o1019=None, o1007=None, o1014=None)
    for facts in (FACTS, right, without_any):
        assert told.isdisjoint(row.what for row in ledger(REAL, facts, ALL_PROVEN))


def test_a_profile_of_another_maker_is_lacking() -> None:
    row = row_of("knows_speed_unit", machine=with_values(REAL, {"can.profile": "maxon_epos4"}))
    assert (row.standing, row.by_file) == (Standing.LACKING, True)
    assert "1018:01" in row.text


def test_what_makes_up_for_a_lack_says_its_cost() -> None:
    # 20 ms, and 0.5 deg/s at 10.59 deg/s2 (torque limit and check moment on the rigid machine) are 47 ms.
    row = row_of("drive_follows_command", machine=with_values(REAL, {"can.follows_bit": False}))
    assert (row.standing, row.by) == (Standing.MADE_UP, "velocity_deviation_deg_s")
    assert str(row.detail) == "seen after 67 ms instead of 4 ms"
    # From 6 to 6.6 deg/s at 10.59 deg/s2 are 57 ms, and 20 ms of the monitor; in 24 ms it gains 0.25 deg/s more.
    row = row_of("limits_speed", changed(FACTS, o6080=None))
    assert row.text == (
        "limits_speed: made up for by overspeed_trip_deg_s (no 6080; seen after 77 ms at 6.9 deg/s)"
    )


def test_an_object_that_goes_into_no_telegram_is_no_csv_axis() -> None:
    position = replace(FACTS.objects[0x6064, 0], mappable=False)
    row = row_of("maps_telegrams", replace(FACTS, objects={**FACTS.objects, (0x6064, 0): position}))
    assert (row.standing, row.acceptable) == (Standing.LACKING, False)
    assert "6064" in row.text


def test_fixed_telegrams_are_no_csv_axis() -> None:
    fixed = dict(FACTS.objects)
    fixed[0x1600, 0] = replace(fixed[0x1600, 0], writable=False)
    row = row_of("maps_telegrams", replace(FACTS, objects=fixed))
    assert "1600:00 cannot be written" in str(row.detail)
    assert (row.standing, row.acceptable, row.proof) == (Standing.LACKING, False, "")
    event = {**FACTS.objects, (0x1400, 2): ObjectFact(False, False, 255)}
    assert "acts when it arrives" in str(row_of("maps_telegrams", replace(FACTS, objects=event)).detail)


@pytest.mark.parametrize("place", [(0x1400, 2), (0x1800, 2)])
@pytest.mark.parametrize(
    ("kind", "standing"), [(0, Standing.LACKING), (1, Standing.OBJECT), (2, Standing.LACKING)]
)
def test_a_telegram_that_is_not_at_each_sync_is_none_of_a_csv_axis(
    place: tuple[int, int], kind: int, standing: Standing
) -> None:
    """CiA 301: 0 is sent at a SYNC when something has changed only, 2 at every second one."""
    fixed = {**FACTS.objects, place: ObjectFact(False, False, kind)}
    assert row_of("maps_telegrams", replace(FACTS, objects=fixed)).standing is standing


# --- a drive of whose fault nobody knows ------------------------------------------------------------------------------


def test_of_a_fault_that_nobody_knows_the_longer_way_counts() -> None:
    """Its ramp: 0.3 + 3.33 deg; torque off and brake: 0.3 + 3.07 deg. After 150 ms the ramp needs 5.8 deg/s, the brake
    with 3.97 deg none.
    """
    row = row_of("stops_without_commands", changed(FACTS, o605E=None))
    assert "50 ms, then its ramp or torque off and brake: 3.63 deg" in str(row.detail)
    slow = with_values(REAL, {"can.heartbeat_alone_ms": 150.0})
    row = row_of("stops_without_commands", changed(FACTS, o1400_5=None, o605E=None), slow)
    assert row.speed_max_deg_s == 5.8
    assert "111 ms allow 6 deg/s" in str(row.detail)


@pytest.mark.parametrize("close_ms", [150.0, 230.0])
def test_a_drive_of_which_nobody_knows_how_it_stops_moves_as_fast_as_the_slower_of_both_ways_allows(
    close_ms: float,
) -> None:
    """A fast brake holds the axis sooner than the ramp of 5.4 deg/s2; one that takes 0.23 s to close does not."""
    machine = with_values(
        REAL,
        {"can.heartbeat_alone_ms": 150.0, "brake.close_time_ms": close_ms, "speed.overspeed_trip_deg_s": 6.6},
    )
    by_ramp, by_brake, unknown = (
        row_of("stops_without_commands", changed(FACTS, o1400_5=None, o605E=option), machine).speed_max_deg_s
        or machine.speed.setting_max_deg_s
        for option in (2, 0, None)
    )
    assert (by_ramp < by_brake) is (close_ms == 150.0)
    assert unknown == min(by_ramp, by_brake)


@pytest.mark.parametrize("passed", [frozenset(), frozenset({"torque"})], ids=["not tried", "no figure kept"])
def test_of_a_limit_that_no_pulse_has_shown_all_is_open(passed: frozenset[str]) -> None:
    row = row_of("limits_torque", changed(FACTS, o6072=None), TORQUE, Proofs(passed))
    assert "what lies above 0 N m is not shown" in str(row.detail)


def test_an_acceptance_covers_the_lack_that_it_names_and_no_other() -> None:
    machine = without("estop_ok", "brake_open")
    rows = ledger(machine, FACTS, ALL_PROVEN, [accepted(machine, "estop_ok")])
    standing = {row.what: row.standing for row in rows}
    assert (standing["estop_ok"], standing["brake_open"]) == (Standing.ACCEPTED, Standing.LACKING)


def test_a_brake_at_an_output_of_the_drive_is_no_consequence_and_nothing_else_is_left_out() -> None:
    owner = with_values(REAL, {"brake.owner": "object_60FE"})
    rows = {row.what for row in ledger(owner, changed(FACTS, o1017=None, o60FE_1=None), ALL_PROVEN)}
    assert "shows_its_life" in rows
    assert "has_outputs" not in rows


@pytest.mark.parametrize(("bit", "place"), [(0, "6000 bit 0 of node 9"), (-1, "")])
def test_an_input_may_be_wired_to_a_node(bit: int, place: str) -> None:
    node = {"can.io.node": 9, "can.io.inputs.estop_ok": bit}
    row = row_of("estop_ok", machine=with_values(without("estop_ok"), node))
    assert (row.standing, row.by) == (Standing.OBJECT if place else Standing.LACKING, place)


@pytest.mark.parametrize(
    ("speed_deg_s", "shown_deg_s"),
    [(3.28, 3.2), (5.0, 5.0), (12.39, 12.3), (1.0, 1.0), (0.489, 0.48), (0.0937, 0.093), (0.0, 0.0)],
)
def test_a_highest_speed_is_never_rounded_up_nor_to_nothing(speed_deg_s: float, shown_deg_s: float) -> None:
    """A nacelle turns with 0.48 deg/s at most."""
    assert permitted_speed_deg_s(speed_deg_s) == pytest.approx(shown_deg_s, abs=1e-12)


def test_the_newest_of_two_acceptances_is_told() -> None:
    machine = without("estop_ok")
    first = accepted(machine, "estop_ok", FACTS)
    second = replace(first, by="Ben", because="the chain is wired to the drive alone")
    for acceptances, name in (((first, second), "Ben"), ((second, first), first.by)):
        (row,) = [row for row in ledger(machine, FACTS, ALL_PROVEN, acceptances) if row.what == "estop_ok"]
        assert (row.standing, row.by) == (Standing.ACCEPTED, name)
