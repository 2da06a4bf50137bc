"""Identification of many plants in the compiled core: each calibration is that of the plant alone, byte for byte."""

from __future__ import annotations

import numpy as np
import pytest

from gantryctl.drives.simulated import SimDrive
from gantryctl.engineering.analysis.measured.compiled_probe import CompiledProbe
from gantryctl.engineering.analysis.measured.excitation import multisine
from gantryctl.engineering.analysis.measured.probe import Probe, ProbeLimits
from gantryctl.engineering.analysis.models.sampled import Input
from gantryctl.engineering.batch import alone
from gantryctl.engineering.comparison.ensemble import random_plant
from gantryctl.engineering.identification import SimulatedAxis, calibrate, calibrate_each
from gantryctl.engineering.scheduler.one_thread import one_blas_thread
from gantryctl.errors import AlarmStop, UsageError
from gantryctl.machine import Machine, calibration_toml, default_machine, with_values
from gantryctl.units import rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import sim_drive
from support.improved import improved_machine


def limits(machine: Machine, torque_nm: float = 128.5) -> ProbeLimits:
    return ProbeLimits(torque_nm, rad(-180.0), rad(180.0), motion_limits(machine))


def standing(angle_deg: float, wraps: int = 0) -> SimDrive:
    """A drive with torque off, whose encoder has gone so many times through the range of its turns."""
    machine = default_machine()
    drive = sim_drive(machine, angle_deg)
    drive.sim.count_offset += wraps * machine.encoder.turns * machine.counts_per_turn
    drive.power_on()
    return drive


def compiled(angle_deg: float, torque_nm: float = 128.5, wraps: int = 0) -> CompiledProbe:
    machine = default_machine()
    return CompiledProbe(
        standing(angle_deg, wraps), position_law(machine), limits(machine, torque_nm), rad(angle_deg), alone
    )


@pytest.mark.slow
def test_many_are_identified_as_each_alone() -> None:
    """One of them travels less, so its runs are shorter; one has no wind-up that could be identified."""
    improved = improved_machine()
    short = with_values(improved, {"axis.pos_min_deg": -170.0, "axis.pos_max_deg": 170.0})
    machines = [
        random_plant(improved, 1),
        with_values(improved, {"plant.switches.rigid": True}),
        random_plant(short, 2),
    ]
    # With several threads the last bits of a least-squares fit are those of the day.
    with one_blas_thread():
        first, rigid, second = calibrate_each(machines, [1, 2, 3])
        assert not isinstance(rigid, Exception)
        assert set(rigid.unknown) == {"windup_per_acc_s2", "stiffness_nm_per_rad", "swing_hz", "backlash_rad"}
        files = []
        for found, machine, seed in ((first, machines[0], 1), (second, machines[2], 3)):
            assert not isinstance(found, Exception)
            files.append(calibration_toml(found))
            # The hash of all samples is part of it.
            assert files[-1] == calibration_toml(calibrate(SimulatedAxis(machine, seed=seed)))
    assert files[0] != files[1]


@pytest.mark.parametrize("wraps", [0, 3])
def test_the_compiled_probe_records_what_the_probe_does(wraps: int) -> None:
    """The same drive scan by scan through its port, and in the compiled loop: enabled, turning, excited, at rest."""
    machine = default_machine()
    by_port = Probe(standing(60.0, wraps), position_law(machine), 1e-3, limits(machine), rad(60.0))
    by_port.enable()
    by_core = compiled(60.0, wraps=wraps)
    signal = multisine(Input.SPEED, 20.0, 150.0, 10, 1e-3, 0.5)
    for probe in (by_port, by_core):
        probe.turn(rad(1.0))
    for excitation, scans in ((None, 300), (signal, 1200)):
        ours, theirs = by_core.run(excitation, scans), by_port.run(excitation, scans)
        assert list(ours) == list(theirs)
        for name, values in ours.items():
            assert values.tobytes() == theirs[name].tobytes(), name
        assert np.ptp(ours["torque_act_nm"]) > 0.0
    assert (by_core.scan_s, by_core.step_rad, by_core.torque_limit_nm) == (
        by_port.scan_s, by_port.step_rad, by_port.torque_limit_nm,
    )  # fmt: skip


def test_too_much_torque_or_travel_stops_a_compiled_probe() -> None:
    loud = multisine(Input.SPEED, 20.0, 150.0, 10, 1e-3, 0.5)
    with pytest.raises(
        AlarmStop, match=r"permitted \+-2 N m; the signal is off, the axis makes a quick stop"
    ):
        compiled(60.0, 2.0).run(loud, 500)
    probe = compiled(179.0)
    with pytest.raises(AlarmStop, match=r"permitted -180\.00 to 180\.00 deg"):
        probe.turn(rad(1.0))


def test_a_torque_signal_is_refused_by_the_compiled_probe() -> None:
    with pytest.raises(UsageError, match="not to the torque"):
        compiled(0.0).run(multisine(Input.TORQUE, 20.0, 150.0, 10, 1e-3, 0.5), 500)
