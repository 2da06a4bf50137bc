"""The controller knows nothing of the plant, and a run is its inputs and nothing else."""

from typing import Any, cast

import numpy as np
import pytest

from acceptance.bench import SHORT, without_plant
from gantryctl._core import PositionLaw
from gantryctl.engineering.accuracy.noise import chord_result
from gantryctl.engineering.accuracy.procedure.on_batch import Readings, random_gear, run_procedure
from gantryctl.engineering.accuracy.procedure.procedures import Procedure
from gantryctl.errors import ConfigError
from gantryctl.machine import FieldSpec, Machine, default_machine, field_specs, with_values
from gantryctl.wiring.program import axis_settings, motion_limits, position_law
from gantryctl.wiring.simulator import plant_params

PLANT_FIELDS = [spec for path, spec in field_specs().items() if path.startswith("plant.")]


def law_values(law: PositionLaw) -> dict[str, object]:
    """All that a position law was made of."""
    return {name: getattr(law, name) for name in dir(law) if not name.startswith("_") and name != "scan"} | {
        "clamped rad/s": law.scan(1e3, 0.0, 0.0)[0]
    }


def controller(machine: Machine) -> tuple[object, ...]:
    """Everything that decides what the controller does."""
    return axis_settings(machine), law_values(position_law(machine)), motion_limits(machine)


class Blind:
    """A machine whose plant nobody can read, not even what the machine computes from it."""

    def __init__(self, machine: Machine) -> None:
        self._tables = without_plant(machine)

    def __getattr__(self, name: str) -> object:
        computed = getattr(Machine, name, None)
        if isinstance(computed, property):
            assert computed.fget is not None
            return computed.fget(self)
        if name not in self._tables:
            raise AttributeError(f"{name!r} is not for a controller")
        return self._tables[name]


def test_the_controller_can_be_made_of_a_machine_without_a_plant() -> None:
    blind = cast(Machine, Blind(default_machine()))
    assert not hasattr(blind, "plant")
    assert controller(blind) == controller(default_machine())


@pytest.mark.parametrize("spec", PLANT_FIELDS, ids=[spec.path for spec in PLANT_FIELDS])
def test_a_changed_plant_leaves_the_controller_as_it_is(spec: FieldSpec) -> None:
    machine = another(spec)
    assert machine.plant != default_machine().plant
    assert controller(machine) == controller(default_machine())


def test_the_comparison_of_controllers_sees_a_change() -> None:
    for path, value in {
        "control.kpp_per_s": 11.0,
        "control.kvf": 0.9,
        "axis.ring_ratio": 12.0,
        "speed.command_clamp_deg_s": 6.4,
        "virtual_axis.acc_deg_s2": 0.4,
        "monitors.standstill_window_deg": 0.03,
    }.items():
        assert controller(with_values(default_machine(), {path: value})) != controller(default_machine()), (
            path
        )


def another(spec: FieldSpec) -> Machine:
    """The reference machine with another allowed value of one field."""
    refused = []
    for value in others(spec):
        try:
            return with_values(default_machine(), {spec.path: value})
        except ConfigError as error:
            refused.append(str(error))
    raise AssertionError(f"{spec.path}: no other value was accepted: {refused}")


def others(spec: FieldSpec) -> list[Any]:
    """Values to try, other than the reference machine's."""
    value: Any = default_machine()
    for part in spec.path.split("."):
        value = getattr(value, part)
    match spec.kind:
        case "switch":
            return [not value]
        case "word":
            return [word for word in spec.words if word != value]
        case "text":
            return ["SIM-0002"]
        case "integer":
            return [n for n in (value + 1, value - 1) if spec.low <= n <= spec.high]
        case "numbers":
            return [[0.9 * n for n in value]]
        case "number":
            tried = (1.05 * value, 0.95 * value, -value, spec.low, spec.high)
            return [x for x in tried if spec.low <= x <= spec.high and x != value]


def bits(readings: Readings) -> list[bytes]:
    """Every figure of a run, bit for bit."""
    return [value.tobytes() for value in vars(readings).values() if isinstance(value, np.ndarray)]


def short_run(machines: list[Machine], threads: int) -> Readings:
    return run_procedure(machines, SHORT, threads=threads)


def test_threads_do_not_change_a_bit() -> None:
    machines = [default_machine(), *(random_gear(default_machine(), seed) for seed in (1, 2))]
    alone = short_run(machines, 1)
    for threads in (2, 3):
        assert bits(short_run(machines, threads)) == bits(alone)
    assert len({row.tobytes() for row in alone.load_rad}) == len(machines), "three gears, three results"


def test_a_plant_does_not_see_which_others_run_beside_it() -> None:
    first, second = (random_gear(default_machine(), seed) for seed in (1, 2))
    rigid = with_values(default_machine(), {"plant.switches.rigid": True})
    together = short_run([first, rigid, second], 2)
    for index, machine in ((0, first), (2, second)):
        alone = short_run([machine], 1)
        assert alone.load_rad[0].tobytes() == together.load_rad[index].tobytes()
        assert alone.vel_err_load_rad_s[0].tobytes() == together.vel_err_load_rad_s[index].tobytes()


def measured(procedure: Procedure, seed: int) -> tuple[bytes, bytes]:
    """True and measured table of the reference machine, bit for bit, run anew."""
    accuracy = default_machine().accuracy
    readings = run_procedure([default_machine()], procedure)
    result = chord_result(
        procedure, readings.load_rad[0], accuracy.chord_radius_m, accuracy.tracker_noise_um * 1e-6, seed
    )
    return result.true.errors_deg.tobytes(), result.measured.errors_deg.tobytes()


def test_the_same_seed_gives_the_same_table_bit_for_bit() -> None:
    assert measured(SHORT, 7) == measured(SHORT, 7)


def test_another_seed_changes_the_measured_table_and_not_the_true_one() -> None:
    (true, seen), (true_too, seen_otherwise) = measured(SHORT, 7), measured(SHORT, 8)
    assert true == true_too
    assert seen != seen_otherwise


def test_the_same_seed_gives_the_same_gear() -> None:
    gear = random_gear(default_machine(), 5)
    assert gear == random_gear(default_machine(), 5)
    assert gear != random_gear(default_machine(), 6)
    # a gear is its phases: amplitudes, and with them the grade, stay
    ours, fitted = plant_params(gear), plant_params(default_machine())
    assert list(ours.error_ring_rad) == list(fitted.error_ring_rad)
    assert list(ours.phase_ring_rad) != list(fitted.phase_ring_rad)
