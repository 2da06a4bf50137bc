"""A stop in mid-move: the operator's Stop on the way to 90 deg, then how far every class of stop turns the gantry."""

from gantryctl import OperatorCommand, build_engine, default_machine, stop_table
from gantryctl.program import AxisState
from gantryctl.runtime import FixedOperator
from gantryctl.units import deg, rad

machine = default_machine()
operator = FixedOperator(OperatorCommand(power=True))
engine = build_engine(machine, operator=operator)
axis = engine.program.axis
engine.run_until(lambda engine: axis.state is AxisState.STANDSTILL, timeout_s=5.0)

operator.command = OperatorCommand(power=True, move=True, target_rad=rad(90.0), speed_rad_s=rad(6.0))
engine.run_until(lambda engine: axis.pos_act_rad > rad(45.0), timeout_s=60.0)
began_deg, speed_deg_s = deg(axis.pos_act_rad), deg(axis.feedback.vel_rad_s)

operator.command = OperatorCommand(power=True, stop=True)
engine.run_for(8.0)
print(f"Stop at {began_deg:.2f} deg and {speed_deg_s:.2f} deg/s: stands at {deg(axis.pos_act_rad):.2f} deg")
print(f"state while Stop is held: {axis.state.name}")
engine.close()

print("class of stop        from     angle    torque  reducer")
for row in stop_table(machine, speeds_deg_s=(1.4, 6.0)):
    stop = row.stop
    print(
        f"{stop.stop_class.value:18} {stop.speed_deg_s:4.1f} deg/s {stop.angle_deg:6.2f} deg "
        f"{stop.torque_motor_nm:5.0f} N m {stop.torque_reducer_nm / 1e3:5.1f} kN m"
    )
