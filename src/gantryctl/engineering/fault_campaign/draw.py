"""Scenarios from seeds: the same campaign, series and number give the same scenario on every computer.

Everything is drawn from one `random.Random` that is seeded with a text, and by `random()` alone, whose sequence Python
keeps the same (docs.python.org/3/library/random.html, "Notes on Reproducibility").
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from itertools import permutations
from typing import Any, Final, Literal, TypeVar

from gantryctl.engineering.drafting.origin import significant
from gantryctl.engineering.drafting.templates import load_template, template_names
from gantryctl.engineering.fault_campaign.machines import axis_of, drafted_machine
from gantryctl.engineering.fault_campaign.scenario import Action, Deed, PlannedFault, Scenario
from gantryctl.engineering.faults.case import FaultCase, Phase
from gantryctl.engineering.faults.catalogue import CATALOGUE
from gantryctl.engineering.faults.kinds.kind import Value
from gantryctl.errors import ConfigError
from gantryctl.machine.places import reach_deg

DURATION_S: Final = 30.0
BUS_SHARE: Final = 0.25
"""Of the seeds; at least a fifth is asked for."""
SOUND_SHARE: Final = 0.1
"""Without a fault: what stops here is a nuisance."""
# Of the scenarios that have faults.
_ONE: Final = 0.4
_TWO: Final = 0.8
PAIR_STRIDE: Final = 100_003
"""A prime above the number of rows, and so without a common divisor with the number of their pairs."""
_BESIDE_SHARE: Final = 0.3
_BUS_ROWS_SHARE: Final = 0.6
_POWER_AT_S: Final = 0.2
_FIRST_ACTION_S: Final = 2.2
_LAST_S: Final = 27.0
_TOP_DEG_S: Final = 6.0
_SCANS_MS: Final = (1.0, 4.0, 4.0, 10.0)
WIDE_SCANS_MS: Final = (1.0, 2.0, 4.0, 10.0)
_DEEDS: Final[tuple[Deed, ...]] = (
    "move", "move", "move", "move", "jog", "jog", "jog", "increment", "halt", "stop", "override", "power_off",
    "quick_stop", "recover", "brake_test", "power",
)  # fmt: skip
_AT_SPEED: Final[tuple[Deed, ...]] = ("move", "jog", "increment")
# A person's own deeds are drawn as such; a brake that never holds and a spoilt HOLD have rows of their own.
_NOT_DRAWN: Final = frozenset({"B1", "B10", "G17"})
_IMPROVED_SHARE: Final = 0.15
# So many answers are drawn for an axis that a motor of the catalogue can do; else those of the template stay.
_DRAFTS: Final = 10
# Decades to either side of the answer of a template.
_ANSWERS: Final = {
    "inertia_kg_m2": 0.5, "unbalance_nm": 0.3, "wind_nm": 0.3, "speed_max_r_min": 0.2, "acc_time_s": 0.3,
    "first_mode_hz": 0.2, "stopping_angle_deg": 0.1,
}  # fmt: skip
Drive = Literal["sim", "bus"]
T = TypeVar("T")


class Draw:
    """Draws of one scenario."""

    def __init__(self, text: str) -> None:
        self._next = random.Random(text).random  # noqa: S311 - scenarios that can be repeated, no secret

    def uniform(self, low: float, high: float) -> float:
        """A number of a range, to the microsecond or millionth: files stay short."""
        return round(low + (high - low) * self._next(), 6)

    def happens(self, share: float) -> bool:
        """True in this part of all draws."""
        return self._next() < share

    def one_of(self, things: Sequence[T]) -> T:
        """One of several."""
        return things[int(self._next() * len(things))]


def drawable(drive: Drive, beside: bool = False) -> list[FaultCase]:
    """Rows that random scenarios have on this drive: those that are judged and can come at any moment."""
    return [
        case
        for case in CATALOGUE
        if case.judged
        and drive in case.buses
        and (beside or not case.beside)
        and case.phase is not Phase.HOLD
        and case.number not in _NOT_DRAWN
    ]


def pairs(drive: Drive, *, beside: bool) -> list[tuple[str, str]]:
    """Ordered pairs of rows that are forced together."""
    return list(permutations([case.number for case in drawable(drive, beside)], 2))


def random_scenario(series: int, number: int, scan_ms: float | None = None) -> Scenario:
    """One random scenario: none to three faults, random moves and deeds, plant within 20 %.

    Args:
        scan_ms: the same for all; drawn when not given.
    """
    name = f"random {series} {number}"
    return _random(Draw(name), name, number, scan_ms)


def wide_scenario(series: int, number: int, scan_ms: float | None = None) -> Scenario:
    """The same on machines further away: every scan period, a second pinion, each value of the plant 20 % off."""
    name = f"wide {series} {number}"
    draw = Draw(name)
    scan_ms = draw.one_of(WIDE_SCANS_MS) if scan_ms is None else scan_ms
    second_pinion, edge = draw.happens(0.5), draw.happens(0.5)
    scene = _random(draw, name, number, scan_ms)
    # Two drives of one axis are simulated in process only.
    second_pinion = second_pinion and scene.drive == "sim"
    return scene.model_copy(update={"second_pinion": second_pinion, "edge": edge})


def axis_scenario(series: int, number: int, scan_ms: float | None = None, drive: Drive = "sim") -> Scenario:
    """The same on another axis: a template of `gantryctl new` with drawn answers, or the improved gantry.

    On a bus it is the same axis with faults of a bus. Speeds and angles are those of the reference gantry, in parts of
    the highest speed and of the travel.
    """
    name = f"axes {series} {number}"
    draw = Draw(name)
    scan_ms = draw.one_of(WIDE_SCANS_MS) if scan_ms is None else scan_ms
    axis = other_axis(draw, drive)
    scene = _random(draw, name, number, scan_ms, drive, beside=False)
    # By a generator of its own: all else is as on the simulated drive.
    axis["inverted"] = drive == "bus" and Draw(f"{name} mounting").happens(0.5)
    return _on_axis(scene.model_copy(update={**axis, "ramp_deg_s2": None}))


def other_axis(draw: Draw, drive: Drive) -> dict[str, Any]:
    """Values of a scenario that make its axis another one: a template with drawn answers, or the improved gantry."""
    # Its encoder on the ring is of the simulated drive.
    if draw.happens(_IMPROVED_SHARE) and drive == "sim":
        # It keeps the plant that its calibration is of: another eccentric moment is told (CTL-19).
        return {"improved": True, "plant_seed": None}
    return {**_drawn_axis(draw, draw.one_of(template_names())), "edge": draw.happens(0.5)}


def _drawn_axis(draw: Draw, template: str) -> dict[str, Any]:
    """A template with answers that a motor of the catalogue can do."""
    usual = load_template(template).answers
    for _ in range(_DRAFTS):
        answers = {
            key: significant(getattr(usual, key) * 10.0 ** draw.uniform(-decades, decades))
            for key, decades in _ANSWERS.items()
            if getattr(usual, key)
        }
        try:
            drafted_machine(template, tuple(sorted(answers.items())))
        except ConfigError:
            continue
        return {"template": template, "answers": answers}
    return {"template": template}


def _on_axis(scene: Scenario) -> Scenario:
    """Speeds and angles of the reference gantry, as parts of what another axis has."""
    machine = axis_of(scene)
    assert machine is not None
    low, high = reach_deg(machine)
    fast, far = machine.speed.setting_max_deg_s / _TOP_DEG_S, (high - low) / 360.0

    def there(angle_deg: float) -> float:
        return round(low + (angle_deg + 180.0) * far, 6)

    actions = []
    for each in scene.actions:
        values = {"speed_deg_s": each.speed_deg_s * fast} if each.do in _AT_SPEED else {}
        if each.do == "move":
            values["target_deg"] = there(each.target_deg)
        if each.do == "increment":
            values["step_deg"] = each.step_deg * min(fast, far)
        actions.append(each.model_copy(update=values))
    return scene.model_copy(update={"angle_deg": there(scene.angle_deg), "actions": tuple(actions)})


def _random(
    draw: Draw,
    name: str,
    number: int,
    scan_ms: float | None,
    drive: Drive | None = None,
    *,
    beside: bool = True,
) -> Scenario:
    """`beside`: nodes beside the drive may be drawn."""
    if drive is None:
        drive = "bus" if draw.happens(BUS_SHARE) else "sim"
    base = drawn_machine(draw, drive, number, scan_ms, beside=beside)
    actions = _deeds(draw, base.angle_deg)
    count = 0 if draw.happens(SOUND_SHARE) else _count(draw)
    rows = drawable(drive, base.beside)
    # Only a fifth of the scenarios can have what only a bus has: there it comes more often.
    only_bus = [case for case in rows if case.beside] if base.beside else []
    only_bus = only_bus or [case for case in rows if "sim" not in case.buses]
    faults = []
    for _ in range(count):
        of = only_bus if only_bus and draw.happens(_BUS_ROWS_SHARE) else rows
        faults.append(_fault(draw, draw.one_of(of), actions))
    return _made(draw, base, name, actions, faults)


def pair_scenario(series: int, number: int, scan_ms: float | None = None) -> Scenario:
    """Two rows forced together: every ordered pair in turn, the second at most half a second after the first.

    They are numbered with a stride, so that any range of seeds is a sample of all pairs.
    """
    draw = Draw(f"pairs {series} {number}")
    drive: Drive = "bus" if draw.happens(BUS_SHARE) else "sim"
    base = drawn_machine(draw, drive, number, scan_ms)
    of_drive = pairs(drive, beside=drive == "bus")
    first, second = of_drive[number * PAIR_STRIDE % len(of_drive)]
    if any(case.beside and case.number in (first, second) for case in CATALOGUE):
        base = base.model_copy(update={"beside": True, "brake_owner": "drive"})
    actions = _deeds(draw, base.angle_deg)
    rows = {case.number: case for case in CATALOGUE}
    one = _fault(draw, rows[first], actions)
    gap_s = draw.one_of((0.0, 0.01, 0.05, 0.2, 0.5))
    two = _fault(draw, rows[second], actions).model_copy(update={"at_s": round(one.at_s + gap_s, 6)})
    return _made(draw, base, f"pairs {series} {number}", actions, [one, two])


def _count(draw: Draw) -> int:
    share = draw.uniform(0.0, 1.0)
    return 1 if share < _ONE else 2 if share < _TWO else 3


def drawn_machine(
    draw: Draw, drive: Drive, number: int, scan_ms: float | None, *, beside: bool = True
) -> Scenario:
    """Drive, scan, plant and place of a scenario, without deeds and faults."""
    drawn_ms = draw.one_of(_SCANS_MS)
    scan_ms = drawn_ms if scan_ms is None else scan_ms
    beside = beside and drive == "bus" and draw.happens(_BESIDE_SHARE)
    owners: tuple[Literal["drive", "object_60FE"], ...] = ("drive", "object_60FE")
    owner = draw.one_of(owners)
    return Scenario(
        drive=drive,
        beside=beside,
        brake_owner="drive" if beside or drive == "sim" else owner,
        scan_ms=scan_ms,
        # A scan waits for half of its period at most (`faults.run.fault_machine`).
        answer_ms=round(min(2.0, scan_ms * draw.uniform(0.25, 0.5)), 6),
        plant_seed=number,
        ramp_deg_s2=draw.one_of((None, 1.0, 1.0)),
        hold_s=draw.uniform(0.5, 3.0) if draw.happens(0.25) else None,
        angle_deg=draw.uniform(-175.0, 175.0),
        duration_s=DURATION_S,
    )


def _deeds(draw: Draw, angle_deg: float) -> list[Action]:
    """A session: power, then one thing after another."""
    actions = []
    if draw.happens(0.08):
        actions.append(Action(at_s=_POWER_AT_S, do="brake_test"))
        power_s = draw.uniform(7.0, 9.0)
    else:
        power_s = _POWER_AT_S + draw.uniform(0.0, 0.2)
    actions.append(Action(at_s=round(power_s, 6), do="power"))
    now_s, here = power_s + _FIRST_ACTION_S, angle_deg
    while now_s < _LAST_S:
        deed = draw.one_of(_DEEDS)
        at_s = round(now_s, 6)
        speed = draw.one_of((0.6, 1.0, 3.0, _TOP_DEG_S, draw.uniform(0.6, _TOP_DEG_S)))
        if deed == "move":
            way = draw.one_of((0.3, 3.0, 15.0, 60.0)) * draw.uniform(-1.0, 1.0)
            # One in twenty is refused: beyond the travel.
            end = 190.0 if draw.happens(0.05) else 179.0
            here = round(max(-end, min(end, here + way)), 6)
            actions.append(Action(at_s=at_s, do="move", target_deg=here, speed_deg_s=speed))
        elif deed == "jog":
            for_s = draw.uniform(0.1, 4.0)
            lost = draw.uniform(0.0, for_s) if draw.happens(0.25) else None
            age_s = draw.uniform(0.0, 0.15) if draw.happens(0.3) else 0.0
            speed = speed if draw.happens(0.5) else -speed
            actions.append(
                Action(at_s=at_s, do="jog", speed_deg_s=speed, for_s=for_s, lease_s=lost, lease_age_s=age_s)
            )
        elif deed == "increment":
            step = draw.uniform(0.01, 3.0) * draw.one_of((-1.0, 1.0))
            actions.append(Action(at_s=at_s, do="increment", step_deg=round(step, 6), speed_deg_s=speed))
        elif deed == "override":
            actions.append(Action(at_s=at_s, do="override", value=draw.one_of((0.0, 0.3, 0.7, 1.0))))
        elif deed == "quick_stop":
            held_s = draw.uniform(0.1, 2.0)
            actions.append(Action(at_s=at_s, do="quick_stop", for_s=held_s))
            actions.append(Action(at_s=round(at_s + held_s + draw.uniform(1.0, 3.0), 6), do="recover"))
            now_s += 3.0
        elif deed == "stop":
            actions.append(Action(at_s=at_s, do="stop", for_s=draw.uniform(0.05, 2.0)))
        elif deed == "power_off":
            actions.append(Action(at_s=at_s, do="power_off"))
            actions.append(Action(at_s=round(at_s + draw.uniform(0.1, 5.0), 6), do="power"))
        else:
            actions.append(Action(at_s=at_s, do=deed))
        now_s += draw.uniform(0.2, 6.0)
    return actions


# Amounts other than those of the row, where a row's physics has a range: from what must just be seen to what is gross.
_AMOUNTS: Final[dict[str, tuple[str, float, float]]] = {
    "A1": ("angle_deg", 0.05, 5.0),
    "A1b": ("angle_deg", -5.0, -0.05),
    "B8": ("share", 0.0, 0.05),
    "C11": ("late_s", 0.0, 0.2),
    "C12": ("share", 0.5, 1.0),
    "F2": ("late_s", 0.035, 0.5),
}


def _fault(draw: Draw, case: FaultCase, actions: Sequence[Action]) -> PlannedFault:
    """A row at a moment: seven of ten soon after something that the person did."""
    after = draw.one_of(actions).at_s + draw.uniform(0.0, 3.0)
    at_s = after if draw.happens(0.7) else draw.uniform(0.5, _LAST_S - 2.0)
    return planned(draw, case, round(at_s, 6))


def planned(draw: Draw, case: FaultCase, at_s: float) -> PlannedFault:
    """A row at a given moment: its amount, and whether it ends."""
    args: dict[str, Value] = {}
    amount = _AMOUNTS.get(case.number)
    if amount is not None:
        name, low, high = amount
        args[name] = draw.uniform(low, high)
    ends = draw.happens(0.4)
    for_s = draw.uniform(0.05, 6.0)
    return PlannedFault(number=case.number, at_s=at_s, for_s=for_s if ends else None, args=args)


def _made(
    draw: Draw, base: Scenario, name: str, actions: list[Action], faults: list[PlannedFault]
) -> Scenario:
    """The person comes back after most faults: reset, power, and goes on."""
    for fault in faults:
        if draw.happens(0.7):
            actions.append(Action(at_s=round(fault.at_s + draw.uniform(0.3, 5.0), 6), do="recover"))
    ordered = sorted(actions, key=lambda each: each.at_s)
    kept = tuple(sorted(faults, key=lambda each: each.at_s))
    return base.model_copy(update={"name": name, "actions": tuple(ordered), "faults": kept})
