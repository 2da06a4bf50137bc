"""A machine opened as the last run left it: reasons against power are values, the gravest first."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.errors import UsageError
from gantryctl.machine import config_hash, with_values
from gantryctl.operation import opening
from gantryctl.operation.opening import (
    close_axis,
    keep_machine,
    new_machine,
    open_axis,
    read_only,
    retained_of_new_plant,
)
from gantryctl.operation.run_memory import RunEnd
from gantryctl.operation.store import StateStore
from gantryctl.program import Code
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.program.alarms.words import Words
from gantryctl.units import deg
from gantryctl.wiring.engine import build_engine

from .kept_bench import MACHINE, NEW, kept_machine

approx = pytest.approx
FRESH = new_machine(MACHINE, 20.0)
SCALE, REST = FRESH.scale, FRESH.retained
RAW = FRESH.drive.read().pos_act_counts


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


def test_there_is_no_new_machine_behind_a_real_drive() -> None:
    """Its zero is set by a person, and kept: without a state directory nobody knows where it stands."""
    real = with_values(
        MACHINE,
        {
            "drive.kind": "canopen",
            "control.scan_period_ms": 4.0,
            "can.interface": "socketcan",
            "can.channel": "can0",
        },
    )
    with pytest.raises(UsageError, match="has no new machine behind it"):
        open_axis(real, None)


def kept(turned_deg: float = 0.0, error_stop: str = "") -> StateStore:
    """A store whose gantry has turned while off."""
    found = new_machine(MACHINE, 10.0)
    rest = found.retained.rest_position_counts
    assert rest is not None
    moved = rest - round(turned_deg / found.scale.deg_per_count)
    store = StateStore(MACHINE)
    keep_machine(
        MACHINE, store, found.drive,
        replace(found.retained, rest_position_counts=moved, error_stop=error_stop),
    )  # fmt: skip
    return store


def test_memory_of_another_machine_file_is_that_of_this_one_from_the_opening_on() -> None:
    with kept_machine(config_hash="of another file") as store:
        assert open_axis(MACHINE, store).retained.config_hash == config_hash(MACHINE)


@pytest.mark.parametrize(
    ("turned_deg", "error_stop", "expected"),
    [
        (0.0, "", []),
        (0.03, "", []),
        (0.2, "", [(Code.ENC_09, ClearedBy.RESET)]),
        (4.85, "", [(Code.ENC_10, ClearedBy.RESTART)]),
        (0.0, "CTL-03", [(Code.SYS_12, ClearedBy.RESET)]),
        (0.0, "ENC-01", [(Code.SYS_12, ClearedBy.SERVICE)]),
        (0.2, "CTL-03", [(Code.ENC_09, ClearedBy.RESET), (Code.SYS_12, ClearedBy.RESET)]),
        (4.85, "CTL-03", [(Code.ENC_10, ClearedBy.RESTART), (Code.SYS_12, ClearedBy.RESET)]),
    ],
)
def test_reasons_name_their_code_and_what_clears_them(
    turned_deg: float, error_stop: str, expected: list[tuple[Code, ClearedBy]]
) -> None:
    with kept(turned_deg, error_stop) as store:
        opened = open_axis(MACHINE, store)
    assert [(reason.code, reason.cleared_by) for reason in opened.reasons] == expected


def test_what_a_person_has_to_deal_with_first_stands_first() -> None:
    """A motion while off is acknowledged by a reset; a record of another drive is not."""
    with kept(turned_deg=0.2, error_stop="CTL-03") as store, read_only(MACHINE, store) as found:
        other = Reason(Code.CFG_CAN_02, {"why": "another drive"}, ClearedBy.COMMISSIONING)
        codes = [reason.code for reason in opening._reasons(found, (other,))]
    assert codes == [Code.CFG_CAN_02, Code.ENC_09, Code.SYS_12]


def test_a_reason_carries_its_numbers() -> None:
    with kept(turned_deg=0.2) as store:
        (reason,) = open_axis(MACHINE, store).reasons
    assert reason.values["moved_deg"] == pytest.approx(0.2, abs=1e-6)
    assert reason.text.startswith("ENC-09 · the axis moved +0.200 deg while off (limit 0.05 deg)")


def test_an_earlier_stop_by_the_encoder_casts_doubt_on_the_position() -> None:
    for code, doubted in (("ENC-01", True), ("CTL-03", False)):
        with kept(error_stop=code) as store:
            (reason,) = open_axis(MACHINE, store).reasons
        assert reason.values == {"stopped_by": code}
        assert reason.doubts_position is doubted


def test_the_axis_shows_the_angle_at_which_the_gantry_was_left() -> None:
    with kept() as store:
        opened = open_axis(MACHINE, store)
        assert opened.reading.angle_deg == pytest.approx(10.0, abs=0.005)
        close_axis(MACHINE, store, opened, RunEnd("done", None, power_ups=1, moves=2, time_s=3.0))
        with read_only(MACHINE, store) as again:
            assert again.reading.angle_deg == pytest.approx(10.0, abs=0.005)
            assert (again.retained.power_ups, again.retained.moves) == (1, 2)
            assert again.retained.last_result == "done"


@pytest.mark.parametrize(
    ("stopped_by", "doubted_by", "cleared"),
    [
        ("CTL-03", "", ClearedBy.RESET),
        ("CTL-03", "ENC-01", ClearedBy.SERVICE),
        ("BRK-03", "", ClearedBy.SERVICE),
    ],
)
def test_a_stop_of_an_earlier_run_is_reset_by_whom_it_is_for(
    stopped_by: str, doubted_by: str, cleared: ClearedBy
) -> None:
    with kept_machine(error_stop=stopped_by, doubted_by=doubted_by) as store:
        opened = open_axis(MACHINE, store)
    assert [reason.cleared_by for reason in opened.reasons] == [cleared]
    assert opened.program.axis.feedback.in_doubt is bool(doubted_by)


def test_a_doubt_without_a_stop_is_a_doubt() -> None:
    """A battery that was empty at the start raises no alarm that stops: the turns are not proven all the same."""
    with kept_machine(error_stop="", doubted_by="-") as store:
        opened = open_axis(MACHINE, store)
    assert opened.reasons == ()
    engine = build_engine(MACHINE, opened.drive, opened.program)
    engine.run_for(0.1)
    refused = opened.program.axis.power_on()
    assert refused is not None
    assert refused.values["reason"] is Words.POSITION_NOT_VALID


@pytest.mark.parametrize("limit_deg_s", [2.5, 99.0])
def test_the_lower_of_machine_file_and_ledger_is_the_highest_speed(
    limit_deg_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opening, "speed_max_deg_s", lambda _: limit_deg_s)
    with kept_machine() as store:
        opened = open_axis(MACHINE, store)
    assert opened.speed_max_deg_s == min(6.0, limit_deg_s)
    assert deg(opened.program.axis.settings.speed.setting_max_rad_s) == approx(min(6.0, limit_deg_s))


@pytest.mark.parametrize(
    ("moved_deg", "noted"), [(0.0009, False), (0.0011, True), (-0.0011, True), (0.0499, True)]
)
def test_a_way_while_off_is_noted_from_a_thousandth_of_a_degree_on(moved_deg: float, noted: bool) -> None:
    found = new_machine(MACHINE, 10.0)
    assert found.retained.rest_position_counts is not None
    rest = round(found.retained.rest_position_counts - moved_deg / SCALE.deg_per_count)
    with kept_machine(rest_position_counts=rest) as store:
        opened = open_axis(MACHINE, store)
    assert any("ENC-09" in note for note in opened.notes) is noted
    assert [alarm.code for alarm in opened.retained.alarms] == (["ENC-09"] if noted else [])
    assert opened.reasons == ()


def test_another_plant_has_another_torque_and_another_zero_and_the_counters_of_the_old() -> None:
    old = replace(
        REST, holding_torque_nm=12.0, torque_weights="[1.0]", calibration_watch="{}", power_ups=9, zero_offset_counts=5,
        brake_failed="bore 10 N m",
    )  # fmt: skip
    new = retained_of_new_plant(
        old, replace(NEW, zero_offset_counts=77, rest_position_counts=88, encoder_serial="B")
    )
    assert (new.holding_torque_nm, new.torque_weights, new.calibration_watch) == (None, "", "")
    assert (new.zero_offset_counts, new.previous_offset_counts, new.rest_position_counts) == (77, 5, 88)
    assert (new.power_ups, new.brake_failed, new.encoder_serial) == (9, "bore 10 N m", "B")


@pytest.mark.parametrize("branch", [-1, 0, 1])
def test_the_zero_lies_on_the_branch_of_the_reading(branch: int) -> None:
    """The reading counts on over the wrap of the encoder's range; 20 deg from the zero is where it stands."""
    found = FRESH._replace(feedback=FRESH.feedback._replace(pos_act_counts=RAW + branch * SCALE.range_counts))
    zero = opening._zero_counts(found)
    assert (RAW + branch * SCALE.range_counts - zero) * SCALE.deg_per_count == approx(20.0, abs=0.01)


def test_what_earlier_runs_have_learned_is_given_to_the_axis() -> None:
    with kept_machine(torque_weights="[1.0, 2.0, 3.0, 4.0, 5.0]") as store:
        opened = open_axis(MACHINE, store)
    assert opened.program.axis.torque_weights == (1.0, 2.0, 3.0, 4.0, 5.0)
    assert opened.program.axis.holding_torque_nm == 0.0, "nothing was learned of the torque that holds"


def test_an_experiment_runs_by_its_own_control() -> None:
    other = with_values(MACHINE, {"virtual_axis.acc_deg_s2": 0.2, "speed.setting_max_deg_s": 5.0})
    opened = open_axis(MACHINE, None, controlled_as=other)
    settings = opened.program.axis.settings
    assert deg(settings.ramps.acc_rad_s2) == approx(0.2)
    assert deg(settings.speed.setting_max_rad_s) == approx(5.0)
    # A move without a speed has one that the axis takes.
    assert opened.speed_max_deg_s == 5.0
    assert opened.retained.machine == MACHINE.name


@pytest.mark.parametrize("experiment", [True, False])
def test_what_is_not_watched_is_told_of_the_control_in_use(
    experiment: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = with_values(MACHINE, {"virtual_axis.acc_deg_s2": 0.2})
    monkeypatch.setattr(
        opening, "_calibration_notes", lambda machine: (f"{machine.virtual_axis.acc_deg_s2:.3f}",)
    )
    opened = open_axis(MACHINE, None, controlled_as=other if experiment else None)
    assert opened.notes[-1] == ("0.200" if experiment else "0.393")


def test_an_experiment_moves_by_the_proofs_of_its_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other gains and ramps may be tried; what the ledger says is of the machine that is there."""
    asked: list[str] = []
    monkeypatch.setattr(
        opening, "ledger_of", lambda machine, store, drive: (asked.append(machine.name), ())[1]
    )
    opening.open_axis(MACHINE, None, controlled_as=with_values(MACHINE, {"machine.name": "other"}))
    assert asked == [MACHINE.name]


def test_an_experiment_with_a_faster_profile_goes_no_faster_than_the_machine() -> None:
    slow = with_values(MACHINE, {"speed.setting_max_deg_s": 3.0})
    opened = open_axis(slow, None, controlled_as=MACHINE)
    assert opened.speed_max_deg_s == 3.0
    assert deg(opened.program.axis.settings.speed.setting_max_rad_s) == approx(3.0)
