"""Ledger of a real machine: a safety input that is not wired keeps power off until a person accepts it by name."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gantryctl.commissioning import Commissioning
from gantryctl.errors import CommandRefused, StateError, UsageError
from gantryctl.machine import Machine, configs_folder, load_machine, with_values
from gantryctl.operation.ledger import (
    SAFETY_INPUTS,
    Acceptance,
    Standing,
    check_acceptance,
    lacks,
    ledger_path,
    load_acceptances,
    store_acceptances,
)
from gantryctl.operation.opening import new_machine
from gantryctl.operation.proofs import bus_reasons, must_be_proven, proven_hash, read_ledger
from gantryctl.operation.run import AxisRun
from gantryctl.operation.store import StateStore
from gantryctl.wiring import canopen as canopen_wiring
from gantryctl.wiring.virtual import virtual_node
from support.command_line import cli, machine_file

pytestmark = pytest.mark.can

VIRTUAL = load_machine(configs_folder() / "hust_can.toml")
REAL = with_values(VIRTUAL, {"can.interface": "socketcan", "can.channel": "can0"})


def without(*names: str, machine: Machine = REAL) -> Machine:
    return with_values(machine, {f"can.inputs.{name}": -1 for name in names})


def accepted(machine: Machine, what: str) -> Acceptance:
    return Acceptance(
        what, "A. Person", "the chain cuts the drive's STO", "2026-01-01", "user", proven_hash(machine)
    )


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> None:
    """A virtual drive in the place of the real one: the machine knows nothing of it."""
    monkeypatch.setattr(canopen_wiring, "can_link", lambda machine: virtual_node(VIRTUAL)[0])


def test_what_is_wired_has_its_object_and_nothing_lacks_on_the_shipped_machine(tmp_path: Path) -> None:
    rows = {row.what: row for row in read_ledger(REAL, tmp_path)}
    assert [rows[name].standing for name in SAFETY_INPUTS] == [Standing.OBJECT] * 6
    assert rows["estop_ok"].text == "estop_ok: has it by 60FD bit 16"
    assert rows["drive_follows_command"].by == "6041 bit 12"
    # Not proven yet, and nobody can accept that: commissioning says so.
    assert rows["stop_of_silent_controller"].standing is Standing.LACKING
    assert lacks(rows.values()) == ()


@pytest.mark.parametrize("name", SAFETY_INPUTS)
def test_each_safety_input_that_is_not_wired_keeps_power_off(bus: None, tmp_path: Path, name: str) -> None:
    machine = without(name)
    with StateStore(machine, tmp_path) as store:
        store.store_retained(new_machine(VIRTUAL).retained)  # its zero is set
        with pytest.raises(CommandRefused, match=rf"^CFG-CAN-04 · .*: {name} · Wire them") as refused:
            AxisRun(machine, store)
        assert "gantryctl commission accept --input INPUT --by NAME --because TEXT" in str(refused.value)
        # Commissioning moves the machine too.
        with pytest.raises(CommandRefused, match="CFG-CAN-04"):
            AxisRun(machine, store, commissioning=True)
        work = Commissioning(machine, store, tmp_path, lambda line: None, lambda step: True)
        with pytest.raises(CommandRefused, match="CFG-CAN-04"):
            work.start(again=False)
        store_acceptances(ledger_path(store.directory, machine), (accepted(machine, name),))
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
    assert reason.values["inputs"] == ", ".join(SAFETY_INPUTS)


def test_an_acceptance_dies_with_any_change_of_what_is_proven(tmp_path: Path) -> None:
    machine = without("estop_ok")
    store_acceptances(ledger_path(tmp_path, machine), (accepted(machine, "estop_ok"),))
    (row,) = [row for row in read_ledger(machine, tmp_path) if row.what == "estop_ok"]
    assert row.standing is Standing.ACCEPTED
    assert row.text == (
        "estop_ok: accepted by A. Person (the chain cuts the drive's STO; 2026-01-01, entered by user)"
    )
    for changes in (
        {"brake.close_time_ms": 151.0},
        {"can.inputs.mains_ready": -1},
        {"axis.pos_max_deg": 179.0},
    ):
        assert "estop_ok" in lacks(read_ledger(with_values(machine, changes), tmp_path))
    # Speeds and monitors prove nothing.
    assert lacks(read_ledger(with_values(machine, {"speed.creep_deg_s": 0.2}), tmp_path)) == ()


def test_what_makes_up_for_a_lack_says_its_cost(tmp_path: Path) -> None:
    blind = with_values(REAL, {"can.follows_bit": False})
    (row,) = [row for row in read_ledger(blind, tmp_path) if row.what == "drive_follows_command"]
    # 20 ms, and 0.5 deg/s at 10.59 deg/s2 (torque limit and check moment on the rigid machine) are 47 ms.
    assert row == (
        "drive_follows_command", Standing.MADE_UP, "velocity_deviation_deg_s", "seen after 67 ms instead of 4 ms",
    )  # fmt: skip


@pytest.mark.parametrize("machine", [VIRTUAL, with_values(REAL, {"can.commissioning_required": False})])
def test_a_virtual_drive_needs_no_acceptance(bus: None, tmp_path: Path, machine: Machine) -> None:
    bare = without(*SAFETY_INPUTS, machine=machine)
    assert not must_be_proven(bare)
    with StateStore(bare, tmp_path) as store:
        drive = canopen_wiring.canopen_drive(bare)
        try:
            assert bus_reasons(bare, store, drive) == ()
        finally:
            drive.close()


@pytest.mark.parametrize(
    ("what", "by", "because", "error", "words"),
    [
        ("mains_ready", "A", "B", CommandRefused, "[can.inputs] mains_ready = 18: it is wired"),
        ("stop_of_silent_controller", "A", "B", CommandRefused, "no acceptance covers it"),
        ("horn", "A", "B", UsageError, "the safety inputs are estop_ok, enabling_switch"),
        ("estop_ok", "  ", "B", UsageError, "--by"),
        ("estop_ok", "A", "x" * 301, UsageError, "--because"),
        ("estop_ok", "A", "line\nbreak", UsageError, "--because"),
    ],
)
def test_what_cannot_be_accepted(
    what: str, by: str, because: str, error: type[Exception], words: str
) -> None:
    with pytest.raises(error) as refused:
        check_acceptance(without("estop_ok"), what, by, because)
    assert words in str(refused.value)


def test_a_damaged_ledger_is_no_acceptance(tmp_path: Path) -> None:
    path = ledger_path(tmp_path, REAL)
    for text in ("{", "[{}]", '[{"what": 1}]'):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(StateError, match="remove it and accept again"):
            load_acceptances(path)


def test_the_command_keeps_it_and_config_show_shows_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    file = machine_file(
        tmp_path / "m.toml",
        {"drive.kind": "canopen", "can.interface": "socketcan", "can.channel": "can0", "control.scan_period_ms": 4.0,
         "can.inputs.estop_ok": -1},
    )  # fmt: skip
    shown = cli("config", "show", file, "--no-derived").out
    assert "# Safety ledger" in shown
    assert "estop_ok: lacking" in shown, shown[-500:]
    who = ("--by", "A. Person", "--because", "the chain cuts STO")
    done = cli("commission", "accept", "--input", "estop_ok", *who, "--config", file)
    assert done.code == 0, done
    assert "estop_ok: accepted by A. Person (the chain cuts STO;" in done.out
    rows = cli("config", "show", file, "--json").json["ledger"]
    (row,) = [row for row in rows if row["what"] == "estop_ok"]
    assert (row["standing"], row["by"]) == ("accepted by", "A. Person")
    refused = cli("commission", "accept", "--input", "limit_plus", *who, "--config", file)
    assert refused.code == 2
    assert "it is wired" in refused.err
    assert "# Safety ledger" not in cli("config", "show", "--no-derived").out
    assert json.loads(json.dumps(rows)) == rows
