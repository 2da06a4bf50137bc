"""Group E, on: nodes beside the drive on its bus."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.table.row import Row, State, at
from gantryctl.program.alarms.codes import Code

_IO: Final = "bus/test_io_node.py"
_RING: Final = "bus/test_ring_encoder.py"

NODES: Final = (
    Row(
        "E20",
        "I/O node is off the bus, or restarts",
        "age of its telegram, 30 ms and at least 3 scans; its boot-up message",
        "quick stop; inputs that it had count as off, its outputs show their error values (6207)",
        (Code.CAN_16,),
        at(
            _IO,
            "test_a_silent_node_is_a_quick_stop_and_its_brake_closes_by_itself",
            "test_a_node_that_restarts_loses_its_outputs_and_the_axis_stops",
            "test_telegrams_missed_for_less_than_30_ms_stop_nothing",
        ),
    ),
    Row(
        "E21",
        "Outputs of the I/O node keep their levels",
        "watchdog relay without edges; contact of the brake",
        "the relay takes the drive's power; without one the brake stays as it is, and is told",
        (Code.DRV_04, Code.BRK_01, Code.BRK_06),
        at(
            _IO,
            "test_outputs_without_effect_keep_the_brake_closed",
            "test_a_brake_relay_that_welds_is_told_and_the_load_stays",
        ),
    ),
    Row(
        "E22",
        "Inputs of the I/O node keep their levels, or come late",
        "nothing sees it; what they stand for acts by wire",
        "that of the emergency stop itself",
        (Code.DRV_04,),
        (),
        State.PARTLY,
        "a telegram carries no time of its inputs, and a level that stands is what most inputs do: door and collision "
        "may be seen late or never, so they need a wire of their own where people depend on them",
    ),
    Row(
        "E23",
        "Encoder on the ring is off the bus, or restarts",
        "age of its telegram, 30 ms and at least 3 scans; its boot-up message",
        "quick stop on the motor encoder",
        (Code.CAN_16,),
        at(
            _RING,
            "test_a_ring_encoder_that_fails_stops_the_axis",
            "test_telegrams_missed_for_24_ms_stop_nothing",
        ),
    ),
    Row(
        "E24",
        "Encoder on the ring is frozen, jumps, is late, or shows its own error",
        "difference of both encoders, 0.05 deg for 20 ms; 6503 of the encoder",
        "torque off and brake: one of two encoders is wrong, and nobody knows which",
        (Code.ENC_07,),
        at(
            _RING,
            "test_a_ring_encoder_that_fails_stops_the_axis",
            "test_a_frozen_ring_encoder_is_noticed",
            "test_a_late_reading_is_noticed_where_it_is_wrong_by_more_than_both_may_differ",
            "test_a_wrong_direction_stops_the_axis_within_the_reach_of_the_loop",
        ),
    ),
    Row(
        "E25",
        "Another node in the place of one",
        "identity (1018) at every set-up",
        "refused: no power",
        (Code.CAN_16,),
        at(_IO, "test_another_node_in_the_place_of_one_is_refused"),
    ),
)
