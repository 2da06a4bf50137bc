"""What steps send, scan by scan, from the first command to the drive that is off: enable, move, rest, brake, off."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import groupby
from typing import Any

import pytest

from gantryctl.commissioning import STEPS, steps_lacks, steps_power, steps_sign
from gantryctl.commissioning.load_side import ring as load_side
from gantryctl.commissioning.results import Figure, Outcome, StepResult
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.errors import AlarmStop
from gantryctl.image import DriveRequest
from gantryctl.machine import with_values
from unit.commissioning.hand_drive import MACHINE, PERIOD_S, HandDrive, axis_of, context, opens

pytestmark = pytest.mark.can

# Scans of 4 ms: the drive is enabled in one and stands for 0.3 s; two braked ones, then off for 0.6 s.
UP, DOWN = ("stands", 76), [("braked", 2), ("off", 150)]


def told(drive: HandDrive) -> list[tuple[str, int]]:
    """What was sent, and for how many scans together."""

    def of(output: Any) -> str:
        if output.request is DriveRequest.DISABLE:
            return "off"
        assert output.request is DriveRequest.ENABLE
        if not output.brake_open:
            return "pushes" if output.torque_ff_nm else "braked"
        return "turns" if output.vel_cmd_rad_s else "stands"

    return [(what, len(list(scans))) for what, scans in groupby(drive.wrote, of)]


def test_the_creep_speed_ends_at_rest_and_behind_the_brake(step: Any) -> None:
    """0.1 deg/s at 0.39 deg/s2: 64 scans up, 5 s of it, 63 down and one at 0, with which half a second begins."""
    drive = HandDrive()
    assert step(steps_power, "velocity", drive).outcome is Outcome.PASSED
    assert told(drive) == [UP, ("turns", 64 + 1250 + 63), ("stands", 1 + 125), *DOWN]
    # 0.5 deg at 0.1 deg/s, 0.0254 deg of ramps and 0.2 deg more, and it must follow.
    assert drive.leashes == [(pytest.approx(0.7254, abs=1e-4), True)]


def test_the_pulse_and_the_push_end_at_rest_and_behind_the_brake(step: Any) -> None:
    """1.5 s of pulse, 0.5 s of rest; back by 0.12 deg/s more in each scan, 0.0216 deg in nine; 0.5 s of rest again."""
    drive = HandDrive()
    drive.opened.rows[0].verdict = ParameterVerdict.OK
    drive.spoil = lambda seen: seen._replace(
        torque_act_nm=128.0 if drive.wrote and drive.wrote[-1].vel_cmd_rad_s < 0.0 else 0.0
    )
    assert step(steps_sign, "sign", drive).outcome is Outcome.PASSED
    assert told(drive) == [UP, ("turns", 375), ("stands", 125), ("turns", 9), ("stands", 125), *DOWN]
    # Sign and scale are what it looks for: they need not be right.
    assert drive.leashes == [(0.05, False)]


@pytest.mark.parametrize("known", [True, False])
def test_a_drive_that_turns_wrong_is_neither_pushed_nor_turned_again(step: Any, known: bool) -> None:
    drive = HandDrive(way=-1.0, shown=-1.0)
    drive.opened.rows[0].verdict = ParameterVerdict.OK if known else ParameterVerdict.ABSENT
    assert step(steps_sign, "sign", drive).outcome is Outcome.FAILED
    assert told(drive) == [UP, ("turns", 375), ("stands", 125), *DOWN]


def test_the_ceiling_of_the_speed_is_seen_in_its_second_half_and_left_at_rest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """6080 = round(0.08 deg/s x 1144 / 6) = 15 r/min are 0.0787 deg/s; 606C shows a tenth of it in the first half."""
    drive = HandDrive(way=0.5)
    monkeypatch.setattr(steps_sign, "open_loop_axis", opens(drive))

    def spoil(seen: Any) -> Any:
        scans = sum(output.vel_cmd_rad_s != 0.0 for output in drive.wrote)
        return seen._replace(vel_act_rad_s=15 * 0.1047198 * (0.1 if scans <= 50 else 1.0) * (scans > 0))

    drive.spoil = spoil
    ceilings, write = [], drive.write
    drive.write = lambda output: (ceilings.append(drive.sdo.values[0x6080]), write(output))[1]  # type: ignore[method-assign]
    assert steps_sign._at_ceiling(context()) == pytest.approx(1.0)
    assert set(ceilings) == {15}
    assert drive.leashes == [(0.05, False)]
    assert told(drive) == [UP, ("turns", 100), ("stands", 125), *DOWN]


def test_a_drive_that_heeds_no_ceiling_is_stopped_by_its_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    """0.16 deg/s are asked for, and it turns at 0.24 deg/s: 0.2 deg/s are the limit, whatever its leash."""
    drive = HandDrive(way=1.5, shown=1.5)
    monkeypatch.setattr(steps_sign, "open_loop_axis", opens(drive))
    with pytest.raises(AlarmStop, match=r"\+0\.24 deg/s by the drive"):
        steps_sign._at_ceiling(context())
    assert told(drive)[1] == ("turns", 1)


def test_the_ring_is_seen_at_rest_three_times(monkeypatch: pytest.MonkeyPatch) -> None:
    """0.3 deg/s at 0.39 deg/s2: 191 scans up, 4.237 s at it, 190 down and one at 0; each rest is a second."""
    drive = HandDrive()
    monkeypatch.setattr(load_side, "open_loop_axis", opens(drive))
    # A machine without one turns for none.
    assert load_side.ring(context()).outcome is Outcome.NOT_TESTABLE
    assert drive.wrote == []
    machine = with_values(MACHINE, {"can.load_encoder.source": "node", "can.load_encoder.node": 4})
    load_side.ring(context(machine))
    way, rest = ("turns", 191 + 1060 + 190), ("stands", 1 + 250)
    assert told(drive) == [("stands", 76 + 250), way, rest, way, rest, *DOWN]
    assert drive.leashes == [(2.0, True)]
    # Forward first, and as long as the progress says.
    assert next(output.vel_cmd_rad_s for output in drive.wrote if output.vel_cmd_rad_s) > 0.0
    lasts_s = next(each for each in STEPS if each.key == "ring").lasts_s(machine)
    assert len(drive.wrote) * PERIOD_S == pytest.approx(lasts_s, rel=0.1)


def test_the_torque_ends_behind_the_brake_before_the_drive_is_off(step: Any) -> None:
    """0.5 s up, 0.3 s of it, 0.2 s back to 0, 0.3 s off: plus, then minus."""
    drive = HandDrive()
    drive.machine = with_values(MACHINE, {"can.torque_limit_in_drive_nm": 385.0})  # type: ignore[attr-defined]
    held = {"plus_nm": Figure(70.0), "minus_nm": Figure(-70.0)}
    step(steps_lacks, "torque", drive, brake=StepResult("brake", Outcome.PASSED, "", held))
    push = [("braked", 76), ("pushes", 200), ("braked", 50), ("off", 75)]
    assert told(drive) == [*push, *push]
    assert drive.leashes == [(0.02, False)]


def test_the_brake_test_ends_behind_the_brake_with_the_drive_off(step: Any) -> None:
    drive = HandDrive()
    step(steps_power, "brake", drive)
    assert [what for what, _ in told(drive)] == ["braked", "pushes", "braked", "off"]
    assert (told(drive)[0], told(drive)[-1]) == (("braked", 76), ("off", 50))
    # What the drive gives of its own is taken out, for 0.3 s.
    assert told(drive)[2][1] >= 75
    assert drive.leashes == [(0.1, True)]


@pytest.mark.parametrize("push", [1.0, 0.3])
def test_operation_knows_of_the_brake_test_of_commissioning(
    monkeypatch: pytest.MonkeyPatch, push: float
) -> None:
    """Its first one: seven days later, or after a hundred power-ups, the next one is due."""
    drive, axes = HandDrive(push=push), list[Any]()

    @contextmanager
    def opened(c: Any, leash_deg: float, part: str, **_: object) -> Iterator[Any]:
        axes.append(axis_of(drive, leash_deg))
        yield axes[0]

    monkeypatch.setattr(steps_power, "open_loop_axis", opened)
    steps_power.brake(context())
    kept = axes[0].retained
    failed = push < 1.0
    assert (kept.brake_tests, kept.brake_tests_failed) == (1, int(failed))
    assert kept.brake_test_outcome == ("failed" if failed else "passed")
