"""A computer held up between its clock and SYNC moves the sample of the position, not the axis."""

from __future__ import annotations

from gantryctl.image import DriveFeedback
from gantryctl.program.alarms.codes import Code
from gantryctl.units import rad
from plant.plant_rig import PlantRig, machine_at

SCAN_MS = 4.0
# 9 ms late in one scan of 4 ms, as measured over UDP on a busy computer.
LATE_SCANS = 9.0 / SCAN_MS


def held_up_once(*, told: bool) -> PlantRig:
    """One sample at 6 deg/s taken late, the next one in time again; `told`: the drive gives the time between them."""
    rig = PlantRig(machine_at(SCAN_MS), 0.0)
    rig.cruise(6.0)
    sample = 0

    def late(feedback: DriveFeedback) -> DriveFeedback:
        nonlocal sample
        sample += 1
        spread = {1: LATE_SCANS, 2: -LATE_SCANS}.get(sample, 0.0)
        counts = feedback.pos_act_counts
        if sample == 1:
            per_rad = rig.axis.settings.law.counts_per_turn * rig.machine.axis.ratio / rad(360.0)
            counts += round(rad(6.0) * LATE_SCANS * SCAN_MS * 1e-3 * per_rad)
        return feedback._replace(pos_act_counts=counts, spread_scans=spread if told else 0.0)

    rig.spoil = late
    rig.run(0.5)
    return rig


def test_a_late_sample_is_no_jump_of_the_encoder() -> None:
    rig = held_up_once(told=True)
    assert not rig.axis.feedback.in_doubt
    assert rig.axis.alarms.first_out is None


def test_a_step_that_no_delay_explains_is_one() -> None:
    first = held_up_once(told=False).axis.alarms.first_out
    assert first is not None
    assert first.code is Code.ENC_01
