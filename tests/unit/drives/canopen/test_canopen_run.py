"""The CANopen master during a long run: parameters read again, and a lost drive set up anew."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.errors import DeviceError
from gantryctl.image import DriveRequest, DriveState, LinkFlag
from unit.drives.canopen.canopen_bench import ENABLE, Bench

pytestmark = pytest.mark.can


def quick_round(monkeypatch: pytest.MonkeyPatch, *quirks: str) -> Bench:
    """A drive whose parameters are all read again in half a second."""
    monkeypatch.setattr("gantryctl.drives.canopen.setup.parameter_watch.ROUND_S", 0.5)
    return Bench(*quirks).open().enable()


@pytest.mark.parametrize("quirk", ["plain", "sparse", "odd-1005", "dangerous-defaults"])
def test_parameters_are_read_again_while_the_axis_moves(monkeypatch: pytest.MonkeyPatch, quirk: str) -> None:
    bench = quick_round(monkeypatch, quirk)
    bench.ramp_to(0.6)
    assert bench.run(1.0, ENABLE, 0.6).changed == ""
    assert bench.drive.requests.answered >= 2 * len(bench.drive.opened.kept)
    assert bench.drive.requests.unanswered == 0
    counters = bench.drive.health()
    assert counters.missed == (0, 0)
    assert counters.unknown == 0
    bench.drive.close()


def test_a_parameter_that_is_changed_behind_our_back_is_told_until_it_is_right_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = quick_round(monkeypatch)
    bench.ask("write", index=0x6007, value=0)
    bench.ask("write", index=0x6085, value=17)
    changed = bench.run(1.0).changed
    assert changed.startswith(("6007:00 Abort connection option code: want 1, have 0", "6085:00"))
    assert len(bench.drive.parameter_watch.differs) == 2
    bench.ask("write", index=0x6007, value=1)
    assert "have 17" in bench.run(1.0).changed
    bench.drive.close()


def test_a_parameter_that_is_not_answered_any_more_holds_nothing_up(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = quick_round(monkeypatch)
    bench.inject("silence")
    bench.run(0.3)
    assert bench.drive.requests.unanswered > 3
    assert (
        bench.drive.parameter_watch.line == ""
    )  # what is not known is not wrong; the heartbeat has an alarm of its own


@given(data=st.binary(max_size=8))
def test_no_answer_to_a_request_breaks_a_scan(data: bytes) -> None:
    bench = _asked()
    bench.drive.requests._answer(data)
    assert isinstance(bench.drive.parameter_watch.line, str)


@cache
def _asked() -> Bench:
    bench = Bench().open()
    bench.drive.parameter_watch.scan(1_000_000)
    return bench


# --- back again ---------------------------------------------------------------------------------------------------


def lose_by_restart(bench: Bench) -> None:
    bench.event("reset")
    bench.run(1.0, ENABLE, 0.6)


def lose_by_silence(bench: Bench) -> None:
    bench.inject("silence")
    bench.run(1.0, ENABLE, 0.6)
    bench.inject("silence", False)


def lose_by_nmt(bench: Bench) -> None:
    bench.event("nmt", state="PRE_OPERATIONAL")
    bench.run(1.0, ENABLE, 0.6)


LOSSES = pytest.mark.parametrize("lose", [lose_by_restart, lose_by_silence, lose_by_nmt])


@LOSSES
def test_a_lost_drive_is_set_up_again_within_the_run_and_nothing_moves(lose: Callable[[Bench], None]) -> None:
    bench = Bench().open().enable()
    bench.ramp_to(0.6)
    # As of an encoder that has passed the end of its range in this run: it knows of the range alone.
    bench.drive.process._unwrap._counts += bench.drive.process._unwrap.range_counts
    begun, begun_deg = bench.scan(ENABLE, 0.6).pos_act_counts, bench.load_deg
    lose(bench)
    assert bench.drive.lost
    assert (
        bench.drive.read().changed == ""
    )  # a drive that restarted has forgotten them all: one cause, one alarm
    assert not bench.virtual.plant.brake_open
    bench.run(2.0, DriveRequest.DISABLE)
    stood, stood_counts = bench.load_deg, bench.virtual.plant.counts
    way_counts = (stood - begun_deg) * bench.drive.identity().counts_per_turn * bench.ratio / 360.0
    bench.drive.set_up_again()
    assert not bench.drive.lost
    assert bench.drive.refusals == ()
    seen = bench.drive.read()
    assert (seen.link, seen.age_scans) == (LinkFlag.NONE, 0)
    # load and motor are not wound up by more than some hundredths of a degree
    assert seen.pos_act_counts - begun == pytest.approx(way_counts, abs=0.05 / 360.0 * 1144.0 * 524288.0)
    bench.run(0.5, DriveRequest.FAULT_RESET)
    assert bench.run(0.2, DriveRequest.DISABLE).state is DriveState.SWITCH_ON_DISABLED
    # The load swings on against the braked motor, which gives way by less than a thousandth of a turn.
    moved = bench.virtual.plant.counts - stood_counts
    assert abs(moved) < 1e-3 * bench.virtual.hardware.fine_counts_per_turn
    assert not bench.virtual.plant.brake_open
    bench.enable()
    bench.ramp_to(0.6)
    assert bench.load_deg > stood + 0.1
    bench.drive.close()


def test_a_parameter_that_cannot_be_read_any_more_is_told_with_the_abort_code() -> None:
    bench = Bench().open().enable()
    bench.inject("sdo_abort", 0x0800_0022)
    # One parameter every three seconds.
    changed = bench.run(4.0).changed
    assert "not possible in the drive's present state (abort code 08000022)" in changed
    bench.inject("sdo_abort", None)
    bench.drive.close()


def test_a_drive_that_stays_silent_stays_lost() -> None:
    bench = Bench().open().enable()
    bench.inject("silence")
    bench.run(1.0)
    with pytest.raises(DeviceError, match="no answer"):
        bench.drive.set_up_again()
    assert bench.drive.lost
    bench.inject("silence", False)
    # Lost, but it has said by SDO that it is off.
    assert bench.run(0.4).state is DriveState.FAULT
    assert not bench.virtual.plant.brake_open


def test_another_drive_on_the_bus_is_not_taken() -> None:
    bench = Bench().open().enable()
    lose_by_restart(bench)
    bench.ask("write", index=0x1018, sub=4, value=77)
    with pytest.raises(DeviceError, match="another drive"):
        bench.drive.set_up_again()
    assert bench.run(0.4).state is DriveState.SWITCH_ON_DISABLED
