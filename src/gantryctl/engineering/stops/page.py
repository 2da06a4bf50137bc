"""The report of the stops of a machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from gantryctl.engineering.report.head import Head, Judged, Required, Verdict, judged_as
from gantryctl.engineering.report.page import Section, render_sections
from gantryctl.engineering.report.pictures import Panel, Picture, line
from gantryctl.engineering.report.recording import recorded
from gantryctl.engineering.stops.measured import MeasuredStops
from gantryctl.engineering.stops.run import StopClass, StopRow, log_stop
from gantryctl.engineering.stops.text import key_lines, stops_notes, stops_text, watch_lines
from gantryctl.machine import Machine
from gantryctl.machine.places import heaviest_deg
from gantryctl.units import deg

# The load has swung out of the picture's sight; a brake stop is logged for longer.
_SHOWN_S: Final = 4.0


def quick_within(machine: Machine, rows: Sequence[StopRow]) -> bool:
    """True when every quick stop keeps the permitted angle; the other classes are only shown."""
    # NaN keeps nothing.
    return all(angle <= machine.required.stopping_angle_deg for angle in _quick_angles_deg(rows))


def _quick_angles_deg(rows: Sequence[StopRow]) -> list[float]:
    return [row.angle_with_reaction_deg for row in rows if row.stop.stop_class is StopClass.QUICK]


def render_stops(
    machine: Machine, rows: Sequence[StopRow], measured: MeasuredStops | None, head: Head
) -> str:
    """The page: every stop class at every speed, and the stops from the highest speed as they run."""
    permitted, found = machine.required.stopping_angle_deg, max(_quick_angles_deg(rows))
    kept = quick_within(machine, rows)
    inspect = [
        f"{row.stop.stop_class.value} from {row.stop.speed_deg_s:g} deg/s" for row in rows if row.inspect
    ]
    verdict = Verdict(
        "PASS" if kept else "FAIL",
        judged_as(kept),
        f"a quick stop takes at most {found:.2f} deg with the reaction before it, {permitted:g} deg are permitted",
    )
    required = [
        Required(
            "stopping angle, quick stop", f"at most {permitted:g} deg", f"{found:.2f} deg", judged_as(kept)
        ),
        Required(
            "stops above the ratings of motor or reducer",
            "inspect afterwards",
            ", ".join(inspect) or "none",
            Judged.OPEN,
        ),
    ]
    speed = max(row.stop.speed_deg_s for row in rows)
    sections = [
        Section("Stops", stops_notes(machine, measured), [stops_text(rows)]),
        Section("Held key without its page", key_lines(machine, rows)),
        Section("Silent controller", watch_lines(machine, rows)),
        Section("As they run", figures=[recorded(_picture(machine, speed), "stops")]),
    ]
    return render_sections(
        head,
        verdict,
        required,
        title=f"Stops of {machine.name}",
        subtitle="Every stop class on the full plant",
        sections=[section for section in sections if section.sentences or section.figures],
    )


def _picture(machine: Machine, speed_deg_s: float) -> Picture:
    speeds, loads, torques = [], [], []
    at_deg = heaviest_deg(machine)[0]
    for stop_class in StopClass:
        log = log_stop(machine, stop_class, speed_deg_s, at_deg)
        shown = log.time_s <= _SHOWN_S
        time_s, name = log.time_s[shown], stop_class.value
        speeds.append(line(name, time_s, np.degrees(log["vel_motor_rad_s"][shown]) / machine.axis.ratio))
        loads.append(line(name, time_s, deg(1.0) * log["vel_load_rad_s"][shown]))
        torques.append(line(name, time_s, log["torque_mesh_nm"][shown] / machine.axis.ring_ratio / 1e3))
    rating = machine.reducer.torque_momentary_nm / 1e3
    return Picture(
        f"Stops from {speed_deg_s:g} deg/s at {machine.axis.dial.text(at_deg)} deg, simulated; time from the command "
        "on. Dashed red: momentary rating of the reducer.",
        (
            Panel("time, s", "motor side, deg/s", tuple(speeds)),
            Panel("time, s", "load side, deg/s", tuple(loads)),
            Panel("time, s", "reducer, kN m", tuple(torques), (-rating, rating)),
        ),
        columns=1,
    )
