"""Death of a controller on purpose: a copy of this process commands the axis on, and gets SIGKILL."""

from __future__ import annotations

import os
import signal
import sys
import time
from typing import Final, NoReturn

from gantryctl.commissioning.open_loop_axis import ENABLE, OpenLoopAxis
from gantryctl.machine import Machine

# Frames of these are in the kernel: a copy of this process shares its socket. Adapters with a library of their own are
# one thing of one process.
_SHARED: Final = ("socketcan", "udp_multicast")
_RUNS_S: Final = 0.5
_LOOK_S: Final = 0.01


def can_be_killed(machine: Machine) -> bool:
    """The controller is a process apart from its drive, and a copy of it can take its place.

    Elsewhere silence in this process stands for its death: of a virtual drive in it, and behind other adapters.
    """
    return machine.paced_by_clock and machine.can.interface in _SHARED and hasattr(os, "fork")


def kill_controller(axis: OpenLoopAxis) -> None:
    """Let a copy of this process run the enabled axis on, and kill it: nothing of it is left to send anything.

    From now on this process has the bus, and has sent nothing.

    Raises:
        AlarmStop: the copy has stopped the axis, or ended by itself.
    """
    sys.stdout.flush()
    copy = os.fork()
    if copy == 0:
        _run_on(axis)
    end_s = time.monotonic() + _RUNS_S
    while time.monotonic() < end_s and not axis.halted:
        time.sleep(_LOOK_S)
    ended, _ = os.waitpid(copy, os.WNOHANG)
    if ended:
        axis.stop_for("the controller that was to be killed has ended by itself")
    os.kill(copy, signal.SIGKILL)
    os.waitpid(copy, 0)
    axis.drive.link.take_over()


def _run_on(axis: OpenLoopAxis) -> NoReturn:
    """Scan until the end; what the copy would print or log is told by the other one."""
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in (1, 2):
            os.dup2(nowhere, stream)
        axis.drive.link.log_nothing()
        axis.hear_nobody()
        axis.begin_time()
        while True:
            axis.scan(ENABLE)
    finally:
        # No handler, no buffer and no lock of the original may be touched.
        os._exit(1)
