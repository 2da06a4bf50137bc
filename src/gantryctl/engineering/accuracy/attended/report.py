"""From the readings of a chord test on a machine to its report, with the same test on the machine's model beside it."""

from __future__ import annotations

import numpy as np

from gantryctl.engineering.accuracy.attended.session import ChordSession
from gantryctl.engineering.accuracy.budget import stated_budget
from gantryctl.engineering.accuracy.procedure.on_batch import run_procedure
from gantryctl.engineering.accuracy.procedure.procedures import Procedure, evaluate
from gantryctl.engineering.accuracy.report.report import AccuracyReport
from gantryctl.engineering.accuracy.table import ErrorTable
from gantryctl.engineering.accuracy.uncertainty import chord_uncertainty
from gantryctl.engineering.instruments import SimulatedTracker, TrackerErrors
from gantryctl.engineering.report.origin import Origin
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, is_reference_machine, required_angle, short_hash
from gantryctl.ports import Truth
from gantryctl.units import deg


def session_report(
    machine: Machine,
    session: ChordSession,
    origin: Origin,
    version: str,
    created: str,
    notes: tuple[str, ...] = (),
) -> AccuracyReport:
    """The report of a finished test.

    Args:
        origin: whether the instrument measured a machine or a model.
        version: of the program. created: a date for the page. notes: warnings for the reader.
    """
    procedure, angles_deg = session.procedure, session.angles_deg()
    return AccuracyReport(
        machine=machine.name,
        config_hash=short_hash(machine),
        version=version,
        seed=0,
        source="; ".join(dict.fromkeys(session.instruments)),
        measured=_table(procedure, angles_deg),
        origin=origin,
        created=created,
        procedure=procedure,
        dwell_s=machine.accuracy.dwell_s,
        average_s=machine.accuracy.average_s,
        vel_max_deg_s=machine.speed.setting_max_deg_s,
        acc_deg_s2=machine.virtual_axis.acc_deg_s2,
        settings=_settings(session),
        notes=notes,
        required=required_angle(machine),
        dial=machine.axis.dial,
        of_reference=is_reference_machine(machine),
        simulated=_table(procedure, np.degrees(run_procedure([machine], procedure).load_rad[0])),
        uncertainty=chord_uncertainty(procedure, angles_deg, session.uncertainties_deg()),
        budget=stated_budget(procedure, angles_deg, session.uncertainties_deg()),
    )


def _table(procedure: Procedure, angles_deg: np.ndarray) -> ErrorTable:
    # The radius cancels: readings are angles.
    return evaluate(procedure, np.radians(angles_deg), 1.0)


def _settings(session: ChordSession) -> dict[str, str]:
    rows = {
        "measured from": session.begun,
        "to": session.readings[-1].at,
        "standard uncertainty of a reading": (
            f"{min(r.uncertainty_deg for r in session.readings):.5f} to "
            f"{max(r.uncertainty_deg for r in session.readings):.5f} deg, as the instrument states"
        ),
    }
    if session.checks:
        rows["instrument after a restart"] = "; ".join(
            f"{check.difference_deg:+.5f} deg, {check.allowed_deg:.5f} deg allowed"
            for check in session.checks
        )
    return rows


def simulated_tracker(machine: Machine, truth: Truth | None, seed: int) -> SimulatedTracker:
    """A tracker on the simulated load of this process, with the radius and the noise of [accuracy].

    Raises:
        UsageError: nothing tells the angle of the load.
    """
    if truth is None:
        raise UsageError(
            f"{machine.name}: no simulated load to look at; a virtual drive in another process is measured by "
            "`gantryctl instrument sim`"
        )
    column = truth.truth_columns.index("pos_load_rad")
    errors = TrackerErrors(
        radius_m=machine.accuracy.chord_radius_m, noise_um=machine.accuracy.tracker_noise_um
    )
    return SimulatedTracker(lambda _: deg(truth.truth()[column]), seed, errors)
