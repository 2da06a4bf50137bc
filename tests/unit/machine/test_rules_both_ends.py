"""Rules at their limit, on either side of it, at either end and in either direction; figures by hand."""

from __future__ import annotations

import pytest

import gantryctl
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine, default_machine, warnings_of, with_values
from gantryctl.machine.derived import rigid_stop
from gantryctl.machine.rules.parts import rigid_inertia_kg_m2, torque_motors
from gantryctl.machine.rules.reaction import (
    driven_acc_deg_s2,
    reaction_room_deg,
    reaction_time_ms,
)
from gantryctl.units import Dial
from support.modulo_machine import modulo_machine

MACHINE = default_machine()
CAN = {"drive.kind": "canopen", "control.scan_period_ms": 4.0}
# 9 deg between switch and stop at the end that is not looked at, so that it leaves more room.
WIDE_BELOW = {"axis.mechanical_stop_min_deg": -191.0}
WIDE_ABOVE = {"axis.mechanical_stop_max_deg": 191.0}


def broken(changes: dict[str, object]) -> set[str]:
    """Names of the rules that a machine breaks, of one with those keys."""
    try:
        with_values(MACHINE, changes)
    except ConfigError as error:
        return set(error.problems)
    return set()


@pytest.mark.parametrize(
    ("changes", "least_deg"),
    [
        # 2 deg/s2 of the released key x 5 ms / 10 per s = 1 mdeg, twice that with a warning at half of the band.
        ({"control.scan_period_ms": 10.0}, 2e-3),
        # A move that is steeper than that, speeding up or slowing down: 3 x 5 ms / 10 per s.
        ({"control.scan_period_ms": 10.0, "virtual_axis.acc_deg_s2": 3.0}, 3e-3),
        ({"control.scan_period_ms": 10.0, "virtual_axis.dec_deg_s2": 3.0}, 3e-3),
        # On a bus one scan more: 2 x 15 ms / 10 per s.
        (CAN | {"control.scan_period_ms": 10.0}, 6e-3),
        ({"control.scan_period_ms": 10.0, "control.kpp_per_s": 5.0}, 4e-3),
        ({"control.scan_period_ms": 10.0, "monitors.following_error_warning_ratio": 0.8}, 1.25e-3),
    ],
)
def test_an_acceleration_alone_warns_nobody(changes: dict[str, object], least_deg: float) -> None:
    small = {**changes, "monitors.in_position_window_deg": 1e-3}
    told = "or every acceleration warns"
    for factor, fits in ((1.001, True), (0.999, False)):
        found = broken(small | {"monitors.following_error_base_deg": factor * least_deg})
        assert any(told in each for each in found) is not fits


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        # 6 deg/s / 10 per s = 0.6 deg without feed-forward; 0.03 + 0.012 x 6 = 0.102 deg trip, 0.051 deg warn: 8.5 %.
        ({"control.kvf": 0.915}, ""),
        ({"control.kvf": 1.085}, ""),
        ({"control.kvf": 0.914}, "the axis is behind its set-point by 0.0516 deg"),
        # 0.015 + 0.006 v = 0.0086 v at 5.769 deg/s.
        ({"control.kvf": 1.086}, "0.051 deg warns in every motion at this speed; set kvf to 1 (0.915 .. "
         "1.085 holds), a higher kpp_per_s, or no speed above 5.769 deg/s"),
        ({"control.kvf": 1.169}, "0.051 deg warns"),
        ({"control.kvf": 1.171}, "ahead of its set-point by 0.103 deg (|1 - kvf| x speed / kpp_per_s), and 0.102 deg "
         "trips"),
        ({"control.kvf": 0.829}, "0.102 deg trips: no motion at this speed ends by itself"),
        # Half as stiff keeps twice as much: 4.25 % either side.
        ({"control.kvf": 0.958, "control.kpp_per_s": 5.0}, ""),
        ({"control.kvf": 0.957, "control.kpp_per_s": 5.0}, "(0.958 .. 1.042 holds)"),
        # 0.03 + 0.012 x 3 = 0.066 deg trip, 0.033 deg of 0.3 deg warn: 11 %.
        ({"control.kvf": 0.89, "speed.setting_max_deg_s": 3.0}, ""),
        ({"control.kvf": 0.889, "speed.setting_max_deg_s": 3.0}, "at 3 deg/s the axis is behind"),
        ({"control.kvf": 0.864, "monitors.following_error_warning_ratio": 0.8}, ""),
        ({"control.kvf": 0.863, "monitors.following_error_warning_ratio": 0.8}, "0.0816 deg warns"),
        ({"control.kvf": 0.0, "control.kpp_per_s": 300.0, "drive.kind": "ideal"}, ""),
    ],
)  # fmt: skip
def test_what_a_cruise_lags_by_is_told_with_its_limit_and_a_way_out(
    changes: dict[str, object], told: str
) -> None:
    lines = warnings_of(with_values(MACHINE, changes))
    assert [told in line for line in lines] == ([True] if told else [])


@pytest.mark.parametrize(
    ("bases", "twice"),
    [
        ([0.0, 30.0, -30.0], None),
        ([0.0, 30.0, 0.0], "0"),
        ([-0.0, 0.0], "0"),
        ([1.5, 2.0, 2.0], "2"),
        ([4.0], None),
    ],
)
def test_a_base_of_the_chord_test_is_listed_once(bases: list[float], twice: str | None) -> None:
    lines = broken({"accuracy.bases_deg": bases})
    assert [f"must list {twice} deg once" in line for line in lines] == ([] if twice is None else [True])


@pytest.mark.parametrize(("kvf", "alarms"), [(0.80, 0), (1.20, 0), (0.77, 1), (1.23, 1)])
def test_a_cruise_that_is_not_warned_of_gives_no_alarm(kvf: float, alarms: int) -> None:
    """1 deg/s: 0.042 deg trip, 0.021 deg of 0.1 deg warn; friction and gear take 0.001 deg of it."""
    machine = with_values(
        MACHINE,
        {
            "control.kvf": kvf, "control.scan_period_ms": 10.0, "speed.setting_max_deg_s": 1.0,
            "monitors.velocity_deviation_deg_s": 0.5, "accuracy.speeds_deg_s": (),
        },
    )  # fmt: skip
    assert len(warnings_of(machine)) == alarms
    assert gantryctl.move(machine, 4.0).trace["alarm_count"].max() == alarms


@pytest.mark.parametrize("end", ["over_travel_min_deg", "over_travel_max_deg"])
@pytest.mark.parametrize(("room_deg", "fits"), [(0.031, True), (0.029, False)])
def test_the_following_error_trips_before_over_travel_at_either_end(
    end: str, room_deg: float, fits: bool
) -> None:
    """0.03 deg at rest."""
    side = -1.0 if "min" in end else 1.0
    lines = broken({f"axis.{end}": side * (180.0 + room_deg)})
    assert (not any("following_error_base_deg" in line for line in lines)) is fits


@pytest.mark.parametrize("wide", [WIDE_BELOW, WIDE_ABOVE], ids=["above", "below"])
@pytest.mark.parametrize(("timeout_ms", "fits"), [(277.0, True), (279.0, False)])
def test_the_heartbeat_stops_the_axis_before_either_stop(
    wide: dict[str, object], timeout_ms: float, fits: bool
) -> None:
    """5 deg from switch to stop, 3.333 of them for the quick stop: 1.667 deg at 6 deg/s are 277.8 ms."""
    lines = broken(CAN | wide | {"can.heartbeat_timeout_ms": timeout_ms})
    assert (not any("heartbeat_timeout_ms" in line for line in lines)) is fits


@pytest.mark.parametrize(
    ("bases", "fits"), [((-179.0, 90.0), True), ((-180.0, 90.0), False), ((-90.0, 180.0), False)]
)
def test_bases_lie_within_both_ends_of_travel(bases: tuple[float, ...], fits: bool) -> None:
    lines = broken({"accuracy.bases_deg": bases})
    assert (not any("bases_deg" in line for line in lines)) is fits


@pytest.mark.parametrize("ramp", ["acc_deg_s2", "dec_deg_s2"])
@pytest.mark.parametrize(("jerk", "fits"), [(0.101, True), (0.099, False)])
def test_the_jerk_reaches_either_ramp_within_10_s(ramp: str, jerk: float, fits: bool) -> None:
    """1 deg/s2 of one, 0.4 of the other."""
    lines = broken(
        {
            "virtual_axis.profile": "jerk_limited",
            "virtual_axis.jerk_deg_s3": jerk,
            f"virtual_axis.{ramp}": 1.0,
        }
    )
    assert (not any("[virtual_axis] jerk_deg_s3" in line.partition(";")[0] for line in lines)) is fits


@pytest.mark.parametrize(("power_kw", "fits"), [(27.9, True), (27.8, False), (34.0, True), (34.1, False)])
def test_the_name_plate_agrees_to_10_percent_either_way(power_kw: float, fits: bool) -> None:
    """257 N m at 1150 r/min are 30.949 kW: 27.85 to 34.04."""
    lines = broken({"motor.power_rated_kw": power_kw})
    assert (not any("[motor] power_rated_kw" in line.partition(";")[0] for line in lines)) is fits


@pytest.mark.parametrize(
    ("sectors", "fits"),
    [
        ([[10.0, 20.0]], True),
        ([[10.0, 10.0]], False),
        ([[-180.0, 180.0]], False),
        # From 175 on to the next turn's -178: 7 deg; what is left before 10 deg.
        ([[10.0, 20.0], [175.0, -178.0]], True),
        ([[10.0, 20.0], [175.0, 9.0]], True),
        ([[10.0, 20.0], [175.0, 9.5]], False),
    ],
)
def test_sectors_of_an_axis_without_ends_leave_a_degree_all_round(
    sectors: list[list[float]], fits: bool
) -> None:
    if fits:
        assert isinstance(modulo_machine({"axis.no_go_deg": sectors}), Machine)
    else:
        with pytest.raises(ConfigError, match="no_go_deg"):
            modulo_machine({"axis.no_go_deg": sectors})


@pytest.mark.parametrize(
    ("at_drive", "at_node", "differ"),
    [
        ((20, 21), (-1, -1), True),
        ((20, 20), (-1, -1), False),
        ((20, 21), (3, 3), False),
        # Bit 3 of one place and bit 3 of the other; an input at the node is read there, whatever the drive has.
        ((-1, 3), (3, -1), True),
        ((3, -1), (-1, 3), True),
        ((20, 20), (3, -1), True),
        ((20, 20), (3, 4), True),
    ],
)
def test_two_channels_of_the_emergency_stop_are_two_inputs(
    at_drive: tuple[int, int], at_node: tuple[int, int], differ: bool
) -> None:
    changes: dict[str, object] = {**CAN, "can.interface": "simulated", "can.io.node": 9}
    for place, bits in (("can.inputs", at_drive), ("can.io.inputs", at_node)):
        changes |= {
            f"{place}.{name}": bit for name, bit in zip(("estop_ok", "estop_ok_2"), bits, strict=True)
        }
    assert any("another input than estop_ok_2" in each for each in broken(changes)) is not differ


@pytest.mark.parametrize(("turns", "fits"), [(1176, True), (1175, False)])
def test_the_encoder_has_its_wrap_margin_at_either_end(turns: int, fits: bool) -> None:
    """360 deg of travel and twice 5 deg are 1175.8 turns of the motor."""
    lines = broken(CAN | {"encoder.turns": turns})
    assert (not any("travel plus the wrap margin on both sides" in line for line in lines)) is fits


@pytest.mark.parametrize(("turns", "fits"), [(4, True), (2, False)])
def test_three_scans_at_the_trip_are_a_quarter_of_the_range_of_the_encoder(turns: int, fits: bool) -> None:
    """30 ms at 6.6 deg/s are 0.63 turns of the motor, a quarter of 2.5."""
    lines = broken({"control.scan_period_ms": 10.0, "encoder.turns": turns})
    assert (not any("a wrap is no more known from a motion" in line for line in lines)) is fits


@pytest.mark.parametrize(("second", "inertia_kg_m2"), [(False, 2.02774), (True, 2.38974)])
def test_a_second_pinion_brings_its_rotor_along(second: bool, inertia_kg_m2: float) -> None:
    """2.18e6 kg m2 behind 1144 are 1.66574; a rotor with its wave generator has 0.362."""
    machine = with_values(MACHINE, {"plant.switches.second_pinion": second})
    assert rigid_inertia_kg_m2(machine) == pytest.approx(inertia_kg_m2, rel=1e-5)


@pytest.mark.parametrize(("lost", "count"), [("none", 2), ("first", 1), ("second", 1)])
def test_a_motor_that_is_lost_gives_no_torque_for_a_stop(lost: str, count: int) -> None:
    machine = with_values(MACHINE, {"plant.switches.second_pinion": True})
    pinion = machine.plant.second_pinion.model_copy(update={"lost": lost})
    plant = machine.plant.model_copy(update={"second_pinion": pinion})
    assert torque_motors(machine.model_copy(update={"plant": plant})) == count


@pytest.mark.parametrize(
    ("limit_nm", "fits"), [(0.0, True), (365.0, False), (366.0, True), (385.0, True), (386.0, False)]
)
def test_a_torque_limit_in_the_drive_is_that_of_the_machine_or_5_percent_less(
    limit_nm: float, fits: bool
) -> None:
    """95 % of 385 N m are 365.75."""
    lines = broken(CAN | {"can.torque_limit_in_drive_nm": limit_nm})
    assert (not any("torque_limit_in_drive_nm" in line.partition(";")[0] for line in lines)) is fits


def test_a_sector_over_the_end_of_the_turn_takes_its_part_of_either_side() -> None:
    """From 150 on to -170 deg: what is left of -180 to 180 is -170 to 150."""
    axis = modulo_machine({"axis.no_go_deg": [[150.0, -170.0]]}).axis
    assert axis.home_stretch_deg == (-170.0, 150.0)


# --- two motors -------------------------------------------------------------------------------------------------------
TWO = {"plant.switches.second_pinion": True}
LOST = TWO | {"plant.second_pinion.lost": "second"}


@pytest.mark.parametrize(
    ("motors", "breakaway_nm", "fits"),
    [(TWO, 374.0, True), (TWO, 376.0, False), (LOST, 182.0, True), (LOST, 183.0, False)],
)
def test_motors_break_away_each_with_its_own_friction(
    motors: dict[str, object], breakaway_nm: float, fits: bool
) -> None:
    """16.0 kN m and 6.8 of the rollers are 19.92 N m behind 1144, each motor has its own; one or two give 385 N m."""
    lines = broken(motors | {"plant.motor_friction.breakaway_nm": breakaway_nm})
    assert (not any("breakaway friction and nominal eccentric moment" in line for line in lines)) is fits


@pytest.mark.parametrize(
    ("motors", "coulomb_nm", "fits"),
    [(TWO, 228.0, True), (TWO, 229.0, False), (LOST, 99.0, True), (LOST, 100.0, False)],
)
def test_motors_hold_the_speed_each_with_its_own_friction(
    motors: dict[str, object], coulomb_nm: float, fits: bool
) -> None:
    """58.1 kN m are 50.78 N m behind 1144, each motor has 3.59 N m of viscous friction; one or two give 257 N m."""
    friction = {f"plant.motor_friction.{name}_nm": coulomb_nm for name in ("coulomb", "breakaway")}
    lines = broken(motors | friction)
    assert (not any("friction at the highest setting and" in line for line in lines)) is fits


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(
    ("reducer_nm", "preload_nm", "fits"),
    # Half of 257 N m are 128.5; a reducer of 10 kN m has 113.6 behind 88.
    [(17600.0, 128.0, True), (17600.0, 129.0, False), (10000.0, 113.0, True), (10000.0, 114.0, False)],
)
def test_a_preload_is_limited_either_way(
    way: float, reducer_nm: float, preload_nm: float, fits: bool
) -> None:
    changes = {"plant.second_pinion.preload_nm": way * preload_nm, "reducer.torque_rated_nm": reducer_nm}
    lines = broken(TWO | changes)
    assert (not any("[plant.second_pinion] preload_nm" in line.partition(";")[0] for line in lines)) is fits


@pytest.mark.parametrize(("length_rad", "fits"), [(1.63e-6, True), (1.62e-6, False)])
def test_the_hysteresis_is_followed_in_a_stop_by_two_motors(length_rad: float, fits: bool) -> None:
    """770 N m slow 3.1275e6 kg m2 by 0.28165 rad/s2, which swings 2.18e6 on 1.0241e9 N m/rad at up to 0.02599 rad/s:
    two lengths in 125 us are 1.624e-6 rad.
    """
    lines = broken(TWO | {"plant.transmission.hysteresis_length_rad": length_rad})
    assert (not any("the simulation of the hysteresis swings up" in line for line in lines)) is fits


@pytest.mark.parametrize(("motors", "acc_deg_s2"), [({}, 10.5887), (TWO, 17.0535)])
def test_an_axis_is_driven_away_by_all_its_motors(motors: dict[str, object], acc_deg_s2: float) -> None:
    """385 or 770 N m and 43.71 of the moment, on 2.02774 or 2.38974 kg m2 times 1144."""
    assert driven_acc_deg_s2(with_values(MACHINE, motors)) == pytest.approx(acc_deg_s2, rel=1e-4)


# --- monitors ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("sag_deg", "fits"), [(0.436, True), (0.437, False)])
def test_a_load_that_sinks_goes_on_sinking_while_the_brake_closes(sag_deg: float, fits: bool) -> None:
    """s = 1.0795 deg/s2, n = 8.8003, 0.15 s, 0.6667 deg of room: u = 0.97036 deg/s and u^2 / 2s = 0.43612 deg."""
    lines = broken({"brake.sag_max_deg": sag_deg})
    assert (not any("[brake] sag_max_deg" in line.partition(";")[0] for line in lines)) is fits


@pytest.mark.parametrize(("band_deg", "fits"), [(0.540, True), (0.541, False)])
def test_encoders_disagree_within_the_room_less_time_and_scan(band_deg: float, fits: bool) -> None:
    """111.1 ms less 20 of the monitor and a scan of 1 ms are 90.1 ms, 0.5407 deg at 6 deg/s."""
    lines = broken({"control.compensation.load_encoder.disagreement_deg": band_deg})
    assert (not any("load_encoder] disagreement_deg" in line.partition(";")[0] for line in lines)) is fits


# --- nodes beside the drive -------------------------------------------------------------------------------------------
BRAKE = CAN | {"brake.owner": "controller_output"}


@pytest.mark.parametrize(
    ("places", "fits"),
    [
        ({"can.outputs.brake_release": 5}, True),
        ({"can.io.node": 3, "can.io.outputs.brake_release": 6}, True),
        ({"can.outputs.brake_release": 5, "can.io.node": 3, "can.io.outputs.brake_release": 6}, False),
        # A node that is not there opens no brake.
        ({"can.io.outputs.brake_release": 6}, False),
        ({}, False),
    ],
)
def test_a_brake_has_one_output_that_is_there(places: dict[str, object], fits: bool) -> None:
    assert (not any("[brake] owner" in line.partition(";")[0] for line in broken(BRAKE | places))) is fits


@pytest.mark.parametrize("output", ["lamp", "drive_enable"])
@pytest.mark.parametrize(("node", "fits"), [(3, True), (0, False)])
def test_an_output_has_its_node(output: str, node: int, fits: bool) -> None:
    lines = broken(CAN | {"can.io.node": node, f"can.io.outputs.{output}": 4})
    assert (not any("must be the id of the node whose outputs are wired" in line for line in lines)) is fits


@pytest.mark.parametrize("table", ["can.outputs", "can.io.outputs"])
@pytest.mark.parametrize(("lamp", "fits"), [(5, True), (4, False)])
def test_no_two_outputs_of_drive_or_node_share_a_bit(table: str, lamp: int, fits: bool) -> None:
    lines = broken(CAN | {"can.io.node": 3, f"{table}.horn": 4, f"{table}.lamp": lamp})
    assert (not any("must have a bit that no other output has" in line for line in lines)) is fits


@pytest.mark.parametrize(
    ("encoder", "io", "fits"), [(4, 3, True), (2, 3, False), (127, 3, False), (3, 3, False)]
)
def test_the_encoder_on_the_ring_answers_with_an_id_of_its_own(encoder: int, io: int, fits: bool) -> None:
    keys = {"can.load_encoder.source": "node", "can.load_encoder.node": encoder, "can.io.node": io}
    lines = broken(CAN | keys)
    assert (not any("must differ from every other node id" in line for line in lines)) is fits


@pytest.mark.parametrize(
    ("owner", "fits"), [("controller_output", True), ("drive", False), ("object_60FE", False)]
)
def test_an_output_releases_no_brake_that_somebody_else_works(owner: str, fits: bool) -> None:
    lines = broken(CAN | {"brake.owner": owner, "can.outputs.brake_release": 5})
    assert (not any("where an output releases the brake" in line for line in lines)) is fits


# --- travel and turns -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("end_deg", "fits"), [(180.0, True), (179.0, False), (181.0, False)])
def test_an_axis_without_ends_has_angles_over_one_turn(end_deg: float, fits: bool) -> None:
    if fits:
        modulo_machine({"axis.pos_max_deg": end_deg})
    else:
        with pytest.raises(ConfigError, match=f"gives angles over {end_deg + 180.0:g} deg"):
            modulo_machine({"axis.pos_max_deg": end_deg})


def test_a_turn_that_begins_below_0_is_not_shown_within_0_to_360() -> None:
    with pytest.raises(ConfigError, match="the turn of the axis begins at -180 deg"):
        modulo_machine({"axis.display": "0..360"})
    modulo_machine({"axis.display": "0..360", "axis.pos_min_deg": 0.0, "axis.pos_max_deg": 360.0})


@pytest.mark.parametrize(("turns", "fits"), [(1143, False), (1144, True), (1145, False)])
def test_the_exact_gear_is_neither_more_nor_less_than_the_ratio(turns: int, fits: bool) -> None:
    """88 x 13."""
    lines = broken({"axis.gear_motor_turns": turns})
    assert (not any("gives a ratio of" in line for line in lines)) is fits


@pytest.mark.parametrize(
    ("sector", "words"),
    [
        ((-179.0, -170.0), ""), ((170.0, 179.0), ""), ((-180.0, -170.0), "inside travel"),
        ((170.0, 180.0), "inside travel"), ((170.0, 190.0), "inside travel"),
        ((-179.5, -170.0), "leaves 0.5 deg"), ((170.0, 179.5), "leaves 0.5 deg"),
    ],
)  # fmt: skip
def test_a_sector_leaves_a_degree_to_either_end_of_travel(sector: tuple[float, float], words: str) -> None:
    lines = [line for line in broken({"axis.no_go_deg": [list(sector)]}) if "[axis] no_go_deg" in line]
    assert any(words in line for line in lines) if words else not lines


@pytest.mark.parametrize("sector", [[300.0, 400.0], [-400.0, 10.0]])
def test_angles_of_a_sector_lie_within_a_turn_either_way(sector: list[float]) -> None:
    with pytest.raises(ConfigError, match="must be two different angles of a turn"):
        modulo_machine({"axis.no_go_deg": [sector]})


def test_an_axis_without_ends_stands_within_a_turn_either_way() -> None:
    axis = modulo_machine().axis
    assert [axis.within_stops(angle) for angle in (-361.0, -360.0, 360.0, 361.0)] == [
        False,
        True,
        True,
        False,
    ]


def test_a_new_machine_stands_in_the_widest_stretch() -> None:
    """10, 130 and 160 deg are left: the middle of 20 to 180."""
    axis = with_values(MACHINE, {"axis.no_go_deg": [[-170.0, -150.0], [-20.0, 20.0]]}).axis
    assert (axis.start_angle_deg, axis.home_stretch_deg) == (100.0, (20.0, 180.0))


@pytest.mark.parametrize(
    ("stop_deg", "ends"), [(187.0, (-187.0, 187.0)), (180.0, (-180.0, 180.0)), (179.0, None)]
)
def test_where_two_places_read_alike_the_dial_names_the_end(
    stop_deg: float, ends: tuple[float, float] | None
) -> None:
    """Within 0 to 360 deg, of stops that are a turn apart or more."""
    stops = {"mechanical_stop_min_deg": -stop_deg, "mechanical_stop_max_deg": stop_deg}
    axis = MACHINE.axis.model_copy(update={"display": "0..360", **stops})
    assert axis.dial == Dial(0.0, ends)


# --- what is measured -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("sag_deg", "fits"), [(7.7e-5, True), (7.6e-5, False)])
def test_a_sag_is_two_steps_of_the_encoder(sag_deg: float, fits: bool) -> None:
    """8192 x 1144 steps a turn: 3.841e-5 deg."""
    lines = broken({"brake.sag_max_deg": sag_deg})
    assert (not any("two encoder steps" in line for line in lines)) is fits


@pytest.mark.parametrize(("speeds", "fits"), [((0.6, 6.0), True), ((0.59, 6.0), False), ((0.6, 6.01), False)])
def test_a_speed_test_lies_within_both_settings(speeds: tuple[float, ...], fits: bool) -> None:
    lines = broken({"accuracy.speeds_deg_s": speeds})
    assert (not any("speeds_deg_s" in line for line in lines)) is fits


def test_displacements_ascend_and_none_comes_twice() -> None:
    assert any("must ascend" in line for line in broken({"accuracy.displacements_deg": (5.0, 5.0, 10.0)}))


@pytest.mark.parametrize("missing", ["moment_observer.active", "windup.active", "windup.reversal"])
def test_backlash_is_followed_with_all_that_says_on_which_flank_the_load_lies(missing: str) -> None:
    laws = {
        "backlash_observer.active": True, "backlash_observer.limit_deg": 0.005, "moment_observer.active": True,
        "moment_observer.limit_nm": 1e3, "windup.active": True, "windup.reversal": True,
        "calibration": "m.calibration.toml",
    }  # fmt: skip
    keys = {"virtual_axis.profile": "jerk_limited"}
    whole = broken(keys | {f"control.compensation.{name}": value for name, value in laws.items()})
    lacking = broken(
        keys | {f"control.compensation.{name}": value for name, value in (laws | {missing: False}).items()}
    )
    words = "which say on which flank the load lies"
    assert [any(words in line for line in lines) for lines in (whole, lacking)] == [False, True]


@pytest.mark.parametrize(("increments", "fits"), [(3_652_000, True), (3_654_000, False)])
def test_6064_has_room_for_travel_and_both_wrap_margins(increments: int, fits: bool) -> None:
    """370 deg are 1175.78 turns of the motor, in which 2^32 are 3,652,873 increments each."""
    lines = broken(CAN | {"can.increments_per_turn": increments})
    assert (not any("the 32 bits of 6064 wrap" in line for line in lines)) is fits


@pytest.mark.parametrize(("kind", "fits"), [("canopen", True), ("sim", False)])
def test_a_drive_on_a_bus_may_count_any_number_of_turns(kind: str, fits: bool) -> None:
    lines = broken(CAN | {"drive.kind": kind, "encoder.turns": 3000})
    assert (not any("must be a power of two" in line for line in lines)) is fits


# --- torque -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("what", ["quick_dec_deg_s2", "acc_deg_s2"])
@pytest.mark.parametrize(
    ("motors", "dec_deg_s2", "fits"),
    [(TWO, 16.1, True), (TWO, 16.2, False), (LOST, 8.0, True), (LOST, 8.1, False)],
)
def test_motors_that_have_torque_stop_and_start_the_rotors_of_all(
    motors: dict[str, object], what: str, dec_deg_s2: float, fits: bool
) -> None:
    """770 or 385 N m on 2.38974 kg m2 times 1144 are 16.138 or 8.069 deg/s2."""
    lines = broken(motors | {f"virtual_axis.{what}": dec_deg_s2})
    words = "for its quick stop" if what == "quick_dec_deg_s2" else "to accelerate"
    assert (not any(f"what the rigid machine needs {words}" in line for line in lines)) is fits


@pytest.mark.parametrize(("hold", "fits"), [("servo", True), ("brake", False)])
def test_only_a_brake_that_closes_waits_for_the_arrival(hold: str, fits: bool) -> None:
    lines = broken(
        {"brake.hold": hold, "brake.hold_brake_after_s": 0.9, "monitors.in_position_dwell_ms": 1000.0}
    )
    assert (not any("[brake] hold_brake_after_s" in line.partition(";")[0] for line in lines)) is fits


@pytest.mark.parametrize(("rigid", "fits"), [(True, True), (False, False)])
def test_the_speed_loop_of_a_rigid_machine_has_its_load_too(rigid: bool, fits: bool) -> None:
    """0.362 kg m2 in 125 us are 2896 N m s/rad, 2.02774 are 16,222."""
    lines = broken({"plant.switches.rigid": rigid, "drive.speed_loop.kvp_nm_s_per_rad": 3000.0})
    assert (not any("or it swings up" in line for line in lines)) is fits


def test_slopes_of_a_machine_without_gears_are_not_looked_at() -> None:
    keys: dict[str, object] = {"plant.transmission.reducer_torque_2_nm": 35_201.0}
    for off in ({}, {"plant.switches.rigid": True}, {"plant.switches.three_slopes": False}):
        refused = any("the momentary torque of the reducer" in line for line in broken(keys | off))
        assert refused is (not off)


@pytest.mark.parametrize(
    ("pinion", "ring_ratio", "fits"), [(5, 13.0, True), (4, 13.0, False), (6, 4.0, True), (5, 4.0, False)]
)
def test_single_teeth_are_those_of_no_smaller_gears_than_the_core_has(
    pinion: int, ring_ratio: float, fits: bool
) -> None:
    """From 5 and 24 on: 4 x 13 are 52 of the ring, and 5 x 4 are 20."""
    keys = {"plant.switches.tooth_pitch": True, "plant.gear_error.pinion_teeth": pinion}
    lines = broken(keys | {"axis.ring_ratio": ring_ratio})
    assert (not any("allowed 5..128 and 24..1024" in line for line in lines)) is fits


# --- reaction ---------------------------------------------------------------------------------------------------------
def test_a_stop_leaves_60_ms_of_reaction_at_the_least() -> None:
    """4 deg less 36 / 10.8 are 0.6667, 111.1 ms at 6 deg/s; less 36 / 9.6 they would be 0.25, and 0.06 s are 0.36."""
    assert reaction_room_deg(MACHINE) == pytest.approx(2.0 / 3.0)
    virtual = MACHINE.virtual_axis.model_copy(update={"quick_dec_deg_s2": 4.8})
    softer = MACHINE.model_copy(update={"virtual_axis": virtual})
    assert (reaction_room_deg(softer), reaction_time_ms(softer)) == pytest.approx((0.36, 60.0))


@pytest.mark.parametrize(
    ("key", "value", "fits"),
    [
        ("standstill_time_ms", 171.0, True), ("standstill_time_ms", 171.5, False),
        ("standstill_window_deg", 0.137, True), ("standstill_window_deg", 0.138, False),
    ],
)  # fmt: skip
def test_an_axis_that_is_driven_away_is_caught_a_scan_later(key: str, value: float, fits: bool) -> None:
    """The brake catches 1.82353 deg/s, reached after 172.21 ms of 10.5887 deg/s2: less the scan of 1 ms. From 11 ms on
    1.70706 deg/s are left, and 1.70706^2 / 21.1774 are 0.13760 deg.
    """
    lines = broken({f"monitors.{key}": value})
    assert (not any(f"[monitors] {key}" in line.partition(";")[0] for line in lines)) is fits


@pytest.mark.parametrize(
    ("speed", "angle_deg", "time_s"),
    # From 4/3 deg/s on the deceleration of 2 deg/s2 is reached at 3 deg/s3.
    [(1.0, 0.57735, 1.154701), (6.0, 11.0, 11.0 / 3.0)],
)
def test_a_slow_stop_ends_before_its_deceleration_is_reached(
    speed: float, angle_deg: float, time_s: float
) -> None:
    assert rigid_stop(speed, 2.0, 3.0) == pytest.approx((angle_deg, time_s), rel=1e-5)


@pytest.mark.parametrize(
    ("turn", "sectors", "stretches"),
    [
        # The same sector in another turn: 340 to 20 deg, 10 to 20, 60 to 70 beside 300 to 310.
        ((0.0, 360.0), [[-20.0, 20.0]], [(20.0, 340.0)]),
        ((0.0, 360.0), [[-350.0, -340.0]], [(0.0, 10.0), (20.0, 360.0)]),
        ((0.0, 360.0), [[-300.0, -290.0], [300.0, 310.0]], [(0.0, 60.0), (70.0, 300.0), (310.0, 360.0)]),
        (
            (-180.0, 180.0),
            [[-300.0, -290.0], [300.0, 310.0]],
            [(-180.0, -60.0), (-50.0, 60.0), (70.0, 180.0)],
        ),
        ((-180.0, 180.0), [[190.0, 200.0]], [(-180.0, -170.0), (-160.0, 180.0)]),
        # All but 20 deg.
        ((0.0, 360.0), [[-350.0, 350.0]], [(0.0, 10.0), (350.0, 360.0)]),
    ],
)
def test_a_sector_of_a_modulo_axis_lies_in_its_turn_however_it_is_written(
    turn: tuple[float, float], sectors: list[list[float]], stretches: list[tuple[float, float]]
) -> None:
    low, high = turn
    ends = {"axis.pos_min_deg": low, "axis.pos_max_deg": high}
    axis = modulo_machine({**ends, "axis.no_go_deg": sectors}).axis
    assert axis._stretches_deg == stretches
    # A new machine stands in one of them.
    first, last = axis.home_stretch_deg
    assert (first, last) in stretches
    assert first <= axis.start_angle_deg <= last
