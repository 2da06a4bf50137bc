"""A program that calls the blocks which a test puts into it."""

from gantryctl.program import AxisProgram, AxisState
from gantryctl.program.blocks import Power
from unit.program.rig import Rig

FINAL = ("done", "command_aborted", "error")


class Bench(AxisProgram):
    """Calls whatever the test puts into `calls`, every scan, in order."""

    def __init__(self, axis):
        super().__init__(axis)
        self.power = Power(axis)
        self.calls = {}

    def logic(self, image):
        self.power(enable=True)
        for block, inputs in self.calls.items():
            block(**inputs)


def standing():
    """An axis with power on, in position at 0 deg."""
    rig = Rig(Bench)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL, 5.0)
    rig.run(0.3)
    return rig


def call(rig, block, **inputs):
    """Set a block's inputs and make one scan."""
    rig.program.calls[block] = inputs
    rig.step()


def outputs(block):
    return {name for name in ("busy", "active", *FINAL) if getattr(block, name)}
