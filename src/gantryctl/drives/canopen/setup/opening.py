"""Set-up of a drive before the first scan: identity, parameters, mapping, mode, by SDO in PRE-OPERATIONAL."""

from __future__ import annotations

from contextlib import suppress
from typing import Final, NamedTuple

from gantryctl.drives.canopen.bus.node import NmtCommand, NodeIdentity, RemoteNode
from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError
from gantryctl.drives.canopen.cia402 import TURNING, decode_statusword
from gantryctl.drives.canopen.mapping import (
    OPTIONAL,
    SET_BRAKE,
    FixedMapping,
    Mapping,
    configure,
    extra_signals,
)
from gantryctl.drives.canopen.scaling import BusUnits
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.drives.canopen.setup.live_facts import (
    ASKED,
    read_facts,
    read_only_of,
    with_mapped,
    without_csv,
)
from gantryctl.drives.canopen.setup.parameter_check import (
    CSV,
    WantedParameter,
    as_set_up,
    compare,
    compare_parameters,
    parameter_checksum,
    rated_torque,
    refusals,
    set_value_places,
    wanted_parameters,
    with_abort_codes,
    write_parameters,
)
from gantryctl.drives.od.facts import DriveFacts
from gantryctl.drives.od.verdicts import ParameterRow, ParameterVerdict
from gantryctl.drives.profiles import places_of_maker
from gantryctl.errors import DeviceError
from gantryctl.image import DriveState

# 6061 may follow a write to 6060 later: by 10 ms on a real drive model.
_LAG_S: Final = 0.2
_STEP_S: Final = 0.005


# The restart marker: the identifier of a telegram that is not used, with its invalid bit set, means nothing to the
# drive. It comes back with its default at every boot-up (CiA 301), and is kept over one only when 1010 stores it.
_UNUSED: Final = ((0x1403, 0x500), (0x1402, 0x400))  # RPDO 4 and 3, and where their defaults begin
_INVALID: Final = 0x8000_0000
_IDENTIFIER: Final = 0x7FF
# Identifiers without a restricted use in CiA 301; the defaults of both telegrams lie above.
RESTART_MARKERS: Final = range(0x181, 0x400)


def read_restart_marker(sdo: SdoClient) -> int | None:
    """Read the marker; None where the drive has none, or no object for one."""
    for index, _ in _UNUSED:
        found = sdo.optional(index, 1)
        if found is not None:
            marker = found & _IDENTIFIER
            return marker if found & _INVALID and marker in RESTART_MARKERS else None
    return None


def write_restart_marker(sdo: SdoClient, node: int, marker: int | None) -> bool:
    """Write a marker, or remove it (None); False where the drive takes none."""
    for index, default in _UNUSED:
        found = sdo.optional(index, 1)
        if found is None:
            continue
        wanted = _INVALID | (default + node if marker is None else marker)
        if not found & _INVALID:
            return False
        try:
            sdo.set(index, 1, wanted, 4)
        except DeviceError:
            return False
        return sdo.optional(index, 1) == wanted
    return False


class NodeSetup(NamedTuple):
    """Drive as set up before the first scan."""

    identity: NodeIdentity
    units: BusUnits
    rows: tuple[ParameterRow, ...]
    refusals: tuple[str, ...]
    mapping: Mapping
    error_code: int
    kept: tuple[WantedParameter, ...]
    """Parameters that agree with their set values, and must stay so."""
    restart_marker: int | None
    """Number that an earlier run left in the drive; gone after a boot-up."""
    facts: DriveFacts
    """What the drive has, as the set-up has left it."""
    settings: CanopenSettings
    """With the profile of the drive."""


class UnusableDrive(DeviceError):
    """Drive that cannot be set up; `facts` show the ledger why."""

    def __init__(self, text: str, facts: DriveFacts) -> None:
        self.facts = facts
        super().__init__(text)


_WATCH: Final = (0x1016, 1)
# The objects by which telegrams are set up.
_TELEGRAMS: Final = ((0x1400, 1), (0x1400, 2), (0x1600, 0), (0x1800, 1), (0x1800, 2), (0x1A00, 0))


def wanted_of(settings: CanopenSettings, rated: int | None) -> tuple[WantedParameter, ...]:
    """Parameters of a drive; `rated` is its object 6076, None where it does not say."""
    rated_nm = rated_torque_nm(settings, rated)
    return wanted_parameters(settings, BusUnits(settings, rated_nm), rated_nm)


def rated_torque_nm(settings: CanopenSettings, rated: int | None) -> float:
    """Rated torque: 6076 where the drive has it and it can be, else of the machine file."""
    # The parameter check refuses one that cannot be; until then nothing is scaled by it.
    if rated is None or compare(rated_torque(settings), rated).verdict is not ParameterVerdict.OK:
        return settings.torque_rated_nm
    return rated / settings.rated_torque_per_nm


def parameter_rows(settings: CanopenSettings, facts: DriveFacts) -> tuple[ParameterRow, ...]:
    """Parameters of a drive against what they must be."""
    return compare_parameters(facts, wanted_of(settings.of_drive(facts), facts.value(0x6076)))


def facts_as_set_up(settings: CanopenSettings, facts: DriveFacts) -> DriveFacts:
    """A drive as `open_node` would leave it."""
    return as_set_up(facts, wanted_of(settings.of_drive(facts), facts.value(0x6076)))


def checksum_of(settings: CanopenSettings, facts: DriveFacts) -> str:
    """Checksum of the values that decide what the drive does."""
    return parameter_checksum(facts, wanted_of(settings.of_drive(facts), facts.value(0x6076)))


def facts_as_found(node: RemoteNode, settings: CanopenSettings) -> tuple[NodeIdentity, DriveFacts]:
    """Identity and facts of a drive as they are; nothing is written."""
    node.drain()
    identity = node.identity()
    settings = _profiled(node, identity, settings)
    wanted = wanted_of(settings, node.sdo.optional(0x6076))
    return identity, _facts(node, identity, wanted)


def _profiled(node: RemoteNode, identity: NodeIdentity, settings: CanopenSettings) -> CanopenSettings:
    """The settings with the profile of the drive that answers."""
    return settings.of_drive(read_facts(node.sdo, identity, places_of_maker(identity.vendor)))


def _facts(
    node: RemoteNode,
    identity: NodeIdentity,
    wanted: tuple[WantedParameter, ...],
    refused: frozenset[tuple[int, int]] = frozenset(),
) -> DriveFacts:
    asked = (*ASKED, *set_value_places(wanted), *places_of_maker(identity.vendor))
    return read_facts(node.sdo, identity, asked, refused)


def open_node(node: RemoteNode, settings: CanopenSettings) -> NodeSetup:
    """Set a drive up and start it; it is not enabled.

    Raises:
        DeviceError: the node does not answer, another controller has enabled it, or it cannot be mapped.
    """
    node.drain()
    identity = node.identity()
    refuse_a_running_drive(node)
    node.enter_pre_operational()
    settings = _profiled(node, identity, settings)
    rated = node.sdo.optional(0x6076)
    refused, codes = write_parameters(node.sdo, wanted_of(settings, rated))
    settings, refused = _watched(node, identity, settings, rated, refused)
    wanted = wanted_of(settings, rated)
    # The brake closes and the speed is 0 before the telegrams fly: the RPDO repeats both from the first scan on.
    mask = settings.output_mask
    if mask:
        _outputs_off(node, mask)
    try:
        node.sdo.set(0x6040, 0, 0)
        node.sdo.set(0x60FF, 0, 0)
    except SdoError as lacking:
        if lacking.silent:
            raise
        raise UnusableDrive(f"node {node.node}: {lacking}", _facts(node, identity, wanted, refused)) from None
    try:
        mapping = configure(node.sdo, node.node, mask != 0, extra_signals(settings))
    except FixedMapping as fixed:
        refused |= read_only_of(node.sdo, _TELEGRAMS)
        found = _facts(node, identity, wanted, refused)
        raise UnusableDrive(str(fixed), found if _takes_csv(node) else without_csv(found)) from None
    wrong_mode = _select_csv(node)
    found = _facts(node, identity, wanted, refused)
    if wrong_mode is None:
        text = f"node {node.node}: 6060 does not take {CSV}: it has no mode CSV"
        raise UnusableDrive(text, without_csv(found))
    facts = with_mapped(found, ((s.obj, s.sub) for s in OPTIONAL if s in mapping.refused))
    rows = with_abort_codes(compare_parameters(facts, wanted), codes)
    # Some drives answer SDO in PRE-OPERATIONAL only.
    marker = read_restart_marker(node.sdo)
    node.nmt(NmtCommand.START)
    kept = tuple(p for p, row in zip(wanted, rows, strict=True) if row.verdict is ParameterVerdict.OK)
    return NodeSetup(
        identity=identity,
        units=BusUnits(settings, rated_torque_nm(settings, rated)),
        rows=rows,
        refusals=(*refusals(rows), *wrong_mode),
        mapping=mapping,
        error_code=facts.value(0x603F) or 0,
        kept=kept,
        restart_marker=marker,
        facts=facts,
        settings=settings,
    )


def _watched(
    node: RemoteNode,
    identity: NodeIdentity,
    settings: CanopenSettings,
    rated: int | None,
    refused: frozenset[tuple[int, int]],
) -> tuple[CanopenSettings, frozenset[tuple[int, int]]]:
    """Shorten the heartbeat time-out of a drive that watches nothing else; one that takes no shorter one keeps it."""
    watches = (_WATCH, (0x1400, 5))
    short = settings.of_drive(read_facts(node.sdo, identity, watches, refused))
    if not short.watched_alone:
        return short, refused
    parameter = next(p for p in wanted_of(short, rated) if (p.obj, p.sub) == _WATCH)
    if not write_parameters(node.sdo, (parameter,))[0]:
        return short, refused
    refused |= {_WATCH}
    return settings.of_drive(read_facts(node.sdo, identity, watches, refused)), refused


def _outputs_off(node: RemoteNode, mask: int) -> None:
    """Switch all outputs off; off is a closed brake."""
    # Not every drive has a mask of its outputs (60FE:02).
    if node.sdo.optional(0x60FE, 2) is not None:
        node.sdo.set(0x60FE, 2, mask)
    node.sdo.set(0x60FE, 1, mask & SET_BRAKE)


def refuse_a_running_drive(node: RemoteNode) -> None:
    """Refuse a drive that has torque.

    Raises:
        DeviceError: it has.
    """
    # Writing the mapping of an enabled drive would take it from the controller that runs it.
    state = decode_statusword(node.sdo.number(0x6041))
    if state is DriveState.FAULT_REACTION_ACTIVE:
        raise DeviceError(f"node {node.node} ramps down after a fault: wait until it stands, then go on")
    if state in TURNING:
        raise DeviceError(
            f"node {node.node} is in {state.name.replace('_', ' ').lower()} already: another controller runs it, or "
            "one was lost and the drive does not watch it · stop it with the emergency stop before you go on"
        )


def _takes_csv(node: RemoteNode) -> bool:
    """Write 6060 = 9; False where the drive refuses it."""
    # Written afresh: after a quick stop some drives report Operation enabled and stand until 6060 changes.
    # Not every drive knows mode 0, "no mode".
    with suppress(DeviceError):
        node.sdo.set(0x6060, 0, 0)
    try:
        node.sdo.set(0x6060, 0, CSV)
    except SdoError as refused:
        if refused.silent:
            raise
        return False
    return True


def _select_csv(node: RemoteNode) -> tuple[str, ...] | None:
    """Write 6060 = 9 and wait until 6061 shows it; a refusal where it does not, None where 6060 does not take it."""
    sdo = node.sdo
    if not _takes_csv(node):
        return None
    waited = 0.0
    while (shown := sdo.number(0x6061)) != CSV and waited < _LAG_S:
        node.listen_for(_STEP_S)
        waited += _STEP_S
    if shown == CSV:
        return ()
    return (f"6061:00 Modes of operation display: want 9, have {shown} · the drive does not take mode CSV",)
