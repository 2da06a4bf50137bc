"""A custom program from PLCopen blocks: to 20 deg, wait two seconds, back by 5 deg. Once on the ideal drive,
where the actual position is the set-point, then unchanged on the virtual gantry.
"""

from gantryctl import Axis, AxisProgram, InputImage, build_engine, default_machine, with_values
from gantryctl.program.blocks import MoveAbsolute, MoveRelative, Power
from gantryctl.units import deg, rad


class ThereAndBack(AxisProgram):
    """Every block is called once a scan; what happens next follows from the blocks' outputs."""

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.power, self.there, self.back = Power(axis), MoveAbsolute(axis), MoveRelative(axis)
        self.arrived_s: float | None = None

    def logic(self, image: InputImage) -> None:
        self.power(enable=True)
        self.there(execute=self.power.status, position_rad=rad(20.0), velocity_rad_s=rad(3.0))
        if self.there.done and self.arrived_s is None:
            self.arrived_s = image.time_s
        waited = self.arrived_s is not None and image.time_s - self.arrived_s >= 2.0
        self.back(execute=waited, distance_rad=rad(-5.0), velocity_rad_s=rad(3.0))


for kind in ("ideal", "sim"):
    engine = build_engine(with_values(default_machine(), {"drive.kind": kind}), program=ThereAndBack)
    program = engine.program
    assert isinstance(program, ThereAndBack)
    if not engine.run_until(lambda engine, program=program: program.back.done, timeout_s=60.0):
        raise SystemExit(f"{kind}: not done in 60 s")
    print(f"{kind}: done after {engine.time_s:.2f} s at {deg(program.axis.pos_act_rad):.4f} deg")
    engine.close()
