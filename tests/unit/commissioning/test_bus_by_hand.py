"""Telegrams and times of a bus by hand: counts that wrap, the worst telegram, the scans until a command shows."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import steps_bus
from gantryctl.commissioning.results import Outcome
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.errors import CommandRefused
from gantryctl.image import DriveRequest, DriveState
from gantryctl.machine import Machine, with_values
from gantryctl.operation.home_reference import AbsoluteReading, RestVerdict
from unit.commissioning.hand_drive import MACHINE, HandDrive, answering, context, enabled, opens

SPAN = 2**31


def judged(monkeypatch: pytest.MonkeyPatch, step: str, drive: HandDrive, machine: Machine = MACHINE) -> Any:
    monkeypatch.setattr(steps_bus, "open_loop_axis", opens(drive))
    monkeypatch.setattr(
        steps_bus, "judge_statuswords", lambda samples: SimpleNamespace(agree=True, text="agrees")
    )
    monkeypatch.setattr(steps_bus, "_statusword_sample", lambda axis, scan: None)
    return getattr(steps_bus, step)(context(machine))


def test_parameters_that_the_drive_refuses_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    @contextmanager
    def refused(*_: object) -> Iterator[None]:
        raise CommandRefused("607F:00 is 1000, 1239 is wanted")
        yield

    monkeypatch.setattr(steps_bus, "open_loop_axis", refused)
    found = steps_bus.parameters(context())
    assert (found.outcome, found.proof) == (Outcome.FAILED, "607F:00 is 1000, 1239 is wanted")


@pytest.mark.parametrize(
    ("pdo", "sdo", "apart"),
    [
        (10, 10, 0),
        (10, 400, 390),
        (400, 10, 390),
        (SPAN - 5, 5, 10),
        (5, SPAN - 5, 10),
        (2000, 10, 1990),
        # As far on the other side of 0: a telegram with the wrong sign.
        (-400, 400, 800),
        (10, 2000, 1990),
    ],
)
def test_positions_of_telegram_and_sdo_are_the_shorter_way_apart(
    monkeypatch: pytest.MonkeyPatch, pdo: int, sdo: int, apart: int
) -> None:
    """A thousandth of a turn of 524 288 increments is 524; 4096 turns are 2^31."""
    drive = bus_drive(pdo, sdo)
    found = judged(monkeypatch, "process_data", drive)
    assert found.number("apart_increments") == apart
    assert (found.outcome is Outcome.PASSED) is (apart < 524)


@pytest.mark.parametrize(
    ("missed", "passes"),
    [((0, 0), True), ((0, 500), False), ((500, 0), False), ((10, 10), True), ((0, 11), False)],
)
def test_the_worst_telegram_decides(
    monkeypatch: pytest.MonkeyPatch, missed: tuple[int, ...], passes: bool
) -> None:
    """Half of 1000 telegrams; one in a hundred may be missed."""
    drive = bus_drive(0, 0, missed)
    drive.health().late = (3, 20)  # type: ignore[attr-defined]
    found = judged(monkeypatch, "process_data", drive)
    assert "2.00 % late" in found.proof
    assert found.number("missed_ratio") == max(missed) / 1000
    assert (found.outcome is Outcome.PASSED) is passes


@pytest.mark.parametrize(("scans", "passes"), [(1, True), (5, True), (6, False), (60, False)])
def test_a_command_that_shows_too_late_fails(
    monkeypatch: pytest.MonkeyPatch, scans: int, passes: bool
) -> None:
    drive = bus_drive(0, 0)
    write, asked = drive.write, [0]

    def late(output: Any) -> None:
        asked[0] += output.request.name == "ENABLE"
        write(output if asked[0] >= scans else output._replace(request=type(output.request).DISABLE))

    drive.write = late  # type: ignore[method-assign]
    answering(drive, 0.001)
    found = judged(monkeypatch, "sync", drive)
    assert found.number("dead_scans") == scans
    assert (found.outcome is Outcome.PASSED) is passes


def test_a_drive_that_is_never_enabled_is_waited_for_a_hundred_scans(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = bus_drive(0, 0)
    write = drive.write
    drive.write = lambda output: write(output._replace(request=DriveRequest.DISABLE))  # type: ignore[method-assign]
    answering(drive, 0.001)
    found = judged(monkeypatch, "sync", drive)
    assert (found.outcome, found.number("dead_scans")) == (Outcome.FAILED, 100.0)


def test_a_drive_that_is_not_off_shows_no_dead_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drive in its fault has left Switch on disabled before any command: 0 scans would be a proof of nothing."""
    drive = bus_drive(0, 0)
    drive.spoil = lambda seen: seen._replace(state=DriveState.FAULT)
    answering(drive, 0.001)
    found = judged(monkeypatch, "sync", drive)
    assert (found.outcome, found.figures) == (Outcome.FAILED, {})
    assert "the drive is in fault" in found.proof


@pytest.mark.parametrize(("received", "missed", "part"), [(0, 0, 0.0), (0, 1, 1.0), (1, 1, 0.5)])
def test_a_node_of_few_telegrams_has_missed_its_part(
    monkeypatch: pytest.MonkeyPatch, received: int, missed: int, part: float
) -> None:
    drive = bus_drive(0, 0)
    node = SimpleNamespace(
        watch=SimpleNamespace(missed=missed, received=received), identity=SimpleNamespace(text="maker"),
        remote=SimpleNamespace(node=3), compare=list,
    )  # fmt: skip
    drive.beside = SimpleNamespace(nodes=[node])  # type: ignore[attr-defined]
    found = judged(monkeypatch, "nodes", drive, with_values(MACHINE, {"can.io.node": 3}))
    assert found.number("node_3_missed_ratio") == part


def test_a_statusword_by_sdo_stands_between_two_telegrams() -> None:
    """6041 is read behind the first one; three scans later comes the second."""
    drive, axis = enabled()
    drive.sdo.values[0x6041] = 0x0250
    drive.process.statusword = 0x0237
    begun, write = len(drive.wrote), drive.write

    def turned(output: Any) -> None:
        write(output)
        drive.process.statusword = 0x0231 + len(drive.wrote) - begun

    drive.write = turned  # type: ignore[method-assign]
    assert steps_bus._statusword_sample(axis, 3) == (0x0237, 0x0250, 0x0234)
    assert [output.request for output in drive.wrote[begun:]] == [DriveRequest.DISABLE] * 3


@pytest.mark.parametrize(("answer_ms", "passes"), [(2.9, True), (3.1, False)])
def test_answers_that_leave_the_program_too_little_of_the_scan_fail(
    monkeypatch: pytest.MonkeyPatch, answer_ms: float, passes: bool
) -> None:
    """Three quarters of 4 ms, of a bus that runs by the clock."""
    drive = bus_drive(0, 0)
    answering(drive, 1e-3 * answer_ms)
    machine = with_values(MACHINE, {"can.interface": "socketcan", "can.channel": "can0"})
    found = judged(monkeypatch, "sync", drive, machine)
    assert found.number("answer_p99_ms") == pytest.approx(answer_ms)
    assert (found.outcome is Outcome.PASSED) is passes


def test_answers_of_a_drive_without_a_time_of_its_own_have_no_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """SYNC steps it: its answers are as late as this computer is busy."""
    drive = bus_drive(0, 0)
    answering(drive, 3.9e-3)
    found = judged(monkeypatch, "sync", drive)
    assert (found.outcome, found.figures["answer_p99_ms"].high) == (Outcome.PASSED, None)


def test_one_answer_in_a_hundred_that_is_late_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """99 after 1 ms and one after 3.5 ms, of 4 ms."""
    drive = bus_drive(0, 0)
    answering(drive, 0.0035, *[0.001] * 99)
    machine = with_values(MACHINE, {"can.interface": "socketcan", "can.channel": "can0"})
    found = judged(monkeypatch, "sync", drive, machine)
    assert (found.number("answer_p50_ms"), found.number("answer_p99_ms")) == pytest.approx((1.0, 3.5))
    assert found.outcome is Outcome.FAILED
    # What was asked for to see the dead time is taken back.
    assert [output.request for output in drive.wrote[-5:]] == [DriveRequest.DISABLE] * 5


@pytest.mark.parametrize(("late", "passes"), [(1, False), (0, True)])
def test_answers_that_no_scan_has_waited_for_are_no_quick_ones(
    monkeypatch: pytest.MonkeyPatch, late: int, passes: bool
) -> None:
    """One in a hundred comes behind the 2 ms of `answer_ms`: in its scan the axis goes by what was a scan before."""
    drive = answering(bus_drive(0, 0), *[math.inf] * late, *[0.001] * (100 - late))
    machine = with_values(MACHINE, {"can.interface": "socketcan", "can.channel": "can0"})
    found = judged(monkeypatch, "sync", drive, machine)
    assert (found.outcome is Outcome.PASSED) is passes
    assert (found.figures["answer_p99_ms"].value is None) is not passes


def test_what_was_answered_before_the_watch_is_no_part_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Quick answers of the set-up, of before the bus was watched."""
    drive = answering(bus_drive(0, 0), 0.001)
    drive.process.answer_times_s += [0.0001] * 1000
    assert judged(monkeypatch, "sync", drive).number("answer_p99_ms") == pytest.approx(1.0)


@pytest.mark.parametrize(("inverted", "pdo"), [(False, 400), (True, SPAN - 400)])
def test_a_position_by_sdo_has_the_sign_of_the_machine_file(
    monkeypatch: pytest.MonkeyPatch, inverted: bool, pdo: int
) -> None:
    drive = bus_drive(pdo, 400)
    drive.settings.inverted = inverted
    assert judged(monkeypatch, "process_data", drive).number("apart_increments") == 0
    drive.settings.inverted = not inverted
    assert judged(monkeypatch, "process_data", drive).number("apart_increments") == 800


def test_the_statusword_is_compared_eight_times_after_another_number_of_scans_each(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A bit that toggles is not met in step."""
    scans: list[int] = []
    judge = SimpleNamespace(agree=False, text="differs")
    monkeypatch.setattr(steps_bus, "open_loop_axis", opens(bus_drive(0, 0)))
    monkeypatch.setattr(steps_bus, "_statusword_sample", lambda axis, count: scans.append(count))
    monkeypatch.setattr(steps_bus, "judge_statuswords", lambda samples: judge)
    assert steps_bus.process_data(context()).outcome is Outcome.FAILED
    assert scans == list(range(3, 11))


NODES: dict[str, dict[str, Any]] = {
    "an I/O node": {"can.io.node": 3},
    "a ring encoder": {"can.load_encoder.source": "node", "can.load_encoder.node": 3},
}


@pytest.mark.parametrize("beside", NODES)
@pytest.mark.parametrize(("missed", "passes"), [(10, True), (11, False)])
def test_a_node_may_miss_one_telegram_in_a_hundred(
    monkeypatch: pytest.MonkeyPatch, missed: int, passes: bool, beside: str
) -> None:
    drive = bus_drive(0, 0)
    node = SimpleNamespace(
        watch=SimpleNamespace(missed=missed, received=1000 - missed),
        identity=SimpleNamespace(text="maker"), remote=SimpleNamespace(node=3), compare=list,
    )  # fmt: skip
    drive.beside = SimpleNamespace(nodes=[node])  # type: ignore[attr-defined]
    found = judged(monkeypatch, "nodes", drive, with_values(MACHINE, NODES[beside]))
    assert (found.outcome is Outcome.PASSED) is passes
    assert judged(monkeypatch, "nodes", drive).outcome is Outcome.NOT_TESTABLE


def test_an_input_that_does_not_change_is_told_with_those_that_have(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wire at another bit; brake and watchdog are proven by the steps that move them, and nobody is asked for."""
    drive = bus_drive(0, 0)

    def levels() -> dict[str, bool]:
        later = len(drive.wrote) >= 60
        return {
            "brake_open": False,
            "watchdog_closed": True,
            "door_ok": True,
            "estop_ok": True,
            "mains_ready": later,
        }

    drive.beside = SimpleNamespace(inputs=SimpleNamespace(levels=levels))  # type: ignore[attr-defined]
    monkeypatch.setattr(steps_bus, "_BY_HAND_S", 0.4)
    found = judged(monkeypatch, "wiring", drive)
    assert found.outcome is Outcome.FAILED
    assert found.proof.startswith("door_ok (")
    assert found.proof.endswith("has not changed; mains_ready has")


@pytest.mark.parametrize("comes_back", [True, False])
def test_an_input_passes_when_it_has_changed_and_come_back(
    monkeypatch: pytest.MonkeyPatch, comes_back: bool
) -> None:
    """A switch that sticks after it was worked once is no switch."""
    drive = bus_drive(0, 0)

    def levels() -> dict[str, bool]:
        scans = len(drive.wrote)
        return {"door_ok": scans < 40 or (comes_back and scans >= 60), "estop_ok": scans < 70 or scans >= 80}

    drive.beside = SimpleNamespace(inputs=SimpleNamespace(levels=levels))  # type: ignore[attr-defined]
    monkeypatch.setattr(steps_bus, "_BY_HAND_S", 0.4)
    found = judged(monkeypatch, "wiring", drive)
    assert (found.outcome is Outcome.PASSED) is comes_back
    assert "door_ok" in found.proof
    assert found.proof.endswith("one after the other: door_ok, estop_ok") is comes_back


def test_an_input_whose_node_is_lost_for_a_while_has_not_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its level is not known then; the lost one is back before the time is over, as it was."""
    drive = bus_drive(0, 0)

    def levels() -> dict[str, bool]:
        return {"estop_ok": True} if 40 <= len(drive.wrote) < 60 else {"door_ok": True, "estop_ok": True}

    drive.beside = SimpleNamespace(inputs=SimpleNamespace(levels=levels))  # type: ignore[attr-defined]
    monkeypatch.setattr(steps_bus, "_BY_HAND_S", 0.4)
    found = judged(monkeypatch, "wiring", drive)
    assert found.outcome is Outcome.FAILED
    assert found.proof.startswith("door_ok (")


def bus_drive(pdo: int, sdo: int, missed: tuple[int, ...] = (0, 0)) -> HandDrive:
    drive = HandDrive()
    drive.sdo.values[0x6064] = sdo
    drive.process.counts = pdo
    encoder = {
        "inverted": False,
        "increments_per_turn": 524_288,
        "turns": 4096,
        "position_around_zero": False,
    }
    drive.settings = SimpleNamespace(**vars(drive.settings), **encoder)
    counters = SimpleNamespace(scans=1000, missed=missed, late=(0, 0))
    drive.health = lambda: counters  # type: ignore[attr-defined]
    return drive


@pytest.mark.parametrize(
    ("verdict", "angle_deg", "outcome"),
    [
        (RestVerdict.OK, 12.5, Outcome.PASSED),
        (RestVerdict.OK, None, Outcome.FAILED),
        (RestVerdict.MOVED, 12.5, Outcome.FAILED),
        (RestVerdict.OTHER_ENCODER, 12.5, Outcome.FAILED),
        (RestVerdict.TURNS, 12.5, Outcome.FAILED),
        (RestVerdict.NOT_VALID, 12.5, Outcome.FAILED),
    ],
)
def test_an_angle_that_is_read_but_not_valid_is_no_reference(
    monkeypatch: pytest.MonkeyPatch, verdict: RestVerdict, angle_deg: float | None, outcome: Outcome
) -> None:
    """Every limit is counted from it: a number alone does not do."""
    reading = AbsoluteReading("A", 0, 0, 0, angle_deg, 0.4, 90.0, 110.0, verdict)
    kept = SimpleNamespace(zero_set_by="anna", zero_witness="mark")
    seen = SimpleNamespace(retained=kept, reading=reading)
    monkeypatch.setattr(steps_bus, "read_only", lambda *_: nullcontext(seen))
    found = steps_bus.encoder(context())
    assert found.outcome is outcome
    assert ("zero set by anna (mark)" in found.proof) is (outcome is Outcome.PASSED)
    margins = {name: figure.value for name, figure in found.figures.items()}
    assert margins == (
        {"margin_minus_deg": 90.0, "margin_plus_deg": 110.0} if outcome is Outcome.PASSED else {}
    )


# Bit 7 is the warning; 0x0237 is operation enabled, 0x0208 a fault.
@pytest.mark.parametrize(
    ("samples", "agree", "text"),
    [
        (((0x237, 0x237, 0x237),) * 2, True, "agrees 2 times"),
        # A bit by SDO alone, in the first sample or in the last one.
        (((0x237, 0x2B7, 0x237), (0x237, 0x237, 0x237)), False, "differs in bits 7"),
        (((0x237, 0x237, 0x237), (0x237, 0x2B7, 0x237)), False, "differs in bits 7"),
        # It changes between two telegrams: before and after one reading, or from one sample to the next.
        (((0x237, 0x237, 0x2B7),), True, "agrees 1 times, bits 7 change by themselves and are not compared"),
        (((0x237, 0x237, 0x237), (0x2B7, 0x237, 0x2B7)), True, "agrees 2 times, bits 7 change by themselves"),
        (((0x237, 0x237, 0x208),), False, "agrees 1 times, the state itself changes (bits 0, 1, 2, 3, 5)"),
    ],
)
def test_a_statusword_is_the_same_by_telegram_and_by_sdo(
    samples: tuple[tuple[int, int, int], ...], agree: bool, text: str
) -> None:
    found = steps_bus.judge_statuswords([steps_bus.StatuswordSample(*each) for each in samples])
    assert found.agree is agree
    assert found.text.startswith(text)


@pytest.mark.parametrize(("before", "said"), [(None, False), ("maker 1", False), ("maker 2", True)])
def test_another_drive_than_the_last_one_is_told(
    monkeypatch: pytest.MonkeyPatch, before: str | None, said: bool
) -> None:
    drive = SimpleNamespace(
        identity=lambda: SimpleNamespace(name="a drive"), health=lambda: SimpleNamespace(drive_key="maker 1")
    )
    monkeypatch.setattr(steps_bus, "read_only", lambda *_: nullcontext(SimpleNamespace(drive=drive)))
    kept = None if before is None else SimpleNamespace(drive=before)
    monkeypatch.setattr(steps_bus, "load_record", lambda _: kept)
    monkeypatch.setattr(steps_bus, "record_path", lambda *_: None)
    monkeypatch.setattr(steps_bus, "_profile", lambda _: "no profile")
    c = with_store()
    proof = steps_bus.identity(c).proof
    assert proof.startswith("a drive; maker 1; no profile")
    assert ("it was maker 2 before" in proof) is said


def with_store() -> Any:
    c = context()
    object.__setattr__(c, "store", SimpleNamespace(directory=None))
    return c


@pytest.mark.parametrize("wrong", [0, 2])
def test_what_a_drive_came_with_is_told_by_its_wrong_parameters(wrong: int) -> None:
    said: list[str] = []
    c = context()
    rows = [SimpleNamespace(line=f"line {k}", verdict=SimpleNamespace(refuses=k < wrong)) for k in range(3)]
    for name, value in (("as_found", tuple(rows)), ("say", said.append)):
        object.__setattr__(c, name, value)
    proof = steps_bus.defaults(c).proof
    assert proof.startswith(
        "3 parameters read, 2 are not" if wrong else "3 parameters read, all as they must be"
    )
    assert said == [f"  line {k}" for k in range(wrong)]


def test_a_table_of_parameters_says_what_was_wanted_and_what_was_read_back(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    rows = [
        SimpleNamespace(
            place=place, name=name, want=want, have=have, verdict=verdict
        ) for place, name, want, have, verdict in (
            ("6085:00", "quick stop", "5400", "5399", ParameterVerdict.OK),
            ("6080:00", "ceiling", "1239", "not there", ParameterVerdict.ABSENT),
            ("6081:00", "profile speed", "2", "3", ParameterVerdict.UNKNOWN),
        )
    ]  # fmt: skip
    drive = bus_drive(0, 0)
    drive.opened.rows = rows
    monkeypatch.setattr(steps_bus, "backup", lambda *_: {"6085:00": 5399})
    c = context()
    object.__setattr__(c, "folder", tmp_path)
    monkeypatch.setattr(steps_bus, "open_loop_axis", opens(drive))
    found = steps_bus.parameters(c)
    assert found.table is not None
    assert found.table.heads == ("object", "parameter", "wanted", "read back", "verdict")
    assert [row[:4] for row in found.table.rows] == [
        ("6085:00", "quick stop", "5400", "5399"), ("6080:00", "ceiling", "1239", "not there"),
        ("6081:00", "profile speed", "2", "3"),
    ]  # fmt: skip
    assert found.proof.startswith("3 parameters read back as written")
    assert found.proof.endswith("this drive has no 6080:00")
    assert json.loads((tmp_path / "hust_can.drive.json").read_text(encoding="utf-8")) == {"6085:00": 5399}


@pytest.mark.parametrize("differing", [3, 4])
def test_a_node_that_shows_something_else_by_sdo_fails_whichever_it_is(
    monkeypatch: pytest.MonkeyPatch, differing: int
) -> None:
    drive = bus_drive(0, 0)
    nodes = [
        SimpleNamespace(
            watch=SimpleNamespace(missed=0, received=1000), identity=SimpleNamespace(text="maker"),
            remote=SimpleNamespace(node=number), compare=lambda number=number: ["6000 differs"] * (number == differing),
        ) for number in (3, 4)
    ]  # fmt: skip
    drive.beside = SimpleNamespace(nodes=nodes)  # type: ignore[attr-defined]
    found = judged(monkeypatch, "nodes", drive, with_values(MACHINE, {"can.io.node": 3}))
    assert found.outcome is Outcome.FAILED
    assert f"node {differing}: 6000 differs" in found.proof


def test_each_output_is_on_for_three_seconds_for_whoever_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    """750 scans of 4 ms each, with the drive off."""
    drive = bus_drive(0, 0)
    drive.beside = SimpleNamespace(inputs=SimpleNamespace(levels=dict))  # type: ignore[attr-defined]
    # Nobody looks at what is not there.
    wireless = judged(monkeypatch, "wiring", drive)
    assert "switched on" not in wireless.proof
    drive.wrote.clear()
    names = ("horn", "lamp", "in_position", "at_rest")
    wired = {f"can.outputs.{name}": 16 + bit for bit, name in enumerate(names)}
    found = judged(monkeypatch, "wiring", drive, with_values(MACHINE, wired))
    shown = [tuple(name for name in names if getattr(output, name)) for output in drive.wrote]
    assert [each for each in shown if each] == [(name,) for name in names for _ in range(750)]
    assert {output.request for output in drive.wrote} == {DriveRequest.DISABLE}
    assert found.proof.endswith("switched on for whoever looked: horn, lamp, in_position, at_rest")


def test_an_input_that_has_changed_back_meanwhile_was_worked_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """A push button at another bit: pressed for ten scans, and long over when the time of the right one ends."""
    drive = bus_drive(0, 0)

    def levels() -> dict[str, bool]:
        return {"door_ok": True, "motion_permit": not 40 <= len(drive.wrote) < 50}

    drive.beside = SimpleNamespace(inputs=SimpleNamespace(levels=levels))  # type: ignore[attr-defined]
    monkeypatch.setattr(steps_bus, "_BY_HAND_S", 0.4)
    assert judged(monkeypatch, "wiring", drive).proof.endswith("has not changed; motion_permit has")


def test_each_input_is_asked_to_change_from_what_it_shows_when_its_turn_comes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The permit goes while a person is at the door: to work it is to give it, and to take it away again."""
    drive = bus_drive(0, 0)

    def levels() -> dict[str, bool]:
        scans = len(drive.wrote)
        return {"door_ok": not 40 <= scans < 60, "motion_permit": scans < 50 or 80 <= scans < 100}

    drive.beside = SimpleNamespace(inputs=SimpleNamespace(levels=levels))  # type: ignore[attr-defined]
    monkeypatch.setattr(steps_bus, "_BY_HAND_S", 0.4)
    found = judged(monkeypatch, "wiring", drive)
    assert found.proof.startswith("changed by hand, one after the other: door_ok, motion_permit")
    # 25 scans of rest, the door until the 60th, the permit until the 100th; no scan is waited for more.
    assert len(drive.wrote) == 100
