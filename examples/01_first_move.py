"""A first move: power up, 0 to 30 deg, power down, on the virtual gantry; then read what was recorded."""

import numpy as np

from gantryctl import default_machine, move

machine = default_machine()  # or load_machine("my_machine.toml")
summary, trace = move(machine, 30.0)

print(f"30 deg in {summary.duration_s:.2f} s, fastest {summary.peak_deg_s:.2f} deg/s")
print(
    f"following error: motor side {summary.following_error_motor_deg:.5f} deg, "
    f"load side {summary.following_error_load_deg:.5f} deg"
)

# A trace is a table: one row a scan, columns by name, numpy arrays.
load_deg = np.degrees(trace["pos_load_rad"])
print(f"{len(load_deg)} scans; the load came to rest at {load_deg[-1]:.4f} deg")
