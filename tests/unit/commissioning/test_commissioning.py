"""Commissioning with a virtual drive: the proofs pass on a sound one, and each fails on the fault it is there for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.commissioning import STEPS, Commissioning, Outcome, write_report
from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.drives.canopen.setup.parameters import save
from gantryctl.drives.profiles.profile import Saving
from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.errors import CommandRefused, UsageError
from gantryctl.image import LinkHealth, NodeHealth
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.operation.proofs import (
    SilentMasterProof,
    load_record,
    load_silent_master_proof,
    record_path,
    silent_master_proof_path,
    store_silent_master_proof,
    why_not_commissioned,
    why_silence_not_proven,
)
from gantryctl.operation.run import AxisRun
from gantryctl.operation.store import StateStore
from gantryctl.wiring import virtual as virtual_wiring
from gantryctl.wiring.canopen import canopen_settings
from gantryctl.wiring.virtual import virtual_node
from support.reports import HEAD

pytestmark = pytest.mark.can

MACHINE = load_machine(configs_folder() / "hust_can.toml")
QUICK = [
    s.key
    for s in STEPS
    if s.key not in ("turn", "accuracy", "bands", "stops") and not (s.makes_up or s.by_hand)
]


def commissioning(
    tmp_path: Path, machine: Machine = MACHINE, asks: bool = True
) -> tuple[Commissioning, StateStore]:
    store = StateStore(machine, tmp_path)
    store.__enter__()
    work = Commissioning(machine, store, tmp_path, lambda line: None, lambda step: asks)
    work.start(again=False)
    return work, store


def do(work: Commissioning, *keys: str) -> dict[str, Outcome]:
    found = {}
    for key in keys:
        result = work.do(work.left(key)[0])
        assert result is not None
        found[key] = result.outcome
    return found


@pytest.fixture
def quirky(monkeypatch: pytest.MonkeyPatch):
    """Virtual drives with quirks from now on, and what is done to each one after its making."""
    made = virtual_wiring.virtual_node

    def become(*quirks: str, spoil=lambda node: None):
        def node_with(machine, angle_deg=0.0, state=None, _quirks=()):
            link, node = made(machine, angle_deg, state, quirks)
            spoil(node)
            return link, node

        monkeypatch.setattr(virtual_wiring, "virtual_node", node_with)

    return become


def test_a_sound_drive_passes_every_quick_step(tmp_path: Path) -> None:
    work, store = commissioning(tmp_path)
    outcomes = do(work, *QUICK)
    assert set(outcomes.values()) == {Outcome.PASSED, Outcome.NOT_TESTABLE}
    assert outcomes["brake"] is Outcome.NOT_TESTABLE  # the drive owns it
    store.__exit__(None, None, None)


def test_the_brake_is_proven_where_the_controller_keeps_it_closed(tmp_path: Path) -> None:
    work, store = commissioning(tmp_path, with_values(MACHINE, {"brake.owner": "object_60FE"}))
    assert do(work, "brake") == {"brake": Outcome.PASSED}
    kept = store.load_retained()
    assert kept is not None
    assert (kept.brake_tests, kept.brake_failed) == (1, "")
    assert kept.brake_tested_at
    store.__exit__(None, None, None)


def test_a_weak_brake_fails_and_holds_the_machine(tmp_path: Path, quirky) -> None:
    """40 N m of friction instead of 400; 70 are asked for."""
    quirky(spoil=lambda node: node.plant.change_plant("brake_torque_nm", 40.0))
    machine = with_values(MACHINE, {"brake.owner": "object_60FE", "can.commissioning_required": False})
    work, store = commissioning(tmp_path, machine)
    result = work.do(work.left("brake")[0])
    assert result is not None
    assert result.outcome is Outcome.FAILED
    with pytest.raises(CommandRefused, match="BRK-08"):
        AxisRun(machine, store)
    store.__exit__(None, None, None)


def test_a_drive_without_a_torque_preload_cannot_be_tested_here(tmp_path: Path, quirky) -> None:
    quirky("sparse")
    work, store = commissioning(tmp_path, with_values(MACHINE, {"brake.owner": "object_60FE"}))
    result = work.do(work.left("brake")[0])
    assert result is not None
    assert result.outcome is Outcome.NOT_TESTABLE
    assert "60B2" in result.proof
    store.__exit__(None, None, None)


def test_a_wrong_sign_is_found_within_the_leash(tmp_path: Path, quirky) -> None:
    """Feedback is true, the motor turns the other way: 0.05 deg are allowed, so 0.03 deg backwards end it."""

    def turn_round(node) -> None:
        node.faults.command_sign = -1

    quirky(spoil=turn_round)
    work, store = commissioning(tmp_path)
    result = work.do(work.left("sign")[0])
    assert result is not None
    assert result.outcome is Outcome.FAILED
    assert result.number("ratio_position") < 0.0
    store.__exit__(None, None, None)


def test_a_wrong_unit_of_speed_is_found(tmp_path: Path, quirky) -> None:
    """The file says inc/s and so does the drive, but it is 1.5 times faster: nothing but motion shows it."""

    def too_fast(node) -> None:
        node.scaling.per_rad_s /= 1.5

    quirky(spoil=too_fast)
    work, store = commissioning(tmp_path)
    assert do(work, "sign") == {"sign": Outcome.FAILED}
    store.__exit__(None, None, None)


def test_a_drive_that_nothing_stops_fails_its_silence(tmp_path: Path, quirky) -> None:
    def deaf_watch(node) -> None:
        node.axis.communication_lost = lambda code: None

    quirky(spoil=deaf_watch)
    work, store = commissioning(tmp_path)
    assert do(work, "silence") == {"silence": Outcome.FAILED}
    store.__exit__(None, None, None)


def prove(path: Path, drive: CanopenDrive) -> SilentMasterProof:
    store_silent_master_proof(path, drive.health().drive_key, drive.leave_restart_marker())
    return load_silent_master_proof(path)


def why_not(path: Path, drive: CanopenDrive) -> str:
    return str(why_silence_not_proven(load_silent_master_proof(path), drive.health()) or "")


def test_silence_is_proven_again_after_a_restart_of_the_drive(tmp_path: Path) -> None:
    """A later run of the same drive is believed; one after a boot-up, of another drive, or without any proof is not."""
    link, node = virtual_node(MACHINE)

    def run(again: bool = True) -> CanopenDrive:
        drive = CanopenDrive(link, canopen_settings(MACHINE)).open()
        if again:  # as `close`, but the bus stays for the next one
            drive._take_the_watch_off()
        return drive

    path = silent_master_proof_path(tmp_path, MACHINE)
    assert "it is not proven" in why_not(path, run())
    assert prove(path, run()).restart_marker is not None
    for _ in range(3):
        assert not why_not(path, run())
    node.boot()
    assert "restarted since" in why_not(path, run())
    prove(path, run())
    assert not why_not(path, run())
    path.write_text(path.read_text(encoding="utf-8").replace("000007FF", "000007FE"), encoding="utf-8")
    assert "it is not proven that this drive" in why_not(path, run())
    path.write_text("{", encoding="utf-8")
    assert "it is not proven" in why_not(path, run(again=False))
    link.close()


def test_stored_parameters_do_not_carry_the_marker_over_a_restart(tmp_path: Path) -> None:
    link, node = virtual_node(MACHINE)
    drive = CanopenDrive(link, canopen_settings(MACHINE)).open()
    path = silent_master_proof_path(tmp_path, MACHINE)
    prove(path, drive)
    drive._take_the_watch_off()
    save(drive.node, Saving())
    node.boot()
    assert "restarted since" in why_not(path, CanopenDrive(link, canopen_settings(MACHINE)).open())
    link.close()


def test_a_drive_that_takes_no_marker_is_believed_and_said_so(tmp_path: Path) -> None:
    link, node = virtual_node(MACHINE)

    def refuse(_value: int) -> None:
        raise SdoAbort(Abort.STATE)

    node.od.checks[0x1403, 1] = refuse
    drive = CanopenDrive(link, canopen_settings(MACHINE)).open()
    assert prove(silent_master_proof_path(tmp_path, MACHINE), drive).restart_marker is None
    assert not why_not(silent_master_proof_path(tmp_path, MACHINE), drive)
    drive.close()


def test_a_passed_silence_step_is_kept(tmp_path: Path) -> None:
    work, store = commissioning(tmp_path)
    assert do(work, "silence") == {"silence": Outcome.PASSED}
    assert '"mark": ' in silent_master_proof_path(store.directory, MACHINE).read_text(encoding="utf-8")
    store.__exit__(None, None, None)


def test_a_drive_without_csv_is_not_commissioned(tmp_path: Path, quirky) -> None:
    quirky("no-csv")
    with StateStore(MACHINE, tmp_path) as store:
        work = Commissioning(MACHINE, store, tmp_path, lambda line: None, lambda step: True)
        with pytest.raises(CommandRefused, match=r"CFG-CAN-05.*runs_csv \(6502 = 4h has no CSV"):
            work.start(again=False)


@pytest.mark.slow
def test_the_stops_are_as_long_as_computed(tmp_path: Path) -> None:
    work, store = commissioning(tmp_path)
    assert do(work, "loop", "stops", "turn", "bands") == dict.fromkeys(
        ("loop", "stops", "turn", "bands"), Outcome.PASSED
    )
    load = MACHINE.plant.load
    nominal = load.mass_kg * 9.81 * load.eccentricity_m
    # Friction of gear and rollers depends on the load, which puts a few percent of a sine into the torque.
    assert abs(work.progress.results["turn"].number("moment_sine_nm")) == pytest.approx(nominal, rel=0.15)
    store.__exit__(None, None, None)


# --- going on, report, record --------------------------------------------------------------------------------------


def test_it_goes_on_where_it_ended(tmp_path: Path) -> None:
    work, store = commissioning(tmp_path)
    do(work, "identity", "encoder")
    store.__exit__(None, None, None)
    again, store = commissioning(tmp_path)
    assert again.resumed
    assert again.left()[0].key == "defaults"
    store.__exit__(None, None, None)


def test_another_configuration_begins_anew(tmp_path: Path) -> None:
    work, store = commissioning(tmp_path)
    do(work, "identity")
    store.__exit__(None, None, None)
    other, store = commissioning(tmp_path, with_values(MACHINE, {"control.kpp_per_s": 9.0}))
    assert not other.resumed
    store.__exit__(None, None, None)


def test_what_nobody_allowed_does_not_move(tmp_path: Path) -> None:
    work, store = commissioning(tmp_path, asks=False)
    assert work.do(work.left("velocity")[0]) is None
    assert "velocity" not in work.progress.results
    store.__exit__(None, None, None)


def test_the_report_has_a_hash_of_what_was_shown_and_compares(tmp_path: Path) -> None:
    work, store = commissioning(tmp_path)
    do(work, "identity", "sync")
    page = write_report(work.progress, work.ledger, tmp_path, HEAD).read_text(encoding="utf-8")
    assert work.progress.hash in page
    assert "Compared with" not in page
    later = replace(work.progress.results["sync"], seconds=99.0, at="another day")
    same = replace(work.progress, results={**work.progress.results, "sync": later})
    assert same.hash == work.progress.hash
    assert "Compared with" in write_report(same, work.ledger, tmp_path, HEAD).read_text(encoding="utf-8")
    store.__exit__(None, None, None)


def test_the_record_is_of_one_drive_and_one_configuration(tmp_path: Path) -> None:
    work, store = commissioning(tmp_path)
    record = load_record(work.record())
    assert record is not None
    drive = LinkHealth(work.progress.drive, work.progress.software)
    other = with_values(MACHINE, {"can.node": 3})
    assert not why_not_commissioned(MACHINE, record, drive)
    for another in (drive._replace(drive_key="another drive"), drive._replace(software="another firmware")):
        assert "was commissioned with" in str(why_not_commissioned(MACHINE, record, another))
    assert "configuration has changed" in str(why_not_commissioned(other, record, drive))
    assert "nodes beside the drive are 3 A-B-1" in str(
        why_not_commissioned(MACHINE, record, drive._replace(nodes=(NodeHealth(3, "A-B-1", 0, 0, 0),)))
    )
    assert "no commissioning record" in str(why_not_commissioned(MACHINE, None, drive))
    assert record_path(store.directory, MACHINE).name == "hust_can.commissioned.toml"
    store.__exit__(None, None, None)


def test_a_machine_without_a_bus_is_not_commissioned(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="CAN machine"):
        commissioning(tmp_path, default_machine())
