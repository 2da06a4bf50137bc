"""The chord test as a step: attended, by an instrument at the load, on the machine as it is commissioned."""

from __future__ import annotations

from dataclasses import replace
from importlib.metadata import version
from typing import Final

from gantryctl.commissioning.results import Context, Figure, Outcome, StepResult, judged
from gantryctl.engineering.accuracy.attended.report import session_report
from gantryctl.engineering.accuracy.attended.run import AttendedTest
from gantryctl.engineering.accuracy.attended.session import (
    ChordOrder,
    ChordSession,
    new_session,
    session_path,
    session_to_go_on_with,
    store_session,
)
from gantryctl.engineering.accuracy.procedure.plan import check_travel, chord_plan
from gantryctl.engineering.accuracy.report.page import write_report
from gantryctl.engineering.accuracy.report.report import AccuracyReport, Beside
from gantryctl.engineering.accuracy.uncertainty import COVERAGE_K
from gantryctl.engineering.accuracy.verdict import Conformity
from gantryctl.engineering.report.head import Head, Made, MeasuredBy
from gantryctl.engineering.report.machine_facts import known_serials, machine_facts
from gantryctl.engineering.report.origin import Origin
from gantryctl.engineering.report.pictures import Panel, Picture, line
from gantryctl.errors import AlarmStop
from gantryctl.machine import Machine
from gantryctl.operation.run import AxisRun
from gantryctl.operation.state import operator_name
from gantryctl.operation.store import now_text

# Every base both ways, one chord each: half the time of procedure A, which `accuracy measure` runs.
PROCEDURE: Final = "E"


def order_of(machine: Machine) -> ChordOrder:
    """The chord test that this machine is commissioned with."""
    return ChordOrder(chord_plan(machine), PROCEDURE)


def accuracy(c: Context) -> StepResult:
    """Run the chord test by the instrument at the load; what was read on an earlier day is kept."""
    if c.instrument is None:
        proof = "no instrument at the load"
        to_do = "gantryctl commission --only accuracy --instrument ADDRESS, or gantryctl accuracy measure"
        return StepResult("accuracy", Outcome.NOT_TESTABLE, proof, to_do=to_do)
    # Not the file of `accuracy measure`: a test of this drive and configuration is begun, and kept, here.
    path = session_path(c.store).with_name("commissioning_chord_test.json")
    if "accuracy" in c.results and c.results["accuracy"].figures:
        # The one before has its result: this is another.
        path.unlink(missing_ok=True)
    order = order_of(c.machine)
    check_travel(c.machine, order.made())
    session = session_to_go_on_with(path, c.machine, order) or new_session(c.machine, order)
    run = AxisRun(c.machine, c.store, commissioning=True, observer=c.watch.observer())
    alarm = None
    try:
        instrument = c.instrument(run)
        session = replace(session, instruments=(*session.instruments, instrument.name))
        with c.watch.halt.stops(run):
            session = AttendedTest(run, session, path, instrument, lambda text: c.say(f"  {text}")).go_on()
        run.power_down()
    except AlarmStop as stopped:
        alarm = stopped
        raise
    finally:
        run.close("commissioning", alarm)
    if not session.complete:
        return judged(False, "accuracy", f"stopped after {session.text}", "the same step goes on")
    folder = c.folder / "accuracy"
    folder.mkdir(exist_ok=True)
    store_session(folder / "readings.json", session)
    return _judged(c, session)


def _judged(c: Context, session: ChordSession) -> StepResult:
    # A virtual drive in this process is watched by a simulated tracker; of any other the instrument's name tells.
    origin = Origin.SIMULATED if c.machine.plant_is_local else Origin.MEASURED
    report = session_report(c.machine, session, origin, version("gantryctl"), now_text())
    page = write_report(report, _head(c, report), c.folder / "accuracy")
    known, beside, required = report.uncertainty, report.beside, report.required
    assert known is not None
    assert beside is not None
    assert required is not None
    limit = required.limit
    c.watch.pictures.append(_picture(report, beside))
    ratio = session.procedure.whole_ratio
    by = f"{report.source} (certificate {c.certificate})" if c.certificate else report.source
    test = f"chord test {PROCEDURE} by {by}, {origin}"
    a_deg, chord_deg = report.a_as_measured_deg, report.statistics.largest_deg
    return judged(
        report.verdict.conformity is Conformity.PASS,
        "accuracy",
        f"{test}: {report.verdict.text}; report in {page.parent.name}/{page.name}",
        "gear, bearings, calibration; a better instrument where the limit lies within its uncertainty",
        a_deg=Figure(a_deg, high=limit / ratio),
        a_expanded_uncertainty_deg=COVERAGE_K * known.a_deg,
        largest_chord_error_deg=Figure(chord_deg, high=limit / ratio),
        chord_expanded_uncertainty_deg=COVERAGE_K * known.largest_chord_deg,
    )


def _head(c: Context, report: AccuracyReport) -> Head:
    made = Made(report.created, report.version, "gantryctl commission, chord test", operator_name())
    serials = known_serials(c.machine, c.store.directory)
    return Head(
        c.machine.name,
        machine_facts(c.machine, serials),
        made,
        MeasuredBy(report.source, c.certificate),
        c.machine.required.source,
    )


def _picture(report: AccuracyReport, beside: Beside) -> Picture:
    """Chord errors of every base, measured and of the model."""
    panels = []
    for base in report.measured.bases_deg:
        lines = [
            line(
                f"{name}, {way.value}", table.displacements_deg, 1e3 * table.select([base], way).mean(axis=0)
            )
            for name, table in ((report.origin.value, report.measured), beside)
            for way in table.directions
        ]
        at = report.dial.text(base)
        panels.append(Panel(f"displacement from {at} deg, deg", "chord error, 0.001 deg", tuple(lines)))
    return Picture("chord errors", tuple(panels))
