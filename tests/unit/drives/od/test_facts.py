"""Facts of a drive: of an EDS and of the drive itself they are the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.setup.live_facts import read_facts
from gantryctl.drives.od.facts import ObjectFact, facts_of
from gantryctl.drives.od.reading import parse_eds, read_eds
from gantryctl.drives.od.standard import STANDARD
from gantryctl.drives.od.writing import write_eds
from gantryctl.machine import configs_folder, load_machine
from gantryctl.wiring.virtual import virtual_node

pytestmark = pytest.mark.can

FILES = Path(__file__).parents[3] / "data" / "eds"


def test_a_dcf_value_counts_before_the_default_and_the_node_is_added() -> None:
    facts = facts_of(read_eds(FILES / "node_arithmetic.dcf", 5))
    assert facts.value(0x6007) == 0
    assert facts.has(0x6007)
    assert not facts.has(0x6007, 1)
    assert facts.value(0x5FFF) is None
    assert facts.serial == 0


def test_what_an_object_takes() -> None:
    assert ObjectFact(True, False, 0, 1, 5).takes(5)
    assert not ObjectFact(True, False, 0, 1, 5).takes(6)
    assert not ObjectFact(True, False, 0, 1, 5).takes(0)
    assert not ObjectFact(False, False).takes(3)


# Identifiers depend on the node, and commands, actual values and the save are what they are at the moment.
_PASSING = {
    0x1001,
    0x1010,
    0x1011,
    0x1014,
    0x1017,
    0x6040,
    0x6041,
    0x6060,
    0x6061,
    0x6064,
    0x606C,
    0x60FD,
    0x603F,
}


@pytest.mark.parametrize("quirks", [(), ("sparse",), ("no-1005",), ("dangerous-defaults",)])
def test_a_drive_and_its_eds_give_the_same_facts(quirks: tuple[str, ...]) -> None:
    link, virtual = virtual_node(load_machine(configs_folder() / "hust_can.toml"), 0.0, quirks=quirks)
    node = RemoteNode(link, 2, 1, 0.5)
    live = read_facts(node.sdo, node.identity(), STANDARD)
    link.close()
    file = facts_of(parse_eds(write_eds(virtual.device).encode(), node_id=virtual.node_id))
    assert (live.vendor, live.product, live.revision) == (file.vendor, file.product, file.revision)
    assert live.software == file.software
    compared = 0
    for place in STANDARD:
        assert live.has(*place) == file.has(*place), f"{place[0]:04X}"
        # Commands and objects that CiA 402 gives as writable and this drive does not: only a write shows it.
        if not live.has(*place) or place[0] in _PASSING:
            continue
        assert live.value(*place) == file.value(*place), f"{place[0]:04X}:{place[1]:02X}"
        compared += 1
    assert compared > 40 - 10 * bool(quirks)


def test_a_refused_write_makes_an_object_read_only() -> None:
    link = virtual_node(load_machine(configs_folder() / "hust_can.toml"))[0]
    node = RemoteNode(link, 2, 1, 0.5)
    facts = read_facts(node.sdo, node.identity(), [(0x605B, 0), (0x6085, 0)], refused=[(0x605B, 0)])
    link.close()
    assert not facts.writable(0x605B)
    assert facts.writable(0x6085)
