"""Where judge or oracle permit what they once did not, a bug of that kind is still found in the same scenario."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from gantryctl.drives.virtual.axis.cabinet import Cabinet
from gantryctl.drives.virtual.axis.plant import DrivePlant
from gantryctl.drives.virtual.nodes.io_node import IoNode
from gantryctl.engineering.fault_campaign.draw import Drive, axis_scenario, pair_scenario
from gantryctl.engineering.fault_campaign.judging.effects import may_come_first
from gantryctl.engineering.fault_campaign.judging.judge import Judge
from gantryctl.engineering.fault_campaign.matrix import Cell, run_cell
from gantryctl.engineering.fault_campaign.play import play
from gantryctl.engineering.fault_campaign.scenario import Action, PlannedFault, Scenario
from gantryctl.engineering.faults.case import Phase
from gantryctl.engineering.faults.catalogue import CATALOGUE, fault_case
from gantryctl.image import OutputImage
from gantryctl.machine import Machine
from gantryctl.program.alarms import log
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.axis import Axis
from gantryctl.program.axis.load_side import Command, LoadSide
from gantryctl.program.blocks.administration import Power
from gantryctl.program.feedback import Feedback
from gantryctl.program.monitors import drag
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.power import sequence
from gantryctl.program.power.hold_watch import HoldWatch
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.sequence import PowerSequence
from gantryctl.program.power.slip_watch import SlipWatch
from gantryctl.program.settings import AxisSettings
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.units import rad
from gantryctl.wiring import simulator
from support.fault_liars import LIARS

pytestmark = pytest.mark.can
Plant = Callable[[pytest.MonkeyPatch], None]


def _blind_to_a_frozen_encoder(patch: pytest.MonkeyPatch) -> None:
    true = Feedback.doubt

    def doubt(self: Feedback, code: Code, /, **values: object) -> None:
        if code not in (Code.ENC_02, Code.ENC_14, Code.BRK_14):
            true(self, code, **values)

    patch.setattr(Feedback, "doubt", doubt)


def _no_word_of_a_lost_torque(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(PowerSequence, "_lost", lambda self: None)
    patch.setattr(Monitors, "_brake_closed", lambda *_: None)
    for code in (Code.PWR_01, Code.BRK_06):
        patch.setitem(log.ALARMS, code, log.ALARMS[code]._replace(reaction=Reaction.W))


def _brake_stays_open(patch: pytest.MonkeyPatch) -> None:
    """Neither the watchdog relay nor the node itself lets it fall."""
    patch.setattr(Cabinet, "watchdog_closed", True)
    patch.setattr(IoNode, "_failed", lambda self: None)


def _torque_off_before_the_brake(patch: pytest.MonkeyPatch) -> None:
    """The way down of an axis at rest takes its torque off, and the brake has yet to close."""
    patch.setitem(sequence._STEPS, PowerPhase.CLOSING, lambda self, _: self._enter(PowerPhase.DISABLING))


def _without_words(patch: pytest.MonkeyPatch, *codes: Code) -> None:
    true = AlarmLog.raise_

    def raise_(self: AlarmLog, code: Code, *reaction: Reaction | None, **values: object) -> None:
        if code not in codes:
            true(self, code, *reaction, **values)

    patch.setattr(AlarmLog, "raise_", raise_)


def _nothing_doubts_or_disobeys(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Feedback, "doubt", lambda *_, **__: None)
    _without_words(patch, *(code for code in Code if code.startswith(("SYS-", "CTL-", "DRV-"))))


@pytest.mark.parametrize(
    ("pair", "scan_ms", "until_s", "plant", "invariant"),
    [
        pytest.param(1204, 4.0, 18.5, _blind_to_a_frozen_encoder, "INV-1", id="frozen in a quick stop"),
        pytest.param(1337, 4.0, 18.5, _no_word_of_a_lost_torque, "INV-6", id="torque lost while held up"),
        pytest.param(
            1188,
            4.0,
            23.5,
            LIARS["an angle that is called valid whatever the reading says"].plant,
            "INV-7",
            id="wrong sign while late",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            1283, 4.0, 17.0, _brake_stays_open, "INV-6", id="brake of a dead node", marks=pytest.mark.slow
        ),
        # The state of the drive is not seen: that a relay takes its torque is told by nobody, but what is commanded is.
        pytest.param(92276, 4.0, 3.0, _torque_off_before_the_brake, "INV-6", id="torque off unseen"),
        # Nobody can end a wrong sign at rest while the controller stands still; one that goes on must.
        pytest.param(80431, 4.0, 30.0, _nothing_doubts_or_disobeys, "INV-2", id="wrong sign at rest"),
        # A quick stop without torque has the time in which the monitor of its ramp sees it, and no more.
        pytest.param(
            92165, 4.0, 19.5, lambda patch: _without_words(patch, Code.DRV_07), "INV-1", id="no ramp"
        ),
        pytest.param(70077, 1.0, 8.0, _brake_stays_open, "INV-6", id="outputs dead", marks=pytest.mark.slow),
        pytest.param(
            90374,
            10.0,
            30.0,
            lambda patch: _without_words(patch, Code.CAN_13),
            "INV-1",
            id="nothing holds, and no word of the drive",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_bug_is_found_where_the_judge_has_learned(
    pair: int, scan_ms: float, until_s: float, plant: Plant, invariant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = pair_scenario(1, pair, scan_ms)
    actions = tuple(each for each in drawn.actions if each.at_s < until_s)
    scene = drawn.model_copy(update={"actions": actions, "duration_s": until_s})
    assert play(scene).ok
    plant(monkeypatch)
    assert invariant in {each.invariant for each in play(scene).violations}


def _drive_with(patch: pytest.MonkeyPatch, name: str, share: float) -> None:
    """Its own value is another one than that of the machine file."""
    true = simulator.drive_params

    def other(machine: Machine) -> object:
        params = true(machine)
        setattr(params, name, share * getattr(params, name))
        return params

    patch.setattr(simulator, "drive_params", other)


def _drive_on_bus_with_a_softer_ramp(patch: pytest.MonkeyPatch, share: float = 0.8) -> None:
    true = DrivePlant.set_ramp
    patch.setattr(DrivePlant, "set_ramp", lambda self, dec_rad_s2: true(self, share * dec_rad_s2))


def _brake_on_bus_late(patch: pytest.MonkeyPatch) -> None:
    true = DrivePlant._make

    def make(self: DrivePlant) -> object:
        known, self._drive = self._drive, self._drive.copy()
        self._drive.brake_close_s *= 2.0
        made, self._drive = true(self), known
        return made

    patch.setattr(DrivePlant, "_make", make)


def _reads_three_times_as_old(patch: pytest.MonkeyPatch) -> None:
    true = Feedback.__init__

    def init(self: Feedback, settings: AxisSettings, alarms: AlarmLog) -> None:
        true(self, settings, alarms)
        self._old_scans *= 3

    patch.setattr(Feedback, "__init__", init)


@pytest.mark.parametrize(
    ("number", "drive", "until_s", "plant", "invariant"),
    [
        # The permitted way of a slow axis goes to its own rest: a ramp that is a tenth softer is beyond it.
        pytest.param(
            2218,
            "sim",
            8.9,
            lambda patch: _drive_with(patch, "quick_dec_rad_s2", 0.9),
            "INV-1",
            id="softer ramp",
        ),
        # Without torque the load carries the motor on, no further than its brake lets it.
        pytest.param(
            1400,
            "sim",
            12.0,
            lambda patch: _drive_with(patch, "brake_close_s", 1.4),
            "INV-1",
            id="late brake",
        ),
        # A brake without torque lets the gear turn back, and then the load must be caught.
        pytest.param(
            3210,
            "sim",
            24.1,
            lambda patch: _without_words(patch, *(code for code in Code if code.startswith("BRK-"))),
            "INV-2",
            id="load not caught",
            marks=pytest.mark.slow,
        ),
        # Late telegrams are a quick stop, from when they are seen to be late.
        pytest.param(
            8034, "bus", 21.9, _reads_three_times_as_old, "INV-1", id="old readings", marks=pytest.mark.slow
        ),
        # The heartbeat has its own time; the brake has no more.
        pytest.param(7001, "bus", 11.3, _brake_on_bus_late, "INV-1", id="late brake", marks=pytest.mark.slow),
        # Without torque the motor goes with the load until the brake has closed, and not twice as long.
        pytest.param(
            7055, "bus", 5.8, _brake_on_bus_late, "INV-1", id="late brake 60FE", marks=pytest.mark.slow
        ),
        # The way of a soft loop behind its ramp is known; a softer ramp is not.
        pytest.param(
            7149,
            "bus",
            5.6,
            _drive_on_bus_with_a_softer_ramp,
            "INV-1",
            id="soft ramp",
            marks=pytest.mark.slow,
        ),
        # A drive that is stopped on the bus goes as far as its own ramp leads, which is that of the machine.
        pytest.param(
            6091,
            "bus",
            17.2,
            _drive_on_bus_with_a_softer_ramp,
            "INV-1",
            id="softer ramp of its own",
            marks=pytest.mark.slow,
        ),
        # So does one that no command reaches.
        pytest.param(
            8109,
            "bus",
            15.5,
            _drive_on_bus_with_a_softer_ramp,
            "INV-1",
            id="softer ramp, unreached",
            marks=pytest.mark.slow,
        ),
        # Behind a frozen controller a load of 0.54 Hz may swing on by 0.24 deg after the ramp, of which this one takes
        # 0.07; half of the ramp, 0.38 deg more, is no swing.
        pytest.param(
            8081,
            "bus",
            17.5,
            lambda patch: _drive_on_bus_with_a_softer_ramp(patch, 0.5),
            "INV-1",
            id="softer ramp, silent",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_bug_is_found_where_the_judge_has_learned_of_other_axes(
    number: int, drive: Drive, until_s: float, plant: Plant, invariant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = axis_scenario(1, number, None, drive)
    deeds = (*(each for each in drawn.actions if each.at_s < until_s), Action(at_s=until_s, do="power_off"))
    scene = drawn.model_copy(update={"actions": deeds, "duration_s": until_s + 1.5})
    assert play(scene).ok
    plant(monkeypatch)
    assert invariant in {each.invariant for each in play(scene).violations}


def _lost_telegrams_end_a_hold(patch: pytest.MonkeyPatch) -> None:
    true = sequence.PowerSequence._torque_hold

    def hold(self: PowerSequence, pos_rad: float) -> None:
        if self._feedback.state_old:
            self._alarms.raise_(Code.DRV_04, measured=Words.OPEN)
        true(self, pos_rad)

    patch.setitem(sequence._STEPS, PowerPhase.TORQUE_HOLD, hold)


@pytest.mark.parametrize("told", [True, False], ids=["torque is kept", "nobody sees it"])
def test_torque_that_is_told_to_be_kept_is_kept_without_telegrams(
    told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """C3 with E4: before a slip is seen nobody can see it, and nothing holds the load; behind HOLD the drive does."""
    deeds = (Action(at_s=0.2, do="power"), Action(at_s=3.0, do="power_off"))
    lost_s = 5.0 if told else 3.2
    faults = (PlannedFault(number="C3", at_s=2.9), PlannedFault(number="E4", at_s=lost_s))
    scene = Scenario(
        drive="bus", angle_deg=-80.0, plant_seed=1, actions=deeds, faults=faults, duration_s=11.0
    )
    assert play(scene).ok
    _lost_telegrams_end_a_hold(monkeypatch)
    assert play(scene).ok is not told


@pytest.mark.parametrize("lasts_s", [None, 4.0], ids=["to the end", "for 4 s"])
def test_a_load_that_sank_unseen_is_told_when_telegrams_come_again(
    lasts_s: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    deeds = (Action(at_s=0.2, do="power"), Action(at_s=3.0, do="power_off"))
    faults = (PlannedFault(number="C3", at_s=2.9), PlannedFault(number="E4", at_s=3.36, for_s=lasts_s))
    scene = Scenario(drive="bus", angle_deg=-68.8, plant_seed=1, actions=deeds, faults=faults, duration_s=8.0)
    assert play(scene).ok
    # A program that looks at the load no more behind a stop.
    monkeypatch.setattr(SlipWatch, "slipped_without_torque", lambda *_: False)
    assert play(scene).ok is (lasts_s is None)


def _violations(number: str, phase: Phase, speed_deg_s: float, angle_deg: float) -> list[str]:
    (case,) = (each for each in CATALOGUE if each.number == number)
    found = run_cell(Cell(case, "sim", phase, speed_deg_s, angle_deg, 4.0, "drive"))
    assert not found["refused"]
    return list(found["violations"])


def _only_warn(patch: pytest.MonkeyPatch, *codes: Code) -> None:
    for code in codes:
        patch.setitem(log.ALARMS, code, log.ALARMS[code]._replace(reaction=Reaction.W))


def test_a_load_that_hardly_moves_without_torque_is_told_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Row B13 at -75 deg: friction and a weak brake let the load go so slowly that 0.15 deg take seconds."""
    assert _violations("B13", Phase.HOLD, -6.0, -75.0) == []
    monkeypatch.setattr(HoldWatch, "_tell", lambda *_: None)
    assert any("BRK-13 should have come" in each for each in _violations("B13", Phase.HOLD, -6.0, -75.0))


def test_a_torque_that_is_still_enough_stops_nothing_and_one_that_is_not_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Row B8 leaves 8 of 400 N m: where the moment of the load helps, from -105 deg on, the axis needs no more."""
    assert _violations("B8", Phase.CRUISE, 3.0, -105.0) == []
    assert _violations("B8", Phase.CRUISE, 3.0, 15.0) == []
    # From 165 deg on it is enough to the target, and the ramp there (4.6 deg) is the program's own.
    at_end = Cell(fault_case("B8"), "bus", Phase.CRUISE, 3.0, 165.0, 10.0, "drive")
    assert run_cell(at_end)["violations"] == []
    _only_warn(monkeypatch, Code.CTL_07, Code.CTL_03, Code.DRV_13, Code.CTL_05)
    assert _violations("B8", Phase.CRUISE, 3.0, 15.0)


def test_a_set_point_that_follows_an_axis_which_gives_way_hides_no_deviation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The axis would do what it is told, whatever it does."""
    true = Axis.end

    def follows(self: Axis) -> OutputImage:
        output = true(self)
        if not self.virtual.at_rest:
            self.virtual.vel_ref_rad_s = self.feedback.vel_rad_s
        return output

    monkeypatch.setattr(Axis, "end", follows)
    _only_warn(monkeypatch, Code.CTL_07, Code.CTL_03, Code.DRV_13, Code.CTL_05)
    assert any("moved" in each for each in _violations("B8", Phase.CRUISE, 3.0, 15.0))


def test_a_winding_that_is_too_hot_is_judged_from_its_alarm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Row G12, a sensor read every 100 ms: the way begins with the alarm; an alarm that stops nothing is found."""
    assert _violations("G12", Phase.DECELERATION, 6.0, 135.0) == []
    _only_warn(monkeypatch, Code.THM_04)
    assert _violations("G12", Phase.CRUISE, 6.0, 135.0)


def _powers_by_level(patch: pytest.MonkeyPatch) -> None:
    """Enable that stands before a reset switches on behind it."""
    true = Power.__call__

    def call(self: Power, *, enable: bool) -> None:
        true(self, enable=enable)
        if enable and self.axis.is_off:
            self.axis.power_on()

    patch.setattr(Power, "__call__", call)


@pytest.mark.parametrize("power_s", [5.0, 5.004])
def test_power_is_asked_for_behind_a_reset_in_a_later_scan_than_it(
    power_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The alarms clear in the scan after the reset; power that is asked for there has been asked for behind it."""
    deeds = (
        Action(at_s=0.2, do="power"), Action(at_s=2.4, do="quick_stop", for_s=0.2), Action(at_s=4.0, do="power_off"),
        Action(at_s=5.0, do="reset"), Action(at_s=power_s, do="power"),
    )  # fmt: skip
    scene = Scenario(actions=deeds, duration_s=6.0)
    assert play(scene).ok
    _powers_by_level(monkeypatch)
    assert play(scene).ok is (power_s > 5.0)


@pytest.mark.parametrize("told", [True, False])
def test_a_stuck_drive_that_a_wrong_sign_drives_through_its_brake_must_be_told(
    told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """D3 with A15b: 385 N m against a closed brake, and no relay in the supply of a drive in process."""
    deeds = (
        Action(at_s=0.2, do="power"),
        Action(at_s=2.4, do="move", target_deg=5.0, speed_deg_s=1.0),
    )
    faults = (PlannedFault(number="D3", at_s=3.0), PlannedFault(number="A15b", at_s=5.0))
    if not told:
        monkeypatch.setattr(PowerSequence, "_torque_kept", lambda self, limit: None)
    played = play(Scenario(actions=deeds, faults=faults, duration_s=6.0))
    assert ("INV-1" in {each.invariant for each in played.violations}) is not told


def test_a_loop_through_the_ring_answers_no_more_than_that_has_corrected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Row B8 at standstill, the encoder on the ring: 0.0001 deg of its correction ask for 0.051 deg/s, not for 0.2.

    Friction holds the motor, so nothing but the wire shows what is asked of it.
    """
    at = Cell(fault_case("B8"), "bus", Phase.ENABLED, 6.0, -165.0, 10.0, "drive", beside=True)
    assert run_cell(at)["violations"] == []
    true, scans = LoadSide.scan, [0]

    def creeping(self: LoadSide, virtual: VirtualAxis, counts: float) -> Command:
        vel, pos, error = true(self, virtual, counts)
        scans[0] += self._feedback.torque_limited
        return vel + rad(min(0.2, 0.01 * scans[0])) * 1144.0, pos, error

    monkeypatch.setattr(LoadSide, "scan", creeping)
    assert any("nobody asks for it" in each for each in run_cell(at)["violations"])


def _runs_away_by_a_frozen_encoder(patch: pytest.MonkeyPatch) -> None:
    _blind_to_a_frozen_encoder(patch)
    _only_warn(patch, Code.CTL_03, Code.CTL_05, Code.CTL_07, Code.DRV_07, Code.DRV_13)
    patch.setattr(drag, "_GRIPS_SHARE", math.inf)  # BRK-02 takes the torque off whatever its row says


def _goes_on_behind_its_alarm(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(PowerSequence, "react", lambda self, reaction: None)


@pytest.mark.parametrize(
    ("fault", "plant", "invariant"),
    [("A2", _runs_away_by_a_frozen_encoder, "INV-3"), ("G7", _goes_on_behind_its_alarm, "INV-1")],
)
def test_a_load_that_motor_and_brake_hold_excuses_nothing(
    fault: str, plant: Plant, invariant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Row B7 at 71 deg in motion, 3 deg/s: nowhere more than 182 N m of the 400 of the brake; then another fault."""
    deeds = (
        Action(at_s=0.2, do="power"),
        Action(at_s=2.4, do="move", target_deg=20.0, speed_deg_s=3.0),
    )
    faults = (PlannedFault(number="B7", at_s=5.0), PlannedFault(number=fault, at_s=6.2))
    scene = Scenario(angle_deg=80.0, ramp_deg_s2=2.0, actions=deeds, faults=faults, duration_s=8.0)
    assert play(scene).ok
    plant(monkeypatch)
    assert invariant in {each.invariant for each in play(scene).violations}


@pytest.mark.parametrize(("row", "may"), [("C3", True), ("C11", False), ("C5", False)])
def test_only_a_brake_without_torque_lets_the_motor_give_more_than_the_proof(row: str, may: bool) -> None:
    """A brake that is late, or that stays closed, holds the load while the torque is proven."""
    assert may_come_first(Code.DRV_14, fault_case(row)) is may


def test_a_quick_stop_that_was_asked_for_excuses_itself_alone() -> None:
    judge = Judge.__new__(Judge)
    judge._cases = []
    for asked in (True, False):
        judge._quick_stop_asked = asked
        assert [judge._caused(code) for code in (Code.INT_06, Code.DRV_01, Code.ENC_02)] == [
            asked,
            False,
            False,
        ]
