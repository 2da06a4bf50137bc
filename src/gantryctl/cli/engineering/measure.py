"""`gantryctl accuracy measure`: the chord test on a machine, with an instrument or a person at the load."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.engineering.accuracy_end import finish
from gantryctl.cli.engineering.at_the_load import (
    BY_HAND,
    LOAD_ENCODER,
    SIMULATED,
    certificate_of,
    instrument_options,
    open_instrument,
)
from gantryctl.cli.engineering.experiment import plan_options
from gantryctl.cli.options import (
    bus_log_option,
    config_option,
    confirm,
    directory,
    json_option,
    out_option,
    proven_machine,
    seed_option,
)
from gantryctl.cli.report import report_options
from gantryctl.cli.values import Whole
from gantryctl.extras import need
from gantryctl.terminal import tell

if TYPE_CHECKING:
    from gantryctl.engineering.accuracy.attended.session import ChordSession
    from gantryctl.engineering.accuracy.report.report import AccuracyReport
    from gantryctl.engineering.report.head import Made
    from gantryctl.machine import Machine
    from gantryctl.operation.client import AxisClient

# What `accuracy run` writes is of the simulator: a folder of its own.
DEFAULT_OUT = Path("accuracy_measured")
_OWN_ERRORS = "load encoder: its own errors, and the rocking of the base, are not seen"
_IN_THE_LOOP = "load encoder: the position loop goes through it, so this shows the loop more than the axis"


@click.command()
@bus_log_option
@config_option
@click.option(
    "--procedure", "name", type=click.Choice(["A", "B", "C", "D", "E"]), default="A", show_default=True
)
@click.option("--chord", type=click.Choice(["base", "adjacent"]), default="base", show_default=True)
@click.option("--runs", type=Whole(1, 100), default=1, show_default=True, help="ISO 230-2 needs 5.")
@plan_options
@instrument_options(default=BY_HAND)
@click.option("--again", is_flag=True, help="Leave a test that is under way and begin anew.")
@click.option("--yes", is_flag=True, help="Do not ask before a real axis moves.")
@seed_option
@out_option
@report_options
@json_option
def measure(
    config_file: Path | None,
    place: str,
    certificate: str,
    out: Path | None,
    as_json: bool,
    made: Made,
    **given: Any,
) -> int:
    """Run the chord test on a machine: move, dwell until settled, read the load's angle, keep the reading, go on.

    Every reading is on the disk before the axis goes on; the same command goes on after any interruption. The report
    has the uncertainty of the figures, and the same test on the machine's model beside it. Exit code 1 when the
    requirement is not shown to be met.
    """
    from gantryctl.cli.axis.move import guarded
    from gantryctl.engineering.accuracy.attended.run import AttendedTest
    from gantryctl.engineering.accuracy.attended.session import session_path, store_session
    from gantryctl.engineering.accuracy.procedure.on_batch import run_time_s
    from gantryctl.engineering.accuracy.procedure.plan import check_travel
    from gantryctl.engineering.report.head import MeasuredBy
    from gantryctl.engineering.report.meter import Meter
    from gantryctl.operation.run import AxisRun
    from gantryctl.operation.store import StateStore

    need("matplotlib")
    machine = proven_machine(config_file)
    folder = directory(out or DEFAULT_OUT)

    def say(line: str) -> None:
        if not as_json:
            click.echo(line)

    with StateStore(machine) as store:
        path = session_path(store)
        session = _session(path, machine, given)
        check_travel(machine, session.procedure)
        meter = Meter(say, run_time_s(machine, session.procedure, session.next_stop), time.monotonic)
        run = AxisRun(machine, store, observer=meter.observer())

        def action(axis: AxisClient) -> ChordSession:
            # Before anything moves: an instrument that does not answer is put right first.
            instrument = open_instrument(run, place, given["uncertainty_deg"], given["seed"])
            test = replace(session, instruments=(*session.instruments, instrument.name))
            ask = axis.must_ask and not given["yes"]
            if ask or not as_json:
                click.echo(_announce(machine, test), err=as_json)
            if ask:
                confirm("Move?", "nothing moved")
            return AttendedTest(run, test, path, instrument, say).go_on()

        ended, failure = guarded(run, action)
        if failure is not None:
            raise failure
        assert ended is not None
        if not ended.complete:
            tell(f"{ended.text}; the same command goes on")
            return 1
        store_session(folder / "readings.json", ended)
        report = _report(machine, ended, place, made)
        code = finish(
            report,
            machine,
            made,
            MeasuredBy(report.source, certificate_of(place, certificate)),
            folder,
            as_json,
        )
        # Only now: a kill before the report must not cost the readings.
        path.unlink(missing_ok=True)
    return code


def _session(path: Path, machine: Machine, given: dict[str, Any]) -> ChordSession:
    from gantryctl.engineering.accuracy.attended.session import (
        ChordOrder,
        new_session,
        session_to_go_on_with,
    )
    from gantryctl.engineering.accuracy.procedure.plan import chord_plan
    from gantryctl.engineering.accuracy.procedure.procedures import Chord

    plan = chord_plan(machine, given["bases_deg"], given["displacements_deg"])
    order = ChordOrder(plan, given["name"], given["runs"], Chord(given["chord"]))
    kept = None if given["again"] else session_to_go_on_with(path, machine, order)
    return kept or new_session(machine, order)


def _announce(machine: Machine, session: ChordSession) -> str:
    procedure = session.procedure
    ends = machine.axis.dial.span(*procedure.travel_deg)
    done = f"; {len(session.readings)} readings are there" if session.readings else ""
    return (
        f"{machine.machine.name} ({machine.drive.kind}): chord test {procedure.name}, {len(procedure.stops)} stops "
        f"from {ends} deg, {machine.accuracy.dwell_s:g} s each, {session.instruments[-1]}{done}"
    )


def _report(machine: Machine, session: ChordSession, place: str, made: Made) -> AccuracyReport:
    from gantryctl.engineering.accuracy.attended.report import session_report
    from gantryctl.engineering.report.origin import Origin, origin_of

    origin = Origin.SIMULATED if place == SIMULATED else Origin.MEASURED
    notes: tuple[str, ...] = ()
    if place == LOAD_ENCODER:
        origin = origin_of(machine)
        notes = (
            (_OWN_ERRORS, _IN_THE_LOOP)
            if machine.control.compensation.load_encoder.active
            else (_OWN_ERRORS,)
        )
    return session_report(machine, session, origin, made.version, made.date, notes)
