"""Record that survives power-off, and its form as plain JSON values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Final, get_args, get_origin, get_type_hints

from gantryctl.errors import StateError

ALARMS_KEPT: Final = 100


@dataclass(frozen=True)
class AlarmEntry:
    """One alarm of the past.

    Attributes:
        code: stable code, e.g. CTL-03.
        text: the finished text with measured value, limit, what was done and what to do.
        at: date and time as the caller writes it (ISO 8601).
        time_s: time of the scan within its run, s.
        pos_act_rad: angle of the gantry at the alarm, motor side, rad.
        vel_act_rad_s: speed of the gantry at the alarm, motor side, rad/s.
        torque_act_nm: motor torque at the alarm, N m.
        severity: INFO, WARNING, REFUSED or STOP; "" where the memory is older than this field.
        follows: code of the alarm that had stopped the axis before, or "".
    """

    code: str
    text: str
    at: str = ""
    time_s: float = 0.0
    pos_act_rad: float | None = None
    vel_act_rad_s: float | None = None
    torque_act_nm: float | None = None
    severity: str = ""
    follows: str = ""


@dataclass(frozen=True)
class Retained:
    """Memory of the controller over a power-off. None or "" where a value is not known yet.

    Attributes:
        machine, config_hash: whose memory this is. speed_rad_s, increment_rad: the operator's settings, at
        the gantry. encoder_serial: the encoder that the zero offset belongs to. zero_offset_counts: raw
        reading of the encoder at gantry angle 0; `previous_offset_counts` the one before. zero_set_by,
        zero_set_at, zero_witness: who, when, and what proved it. rest_position_counts: raw reading when the
        axis was last left at rest. holding_torque_nm: motor torque that held the load there, N m.
        torque_weights: learned torque model of motions, JSON; or "".
        calibration_watch: what the watch of the calibration has seen and found, JSON; or "".
        brake_tested_at: date of the last brake test that passed or failed; `brake_tested_power_ups` the
        power-ups before it. brake_test_outcome: the last test in one word, brake_test_text: what
        was measured, in a sentence, brake_test_words: the sentence as words and values, JSON;
        brake_plus_nm, brake_minus_nm: torque that the brake bore in it, N m. brake_failed:
        what a failed test measured, until one passes or service resets; or "".
        brake_tests, brake_tests_failed: counters. power_ups, moves, emergency_brake_stops: counters.
        emergency_brake_energy_j: what the brake took in those stops, J.
        travelled_rad: total way of the gantry, rad. error_stop: code of the alarm that still holds the axis
        in ErrorStop, or "". doubted_by: code of the alarm since which the encoder's reading is in doubt, until
        service has compared the angle; or "". last_result: how the last command ended, in words. alarms: the last
        `ALARMS_KEPT`, oldest first.
    """

    machine: str
    config_hash: str
    speed_rad_s: float | None = None
    increment_rad: float | None = None
    encoder_serial: str = ""
    zero_offset_counts: int | None = None
    previous_offset_counts: int | None = None
    zero_set_by: str = ""
    zero_set_at: str = ""
    zero_witness: str = ""
    rest_position_counts: int | None = None
    holding_torque_nm: float | None = None
    torque_weights: str = ""
    calibration_watch: str = ""
    brake_tested_at: str = ""
    brake_tested_power_ups: int = 0
    brake_test_outcome: str = ""
    brake_test_text: str = ""
    brake_test_words: str = ""
    brake_plus_nm: float | None = None
    brake_minus_nm: float | None = None
    brake_failed: str = ""
    brake_tests: int = 0
    brake_tests_failed: int = 0
    power_ups: int = 0
    moves: int = 0
    emergency_brake_stops: int = 0
    emergency_brake_energy_j: float = 0.0
    travelled_rad: float = 0.0
    error_stop: str = ""
    doubted_by: str = ""
    last_result: str = ""
    alarms: tuple[AlarmEntry, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "alarms", tuple(self.alarms)[-ALARMS_KEPT:])


# Fields that memories of the first version do not have, with what they mean there.
_ADDED: Final = {
    "torque_weights": "", "calibration_watch": "", "emergency_brake_energy_j": 0.0,
    "brake_tested_power_ups": 0, "brake_test_outcome": "", "brake_test_text": "", "brake_test_words": "",
    "brake_plus_nm": None, "brake_minus_nm": None,
    "brake_failed": "", "brake_tests": 0, "brake_tests_failed": 0, "doubted_by": "",
}  # fmt: skip
_ADDED_TO_ALARMS: Final = {"severity": "", "follows": ""}


def to_json_values(record: Retained) -> dict[str, object]:
    """Turn the record into JSON values.

    Raises:
        StateError: a value that is not finite or not of its type; nothing of it may be stored.
    """
    _check(Retained, vars(record))
    for alarm in record.alarms:
        _check(AlarmEntry, vars(alarm))
    return {**asdict(record), "alarms": [asdict(alarm) for alarm in record.alarms]}


def from_json_values(values: Mapping[str, object]) -> Retained:
    """Read the record from JSON values; StateError when a field is missing, unknown or of another type."""
    values = {**_ADDED, **values}
    alarms = values.get("alarms")
    if not isinstance(alarms, list) or not all(isinstance(alarm, dict) for alarm in alarms):
        raise StateError("alarms: must be a list of records")
    alarms = [{**_ADDED_TO_ALARMS, **alarm} for alarm in alarms]
    for alarm in alarms:
        _check(AlarmEntry, alarm)
    flat = {**values, "alarms": tuple(AlarmEntry(**alarm) for alarm in alarms)}
    _check(Retained, flat)
    return Retained(**flat)  # type: ignore[arg-type]  # _check has just compared every field with its type


def _check(kind: type[Retained] | type[AlarmEntry], values: Mapping[str, object]) -> None:
    """Refuse all but exactly the fields of `kind`, each of its type, numbers finite."""
    hints = get_type_hints(kind)
    if set(hints) != set(values):
        raise StateError(f"missing or unknown: {', '.join(sorted(set(hints) ^ set(values)))}")
    for name, value in values.items():
        if not _fits(value, hints[name]):
            wanted = getattr(hints[name], "__name__", hints[name])
            raise StateError(f"{name} = {value!r}: must be a finite {wanted}")


def _fits(value: object, hint: object) -> bool:
    """Whether a value may stand in a field of this type; a whole number also for a float, a bool never."""
    kinds = get_args(hint) if get_origin(hint) is not tuple else (tuple,)
    kinds = kinds or (hint,)
    if isinstance(value, bool):
        return False
    if isinstance(value, float):
        return float in kinds and math.isfinite(value)
    if isinstance(value, int):
        # Above 2^53 a whole number is no longer the same one as a float.
        return int in kinds or (float in kinds and abs(value) <= 2**53)
    return (type(None) if value is None else type(value)) in kinds
