"""The core as WebAssembly, and the axes that a page simulates with it: `python tools/build_wasm.py [FOLDER]`.

Writes `axis.wasm` to the folder, or to `build/wasm`, and `gains_data.js`, which carries it and the axes into a page
that was opened as a file. The compiler is the package `ziglang` (`requirements/dist.txt`). Flags are those of
CMakeLists.txt that decide bits: no fused multiply-add, no fast-math.
"""

from __future__ import annotations

import base64
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from zig import zig

from gantryctl import _core
from gantryctl.engineering.tuning.gains import configured
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine
from gantryctl.machine.places import fitted_stretch_deg, one_flank_deg
from gantryctl.motion import SetPoint, plan_move
from gantryctl.units import rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import drive_params, plant_params

ROOT: Final = Path(__file__).resolve().parent.parent
SOURCES: Final = (ROOT / "core" / "web" / "axis.cpp", ROOT / "core" / "web" / "runtime.cpp")
EXPORTS: Final = ("names", "columns", "numbers", "stand", "segments", "run", "__wasm_call_ctors")
FLAGS: Final = (
    *("-target", "wasm32-wasi", "-std=c++17", "-O3", "-DNDEBUG"),
    *("-ffp-contract=off", "-fno-math-errno", "-fno-exceptions", "-fno-rtti"),
    *("-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wno-inline-namespace-reopened-noninline"),
)
# Headers only: Zig would compile its C and C++ libraries first, some ten minutes of one processor.
LINK: Final = ("--no-entry", "--gc-sections", "-O2", "--strip-all", "-z", "stack-size=1048576")
AXES: Final = ("hust_gantry", "azimuth_dish", "rotary_table")
TEETH: Final = {
    "plant.ring_pitch_rad": 1024,
    "plant.pinion_pitch_rad": 128,
    "plant.second_pinion_pitch_rad": 128,
}
MOVE_DEG: Final = 10.0


def compile_axis(file: Path) -> None:
    """Compile the core for the browser.

    Raises:
        SystemExit: there is no compiler, or it finds a fault.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    objects = []
    for source in SOURCES:
        objects.append(str(file.parent / f"{source.stem}.o"))
        _run("c++", *FLAGS, "-I", str(ROOT), "-c", str(source), "-o", objects[-1])
    exports = (f"--export={name}" for name in EXPORTS)
    _run("wasm-ld", *LINK, *exports, *objects, "-o", str(file))


def _run(*words: str) -> None:
    made = subprocess.run([str(zig()), *words], check=False)  # noqa: S603 - the compiler of this environment
    if made.returncode:
        raise SystemExit(f"zig {words[0]} has failed")


def numbers_of(machine: Machine) -> dict[str, float | list[float]]:
    """What `stand` of `axis.cpp` takes, by name: plant, drive, law, timing."""
    numbers: dict[str, float | list[float]] = {}
    law = position_law(machine)
    for of, params in (("plant", plant_params(machine)), ("drive", drive_params(machine))):
        numbers |= {f"{of}.{name}": value for name, value in _fields(params)}
    for name in ("kpp_per_s", "kvf", "ratio", "rad_per_count", "vel_max_rad_s"):
        numbers[f"law.{name}"] = getattr(law, name)
    integration = machine.plant.integration
    # As long as the core has room for; a plant has as many as it has teeth.
    for name, most in TEETH.items():
        teeth = numbers[name]
        assert isinstance(teeth, list)
        numbers[name] = teeth + [0.0] * (most - len(teeth))
    numbers["scan_period_s"] = machine.control.scan_period_ms * 1e-3
    numbers["rk4_steps"] = integration.rk4_steps if integration.scheme == "rk4" else 0
    numbers["count_offset"] = float(
        machine.plant.encoder.mounting_turns * machine.encoder.fine_counts_per_turn
    )
    return numbers


def _fields(params: object) -> list[tuple[str, float | list[float]]]:
    """Fields of a structure of the core, numbers as JSON has them."""
    found = []
    for name in dir(type(params)):
        value = getattr(params, name)
        if not name.startswith("_") and not callable(value):
            found.append((name, list(value) if isinstance(value, Sequence) else float(value)))
    return found


def plan_of(plan: _core.Segments) -> dict[str, Any]:
    """A plan as numbers."""
    segments = zip(plan.t_start, plan.pos, plan.vel, plan.acc, plan.jerk, strict=True)
    return {
        "segments": [number for segment in segments for number in segment],
        "duration_s": plan.duration,
        "pos_end_rad": plan.pos_end,
        "vel_end_rad_s": plan.vel_end,
    }


def axis_of(name: str, machine: Machine) -> Mapping[str, Any]:
    """An axis to drag gains of: its numbers, where it stands, its step and its move."""
    gains = configured(machine)
    start_deg, end_deg = fitted_stretch_deg(machine, 0.0, MOVE_DEG)
    plan = plan_move(SetPoint(rad(start_deg), 0.0, 0.0), rad(end_deg), motion_limits(machine))
    return {
        "name": name,
        "numbers": numbers_of(machine),
        "gains": {
            "kvp_nm_s_per_rad": gains.kvp_nm_s_per_rad,
            "tvi_s": gains.tvi_s,
            "kpp_per_s": gains.kpp_per_s,
            "kvf": gains.kvf,
        },
        # As `Bench.position_step` tries it.
        "stands_rad": rad(one_flank_deg(machine)),
        "step_rad": rad(machine.monitors.in_position_window_deg),
        "move_from_rad": rad(start_deg),
        "move": plan_of(plan),
    }


def make(folder: Path) -> None:
    """Build both into a folder."""
    compile_axis(folder / "axis.wasm")
    machines = {
        name: default_machine() if name == "hust_gantry" else load_machine(configs_folder() / f"{name}.toml")
        for name in AXES
    }
    axes = [axis_of(name, machine) for name, machine in machines.items()]
    wasm = base64.b64encode((folder / "axis.wasm").read_bytes()).decode("ascii")
    data = json.dumps({"axes": axes, "wasm": wasm}, allow_nan=False)
    (folder / "gains_data.js").write_text(f"globalThis.gantryctlCore = {data};\n", encoding="utf-8")
    print(f"{folder}: axis.wasm {(folder / 'axis.wasm').stat().st_size} bytes, {len(axes)} axes")


def main() -> int:
    """Build both where they are asked for."""
    make(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT / "build" / "wasm")
    return 0


if __name__ == "__main__":
    sys.exit(main())
