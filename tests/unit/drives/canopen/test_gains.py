"""Gains of the drive's speed loop, and its store: written with read back, refused where that would say nothing."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest

from gantryctl.commissioning import Commissioning, Outcome
from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.setup.gains import (
    GainReading,
    _refuse_turning,
    planned_changes,
    read_gains,
    write_gains,
)
from gantryctl.drives.canopen.setup.parameters import save
from gantryctl.drives.profiles import Gain, Saving, SpeedLoop, load_profile
from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.errors import CommandRefused, DeviceError
from gantryctl.machine import Machine, configs_folder, load_machine, with_values
from gantryctl.operation.proofs import record_path
from gantryctl.operation.store import StateStore
from gantryctl.wiring.virtual import shipped_objects, virtual_node
from support.command_line import cli, machine_file

pytestmark = pytest.mark.can

EPOS4 = load_profile("maxon_epos4")
CHANGES: dict[str, object] = {"drive.kind": "canopen", "control.scan_period_ms": 4.0, "can.encoder.index": 0}


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """The EPOS4 of the delivered table, with the objects of its speed controller."""
    lines = shipped_objects().read_text(encoding="utf-8").splitlines()
    rows = [lines[0], *(line for line in lines if line.startswith("maxon EPOS4"))]
    rows += [f"maxon EPOS4 0x1018,30A2,{sub},present,0x7,rw,{sub}0000,0,0xFFFFFFFF" for sub in (1, 2)]
    path = tmp_path / "epos4.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def machine_with(table: Path) -> Machine:
    base = load_machine(configs_folder() / "hust_can.toml")
    return with_values(base, {**CHANGES, "can.virtual_drive": f"maxon EPOS4@{table}"})


@contextmanager
def on_bus(machine: Machine) -> Iterator[tuple[RemoteNode, DriveNode]]:
    link, drive = virtual_node(machine)
    try:
        yield RemoteNode(link, machine.can.node, machine.can.master_node, 0.5), drive
    finally:
        link.close()


def reading(name: str, unit: str, value: float, *, real: bool = False) -> GainReading:
    gain = Gain(object="30A2:01" if name == "kp" else "30A2:02", unit=unit, real=real)
    return GainReading(name, gain, value, value * gain.si)


def test_a_gain_is_converted_by_the_unit_of_its_profile() -> None:
    found = reading("kp", "uA s/rad", 10_000), reading("ki", "uA/rad", 20_000)
    changes = planned_changes(found, {"kp": 0.025}, {"ki": 1.5})
    assert [(each.name, each.before, each.after) for each in changes] == [
        ("kp", 10_000, 25_000), ("ki", 20_000, 30_000),
    ]  # fmt: skip


@pytest.mark.parametrize(("unit", "after"), [("A/(rev/s)", 6.2832), ("uA s/rad", 1e6)])
def test_a_gain_in_si_is_one_of_the_drive_in_its_own_unit(unit: str, after: float) -> None:
    """1 A s/rad: of a turn a second, which is 6.28 rad/s, 6.28 A."""
    (kp,) = planned_changes((reading("kp", unit, 2.0, real=True),), {"kp": 1.0}, {})
    assert kp.after == pytest.approx(after, rel=1e-4)


def test_an_integral_rate_gets_the_factor_that_gives_the_integral_gain() -> None:
    """ki = kp x rate: with kp doubled and ki tripled the rate goes up by 1.5."""
    found = reading("kp", "A/(rev/s)", 2.0, real=True), reading("ki", "Hz", 4.0, real=True)
    kp, rate = planned_changes(found, {}, {"kp": 2.0, "ki": 3.0})
    assert (kp.after, rate.after) == (4.0, 6.0)


@pytest.mark.parametrize(
    ("unit", "value", "wanted", "times", "words"),
    [
        ("", 5.0, {"kp": 1.0}, {}, "give --kp-times"),
        ("uA s/rad", 30.0, {}, {"kp": 1.05}, "takes whole numbers"),
        ("uA s/rad", 30.0, {}, {"kp": -1.0}, "must be above 0"),
        ("uA s/rad", 30.0, {}, {"kp": float("nan")}, "must be above 0"),
        ("uA s/rad", 30.0, {}, {"ki": 2.0}, "names no object for it"),
    ],
)
def test_what_cannot_be_a_gain_is_refused(
    unit: str, value: float, wanted: dict[str, float], times: dict[str, float], words: str
) -> None:
    with pytest.raises(CommandRefused, match=words):
        planned_changes((reading("kp", unit, value),), wanted, times)


def loop() -> SpeedLoop:
    assert EPOS4.speed_loop is not None
    return EPOS4.speed_loop


def test_gains_are_written_and_read_back(table: Path) -> None:
    with on_bus(machine_with(table)) as (node, drive):
        found = read_gains(node.sdo, loop())
        write_gains(node, planned_changes(found, {}, {"kp": 2.0, "ki": 0.5}), 524_288)
        assert [each.value for each in read_gains(node.sdo, loop())] == [20_000, 10_000]
        assert (drive.od.number(0x30A2, 1), drive.od.number(0x30A2, 2)) == (20_000, 10_000)


def test_a_gain_that_is_not_taken_gives_the_others_their_old_value(table: Path) -> None:
    def never(_value: int) -> None:
        raise SdoAbort(Abort.VALUE)

    with on_bus(machine_with(table)) as (node, drive):
        found = read_gains(node.sdo, loop())
        drive.od.checks[0x30A2, 2] = never
        with pytest.raises(DeviceError, match="30A2:02"):
            write_gains(node, planned_changes(found, {}, {"kp": 2.0, "ki": 2.0}), 524_288)
        assert (drive.od.number(0x30A2, 1), drive.od.number(0x30A2, 2)) == (10_000, 20_000)


def test_a_gain_that_the_drive_keeps_as_it_was_is_refused(table: Path) -> None:
    """It takes the value, and holds another one: a limit of its own, or a lie."""
    with on_bus(machine_with(table)) as (node, drive):
        found = read_gains(node.sdo, loop())
        drive.od.readers[0x30A2, 1] = lambda: 10_000
        with pytest.raises(DeviceError, match="written 20000 and holds 10000"):
            write_gains(node, planned_changes(found, {}, {"kp": 2.0}), 524_288)


def test_a_drive_with_torque_or_a_turning_motor_is_refused(table: Path) -> None:
    with on_bus(machine_with(table)) as (node, drive):
        changes = planned_changes(read_gains(node.sdo, loop()), {}, {"kp": 2.0})
        for word in (6, 7, 15):
            node.sdo.set(0x6040, 0, word)
            node.link.pause(0.5)
        with pytest.raises(CommandRefused, match="parameters wait until it is off"):
            write_gains(node, changes, 524_288)
        node.sdo.set(0x6040, 0, 0)
        node.link.pause(1.0)
        turned = iter(range(0, 10**6, 1000))
        drive.od.readers[0x6064, 0] = lambda: next(turned)
        with pytest.raises(CommandRefused, match="the motor turns: 1000 increments"):
            write_gains(node, changes, 524_288)
        assert drive.od.number(0x30A2, 1) == 10_000


@pytest.mark.parametrize(
    ("begun", "then", "stands"),
    [
        (0, 524, True), (0, -524, True), (0, 525, False), (0, -525, False),
        (2**31 - 1, -(2**31) + 523, True), (-(2**31), 2**31 - 600, False),  # over the end of 32 bits
    ],
)  # fmt: skip
def test_a_motor_that_turns_either_way_keeps_its_gains(begun: int, then: int, stands: bool) -> None:
    """Within 0.2 s a standing shaft passes no thousandth of its 524 288 increments."""
    read = iter((begun, then))
    sdo = SimpleNamespace(number=lambda _: next(read))
    node = SimpleNamespace(sdo=sdo, link=SimpleNamespace(pause=lambda _: None))
    with nullcontext() if stands else pytest.raises(CommandRefused, match="the motor turns"):
        _refuse_turning(node, 524_288)  # type: ignore[arg-type]


def test_written_gains_make_the_record_void(
    table: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was proven with the speed loop as it was is to be proven again; identity and silence are not."""
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    config = tmp_path / "m.toml"
    machine_file(
        config, {**CHANGES, "can.virtual_drive": f"maxon EPOS4@{table}", "can.velocity_unit": "profile",
                 "can.torque_limit_in_drive_nm": 385.0, "can.increments_per_turn": 524_288},
    )  # fmt: skip
    machine = load_machine(config)
    with StateStore(machine) as store:
        work = Commissioning(machine, store, tmp_path, lambda line: None, lambda step: True)
        work.start(again=False)
        for key in ("identity", "silence", "sign"):
            result = work.do(work.left(key)[0])
            assert result is not None
            assert result.outcome is Outcome.PASSED, result
        record = record_path(store.directory, machine)
        record.write_text("a record", encoding="utf-8")
    # Nobody answers the question.
    monkeypatch.setattr("sys.stdin", io.StringIO("n\n"))
    assert cli("drive", "gains", "--kp-times", 2, "--config", config).code == 2
    assert record.exists()
    told = cli("drive", "gains", "--kp-times", 2, "--yes", "--save", "--config", config)
    assert told.code == 0, told.err
    assert "30A2:01  10000 uA s/rad = " in told.out
    assert "-> 20000 uA s/rad = " in told.out
    assert "goes on with the step sign" in told.out
    assert not record.exists()
    with StateStore(machine) as store:
        again = Commissioning(machine, store, tmp_path, lambda line: None, lambda step: True)
        left = {step.key for step in again.left()}
    assert "sign" in left
    assert not left & {"identity", "silence"}


def test_without_a_gain_to_write_nothing_is_written(table: Path, tmp_path: Path) -> None:
    config = tmp_path / "m.toml"
    machine_file(
        config, {**CHANGES, "can.virtual_drive": f"maxon EPOS4@{table}", "can.velocity_unit": "profile"}
    )
    assert "kp  30A2:01  10000 uA s/rad = " in cli("drive", "gains", "--config", config).out
    # 257 N m at 69 A are 3.725 N m/A: 0.07449 N m s/rad at the shaft are 0.02 A s/rad.
    told = cli("drive", "gains", "--kp", "0.0744928", "--yes", "--config", config)
    assert "kp  30A2:01  10000 uA s/rad = 0.03725 N m s/rad -> 20000 uA s/rad = 0.07449 N m s/rad" in told.out
    assert cli("drive", "gains", "--save", "--config", config).code == 2
    assert cli("drive", "gains", "--kp", 1, "--kp-times", 2, "--config", config).code == 2


# --- the store of the drive ----------------------------------------------------------------------------------------


def test_a_drive_is_told_to_store_as_its_profile_says() -> None:
    machine = load_machine(configs_folder() / "hust_can.toml")
    seen: list[int] = []
    with on_bus(machine) as (node, drive):
        assert save(node, Saving()).remark == ""
        # Storing may take its time; the next question is answered as fast as ever, or not.
        assert node.sdo.timeout_s == machine.can.sdo_timeout_ms * 1e-3
        drive.od.checks[0x1010, 2] = seen.append
        save(node, Saving(object="1010:02", signature=0x12345678, remark="by its own signature"))
        assert seen == [0x12345678]


@pytest.mark.parametrize(
    ("told", "fault", "words"),
    [(2, CommandRefused, "stores by itself"), (0, None, "does not store on command"), (1, None, "")],
)
def test_what_the_drive_says_of_its_store_is_told(
    told: int, fault: type[Exception] | None, words: str
) -> None:
    with on_bus(load_machine(configs_folder() / "hust_can.toml")) as (node, drive):
        drive.od.readers[0x1010, 1] = lambda: told
        if fault is not None:
            with pytest.raises(fault, match=words):
                save(node, Saving())
        else:
            assert words in save(node, Saving()).remark


def test_a_drive_that_stores_nothing_is_told_of() -> None:
    with on_bus(load_machine(configs_folder() / "hust_can.toml")) as (node, _):
        with pytest.raises(
            CommandRefused, match="stores nothing on a command of the bus: with the tool only"
        ):
            save(node, Saving(object="", remark="with the tool only"))
        with pytest.raises(DeviceError, match="forgets at power off"):
            save(node, Saving(object="2F00:01"))
        timeout_s = node.sdo.timeout_s
        with pytest.raises(DeviceError, match="does not store its parameters"):
            save(node, Saving(signature=0x12345678))
        assert node.sdo.timeout_s == timeout_s


def test_a_record_does_not_outlive_gains_that_could_not_be_written(
    table: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The drive may have taken some of them, and runs with those from then on."""

    def broken(*_: object) -> None:
        assert void == ["void"]
        raise DeviceError("the bus is gone")

    void: list[str] = []
    monkeypatch.setattr("gantryctl.drives.canopen.setup.gains.write_gains", broken)
    monkeypatch.setattr("gantryctl.commissioning.void_control_proofs", lambda *_: void.append("void"))
    config = tmp_path / "m.toml"
    machine_file(
        config, {**CHANGES, "can.virtual_drive": f"maxon EPOS4@{table}", "can.velocity_unit": "profile"}
    )
    told = cli("drive", "gains", "--kp-times", 2, "--yes", "--config", config)
    assert told.code != 0
    assert "the bus is gone" in told.err
