"""Nine real object dictionaries: the rows of each, by hand from the table, by its EDS, and by the drive itself."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Final

import pytest

from gantryctl.commissioning import Commissioning
from gantryctl.drives.od.facts import DriveFacts, facts_of
from gantryctl.drives.od.reading import parse_eds
from gantryctl.drives.od.writing import write_eds
from gantryctl.errors import CommandRefused
from gantryctl.machine import Machine, configs_folder, load_machine, with_values
from gantryctl.operation.ledger import LedgerRow, Standing
from gantryctl.operation.ledger.judging import impossible, known_of_model, lacks, ledger, unset
from gantryctl.operation.store import StateStore
from gantryctl.wiring.canopen import set_up_facts
from gantryctl.wiring.virtual import virtual_node
from support.command_line import cli, machine_file

pytestmark = pytest.mark.can

# Made up for; a step is to show it; a name may stand for it; a key of the machine file gives it; nothing does.
MADE, STEP, NAME, FILE, NEVER = "made up", "step", "name", "file", "never"

# Each row by hand: the objects of the table (configs/drives/objects.csv) against what the machine needs. Without 6072
# the limit of the maker's tool must be entered, which the delivered machine has not. `sign` shows what 608F and 60A9
# do not.
_SILENT: Final = {"stops_without_commands": STEP, "stops_without_controller": STEP, "keeps_brake": STEP}
_SCALES_BY_SIGN: Final = {"knows_counts": STEP, "knows_speed_unit": STEP}
_INPUTS_OPEN: Final = dict.fromkeys(
    ("estop_ok", "enabling_switch", "mains_ready", "brake_open", "limit_minus", "limit_plus"), NAME
)
EXPECTED: Final[dict[str, dict[str, str]]] = {
    # 1016, 605A, 6085, 6080; no 1400:05, 6072, 608F. 60A9 takes the unit of the profile.
    "maxon EPOS4 0x1018": {**_SILENT, "limits_torque": FILE, "knows_counts": STEP},
    # By its profile it has no CSV. 1016; no 605A, 6072, 6077, 60FD, 6080; 60C2 stays at 1 ms.
    "maxon EPOS2 50/5": {
        **_SILENT, **_SCALES_BY_SIGN, **_INPUTS_OPEN, "runs_csv": NEVER, "limits_torque": FILE,
        "ramps_quick_stop": STEP,
        "limits_speed": MADE, "leaves_operational": MADE, "tells_its_fault": MADE, "knows_rated_torque": MADE,
        "tells_its_torque": MADE, "takes_preload": MADE, "has_outputs": MADE, "interpolates": MADE,
    },
    # 1400:05; no 1016, 6085, 605C, 605E, 6072, 60FD.
    "Ingenia EVE-NET 1.8.1": {
        **_SILENT, **_SCALES_BY_SIGN, **_INPUTS_OPEN, "limits_torque": FILE, "ramps_quick_stop": STEP,
        "limits_speed": MADE, "leaves_operational": MADE, "tells_its_fault": MADE, "has_outputs": MADE,
        "ramps_fault": MADE,
    },
    # 1016, 605A to 605E, 6085, 6072; no 6007, 6080, 6076.
    "Trinamic TMCM-1617 fw1.06": {
        **_SILENT, **_SCALES_BY_SIGN, "limits_speed": MADE, "reacts_to_lost_bus": MADE, "tells_its_fault": MADE,
        "knows_rated_torque": MADE, "has_outputs": MADE,
    },
    # 605B to 605E are read-only and right, but for 605B, which nothing asks for; 1400:02 stays 255; no 6072, 6077.
    "Trinamic TMCM-6212 v3.22": {
        **_SILENT, "knows_speed_unit": STEP, "limits_torque": FILE, "limits_speed": MADE, "reacts_to_lost_bus": MADE,
        "tells_its_fault": MADE, "knows_rated_torque": MADE, "tells_its_torque": MADE, "takes_preload": MADE,
        "has_outputs": MADE,
    },
    # Everything but 1400:05, 1005 and 60A9.
    "Elmo Gold (DCF)": {**_SILENT, "knows_speed_unit": STEP, "hears_sync": MADE},
    # 1016, 605A, 6085; 6072 up to 1000, which is 385 N m here; no 6007, 6080, 60FD.
    "Yiyou servo v1.4": {
        **_SILENT, **_SCALES_BY_SIGN, **_INPUTS_OPEN, "limits_speed": MADE, "leaves_operational": MADE,
        "reacts_to_lost_bus": MADE, "knows_rated_torque": MADE, "takes_preload": MADE, "has_outputs": MADE,
    },
    # Telegrams are fixed, mode 9 is beyond the limit of 6060, neither 1016 nor 1400:05.
    "Faulhaber MCDC 73-A": {
        **_INPUTS_OPEN, "runs_csv": NEVER, "maps_telegrams": NEVER, "stops_without_commands": NEVER,
        "stops_without_controller": NEVER, "keeps_brake": STEP, "limits_torque": FILE, "ramps_quick_stop": STEP,
        "knows_speed_unit": STEP, "limits_speed": MADE, "shows_its_life": MADE, "leaves_operational": MADE,
        "reacts_to_lost_bus": MADE, "tells_its_fault": MADE, "knows_rated_torque": MADE, "tells_its_torque": MADE,
        "takes_preload": MADE, "has_outputs": MADE, "ramps_fault": MADE, "interpolates": MADE,
    },
    # Neither 1016 nor 1400:05; no 605A, 605C, 605E, 6007; 60B2 has 32 bits.
    "e35 example": {
        "stops_without_commands": NEVER, "stops_without_controller": NEVER, "keeps_brake": STEP,
        "ramps_quick_stop": STEP, "leaves_operational": MADE, "reacts_to_lost_bus": MADE, "takes_preload": MADE,
        "ramps_fault": MADE,
    },
}  # fmt: skip
# Drives that no limit of torque entered and no acceptance makes usable.
REFUSED: Final = {"maxon EPOS2 50/5", "Faulhaber MCDC 73-A", "e35 example"}
_BY_PROFILE: Final = {"can.velocity_unit": "profile"}
_CHANGES: Final[dict[str, dict[str, object]]] = {
    "maxon EPOS4 0x1018": {**_BY_PROFILE},
    "maxon EPOS2 50/5": {**_BY_PROFILE},
    "Ingenia EVE-NET 1.8.1": {**_BY_PROFILE},
    "Trinamic TMCM-1617 fw1.06": {**_BY_PROFILE},
    "Faulhaber MCDC 73-A": {**_BY_PROFILE},
    "Yiyou servo v1.4": {"can.torque_reference": 385.0 / 257.0},
}


@cache
def machine_of(name: str) -> Machine:
    machine = load_machine(configs_folder() / "hust_can.toml")
    # The status object of the encoder is one of the plain virtual drive.
    changes = {"can.virtual_drive": f"{name}@", "can.encoder.index": 0, **_CHANGES.get(name, {})}
    return with_values(machine, changes)


@cache
def eds_of(name: str) -> str:
    link, node = virtual_node(machine_of(name))
    link.close()
    return write_eds(node.od.visible)


def facts_by_eds(name: str, machine: Machine) -> DriveFacts:
    return facts_of(parse_eds(eds_of(name).encode(), node_id=machine.can.node))


def rows_by_eds(name: str, machine: Machine) -> tuple[LedgerRow, ...]:
    return ledger(machine, set_up_facts(machine, facts_by_eds(name, machine)))


def said_by_commissioning(name: str, machine: Machine, folder: Path) -> tuple[list[str], str]:
    """The rows that `commission` says before its first step, and the refusal that follows, or ""."""
    said: list[str] = []
    with StateStore(machine, folder) as store:
        work = Commissioning(machine, store, folder, said.append, lambda step: True)
        try:
            work.start(again=False)
        except CommandRefused as refused:
            return said, str(refused)
    return said, ""


@pytest.mark.parametrize("name", EXPECTED)
def test_the_rows_of_a_real_drive_are_those_by_hand(name: str) -> None:
    found = {
        row.what: NAME if row.lacking and row.acceptable
        else STEP if row.lacking and row.proof
        else FILE if row.lacking and row.by_file
        else NEVER if row.lacking
        else MADE
        for row in rows_by_eds(name, machine_of(name))
        if row.standing is not Standing.OBJECT
    }  # fmt: skip
    assert found == EXPECTED[name]


@pytest.mark.parametrize("name", EXPECTED)
def test_the_file_and_the_commissioning_of_the_drive_say_the_same(name: str, tmp_path: Path) -> None:
    machine = machine_of(name)
    rows = rows_by_eds(name, machine)
    said, refusal = said_by_commissioning(name, machine, tmp_path)
    known = known_of_model(machine, facts_by_eds(name, machine))
    assert said == [f"  {line}" for line in (*known, *(row.text for row in rows))]
    assert known[0].startswith("profile ")
    assert bool(impossible(rows)) == refusal.startswith("CFG-CAN-05")
    assert bool(refusal) == bool(impossible(rows) or unset(rows))
    # And as a user sees it: the same lines, the same refusal.
    file, config = tmp_path / "drive.eds", tmp_path / "m.toml"
    file.write_text(eds_of(name))
    machine_file(config, {"drive.kind": "canopen", "control.scan_period_ms": 4.0, **_CHANGES.get(name, {})})
    shown = cli("eds", "check", file, "--node", 2, "--config", config)
    lines = shown.out.splitlines()
    assert [line for line in lines if line in said] == said
    assert shown.code == int(bool(impossible(rows)))
    # What a person could accept counts as accepted of a virtual drive; of the file it is told.
    if refusal.startswith("CFG-CAN-05"):
        assert any(refusal.split(" · CFG")[0] in line for line in lines)


@pytest.mark.parametrize("name", EXPECTED)
def test_a_limit_of_torque_entered_leaves_what_names_and_steps_stand_for(name: str) -> None:
    rows = rows_by_eds(name, with_values(machine_of(name), {"can.torque_limit_in_drive_nm": 385.0}))
    assert bool(impossible(rows)) == (name in REFUSED)
    expected = EXPECTED[name]
    named = {what for what, standing in expected.items() if standing == NAME}
    assert {row.what for row in lacks(rows)} == named | (
        {"limits_torque"} if expected.get("limits_torque") == FILE else set()
    )
