"""MuJoCo: a hinge with an eccentric mass and a geared motor, stepped in Python with the controllers as functions."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Final

from gantryctl.engineering.bench.rigid import (
    CYCLE_S,
    CYCLES,
    ECCENTRIC_NM,
    INERTIA_KG_M2,
    RATIO,
    Run,
    Timed,
    position_law,
    set_points,
    speed_loop,
)

_GRAVITY: Final = 9.81
_ARM_M: Final = 1.0
# The mass hangs below the axis at 0 deg: gravity gives -m g r sin(angle), which is the eccentric moment.
_MASS_KG: Final = -ECCENTRIC_NM / (_GRAVITY * _ARM_M)
_ARMATURE: Final = INERTIA_KG_M2 * RATIO * RATIO - _MASS_KG * _ARM_M * _ARM_M - 1.0
_MODEL: Final = f"""
<mujoco>
  <option timestep="{CYCLE_S!r}" gravity="0 0 {-_GRAVITY!r}" integrator="Euler">
    <flag contact="disable" constraint="disable"/>
  </option>
  <worldbody>
    <body>
      <joint name="axis" type="hinge" axis="1 0 0" armature="{_ARMATURE!r}"/>
      <inertial pos="0 0 {-_ARM_M!r}" mass="{_MASS_KG!r}" diaginertia="1 1 1"/>
    </body>
  </worldbody>
  <actuator><motor joint="axis" gear="{RATIO!r}"/></actuator>
</mujoco>
"""


def mujoco_hinge(seconds: int, _folder: Path) -> Run:
    """`mj_step` for every drive cycle, the torque in `ctrl`: the loop of the manual."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(_MODEL)
    data = mujoco.MjData(model)
    points = set_points(seconds)

    def run() -> Timed:
        mujoco.mj_resetData(model, data)
        step, angle, control = mujoco.mj_step, data.qpos, data.ctrl
        begin = time.process_time()
        last = integral = 0.0
        angles = []
        for k, (pos_ref, vel_ref) in enumerate(points, start=1):
            pos = float(angle[0]) * RATIO
            command = position_law(pos_ref, vel_ref, pos)
            for _ in range(CYCLES):
                control[0], integral = speed_loop(command, pos, last, integral)
                last = pos
                step(model, data)
                pos = float(angle[0]) * RATIO
            if k % 1000 == 0:
                angles.append(pos)
        return Timed(angles, time.process_time() - begin)

    return run
