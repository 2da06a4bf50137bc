"""The improved machine with the calibration that comes with it."""

from functools import cache

from gantryctl.machine import Machine, default_machine_path, load_machine


@cache
def improved_machine() -> Machine:
    return load_machine(default_machine_path().with_name("hust_improved.toml"))
