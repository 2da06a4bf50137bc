"""`gantryctl identify`: measures a machine and writes its calibration file."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.options import (
    PATH,
    choice_option,
    config_option,
    json_option,
    print_json,
    seed_option,
    simulated_machine,
    write_text,
)
from gantryctl.cli.text import print_table

if TYPE_CHECKING:
    from gantryctl.engineering.identification import CalibrationFit, Comparison
    from gantryctl.machine import Calibration, Machine


@click.command()
@config_option
@choice_option("--instrument", ("tracker", "load-encoder"), "What watches the load.")
@click.option(
    "--out",
    "out",
    type=PATH,
    help="Calibration file to write; the one that the machine file names, else MACHINE.calibration.toml here.",
)
@click.option("--force", is_flag=True, help="Replace a calibration that exists; its version is counted on.")
@seed_option
@json_option
def identify(
    config_file: Path | None, instrument: str, out: Path | None, force: bool, seed: int, as_json: bool
) -> int:
    """Measure friction, eccentric moment, inertia, stiffness, gear map and scale of this machine.

    Slow turns both ways, fast moves and a creep through the position loop, all compensations off, while an instrument
    watches the load: 17 minutes of axis time. The controller's compensations live on the file that this writes and on
    nothing else. On the simulator the identified values stand beside the truth.
    """
    from gantryctl.engineering.identification import LoadInstrument, calibration_of, comparisons, fit, record
    from gantryctl.machine import calibration_toml

    machine = simulated_machine(config_file, "identify")
    path = out or _usual_place(machine, config_file)
    # Before 17 minutes of axis time, not after them.
    version = _next_version(path, force)
    found = fit(machine, record(machine, LoadInstrument(instrument), seed))
    calibration = calibration_of(machine, found, datetime.date.today().isoformat(), version)
    write_text(path, calibration_toml(calibration))
    beside = comparisons(machine, calibration)
    if as_json:
        print_json(_data(path, calibration, found, beside))
    else:
        _show(path, machine, calibration, found, beside)
    return 0


def _usual_place(machine: Machine, config_file: Path | None) -> Path:
    named = machine.control.compensation.calibration
    # The controller reads the calibration beside the machine file, so it is written there.
    if named and config_file is not None:
        return config_file.parent / named
    # A shipped machine has no folder to write to: here, then.
    return Path(f"{machine.name}.calibration.toml")


def _next_version(path: Path, force: bool) -> int:
    """1 for a new file, else one more than in the file that is replaced."""
    from gantryctl.errors import ConfigError, UsageError
    from gantryctl.machine import load_calibration

    # Before 17 minutes of axis time: a folder that is missing, a file that exists, a file of another kind.
    if not path.parent.is_dir():
        raise UsageError(f"{path}: there is no directory {path.parent}")
    if not path.exists():
        return 1
    if not force:
        raise UsageError(f"{path}: exists already; --force replaces it, --out writes elsewhere")
    try:
        return load_calibration(path).origin.version + 1
    except ConfigError:
        raise UsageError(
            f"{path}: is no calibration file, so it is not replaced; --out writes elsewhere"
        ) from None


def _show(
    path: Path, machine: Machine, calibration: Calibration, found: CalibrationFit, beside: list[Comparison]
) -> None:
    from gantryctl.engineering.identification.text import truth_table

    swing = calibration.identified.swing_hz
    acc = machine.virtual_axis.acc_deg_s2
    click.echo(
        f"{machine.name}: {found.recording.axis_time_s:.0f} s of axis time, watched by "
        f"{calibration.origin.instrument}; the fit leaves {found.residual_deg:.5f} deg (rms)"
    )
    title = "Identified, beside the truth of the simulator"
    print_table(truth_table(title, "found", beside, digits=6))
    click.echo(
        f"\nFirst mode with the motor held: {swing:.2f} Hz. An S-curve whose ramps last one period of it: "
        f"jerk_deg_s3 = {acc * swing:.3g} with the present acc_deg_s2 = {acc:.4g}."
    )
    click.echo(f"wrote {path} (version {calibration.origin.version})")


def _data(
    path: Path, calibration: Calibration, found: CalibrationFit, beside: list[Comparison]
) -> dict[str, Any]:
    return {
        "file": str(path),
        "calibration": calibration.model_dump(mode="json"),
        "residual_deg": found.residual_deg,
        "axis_time_s": found.recording.axis_time_s,
        "truth": [c._asdict() for c in beside],
    }
