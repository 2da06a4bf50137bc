"""The axis of a service from the command line, command by command, at a service that is played by the test."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import pytest

from gantryctl.cli.axis import move as move_command
from gantryctl.cli.axis import service_axis
from gantryctl.cli.axis.service_axis import ServiceAxis, held_codes
from gantryctl.errors import AlarmStop, CommandRefused
from gantryctl.machine import default_machine, short_hash
from gantryctl.operation.client import Ending, Stop
from gantryctl.program import BrakeTestOutcome
from gantryctl.service.clients.link import Refused
from support.command_line import cli

MACHINE = default_machine()
AT_REST: dict[str, Any] = {
    "config_hash": short_hash(MACHINE), "machine": MACHINE.name, "authority_user": "", "authority_client": "",
    "at_rest": True, "in_position": True, "power": True, "power_phase": "on", "pos_act_deg": 10.0,
    "target_deg": 10.0, "time_s": 5.0, "speed_max_deg_s": 6.0, "quick_dec_deg_s2": 3.0, "alarms": [],
    "alarm_count": 0, "speed_setting_deg_s": 2.0, "override_percent": 40.0, "journal_sequence": 100,
    "reset_locked": False, "blocked_by": "", "blocked_by_messages": [], "second_person": False,
    "brake_tests": 3, "brake_test_phase": "idle", "brake_test_result": "passed", "brake_test_text": "old",
    "brake_test_level_nm": 90.0, "brake_test_plus_nm": 91.0, "brake_test_minus_nm": -92.0,
    "brake_test_moved_deg": 0.01, "brake_test_limit_deg": 0.05, "brake_test_due_at": "",
    "brake_test_cycles_left": 7, "brake_test_overdue": False, "epoch": 7,
    "mode": "incremental",
}  # fmt: skip


class Link:
    """A connection whose tags change by what is asked, and by themselves with every look.

    Attributes:
        does: tags by kind of command. asked: kinds with their values, in their order. modes: that were asked for.
        looks: tags of the looks to come, each on top of those before. lets_go: why the service lets a held key go.
    """

    client = "me"
    lets_go: Refused | None = None
    signs_of_life = 0

    def __init__(self, **tags: Any) -> None:
        self.tags = {**AT_REST, **tags}
        self.does: dict[str, dict[str, Any]] = {"give": {"authority_client": ""}}
        self.asked: list[Any] = []
        self.modes: list[str] = []
        self.looks: list[dict[str, Any]] = []
        self.when_looked: Callable[[], None] = lambda: None

    def __enter__(self) -> Link:
        return self

    def __exit__(self, *_: object) -> None:
        self.asked.append("left")

    def ask(self, kind: str, **values: Any) -> dict[str, Any]:
        if kind == "set":
            self.asked.append((values["tag"], values["value"]))
            self.tags[values["tag"]] = values["value"]
        else:
            self.asked.append(kind)
            self.modes += [values["mode"]] if kind == "mode" else []
        self.tags.update(self.does.get(kind, {}))
        return {"journal": 100, "epoch": self.tags["epoch"]}

    def hold(self, forward: bool, seconds: float, stopped: object) -> Refused | None:
        self.asked.append("hold")
        self.tags.update(self.does.get("hold", {}))
        return self.lets_go

    def look(self) -> dict[str, Any]:
        if self.looks:
            self.tags.update(self.looks.pop(0))
        self.when_looked()
        return self.tags

    def alive(self) -> None:
        self.signs_of_life += 1


def axis_of(link: Link, monkeypatch: pytest.MonkeyPatch, *, take_over: bool = False) -> ServiceAxis:
    monkeypatch.setattr(service_axis, "ServiceLink", lambda *_: link)
    return ServiceAxis(MACHINE, take_over=take_over)


def test_a_move_borrows_speed_and_override_and_gives_both_back(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Link()
    link.does["move"] = {"at_rest": False, "pos_act_deg": 15.0}
    link.looks = [{}, {}, {"at_rest": True, "in_position": False}, {"in_position": True, "pos_act_deg": 20.0}]
    link.looks.append({"time_s": 9.0})
    axis = axis_of(link, monkeypatch)
    report = axis.move(20.0, 6.0, 0.5)
    assert (report.ending, report.start_deg, report.end_deg) == (Ending.DONE, 10.0, 20.0)
    assert [each for each in link.asked if each != "left"] == [
        "take",
        ("speed_setting_deg_s", 6.0),
        ("override_percent", 50.0),
        "move",
        ("speed_setting_deg_s", 2.0),
        ("override_percent", 40.0),
    ]


@pytest.mark.parametrize(
    ("tags", "after"),
    [
        ({}, [("speed_setting_deg_s", 2.0), "mode"]),
        ({"mode": "continuous"}, [("speed_setting_deg_s", 2.0)]),
        ({"authority_client": "other"}, []),
    ],
)
def test_a_jog_borrows_speed_and_mode_and_gives_both_back(
    monkeypatch: pytest.MonkeyPatch, tags: dict[str, Any], after: list[Any]
) -> None:
    """Not to whoever has taken control meanwhile."""
    link = Link(mode=tags.pop("mode", "incremental"))
    link.does["hold"] = {"authority_user": "otto", **tags} if tags else {}
    with nullcontext() if not tags else pytest.raises(CommandRefused, match="otto"):
        axis_of(link, monkeypatch).jog(True, 6.0, 5.0)
    assert [each for each in link.asked if each != "left"] == [
        "take", "mode", ("speed_setting_deg_s", 6.0), "hold", *after,
    ]  # fmt: skip
    assert link.modes == ["continuous", "incremental"][: 1 + ("mode" in after)]


def test_a_move_that_was_stopped_is_not_done(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C on the way, and a second one before the axis stands."""
    link = Link()
    link.does["move"] = {"at_rest": False}
    axis = axis_of(link, monkeypatch)
    link.looks = [{}, {}, {}, {}, {"at_rest": True, "in_position": False}]
    asks = iter((Stop.NO, Stop.NO, Stop.RAMP, Stop.QUICK))

    def pressed() -> None:
        axis.stop = next(asks, Stop.QUICK)

    link.when_looked = pressed
    assert axis.move(20.0).ending is Ending.STOPPED
    assert [kind for kind in link.asked if kind in ("stop", "quick_stop")] == ["stop", "quick_stop"]


@pytest.mark.parametrize("ended_by", [{"epoch": 8}, {"power": False}])
@pytest.mark.parametrize("command", ["move", "jog"])
def test_what_somebody_else_has_ended_is_not_done(
    monkeypatch: pytest.MonkeyPatch, command: str, ended_by: dict[str, Any]
) -> None:
    """Stop or power off from a page: the axis stands in position where it was stopped, 3 of 10 deg further."""
    link = Link()
    axis = axis_of(link, monkeypatch)
    link.does[{"move": "move", "jog": "hold"}[command]] = {"at_rest": False}
    link.looks = [{}, {}, {"pos_act_deg": 13.0, "at_rest": True, **ended_by}]
    report = axis.move(20.0) if command == "move" else axis.jog(True, 2.0, 5.0)
    assert (report.ending, report.end_deg) == (Ending.STOPPED, 13.0)


def test_a_key_that_the_service_has_let_go_was_not_held_for_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Link()
    link.lets_go = Refused("SEC-09", "the lease ran out")
    with pytest.raises(CommandRefused, match="SEC-09 · the lease ran out"):
        axis_of(link, monkeypatch).jog(True, 2.0, 5.0)


def test_what_the_next_holder_does_is_not_followed_and_keeps_its_power_and_settings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The console of the machine has taken control from this command, and moves."""
    link = Link(power=False, power_phase="off")
    axis = axis_of(link, monkeypatch)
    link.does |= {"power": {"power": True, "power_phase": "on"}, "move": {"at_rest": False}}
    axis.power_up()
    link.looks = [{}, {}, {}, {"authority_client": "other", "authority_user": "otto", "epoch": 8}]
    with pytest.raises(CommandRefused, match="SEC-07 · otto has taken control"):
        axis.move(20.0)
    axis.power_down()
    axis.close("refused")
    assert link.asked == [
        "take", "power", ("speed_setting_deg_s", 6.0), ("override_percent", 100.0), "move", "left"
    ]  # fmt: skip


def test_what_moves_is_left_alone_or_stands_before_anything_is_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Link(at_rest=False, target_deg=50.0)
    with pytest.raises(CommandRefused, match=r"moves to 50\.00 deg"):
        axis_of(link, monkeypatch).take()
    assert "stop" not in link.asked
    link = Link(at_rest=False)
    link.looks = [{}, {"pos_act_deg": 29.0}, {"at_rest": True, "pos_act_deg": 30.0}]
    assert axis_of(link, monkeypatch, take_over=True).take() == 30.0
    assert link.asked == ["take", "stop"]


def test_power_goes_off_under_the_control_of_who_has_switched_it_on(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Link(power=False, power_phase="off")
    link.does["power"] = {"power": True, "power_phase": "on"}
    axis = axis_of(link, monkeypatch)
    axis.power_up()
    axis.close("done")
    assert link.asked == ["take", "power", "power", "give", "left"]
    link = Link()
    axis = axis_of(link, monkeypatch)
    axis.power_up()
    axis.close("done")
    assert link.asked == ["take", "give", "left"], "power that was on belongs to somebody else"


def test_the_alarm_that_stopped_the_axis_is_told_and_not_one_that_followed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rows = [
        {"first_out": False, "severity": "STOP", "code": "DRV-01", "text": "DRV-01 STOP"},
        {"first_out": True, "severity": "STOP", "code": "CTL-03", "text": "CTL-03 STOP"},
    ]
    link = Link()
    link.does["move"] = {"at_rest": False}
    link.looks = [{}, {}, {"power": False, "alarms": rows}]
    with pytest.raises(AlarmStop) as stopped:
        axis_of(link, monkeypatch).move(20.0)
    assert stopped.value.code == "CTL-03"


def test_a_brake_test_has_a_result_once_this_command_has_made_one(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Link()
    axis = axis_of(link, monkeypatch)
    axis.tags = link.tags
    assert axis.brake_test_report().outcome is BrakeTestOutcome.NONE
    link.does["brake_test"] = {"brake_test_phase": "enabling"}
    link.looks = [{}, {}, {"brake_test_phase": "idle"}, {"brake_tests": 4, "brake_test_result": "failed"}]
    assert axis.test_brake().outcome is BrakeTestOutcome.FAILED
    assert link.asked == ["take", "arm", "brake_test"]


def test_a_brake_test_that_was_refused_has_no_result(monkeypatch: pytest.MonkeyPatch) -> None:
    """That of an earlier one is in the tags."""
    link = Link()
    axis = axis_of(link, monkeypatch)
    ask = link.ask

    def refuse(kind: str, **values: Any) -> dict[str, Any]:
        if kind == "brake_test":
            raise CommandRefused("SEC-10 · arm it first")
        return ask(kind, **values)

    monkeypatch.setattr(link, "ask", refuse)
    with pytest.raises(CommandRefused, match="SEC-10"):
        axis.test_brake()
    report = axis.brake_test_report()
    assert report.outcome is BrakeTestOutcome.NONE
    # Nor what that one has borne: it would stand under the date of this refusal.
    assert (report.detail, report.moved_deg) == ("", 0.0)
    assert math.isnan(report.plus_nm)
    assert math.isnan(report.minus_nm)


def test_no_power_comes_for_a_jog_that_cannot_be(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Link(power=False, power_phase="off")
    link.does["power"] = {"power": True, "power_phase": "on"}
    with pytest.raises(CommandRefused, match="speed"):
        axis_of(link, monkeypatch).jog(True, 60.0, 1.0)
    with pytest.raises(CommandRefused, match="180"):
        axis_of(Link(power=False, pos_act_deg=180.0), monkeypatch).jog(True, 1.0, 1.0)
    assert link.asked == ["take"]


def test_a_way_that_leads_beyond_travel_is_refused_before_power_comes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """From 10 deg 175 deg on; the other way round it is possible."""
    link = Link(power=False, power_phase="off")
    with pytest.raises(CommandRefused, match=r"target 185\.00 deg is beyond"):
        axis_of(link, monkeypatch).move_by(175.0)
    assert "power" not in link.asked


def test_who_waits_for_the_end_of_a_motion_keeps_control_by_signs_of_life(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One with each look that has not shown the end."""
    link = Link()
    link.does["move"] = {"at_rest": False}
    link.looks = [{}, {}, {}, {}, {"at_rest": True}]
    axis_of(link, monkeypatch).move(20.0)
    assert link.signs_of_life == 3


@pytest.mark.parametrize("way", [["20"], ["--by", "10"]])
def test_a_move_that_nobody_is_asked_about_tells_its_way_and_its_quick_stop(
    monkeypatch: pytest.MonkeyPatch, way: list[str]
) -> None:
    """From 10 to 20 deg at 6 deg/s with 3 deg/s2."""
    monkeypatch.setattr(service_axis, "ServiceLink", lambda *_: Link())
    told = cli("move", "--service", "--yes", *way).out
    assert "from 10.000 to 20.000 deg, way 10.000 deg at 6 deg/s, a quick stop takes 6.00 deg" in told


def test_a_reset_that_nothing_has_followed_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Link(alarms=[{"code": "INT-03"}], alarm_count=1)
    assert axis_of(link, monkeypatch).reset() == "nothing to reset; still there: INT-03"


def test_a_lock_that_nobody_has_looked_at_is_not_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Link()
    axis = axis_of(link, monkeypatch)
    axis.look()
    axis.tags = dict(axis.tags)
    link.tags["reset_locked"] = True
    with pytest.raises(CommandRefused, match="look, then ask again"):
        axis.reset()
    assert not {"arm", "reset"} & set(link.asked)


def test_a_reset_names_what_has_gone_and_what_has_stayed(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Link(alarms=[{"code": "CTL-03"}, {"code": "INT-03"}], alarm_count=2)
    link.does["reset"] = {"alarms": [{"code": "INT-03"}], "alarm_count": 1}
    assert axis_of(link, monkeypatch).reset() == "CTL-03 reset; still there: INT-03"


def test_another_configuration_or_holder_is_refused_before_control_is_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for tags, words in (
        ({"config_hash": "x"}, "the service runs"),
        ({"authority_user": "otto"}, "otto has control"),
    ):
        link = Link(**tags)
        with pytest.raises(CommandRefused, match=words):
            axis_of(link, monkeypatch).take()
        assert "take" not in link.asked
    link = Link(authority_user="otto")
    axis_of(link, monkeypatch, take_over=True).take()
    assert link.asked == ["take"]


def test_the_question_before_a_move_names_the_stop_of_the_drive_as_it_was_measured(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """6 deg/s with 3 deg/s2: 36 / 6 = 6 deg; the machine file has 5.4 deg/s2, 3.33 deg."""
    axis = axis_of(Link(), monkeypatch)
    asked = move_command._way(axis, 10.0, -100.0, 6.0, None, None)
    assert asked.endswith(
        "from 10.000 to -100.000 deg, way 110.000 deg at 6 deg/s, a quick stop takes 6.00 deg"
    )
    asked = move_command._way(axis, 170.0, -170.0, 3.0, None, None)
    assert asked.endswith("a quick stop takes 1.50 deg; 340 deg the long way: cable")
    with pytest.raises(CommandRefused, match="beyond"):
        move_command._way(axis, 10.0, 200.0, 6.0, None, None)


@pytest.mark.parametrize("moved_deg", [0.02, -0.02])
def test_an_axis_that_has_moved_while_a_person_was_asked_is_asked_for_again(moved_deg: float) -> None:
    move_command._check_unmoved(MACHINE, 10.0, 10.0 + 0.4 * moved_deg)
    with pytest.raises(CommandRefused, match="look, then ask again"):
        move_command._check_unmoved(MACHINE, 10.0, 10.0 + moved_deg)


NOT_HELD = [{"first_out": True, "severity": "STOP", "code": "BRK-03", "text": "BRK-03 STOP"}]


@pytest.mark.parametrize("way", ["up", "down", "switched off"])
def test_a_load_that_torque_alone_holds_ends_the_waiting_for_power(
    monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    """The power sequence goes no further; of a service nothing else has to wait, which goes on holding it."""
    link = Link(power=way != "up", power_phase="off" if way == "up" else "on")
    axis = axis_of(link, monkeypatch)
    axis.take()
    link.looks = [{}, {"power": False, "power_phase": "torque_hold", "alarms": NOT_HELD}]
    looked = 0

    def endless() -> None:
        nonlocal looked
        looked += 1
        assert looked < 100, "it waits for what does not come"

    link.when_looked = endless
    axis._powered = way == "down"
    ask = {"up": axis.power_up, "down": axis.power_down, "switched off": lambda: axis.switch(on=False)}[way]
    with pytest.raises(AlarmStop, match="BRK-03"):
        ask()


@pytest.mark.parametrize("lets_go_s", [0.8, None])
def test_a_brake_is_watched_for_a_second_behind_the_power_down(
    monkeypatch: pytest.MonkeyPatch, lets_go_s: float | None
) -> None:
    link = Link()
    axis = axis_of(link, monkeypatch)
    axis.take()
    axis._powered = True
    link.does["power"] = {"power": False, "power_phase": "off"}
    begun_s = link.tags["time_s"]

    def goes_on() -> None:
        link.tags["time_s"] += 0.05
        if lets_go_s is not None and link.tags["time_s"] - begun_s > lets_go_s:
            link.tags.update(power_phase="torque_hold", alarms=NOT_HELD)

    link.when_looked = goes_on
    if lets_go_s is None:
        axis.power_down()
        assert link.tags["time_s"] - begun_s == pytest.approx(1.0, abs=0.21)
    else:
        with pytest.raises(AlarmStop, match="BRK-03"):
            axis.power_down()


def test_power_that_somebody_has_switched_off_again_is_not_on(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Link(power=False, power_phase="off")
    link.looks = [{}, {"power_phase": "enabling"}, {"power_phase": "off"}]
    with pytest.raises(CommandRefused, match="power stays off: it was switched off again"):
        axis_of(link, monkeypatch).switch(on=True)


def test_an_angle_that_is_not_known_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CommandRefused, match="the angle is not known"):
        axis_of(Link(pos_act_deg=None), monkeypatch).take()


def test_the_second_person_is_waited_for_and_no_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a second here: ten frames of 50 ms."""
    monkeypatch.setattr(service_axis, "_OTHER_S", 0.5)
    link, looked = Link(second_person=True, armed_action="none"), 0

    def seen() -> None:
        nonlocal looked
        looked += 1
        assert looked < 50, "it waits without an end"

    link.when_looked = seen
    with pytest.raises(CommandRefused, match="SEC-10 · nobody has armed brake-test"):
        axis_of(link, monkeypatch).test_brake()
    assert link.asked == ["take"]
    assert looked >= 10


def test_codes_that_hold_the_axis_are_those_of_its_alarms_and_of_earlier_stops() -> None:
    """What the program says is words without a code of its own; a text has none at all."""
    earlier = {"reason": "SYS-12", "values": {"stopped_by": "BRK-04"}}
    latched = {"words": "LATCHED", "values": {"code": "INT-06"}}
    told = [earlier, latched, {"reason": "ENC-09", "values": {}}, "the axis is being commissioned"]
    assert held_codes({**AT_REST, "alarms": [{"code": "INT-06"}], "blocked_by_messages": told}) == [
        "INT-06",
        "BRK-04",
        "ENC-09",
    ]


def test_tags_of_before_a_command_say_nothing_of_what_it_did(monkeypatch: pytest.MonkeyPatch) -> None:
    """The reply is faster than the tags: power that is asked for is "off" in those of before, as power that failed."""
    link = Link(power=False, power_phase="off", journal_sequence=99)
    link.looks = [*({} for _ in range(4)), {"journal_sequence": 100, "power_phase": "enabling"}]
    link.looks.append({"power_phase": "on", "power": True})
    assert axis_of(link, monkeypatch).switch(on=True)
    assert [each for each in link.asked if each != "left"] == ["take", "power", "give"]


def test_a_command_leaves_when_the_tags_show_that_control_is_free(monkeypatch: pytest.MonkeyPatch) -> None:
    """The next command reads there who has it, and would be refused."""
    link = Link()
    link.does = {"take": {"authority_client": "me"}, "give": {}}
    axis = axis_of(link, monkeypatch)
    axis.take()
    link.looks = [{}, {}, {"authority_client": ""}]
    axis.close("done")
    assert link.asked == ["take", "give", "left"]
    assert link.tags["authority_client"] == ""


@pytest.mark.parametrize(
    ("signals", "ending"),
    [(["SIGHUP"], Ending.HUNG_UP), (["SIGINT", "SIGHUP"], Ending.STOPPED), (["SIGINT"], Ending.STOPPED)],
)
def test_a_terminal_that_is_lost_behind_ctrl_c_does_not_rename_the_stop(
    monkeypatch: pytest.MonkeyPatch, signals: list[str], ending: Ending
) -> None:
    """Who pressed Ctrl-C has stopped it, though the terminal was closed before the axis stood."""
    link = Link()
    axis = axis_of(link, monkeypatch)
    link.does["move"] = {"at_rest": False}
    link.looks = [{}, {}, {}, {}, {"at_rest": True}]

    def action(axis: ServiceAxis) -> Any:
        for name in signals:
            signal.raise_signal(getattr(signal, name))
        return axis.move(20.0)

    report, failure = move_command.guarded(axis, action)
    assert (report and report.ending, failure) == (ending, None)
