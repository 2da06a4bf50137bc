"""What stays of a machine between runs, and what a person does with it while it is off: status, reset, zero."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from gantryctl.errors import AlarmStop, CommandRefused, DeviceError, UsageError
from gantryctl.image import DriveState
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.operation import opening, state
from gantryctl.operation.brake_policy import brake_words, locked_code
from gantryctl.operation.home_reference import RestVerdict, judge_reference
from gantryctl.operation.opening import new_machine
from gantryctl.operation.run import AxisRun
from gantryctl.operation.state import (
    encoder_report,
    machine_status,
    read_retained,
    reset_machine,
    reset_simulation,
    set_encoder_zero,
)
from gantryctl.operation.store import StateStore
from gantryctl.program import Code, Reaction
from gantryctl.runtime import Retained

MACHINE = with_values(default_machine(), {"drive.kind": "ideal"})
ON_BUS = with_values(
    default_machine(),
    {
        "drive.kind": "canopen",
        "control.scan_period_ms": 4.0,
        "can.interface": "socketcan",
        "can.channel": "can0",
    },
)
COUNTS_PER_TURN, RATIO, TURNS = 4_194_304, 1144, 4096
COUNTS_PER_DEG = 13_328_565.6  # 4 194 304 x 1144 / 360


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


def kept(**values: Any) -> Retained:
    """A machine that has run, with these values in its memory."""
    reset_simulation(MACHINE, 10.0)
    with StateStore(MACHINE) as store:
        retained = store.load_retained()
        assert retained is not None
        store.store_retained(replace(retained, **values))
    return retained


def memory(machine: Machine = MACHINE) -> Retained:
    retained = read_retained(machine)
    assert retained is not None
    return retained


def test_a_run_adds_to_what_earlier_runs_have_counted() -> None:
    kept(power_ups=3, moves=20, travelled_rad=2.0, emergency_brake_stops=7, emergency_brake_energy_j=500.0)
    with StateStore(MACHINE) as store:
        run = AxisRun(MACHINE, store)
        run.move(16.0, 6.0)
        run.power_down()
        run.close("done")
    after = memory()
    assert (after.power_ups, after.moves, after.emergency_brake_stops) == (4, 21, 7)
    assert after.emergency_brake_energy_j == 500.0
    # 6 deg are 0.10472 rad.
    assert after.travelled_rad == pytest.approx(2.10472, abs=1e-4)
    assert after.last_result == "done"
    assert machine_status(MACHINE).angle_deg == pytest.approx(16.0, abs=0.005)


def test_a_stop_by_the_brake_is_one_more() -> None:
    kept(emergency_brake_stops=7)
    with StateStore(MACHINE) as store:
        run = AxisRun(MACHINE, store)
        run.power_up()
        run.begin_move(100.0, 6.0)
        run.follow(2.5)
        run.axis.alarms.raise_(Code.CTL_05, Reaction.TORQUE_OFF, measured=1.0, command=2.0, limit=0.5)
        with pytest.raises(AlarmStop):
            run.follow(1.0)
        run.close("stopped")
    assert memory().emergency_brake_stops == 8
    assert memory().error_stop == "CTL-05"
    assert machine_status(MACHINE).condition.startswith("stopped by alarm CTL-05")


@pytest.mark.parametrize("shown", ["OPERATION_ENABLED", "QUICK_STOP_ACTIVE", "FAULT_REACTION_ACTIVE"])
def test_no_zero_is_set_while_another_controller_runs_the_drive(
    monkeypatch: pytest.MonkeyPatch, shown: str
) -> None:
    before = replace(kept(), last_result=memory().last_result)

    @contextmanager
    def enabled_elsewhere(machine: Machine, store: StateStore) -> Iterator[opening.OpenMachine]:
        with opening.read_only(machine, store) as found:
            yield found._replace(feedback=found.feedback._replace(state=DriveState[shown]))

    monkeypatch.setattr(state, "read_only", enabled_elsewhere)
    with pytest.raises(CommandRefused, match="the drive is enabled"):
        set_encoder_zero(MACHINE, 12.0, "mark 7")
    assert memory() == before


@pytest.mark.parametrize("moved_deg", [0.002, -0.002, 0.0005, -0.0005])
def test_no_zero_is_set_of_a_real_axis_that_moves(monkeypatch: pytest.MonkeyPatch, moved_deg: float) -> None:
    """Turned by hand, or sinking through its brake: 0.002 deg between two readings; 0.0005 deg pass."""
    before = replace(kept(), last_result=memory().last_result)
    readings = iter([0.0, moved_deg])

    @contextmanager
    def on_the_bus(machine: Machine, store: StateStore) -> Iterator[opening.OpenMachine]:
        with opening.read_only(MACHINE, store) as found:
            counts = found.feedback.pos_act_counts + next(readings) * COUNTS_PER_DEG
            yield found._replace(feedback=found.feedback._replace(pos_act_counts=counts))

    monkeypatch.setattr(state, "read_only", on_the_bus)
    if abs(moved_deg) > 0.001:
        with pytest.raises(CommandRefused, match=r"the axis moves, .0\.002 deg between"):
            set_encoder_zero(ON_BUS, 12.0, "mark 7")
        assert memory() == before
    else:
        assert "stands at 12" in set_encoder_zero(ON_BUS, 12.0, "mark 7")


@pytest.mark.parametrize("lead_deg", [0.0, 0.25, -0.25])
def test_the_zero_lies_where_map_and_angle_put_it(monkeypatch: pytest.MonkeyPatch, lead_deg: float) -> None:
    kept()
    monkeypatch.setattr(state, "lead_deg", lambda machine, angle_deg: lead_deg)
    set_encoder_zero(MACHINE, 12.0, " mark 7 ")
    retained = memory()
    assert retained.rest_position_counts is not None
    assert retained.zero_offset_counts is not None
    # The motor stands at 12 deg and what it leads the load by.
    way = (retained.rest_position_counts - retained.zero_offset_counts) % (COUNTS_PER_TURN * TURNS)
    assert way == pytest.approx((12.0 + lead_deg) * COUNTS_PER_DEG, abs=20.0)
    assert 0 <= retained.zero_offset_counts < COUNTS_PER_TURN * TURNS
    assert retained.zero_witness == "mark 7"
    assert retained.previous_offset_counts is not None


@pytest.mark.parametrize(
    ("angle_deg", "witness", "said"),
    [
        (200.0, "mark", "--angle 200"),
        (0.0, "  ", "--witness: say"),
        (0.0, "a\nb", "one line"),
        (0.0, "a" * 201, "200"),
    ],
)
def test_a_zero_needs_an_angle_between_the_stops_and_a_witness(
    angle_deg: float, witness: str, said: str
) -> None:
    kept()
    with pytest.raises(UsageError, match=said):
        set_encoder_zero(MACHINE, angle_deg, witness)


def test_a_witness_of_200_characters_is_kept_whole() -> None:
    kept()
    set_encoder_zero(MACHINE, 12.0, "a" * 200)
    assert memory().zero_witness == "a" * 200


def test_a_zero_whose_range_would_wrap_in_the_travel_is_not_stored() -> None:
    # 2048 turns are 644.5 deg: 142.2 beside the travel. What stands at 10 deg and is called 170 moves the range by 160.
    short = with_values(MACHINE, {"encoder.turns": 2048, "plant.encoder.mounting_turns": 1024})
    reset_simulation(short, 10.0)
    before = memory(short)
    with pytest.raises(CommandRefused, match=r"wraps -17\.8 deg from the travel"):
        set_encoder_zero(short, 170.0, "mark")
    assert memory(short) == before


def test_a_reset_makes_no_reading_valid() -> None:
    kept(rest_position_counts=None, error_stop="CTL-03")
    with pytest.raises(CommandRefused, match="rest position"):
        reset_machine(MACHINE)
    assert memory().error_stop == "CTL-03"


def test_a_reset_says_what_it_acknowledged_and_does_it_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(state, "operator_name", lambda: "ana")
    retained = kept(doubted_by="ENC-01", brake_failed="slipped at 40 N m", error_stop="ENC-01")
    moved = int(0.8 * COUNTS_PER_DEG)
    with StateStore(MACHINE) as store:
        loaded = store.load_retained()
        assert loaded is not None
        assert retained.rest_position_counts is not None
        store.store_retained(replace(loaded, rest_position_counts=retained.rest_position_counts - moved))
    status = machine_status(MACHINE)
    assert status.angle_deg is None
    assert status.encoder.startswith("in doubt since ENC-01")
    assert status.condition == "stopped by alarm ENC-01; `gantryctl explain ENC-01`, only service resets it"
    done = reset_machine(MACHINE)
    assert "ENC-09 acknowledged by ana: moved +0.800 deg while off" in done
    assert "ENC-01 acknowledged by ana; the axis stays without power" in done
    assert "the encoder's angle of 10.000 deg is accepted by ana" in done
    assert "BRK-08 acknowledged by ana: slipped at 40 N m" in done
    after = memory()
    assert (after.doubted_by, after.brake_failed, after.error_stop) == ("", "", "")
    assert after.rest_position_counts == retained.rest_position_counts
    assert after.alarms[-1].code == "ENC-09"
    assert machine_status(MACHINE).angle_deg == pytest.approx(10.0, abs=1e-3)
    assert reset_machine(MACHINE) == "nothing to reset"


def test_a_doubt_without_an_alarm_names_none() -> None:
    kept(doubted_by="-")
    assert machine_status(MACHINE).encoder == "in doubt: service compares the angle, then reset"


def test_the_encoder_is_reported_with_its_margins() -> None:
    kept()
    rows = dict(encoder_report(MACHINE).rows())
    # 4096 turns of 0.31469 deg are 1288.95; 360 of travel leave 928.95, centred.
    assert rows["wrap margin"] == "464.5 deg below the travel, 464.5 deg above"
    assert rows["angle"] == "10.00000 deg"
    assert rows["moved while off"] == "+0.00000 deg"
    report = encoder_report(MACHINE)
    uneven = replace(report, reading=report.reading._replace(margin_minus_deg=1.0, margin_plus_deg=2.0))
    assert dict(uneven.rows())["wrap margin"] == "1.0 deg below the travel, 2.0 deg above"


NOW = datetime(2026, 11, 23, tzinfo=UTC)


def test_a_failed_brake_is_told_first_and_locks() -> None:
    failed = replace(kept(), brake_failed="slipped", brake_tested_at="2026-11-20T10:00:00Z")
    assert brake_words(MACHINE, failed, NOW) == "failed 2026-11-20T10:00:00Z: slipped"
    assert locked_code(failed) == "BRK-08"
    assert locked_code(None) == ""
    assert locked_code(replace(failed, brake_failed="")) == ""
    assert locked_code(replace(failed, error_stop="ENC-01")) == "ENC-01"
    assert locked_code(replace(failed, error_stop="CTL-03", brake_failed="")) == ""


@pytest.mark.parametrize(
    ("tested_at", "begins"), [("2026-11-20T10:00:00Z", "passed 2026-11-20"), ("", "due after")]
)
def test_only_a_brake_that_was_tested_has_passed(tested_at: str, begins: str) -> None:
    assert brake_words(MACHINE, replace(kept(), brake_tested_at=tested_at), NOW).startswith(begins)


def test_a_user_whom_the_system_does_not_know_has_a_name_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def nobody() -> str:
        raise KeyError

    monkeypatch.setattr(state.getpass, "getuser", nobody)
    assert state.operator_name() == "unknown user"


def test_a_zero_may_have_just_the_margin_of_the_file() -> None:
    """As the start has it, or what was stored would be refused there. 2048 turns leave 142 deg beside the travel."""
    short = with_values(MACHINE, {"encoder.turns": 2048, "plant.encoder.mounting_turns": 1024})
    reset_simulation(short, 10.0)
    reading = encoder_report(short).reading
    assert reading.margin_minus_deg is not None
    assert reading.margin_plus_deg is not None
    least = min(reading.margin_minus_deg, reading.margin_plus_deg)
    machine = with_values(short, {"encoder.wrap_margin_min_deg": least})
    assert set_encoder_zero(machine, 10.0, "mark")
    assert encoder_report(machine).reading.verdict is RestVerdict.OK
    machine = with_values(short, {"encoder.wrap_margin_min_deg": math.nextafter(least, math.inf)})
    with pytest.raises(CommandRefused, match="wraps 142"):
        set_encoder_zero(machine, 10.0, "mark")


def test_a_zero_is_of_this_encoder_at_this_rest_and_the_one_before_is_kept() -> None:
    before = kept(encoder_serial="ANOTHER", rest_position_counts=None)
    set_encoder_zero(MACHINE, 12.0, "mark 7")
    after = memory()
    assert after.zero_offset_counts != before.zero_offset_counts
    assert after.encoder_serial == new_machine(MACHINE).retained.encoder_serial != "ANOTHER"
    assert after.previous_offset_counts == before.zero_offset_counts
    assert after.rest_position_counts == new_machine(MACHINE, 10.0).retained.rest_position_counts
    assert machine_status(MACHINE).condition == "power off, brake closed"
    rows = dict(encoder_report(MACHINE).rows())
    assert rows["witness"] == "mark 7"
    assert rows["zero set by"] == f"{after.zero_set_by} {after.zero_set_at}"


# Of a moment of 40 N m at the motor whose sine is 0 at 0 deg, and friction.
LEARNED = "[40.0, 0.0, 6.0, 1.0, 2.0]"


def test_a_new_zero_turns_the_learned_torque_along() -> None:
    """What stood at 10 deg is at 100 deg from now on, so is the moment: 40 N m sin(q - 90 deg) = -40 N m cos q."""
    kept(torque_weights=LEARNED)
    set_encoder_zero(MACHINE, 100.0, "mark 7")
    assert json.loads(memory().torque_weights) == pytest.approx([0.0, -40.0, 6.0, 1.0, 2.0], abs=1e-4)


@pytest.mark.parametrize(
    "unknown",
    [{"encoder_serial": "ANOTHER"}, {"rest_position_counts": None}, {"doubted_by": "ENC-01"}],
    ids=str,
)
def test_a_new_zero_of_an_angle_that_was_not_known_forgets_the_learned_torque(
    unknown: dict[str, Any],
) -> None:
    kept(torque_weights=LEARNED, **unknown)
    set_encoder_zero(MACHINE, 10.0, "mark 7")
    assert memory().torque_weights == ""


def test_the_way_travelled_is_told_in_degrees() -> None:
    kept(travelled_rad=6.283185307179586)
    assert machine_status(MACHINE).travelled_deg == pytest.approx(360.0)


@pytest.mark.parametrize("measured", [None, 3.0])
def test_the_quick_stop_is_told_as_it_was_measured(
    measured: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept()
    monkeypatch.setattr(state, "own_ramp_deg_s2", lambda machine, directory: measured)
    assert machine_status(MACHINE).quick_dec_deg_s2 == (measured or 5.4)


@pytest.mark.parametrize(
    ("after", "resets"), [(DriveState.FAULT, False), (DriveState.SWITCH_ON_DISABLED, True)]
)
def test_only_a_drive_that_has_left_its_fault_is_reset(
    after: DriveState, resets: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gantryctl.wiring.canopen.reset_drive_fault", lambda machine: after)
    if resets:
        assert "the drive is in switch on disabled" in state._reset_drive(ON_BUS)
    else:
        with pytest.raises(DeviceError, match="its cause is still there"):
            state._reset_drive(ON_BUS)


@pytest.mark.parametrize(("counts", "moves"), [(3, False), (30_000, True)])
def test_a_reading_just_behind_the_wrap_is_no_motion_of_a_whole_range(
    counts: int, moves: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Five counts before the end of the encoder's range, and then three behind it; 30,000 are 0.00225 deg."""
    found = new_machine(MACHINE)
    before, after = found.scale.range_counts - 5, counts

    @contextmanager
    def again(*_: object) -> Iterator[Any]:
        yield found._replace(feedback=found.feedback._replace(pos_act_counts=after))

    monkeypatch.setattr(state, "read_only", again)
    seen = found._replace(feedback=found.feedback._replace(pos_act_counts=before))
    store: Any = None
    if moves:
        with pytest.raises(CommandRefused, match="the axis moves"):
            state._check_standing(ON_BUS, store, seen)
    else:
        state._check_standing(ON_BUS, store, seen)


def test_a_thousandth_of_a_degree_between_two_readings_is_a_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """An encoder of 360 000 counts on the axis itself: one count."""
    found = new_machine(MACHINE)
    coarse = found.scale._replace(identity=found.scale.identity._replace(counts_per_turn=360_000), ratio=1.0)
    seen = found._replace(scale=coarse, feedback=found.feedback._replace(pos_act_counts=7.0))

    @contextmanager
    def again(*_: object) -> Iterator[Any]:
        yield seen._replace(feedback=seen.feedback._replace(pos_act_counts=8.0))

    monkeypatch.setattr(state, "read_only", again)
    store: Any = None
    with pytest.raises(CommandRefused, match=r"the axis moves, \+0\.001 deg"):
        state._check_standing(ON_BUS, store, seen)


@pytest.mark.parametrize(("angle_deg", "told"), [(None, "100"), (30.0, "30")])
def test_a_new_simulated_machine_is_told_with_the_angle_it_stands_at(
    angle_deg: float | None, told: str
) -> None:
    """By itself in the middle of its travel, from 20 to 180 deg."""
    machine = with_values(MACHINE, {"axis.pos_min_deg": 20.0})
    assert reset_simulation(machine, angle_deg) == (
        f"hust_gantry: a new simulated machine stands at {told} deg, brake closed"
    )
    assert machine_status(machine).angle_deg == pytest.approx(float(told), abs=1e-4)


def test_a_simulated_machine_that_was_made_new_leaves_its_bus(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a machine on a virtual bus: its drive would go on."""
    left: list[object] = []
    kept_of: list[object] = []
    monkeypatch.setattr(state, "leave_bus", left.append)
    monkeypatch.setattr(state, "keep_machine", lambda machine, store, drive, retained: kept_of.append(drive))
    reset_simulation(MACHINE, 5.0)
    assert len(left) == 1
    assert left == kept_of


def test_an_encoder_without_a_zero_is_reported_as_that() -> None:
    found = new_machine(MACHINE, 10.0)
    nothing = Retained(machine=MACHINE.name, config_hash="")
    reading = judge_reference(found.scale, found.feedback.pos_act_counts, nothing)
    rows = dict(state.EncoderReport(reading, nothing, found.scale, MACHINE.axis.dial).rows())
    assert (rows["zero offset"], rows["witness"], rows["angle"]) == ("not set", "-", "unknown")
    assert (rows["stored rest position"], rows["moved while off"], rows["zero set by"]) == ("-", "-", "-")
    kept()
    report = encoder_report(MACHINE)
    assert dict(report.rows())["zero offset"] == f"fine count {memory().zero_offset_counts}"
    assert report.as_dict()["verdict"] == "ok"
    assert report.as_dict()["zero_offset_counts"] == memory().zero_offset_counts


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("holding_torque_nm", 12.5, ("holding torque", "12.5 N m")),
        ("travelled_rad", 6.283185307179586, ("travelled", "360 deg")),
        ("speed_rad_s", 0.05235987755982988, ("speed", "3 deg/s")),
        ("zero_offset_counts", 7, ("zero offset", "fine count 7")),
        ("error_stop", "", ("error stop", "-")),
        ("moves", 3, ("moves", "3")),
    ],
)
def test_what_is_retained_is_shown_in_units_of_people(
    name: str, value: object, shown: tuple[str, str]
) -> None:
    assert shown in state.retained_rows(Retained(**{"machine": "m", "config_hash": "", name: value}))


def test_a_reset_that_is_cut_off_leaves_no_memory_of_one_machine_with_the_plant_of_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def cut(*_: object) -> None:
        raise OSError("the disk is full")

    kept()
    monkeypatch.setattr(state, "keep_machine", cut)
    with pytest.raises(OSError, match="disk is full"):
        reset_simulation(MACHINE, 5.0)
    with StateStore(MACHINE) as store:
        assert (store.load_plant(), store.load_retained()) == (None, None)
