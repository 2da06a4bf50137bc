"""Steps of what is wired beside the drive: a relay that hangs, a node that sends something else, pass no step."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from gantryctl.commissioning import Commissioning, Outcome, StepResult
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.nodes.group import Neighbours
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.operation.ledger.rows import Standing
from gantryctl.operation.store import StateStore
from gantryctl.wiring import virtual as virtual_wiring

pytestmark = pytest.mark.can

MACHINE = load_machine(configs_folder() / "hust_can.toml")
ON_DRIVE: dict[str, object] = {"can.outputs.watchdog": 20, "can.inputs.watchdog_closed": 23}
ON_NODE: dict[str, object] = {
    "can.io.node": 3,
    "can.io.outputs.watchdog": 5,
    "can.io.inputs.watchdog_closed": 7,
}
ENABLE_ON_NODE: dict[str, object] = {
    "can.io.node": 3,
    "can.io.outputs.drive_enable": 5,
    "can.io.inputs.watchdog_closed": 7,
}
UNWATCHED = {"can.virtual_drive": "unwatched"}
Spoil = Callable[[DriveNode, Neighbours], object]


def do(
    key: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    changes: dict[str, object],
    spoil: Spoil | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> tuple[StepResult, float, Commissioning]:
    """Run one step; its result, and how far the true gantry has turned, deg."""
    made, far = virtual_wiring.virtual_bus, [0.0]
    machine = with_values(MACHINE, changes)

    def bus(*args: object, **named: object) -> object:
        link, drive, neighbours = made(*args, **named)
        if spoil is not None:
            spoil(drive, neighbours)
        begun = drive.truth()[0]

        def look() -> None:
            far[0] = max(far[0], abs(math.degrees(drive.truth()[0] - begun)))

        drive.plant.watch = look
        return link, drive, neighbours

    monkeypatch.setattr(virtual_wiring, "virtual_bus", bus)
    with StateStore(machine, folder) as store:
        work = Commissioning(machine, store, folder, say, lambda step: True)
        work.start(again=False)
        result = work.do(work.left(key)[0])
    assert result is not None
    return result, far[0], work


@pytest.mark.parametrize("where", [ON_DRIVE, ON_NODE], ids=["60FE", "6200"])
def test_a_watchdog_relay_makes_up_for_a_drive_that_watches_nothing(
    where: dict[str, object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result, way_deg, work = do("watchdog", tmp_path, monkeypatch, UNWATCHED | where)
    assert result.outcome is Outcome.PASSED, result
    # The relay opens 100 ms after the last edge, which may have been a quarter of that old when silence began; then
    # four scans and 10 ms. What counts is the longest that it may take, not what was seen once.
    assert 0.100 <= result.number("silent_stop_s") < 0.130
    assert way_deg < 0.05
    rows = {row.what: row for row in work.ledger}
    for what in ("stops_without_commands", "stops_without_controller"):
        assert rows[what].standing is Standing.MADE_UP, rows[what]
        assert "torque off and brake" in str(rows[what].detail)


def test_without_the_relay_such_a_drive_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(Exception, match="stops_without_controller"):
        do("watchdog", tmp_path, monkeypatch, UNWATCHED)


def hangs(drive: DriveNode, _: Neighbours) -> None:
    drive.plant.cabinet.welded = True


def slow(drive: DriveNode, _: Neighbours) -> None:
    drive.plant.cabinet._hold_us = 400_000


@pytest.mark.parametrize("liar", [hangs, slow])
@pytest.mark.parametrize("where", [ON_DRIVE, ON_NODE], ids=["60FE", "6200"])
def test_a_relay_that_does_not_open_in_time_passes_nothing(
    where: dict[str, object], liar: Spoil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result, way_deg, work = do("watchdog", tmp_path, monkeypatch, UNWATCHED | where, liar)
    assert result.outcome is Outcome.FAILED, result
    assert way_deg < 0.05
    assert {row.standing for row in work.ledger if row.what == "stops_without_controller"} == {
        Standing.LACKING
    }


def test_a_relay_that_hangs_behind_a_drive_that_stops_by_itself_is_seen_by_its_contact(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result, _, _ = do("watchdog", tmp_path, monkeypatch, ON_NODE, hangs)
    assert result.outcome is Outcome.FAILED
    assert "contact still shows closed" in result.proof
    result, _, _ = do("watchdog", tmp_path, monkeypatch, ON_NODE | {"can.io.inputs.watchdog_closed": -1})
    assert "perhaps by the drive's own watch" in result.proof
    assert result.outcome is Outcome.FAILED


def test_an_output_that_is_not_toggled_opens_the_relay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The drive cannot be enabled: a level that stands is no sign of life."""

    def dead(_: DriveNode, neighbours: Neighbours) -> None:
        assert neighbours.io is not None
        neighbours.io.outputs_dead = True

    result, _, _ = do("watchdog", tmp_path, monkeypatch, UNWATCHED | ON_NODE, dead)
    assert result.outcome is Outcome.FAILED
    assert "operation enabled was wanted" in result.proof


def test_an_enable_that_its_node_takes_off_makes_up_for_a_drive_that_watches_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """1016 of the node alone, then everything at once, where its 1400:05 is the earlier one."""
    result, way_deg, work = do("watchdog", tmp_path, monkeypatch, UNWATCHED | ENABLE_ON_NODE)
    assert result.outcome is Outcome.PASSED, result
    # The last heartbeat is 0 to 50 ms old when it falls silent; then four scans and 10 ms.
    assert 100.0 <= result.number("watchdog_heartbeat_ms") < 180.0
    # 1400:05 is 50 ms; the longest time goes into the stops, not the one that was seen.
    assert 0.050 <= result.number("silent_stop_s") < 0.080
    assert way_deg < 0.05
    rows = {row.what: row for row in work.ledger}
    assert rows["stops_without_controller"].standing is Standing.MADE_UP
    assert "6200 bit 5 of node 3" in str(rows["stops_without_controller"].by)


def ignores_1016(_: DriveNode, neighbours: Neighbours) -> None:
    assert neighbours.io is not None
    neighbours.io.slave.heartbeat_deaf = True


def keeps_outputs(_: DriveNode, neighbours: Neighbours) -> None:
    assert neighbours.io is not None
    neighbours.io.error_values_ignored = True


@pytest.mark.parametrize(
    ("liar", "words"),
    [
        (ignores_1016, "heartbeat silent: no EMCY, still"),
        (keeps_outputs, "still operation enabled"),
        (hangs, "still"),
    ],
)
def test_a_node_that_does_not_take_the_enable_off_is_refused(
    liar: Spoil, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """1016, or 6206 and 6207, are taken and have no effect; the contact of the relay hangs."""
    result, way_deg, work = do("watchdog", tmp_path, monkeypatch, UNWATCHED | ENABLE_ON_NODE, liar)
    assert result.outcome is Outcome.FAILED, result
    assert words in result.proof
    assert way_deg < 0.05
    assert {row.standing for row in work.ledger if row.what == "stops_without_controller"} == {
        Standing.LACKING
    }


def test_an_enable_relay_behind_a_drive_that_stops_by_itself_is_seen_by_its_contact(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert do("watchdog", tmp_path, monkeypatch, ENABLE_ON_NODE)[0].outcome is Outcome.PASSED
    result, _, _ = do("watchdog", tmp_path, monkeypatch, ENABLE_ON_NODE, keeps_outputs)
    assert result.outcome is Outcome.FAILED
    assert "contact still shows closed" in result.proof


RING: dict[str, object] = {"can.load_encoder.source": "node", "can.load_encoder.node": 4}


def test_nodes_say_by_sdo_what_they_send(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result, way_deg, _ = do("nodes", tmp_path, monkeypatch, ON_NODE | RING)
    assert result.outcome is Outcome.PASSED, result
    assert "node 3" in result.proof
    assert "node 4" in result.proof
    assert way_deg < 0.001


def test_a_node_that_sends_something_else_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def swapped(_: DriveNode, neighbours: Neighbours) -> None:
        """Its telegram carries the inputs upside down."""
        assert neighbours.io is not None
        slave = neighbours.io.slave
        out = slave._out
        slave._out = lambda can_id, data: out(
            can_id, bytes(~b & 0xFF for b in data) if can_id == 0x183 else data
        )

    result, _, _ = do("nodes", tmp_path, monkeypatch, ON_NODE | RING, swapped)
    assert result.outcome is Outcome.FAILED
    assert "6000:01 is" in result.proof


class Person:
    """Works the input that the step names, a second after it is named; `swapped`: with two wires crossed."""

    def __init__(self, swapped: dict[str, str] | None = None) -> None:
        self.swapped = swapped or {}
        self.seen: list[str] = []
        self.lit: set[str] = set()

    def meet(self, drive: DriveNode, _: Neighbours) -> None:
        self.drive = drive
        true = drive.plant.cabinet.take

        def take(outputs: dict[str, bool]) -> None:
            self.lit |= {name for name, on in outputs.items() if on}
            true(outputs)

        drive.plant.cabinet.take = take

    def hear(self, line: str) -> None:
        name = line.split(" (", maxsplit=1)[0].strip()
        if "change it within" not in line:
            return
        self.seen.append(name)
        fault = self.swapped.get(name, name)
        fault = {"limit_minus": "limit_minus_ok", "limit_plus": "limit_plus_ok"}.get(fault, fault)
        sound = getattr(self.drive.faults, fault)
        self.drive.after(1_000_000, lambda: setattr(self.drive.faults, fault, False))
        self.drive.after(3_000_000, lambda: setattr(self.drive.faults, fault, sound))


WIRED: dict[str, object] = ON_NODE | {
    "can.io.inputs.estop_ok": 0, "can.io.inputs.door_ok": 1, "can.io.outputs.horn": 2, "can.outputs.lamp": 18,
}  # fmt: skip


def test_a_person_works_every_input_and_sees_every_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    person = Person()
    result, way_deg, work = do("wiring", tmp_path, monkeypatch, WIRED, person.meet, person.hear)
    assert result.outcome is Outcome.PASSED, result
    assert set(person.seen) == {
        "estop_ok", "enabling_switch", "mains_ready", "limit_minus", "limit_plus", "door_ok",
    }  # fmt: skip
    assert {"horn", "lamp"} <= person.lit
    assert way_deg < 0.001
    # Nobody is waited for in a commissioning as a whole.
    assert "wiring" not in {step.key for step in work.left()}


def test_a_crossed_wire_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    person = Person({"door_ok": "enabling_switch"})
    result, _, _ = do("wiring", tmp_path, monkeypatch, WIRED, person.meet, person.hear)
    assert result.outcome is Outcome.FAILED
    assert "has not changed; " in result.proof
    assert "enabling_switch has" in result.proof


BRAKE_ON_NODE: dict[str, object] = {
    "brake.owner": "controller_output", "can.io.node": 3,
    "can.io.outputs.brake_release": 0, "can.io.inputs.brake_open": 1,
}  # fmt: skip


def test_a_brake_on_a_node_closes_in_each_silence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result, way_deg, _ = do("silence", tmp_path, monkeypatch, BRAKE_ON_NODE)
    assert result.outcome is Outcome.PASSED, result
    assert way_deg < 0.05


def test_a_node_that_takes_its_error_values_and_keeps_its_outputs_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def keeps(_: DriveNode, neighbours: Neighbours) -> None:
        assert neighbours.io is not None
        neighbours.io.error_values_ignored = True

    result, _, _ = do("silence", tmp_path, monkeypatch, BRAKE_ON_NODE, keeps)
    assert result.outcome is Outcome.FAILED, result
    assert "brake open" in result.proof
