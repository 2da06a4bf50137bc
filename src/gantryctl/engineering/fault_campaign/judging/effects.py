"""What faults leave of the axis, and which alarms may come first because of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from gantryctl.engineering.faults.case import FaultCase, ReactionClass
from gantryctl.engineering.faults.injection import Injection
from gantryctl.engineering.faults.kinds.kind import Place
from gantryctl.engineering.faults.oracle.tell import effect_of, hides_state
from gantryctl.program.alarms.codes import Code

_TAKES_TORQUE: Final = frozenset(
    {
        ReactionClass.TORQUE_OFF, ReactionClass.FEEDBACK, ReactionClass.STANDSTILL, ReactionClass.DRIVE_DEADLINE,
        ReactionClass.NONE,
    }
)  # fmt: skip
# Of its torque: the 16 kN m of the reference gantry, with 20 % more, ask for 17 N m of 400.
_HOLDS_SHARE: Final = 0.1
LOAD_MOVES: Final = frozenset({Code.BRK_03, Code.BRK_04, Code.BRK_11, Code.BRK_13})
"""Alarms that tell people that the load moves."""


def nothing_holds(cases: Sequence[FaultCase]) -> bool:
    """Faults together leave nothing that could hold the load: a brake without torque, and another takes the drive's,
    or lets the controller stand still, which alone could give it back (seed 90374 of the pairs).

    Then the axis can keep no way, and must tell people (rows A20 and B13 are of this kind by themselves); that the load
    moves nobody can know where the reading stands whatever it does.
    """
    return _beside_no_brake(cases, lambda case: case.reaction in _TAKES_TORQUE or _stands_still(case))


def nobody_sees_the_brake(cases: Sequence[FaultCase]) -> bool:
    """A brake without torque, and no telegrams of the drive that would show it as the torque goes in order."""
    return _beside_no_brake(cases, lambda case: any(loses_telegrams(each) for each in case.injections))


def _beside_no_brake(cases: Sequence[FaultCase], is_so: Callable[[FaultCase], bool]) -> bool:
    weak = [case for case in cases if any(_without_brake(each) for each in case.injections)]
    return bool(weak) and any(is_so(case) for case in cases if case not in weak)


def loses_telegrams(each: Injection) -> bool:
    """The telegrams of the drive do not come, or those with its state do not."""
    lost = (each.where, each.kind) in ((Place.FRAME, "sync_lost"), (Place.FRAME, "drive_silent"))
    return lost or hides_state(each)


def _stands_still(case: FaultCase) -> bool:
    return any((each.where, each.kind) == (Place.CLOCK, "stall") for each in case.injections)


def driven_on(cases: Sequence[FaultCase]) -> bool:
    """A drive that obeys nothing, and a spoilt reading: all of its torque drives the shaft through the closed brake.

    385 N m against the 380 N m that a brake may have. Only its supply ends it, and a relay in that where one is wired.
    """
    stuck = any(
        (each.where, each.kind) == (Place.DRIVE, "stuck_state") for case in cases for each in case.injections
    )
    return stuck and any(effect_of(each).feedback for case in cases for each in case.injections)


def shows_no_motion(case: FaultCase) -> bool:
    """The reading stands whatever the shaft does."""
    return any(
        each.where is Place.ENCODER
        and (each.kind == "freeze_reading" or (each.kind == "gain" and each.values["value"] == 0.0))
        for each in case.injections
    )


def reaches_nobody(case: FaultCase) -> bool:
    """The drive is off the bus: no reading comes, and none of a drive that comes back counts before a reset."""
    return any((each.where, each.kind) == (Place.FRAME, "drive_silent") for each in case.injections)


def wrong_sign(case: FaultCase) -> bool:
    """The reading turns the other way than the shaft."""
    return any(
        each.where is Place.ENCODER and each.kind == "gain" and each.values["value"] < 0.0
        for each in case.injections
    )


def _without_brake(each: Injection) -> bool:
    key = (each.where, each.kind)
    if key == (Place.BRAKE, "stuck"):
        return str(each.values["position"]) == "open"
    return key == (Place.BRAKE, "torque") and float(each.values["share"]) < _HOLDS_SHARE


# Families of alarms by the place where a fault acts. What a fault of one place may show as first depends on what the
# axis does at that moment: an encoder that lies shows as control that is lost, a drive without torque too.
_CONTROL: Final = ("CTL-", Code.ENC_02, Code.ENC_12, Code.ENC_14, Code.BRK_13, Code.BRK_14, Code.DRV_13)
_FAMILIES: Final[dict[Place, tuple[str, ...]]] = {
    Place.ENCODER: ("ENC-", *_CONTROL, Code.BRK_03, Code.BRK_04),
    # A drive that restarts, or sends two thousand emergencies at once, shows on the bus too: no answer, no room.
    Place.DRIVE: (
        "DRV-",
        "CAN-",
        *_CONTROL,
        Code.BRK_01,
        Code.BRK_03,
        Code.BRK_04,
        Code.BRK_05,
        Code.BRK_06,
        Code.BRK_07,
        # Torque that goes within the 0.2 s in which the sag behind the opened brake is watched (axes 4197).
        Code.BRK_10,
    ),
    Place.BRAKE: ("BRK-", *_CONTROL),
    Place.PLANT: (*_CONTROL, "BRK-", "THM-"),
    # A channel that is wired to the drive alone shows as a power stage without its supply: it leaves Operation
    # enabled, and stays in Ready to switch on.
    Place.INPUT: ("INT-", "LIM-", "PWR-", "THM-", Code.DRV_01, Code.DRV_03, Code.DRV_04),
    # A reading that is 40 ms late is 0.05 deg away from the encoder on the ring from 1.25 deg/s on.
    Place.FRAME: ("CAN-", "DRV-", *_CONTROL, Code.ENC_01, Code.ENC_07),
    Place.NODE: (
        Code.CAN_16,
        Code.DRV_03,
        Code.DRV_04,
        "INT-",
        "LIM-",
        "PWR-",
        "BRK-",
        Code.ENC_07,
        *_CONTROL,
    ),
    Place.CLOCK: (Code.SYS_02, Code.SYS_03, "CAN-", "DRV-", *_CONTROL, Code.ENC_01),
    Place.PROCESS: (),
    Place.OPERATOR: (Code.INT_06,),
}


def may_come_first(code: Code, case: FaultCase) -> bool:
    """An alarm of this code may be the first because of a row of the catalogue."""
    if code in case.codes or code is case.also or any(each.code is code for each in case.instead):
        return True
    # A load that hangs on the motor alone takes more torque than the proof asks for (seed 70322).
    if code is Code.DRV_14 and any(_without_brake(each) for each in case.injections):
        return True
    families = {family for each in case.injections for family in _FAMILIES[each.where]}
    return code.value.startswith(tuple(families))
