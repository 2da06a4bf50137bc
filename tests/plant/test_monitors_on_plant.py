"""Every monitor of a moving axis on the plant, at 1, 4 and 10 ms and both ways: which alarm, how soon, how far.

The way is the true one of the motor, from the onset of the fault to rest; limits are those of the reaction classes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from gantryctl.engineering.faults.kinds.kind import Value
from gantryctl.image import DriveRequest, EncoderFlag
from gantryctl.program import PowerPhase, Reaction
from gantryctl.units import deg, rad
from plant.plant_rig import AT_EVERY_SCAN_MS, CHECK_NM, NOMINAL_NM, PlantRig, machine_at

SPEED_DEG_S = 1.0
# Classes at 1 deg/s: quick stop, torque off and brake, feedback; from standstill.
QUICK_DEG, OFF_DEG, FEEDBACK_DEG, STANDSTILL_DEG = 0.16, 0.45, 0.8, 0.35
# The reading of a fault is that of the next scan; a stop of the gantry's swing takes some scans more.
_SCANS_MORE = 2


@dataclass(frozen=True)
class Row:
    """One fault in motion (or at standstill), and what must come of it.

    Attributes:
        inject: makes the fault; gets the rig and the direction.
        code, reaction: of the first alarm; of several codes that see the same, any.
        within_s: from the fault to the alarm, beside two scans.
        way_deg: from the fault to rest.
        standing: the axis stands in position when it happens.
    """

    name: str
    inject: Callable[[PlantRig, float], None]
    code: str
    reaction: Reaction | None
    within_s: float
    way_deg: float
    standing: bool = False
    moment_nm: float = NOMINAL_NM


def fault(where: str, kind: str, **args: Value) -> Callable[[PlantRig, float], None]:
    return lambda rig, _: rig.inject(where, kind, **args)


def limit_switch(rig: PlantRig, direction: float) -> None:
    rig.inject("input", "off", name="limit_plus_ok" if direction > 0.0 else "limit_minus_ok")


def both_switches(rig: PlantRig, _: float) -> None:
    rig.inject("input", "off", name="limit_plus_ok")
    rig.inject("input", "off", name="limit_minus_ok")


def error_seen(extra_deg: float) -> Callable[[PlantRig, float], None]:
    """The following error is larger than it is, for the monitors only."""

    def inject(rig: PlantRig, direction: float) -> None:
        law = rig.axis._law

        def shifted(*given: float) -> tuple[float, float, float]:
            vel, pos, error = law(*given)
            return vel, pos, error + direction * rad(extra_deg)

        rig.axis._law = shifted

    return inject


def shows_too_fast(rig: PlantRig, direction: float) -> None:
    """The speed shows 0.15 deg/s more, beyond the trip: a change that torque could make (ENC-14)."""
    rig.axis.monitors._deviation = math.inf
    rig.axis.monitors._trip = rad(SPEED_DEG_S + 0.1)
    ratio = rig.axis.settings.law.ratio
    rig.spoil = lambda drive: drive._replace(
        vel_act_rad_s=drive.vel_act_rad_s + direction * rad(0.15) * ratio
    )


def travel_ends(ahead_deg: float) -> Callable[[PlantRig, float], None]:
    """The end of the travel comes near by itself: nothing else than these monitors may see it."""

    def inject(rig: PlantRig, direction: float) -> None:
        end = rig.axis.pos_act_rad + direction * rad(ahead_deg)
        if direction > 0.0:
            rig.axis.monitors._over_travel_plus = end
        else:
            rig.axis.monitors._over_travel_minus = end

    return inject


QS, TO = Reaction.QUICK_STOP, Reaction.TORQUE_OFF
ROWS = (
    Row("following error", error_seen(0.06), "CTL-03", QS, 0.010, QUICK_DEG),
    Row("velocity deviation", fault("drive", "sign"), "CTL-05", TO, 0.060, FEEDBACK_DEG),
    Row("overspeed", shows_too_fast, "CTL-04", QS, 0.030, QUICK_DEG),
    Row("over-travel", travel_ends(-0.001), "LIM-02", QS, 0.0, QUICK_DEG),
    Row("stop point", travel_ends(0.05), "CTL-10", QS, 0.0, QUICK_DEG),
    Row("standstill lost", error_seen(0.025), "CTL-13", QS, 0.010, 0.02, True),
    Row(
        "torque limit",
        fault("drive", "torque_limit", share=0.05),
        "CTL-07",
        TO,
        0.4,
        OFF_DEG,
        False,
        CHECK_NM,
    ),
    Row("brake closes", fault("brake", "stuck", position="closed"), "BRK-05 BRK-14", None, 0.3, OFF_DEG),
    Row("limit switch", limit_switch, "LIM-03", QS, 0.0, QUICK_DEG),
    Row("both limit switches", both_switches, "LIM-04", QS, 0.0, QUICK_DEG),
    Row("drive fault", fault("drive", "trip", code=0x2310), "DRV-01", TO, 0.0, OFF_DEG),
    Row("drive leaves enable", fault("drive", "leaves_enabled"), "DRV-04", TO, 0.0, OFF_DEG),
    Row("mains", fault("input", "off", name="mains_ready"), "PWR-01", TO, 0.0, OFF_DEG),
    Row("emergency stop", fault("input", "off", name="estop_ok"), "INT-03", TO, 0.0, OFF_DEG),
    Row("collision", fault("input", "off", name="collision_ok"), "INT-01", QS, 0.0, QUICK_DEG),
    Row(
        "encoder alarm",
        fault("encoder", "flags", bits=int(EncoderFlag.ALARM)),
        "ENC-05",
        TO,
        0.0,
        FEEDBACK_DEG,
    ),
    Row(
        "encoder frozen", fault("encoder", "gain", value=0.0), "ENC-02 ENC-14 BRK-14", TO, 0.050, FEEDBACK_DEG
    ),
)


REQUEST = {QS: DriveRequest.QUICK_STOP, TO: DriveRequest.DISABLE}


@pytest.mark.parametrize("direction", [1.0, -1.0], ids=["forward", "back"])
@AT_EVERY_SCAN_MS
@pytest.mark.parametrize("row", [pytest.param(row, id=row.name) for row in ROWS])
def test_a_monitor_on_the_plant(row: Row, scan_ms: float, direction: float) -> None:
    rig = PlantRig(machine_at(scan_ms, row.moment_nm), -90.0 * direction)
    if row.standing:
        rig.power_up(1.0)
    else:
        rig.cruise(SPEED_DEG_S, direction)
    assert rig.first == "", rig.texts
    start, begin = rig.motor_deg, rig.engine.time_s
    row.inject(rig, direction)
    while rig.first == "" and rig.engine.time_s - begin < 2.0:
        rig.step()
    seen = f"{rig.first_alarm and rig.first_alarm.text} after {rig.engine.time_s - begin:.3f} s"
    assert rig.first_alarm is not None, seen
    assert rig.first in row.code.split(), seen
    reaction = rig.first_alarm.reaction
    assert reaction is (row.reaction or reaction), seen
    assert rig.engine.time_s - begin <= row.within_s + (_SCANS_MORE + 1e-6) * rig.period_s, seen
    assert rig.axis.power.request is REQUEST[reaction], seen
    assert rig.axis.power.brake_open is (reaction is QS), seen
    assert rig.axis.vel_cmd_rad_s == 0.0, seen
    # A reading that was spoilt for a monitor is right again: what is judged is the stop.
    rig.spoil = None
    rig.way_to_rest()
    assert abs(rig.motor_deg - start) <= row.way_deg, seen
    assert rig.axis.power.phase is PowerPhase.OFF, seen


def test_the_moves_of_these_rows_alone_raise_nothing() -> None:
    """Without a fault the same moves go on, at every scan period and both ways."""
    for scan_ms in (1.0, 4.0, 10.0):
        for direction in (1.0, -1.0):
            rig = PlantRig(machine_at(scan_ms), -90.0 * direction)
            rig.cruise(SPEED_DEG_S, direction)
            rig.run(1.0)
            assert not rig.axis.alarms.active, rig.texts
            assert abs(deg(rig.axis.pos_err_rad)) < 0.015
