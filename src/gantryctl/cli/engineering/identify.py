"""`gantryctl identify`: measures a machine and writes its calibration file."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.engineering.at_the_load import LOAD_ENCODER, SIMULATED
from gantryctl.cli.engineering.experiment import (
    bus_experiment,
    instrument_at,
    machine_under_test,
    yes_option,
)
from gantryctl.cli.options import (
    bus_log_option,
    config_option,
    json_option,
    print_json,
    seed_option,
    write_text,
)
from gantryctl.cli.progress import metered
from gantryctl.cli.text import print_table
from gantryctl.cli.values import PATH, check_lasting
from gantryctl.extras import need
from gantryctl.terminal import tell

if TYPE_CHECKING:
    from gantryctl.engineering.identification import CalibrationFit, Comparison
    from gantryctl.engineering.identification.measure import MotionRecording
    from gantryctl.machine import Calibration, Machine


@click.command()
@bus_log_option
@config_option
@click.option(
    "--instrument",
    default=SIMULATED,
    show_default=True,
    help="What watches the load: simulated (a tracker), load-encoder, tcp:HOST:PORT or serial:DEVICE:BAUD.",
)
@click.option(
    "--out",
    "out",
    type=PATH,
    help="Calibration file to write; the one that the machine file names, else MACHINE.calibration.toml here.",
)
@click.option("--force", is_flag=True, help="Replace a calibration that exists; its version is counted on.")
@seed_option
@yes_option
@json_option
def identify(
    config_file: Path | None,
    instrument: str,
    out: Path | None,
    force: bool,
    seed: int,
    yes: bool,
    as_json: bool,
) -> int:
    """Measure friction, eccentric moment, inertia, stiffness, gear map and dead time of this machine.

    Slow turns both ways, swings, a creep and an excited speed loop through the position loop, all compensations off,
    while an instrument watches the load: some 26 minutes of axis time, by travel and speed. The controller's
    compensations live on the file that this writes and on nothing else. Each number has a 95 % interval; one that this
    travel and these loads do not show is named with the reason. On a bus only what the drive and the instrument say is
    used. A move each way that is not in the fit judges the maps: what they leave and comes again is named, and maps
    that leave more than a third of the lead are refused. Where the load is simulated the identified values stand beside
    the truth.
    """
    from gantryctl.engineering.identification import calibration_of, check_valid, comparisons, fit
    from gantryctl.machine import calibration_toml
    from gantryctl.wiring.plant_effects import expect_one_pinion

    need("scipy")
    check_lasting(config_file, "identify")
    machine = machine_under_test(config_file, "identify", calibrated=False)
    expect_one_pinion(machine, "identify")
    path = out or _usual_place(machine, config_file)
    # Before the axis has moved for minutes, not after them.
    version = _next_version(path, force)
    found = fit(machine, _recorded(machine, instrument, seed, yes, quiet=as_json))
    check_valid(machine, found)
    calibration = calibration_of(machine, found, datetime.date.today().isoformat(), version)
    write_text(path, calibration_toml(calibration))
    beside = comparisons(machine, calibration) if _is_simulated(machine) else []
    if as_json:
        print_json(_data(path, calibration, found, beside))
    else:
        _show(path, machine, calibration, found, beside)
    return 0


def _is_simulated(machine: Machine) -> bool:
    """The machine file describes the load that was measured."""
    return not machine.on_bus or machine.can.simulated or bool(machine.can.side_channel)


def _recorded(machine: Machine, instrument: str, seed: int, yes: bool, *, quiet: bool) -> MotionRecording:
    from gantryctl.engineering.identification import EngineAxis, LoadInstrument, SimulatedAxis, record
    from gantryctl.engineering.identification.experiment import experiment_of
    from gantryctl.engineering.identification.measure import quiet_machine
    from gantryctl.errors import UsageError
    from gantryctl.machine.places import reach_deg

    if not machine.on_bus:
        watching = {SIMULATED: LoadInstrument.TRACKER, LOAD_ENCODER: LoadInstrument.LOAD_ENCODER}
        if instrument not in watching:
            raise UsageError(
                f'--instrument {instrument}: with [drive] kind = "sim" it is {SIMULATED} or {LOAD_ENCODER}'
            )
        with metered(60.0 * experiment_of(machine).minutes, quiet=quiet) as meter:
            return record(SimulatedAxis(machine, watching[instrument], seed, advance=meter.advance))
    way = machine.axis.dial.span(*reach_deg(machine))
    minutes, fastest = experiment_of(machine).minutes, machine.speed.setting_max_deg_s
    moves = f"moves for {minutes:.0f} minutes from {way} deg and back, at up to {fastest:g} deg/s"
    # It says in lines what it does: those are progress enough, and a log keeps them.
    with bus_experiment(
        machine,
        moves,
        takes_s=60.0 * minutes,
        yes=yes,
        quiet=True,
        controlled_as=quiet_machine(machine),
    ) as run:
        seeing = instrument_at(instrument, run, seed)
        progress = None if quiet else tell
        return record(EngineAxis(machine, run, seeing, progress))


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
    from gantryctl.machine.calibration import calibration_version

    # Before the axis moves: a folder that is missing, a file that exists, a file of another kind.
    if not path.parent.is_dir():
        raise UsageError(f"{path}: there is no directory {path.parent}")
    if not path.exists():
        return 1
    if not force:
        raise UsageError(f"{path}: exists already; --force replaces it, --out writes elsewhere")
    # Of a file of an earlier version, which cannot be loaded any more, the version alone counts.
    try:
        return calibration_version(path) + 1
    except ConfigError:
        raise UsageError(
            f"{path}: is no calibration file, so it is not replaced; --out writes elsewhere"
        ) from None


def _show(
    path: Path, machine: Machine, calibration: Calibration, found: CalibrationFit, beside: list[Comparison]
) -> None:
    from gantryctl.engineering.identification.text import (
        lead_lines,
        numbers_table,
        truth_table,
        unknown_lines,
    )

    click.echo(
        f"{machine.name}: {found.recording.axis_time_s:.0f} s of axis time, watched by "
        f"{calibration.origin.instrument}; the fit leaves {found.residual_deg:.5f} deg (rms)"
    )
    if beside:
        print_table(truth_table("Identified, beside the truth of the simulator", "found", beside, digits=6))
    else:
        print_table(numbers_table(calibration))
    for line in ("", *lead_lines(found, machine.axis.dial), *unknown_lines(calibration)):
        click.echo(line)
    swing, acc = calibration.identified.swing_hz, machine.virtual_axis.acc_deg_s2
    if swing is not None:
        click.echo(
            f"First mode with the motor held: {swing:.2f} Hz. An S-curve whose ramps last one period of it: "
            f"jerk_deg_s3 = {acc * swing:.3g} with the present acc_deg_s2 = {acc:.4g}."
        )
    click.echo(f"wrote {path} (version {calibration.origin.version})")


def _data(
    path: Path, calibration: Calibration, found: CalibrationFit, beside: list[Comparison]
) -> dict[str, Any]:
    loop = found.recording.speed_loop
    return {
        "file": str(path),
        "calibration": calibration.model_dump(mode="json"),
        "residual_deg": found.residual_deg,
        "validation": {**found.validation._asdict(), "warned": found.validation.warned},
        "axis_time_s": found.recording.axis_time_s,
        "instrument_delay_s": found.delay_s,
        "balance": found.balance._asdict(),
        "speed_loop": None if loop is None else loop._asdict(),
        "truth": [c._asdict() for c in beside],
    }
