"""The question before a real drive moves."""

from __future__ import annotations

import click

from gantryctl.errors import CommandRefused
from gantryctl.machine.derived import rigid_stop
from gantryctl.operation.run import AxisRun


def ask_for_torque(session: AxisRun, yes: bool) -> None:
    """The same question before a brake test of a real drive.

    Raises:
        CommandRefused: the person does not want it; nothing has been switched on.
    """
    machine = session.machine
    if yes or not machine.paced_by_clock or not machine.can.commissioning_required:
        return
    question = f"{machine.name}: +-{machine.brake.test_torque_nm:g} N m against the closed brake. Test?"
    if not click.confirm(question, err=True):
        raise CommandRefused("not confirmed: no torque was given")


def ask_before(session: AxisRun, way: str, speed_deg_s: float, yes: bool) -> None:
    """Say what will move, how fast and what a stop takes; ask, unless told not to. Virtual gantries are not asked for.

    Raises:
        CommandRefused: the person does not want it; nothing has been switched on.
    """
    machine = session.machine
    if yes or not machine.paced_by_clock or not machine.can.commissioning_required:
        return
    stop, _ = rigid_stop(speed_deg_s, machine.virtual_axis.quick_dec_deg_s2, float("inf"))
    question = f"{machine.name}: {way} at {speed_deg_s:g} deg/s, a quick stop takes {stop:.2f} deg. Move?"
    if not click.confirm(question, err=True):
        raise CommandRefused("not confirmed: nothing moved")
