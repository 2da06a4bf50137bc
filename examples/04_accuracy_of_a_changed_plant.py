"""The paper's accuracy test on changed plants: which property of the gantry costs accuracy, and which does not."""

from gantryctl import default_machine, run_accuracy, with_values

changes: dict[str, dict[str, object]] = {
    "as it is": {},
    "no gear error": {"plant.switches.gear_error": False},
    "no eccentric moment": {"plant.switches.eccentric_moment": False},
    "rest of the train half as stiff": {"plant.transmission.rest_stiffness_nm_per_rad": 0.75e9},
    "slack gears, 0.4 mm": {"plant.transmission.backlash_mm": 0.4},
    "position gain halved": {"control.kpp_per_s": 5.0},
}

print("the paper measured A = 0.0113 deg")
for name, change in changes.items():
    report = run_accuracy(with_values(default_machine(), change), "A", speed_test=False)
    rms = ", ".join(f"{base:+.0f} deg {value:.4f}" for base, value in report.statistics.rms_deg.items())
    print(f"{name:32} A = {report.statistics.a_deg:.4f} deg   rms by base: {rms}")
