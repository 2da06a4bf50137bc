"""Personality of a drive model: its differences from the plain CiA 402 drive, one switch per quirk of real models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Final

from gantryctl.drives.od.object_table import ObjectTable
from gantryctl.errors import UsageError
from gantryctl.units import DriveVelocityUnit

PLAIN_MODES: Final = (0, 3, 9)
"""None, profile velocity, CSV: the modes that the virtual drive knows."""


@dataclass(frozen=True)
class Personality:
    """Switches; the defaults are the plain drive.

    Each quirk was found in the manual, the EDS or the behaviour of a real drive model.
    """

    name: str = "plain"
    summary: str = "CiA 301 and CiA 402 by the text"

    # 1000h: some have product codes in the upper half, or the bytes swapped.
    device_type: int = 0x0002_0192
    # 1005h; None: absent.
    sync_cob_id: int | None = 0x80
    # Objects the bus does not see; the drive behaves by their defaults.
    absent: tuple[int, ...] = ()
    not_mappable: tuple[int, ...] = ()
    # RPDOs have no event timer (1400:05), and so no deadline.
    no_deadline: bool = False
    # The EDS declares the mapping objects as ARRAY.
    array_mapping: bool = False
    # The EDS gives no default for 6502.
    no_mode_default: bool = False
    # Other factory defaults: (index, sub, value in the drive's units).
    defaults: tuple[tuple[int, int, int], ...] = ()
    # Factory default of 6085, motor side; None: the machine's own.
    quick_dec_deg_s2: float | None = None

    # Dictionary of a real model: the bus sees what is in it, with its access, limits and defaults; None: the plain one.
    table: ObjectTable | None = None
    # Modes that 6060 takes; those of 6502 where the table has no default.
    modes: tuple[int, ...] = PLAIN_MODES
    # Units of 6076 in one N m: CiA 402 has 1 mN m.
    rated_torque_per_nm: float = 1000.0

    # Increments of 6064 per motor turn; 2^19 x 4096 turns fill the positive half of 32 bit.
    counts_per_turn: int = 1 << 19
    # 6064 runs from minus half the multiturn range to plus half, not from 0.
    position_around_zero: bool = False
    # Unit of 60FF, 606C, 60B1 and 607F; of accelerations that per second.
    velocity_unit: DriveVelocityUnit = "inc/s"
    # Unit of 6083 to 6085 per second, None: that of 60FF; and how many of it make one.
    ramp_unit: DriveVelocityUnit | None = None
    ramp_size: float = 1.0
    # What 1000 in 6072, 6077 and 60B2 means, as part of the rated torque.
    torque_reference: float = 1.0

    # False: 6502 has no CSV bit, yet mode 9 is accepted and shown, and nothing moves.
    csv: bool = True
    # Enters OPERATIONAL by itself after boot-up.
    auto_operational: bool = False
    # SDO block transfer is served; most real drives refuse it (0504 0001).
    block_transfer: bool = True
    # SDO is served in PRE-OPERATIONAL only, although CiA 301 serves it in OPERATIONAL too.
    sdo_preoperational_only: bool = False
    # 6041 is 0 until the first controlword.
    statusword_zero: bool = False
    # Bits of 6041 that toggle every 7 ms, as a sign of life.
    status_toggles: int = 0
    # 0F straight from Ready to switch on is ignored.
    needs_switch_on: bool = False
    # Fault reset acts as long as bit 7 is 1.
    reset_by_level: bool = False
    # While bit 7 is 1 nothing else of the controlword counts.
    frozen_while_reset: bool = False
    # 6041 and 6061 follow a write that much later: 10 ms on a real drive model.
    lag_ms: int = 0
    # Quick stop active lasts one tick, then Switch on disabled, torque off.
    quick_stop_one_tick: bool = False
    # A quick stop is not obeyed at all: the controller's own ramp has to stop such an axis.
    quick_stop_ignored: bool = False
    # Enabled again after a quick stop: says that it follows and stands still until 6060 changes.
    dead_after_quick_stop: bool = False
    # Does not move before 60C2 was written (and equals 1006 where that is set).
    needs_cycle_time: bool = False
    # Bit 8 of the controlword stops in CSV too.
    halt_in_csv: bool = False
    # Says Operation enabled (bit 12 = 0) while the brake still opens.
    enabled_before_brake: bool = False
    # Faults come without EMCY and leave 603F at 0.
    silent_faults: bool = False
    # EMCY messages of 3 bytes.
    short_emcy: bool = False
    # Heartbeats without data.
    empty_heartbeat: bool = False
    # --- drives that lie: each breaks what a step of the commissioning proves, and nothing else
    # Lost commands or a lost heartbeat: EMCY, and the axis goes on.
    silence_emcy_only: bool = False
    # The same, but it obeys its watch at standstill: the axis goes on only while it turns.
    silence_obeyed_at_rest_only: bool = False
    # Lost commands or a lost heartbeat: 6041 shows Fault, and the axis goes on.
    fault_shown_only: bool = False
    # After lost commands or a lost heartbeat the brake stays open until the next command.
    brake_open_in_silence: bool = False
    # 1016 is taken and nothing watches for heartbeats; the same of 1400:05 and commands.
    heartbeat_without_effect: bool = False
    deadline_without_effect: bool = False
    # 605A is taken, and a quick stop takes the torque off at once.
    quick_stop_option_ignored: bool = False
    # Part of 6085 that the quick-stop ramp really has.
    quick_stop_ramp_share: float = 1.0
    # 6072 is taken and limits nothing.
    torque_limit_ignored: bool = False
    # Bit 12 of 6041 (the drive follows the command) is 1 in every state.
    follows_bit_stuck: bool = False
    # Beyond creep speed the motor turns the other way.
    sign_wrong_at_speed: bool = False
    # While there is torque 6064 keeps its value and 606C is 0.
    position_frozen: bool = False
    # How long 1010 takes until it answers: more than 1 s on real drives.
    save_ms: int = 0
    # The node leaves the bus that long while it saves: 0.4 s on some devices.
    save_silence_ms: int = 0


_p: Final = Personality

PERSONALITIES: Final = {
    p.name: p
    for p in (
        Personality(),
        _p("no-csv", "accepts mode 9, shows it, never moves; 6502 has no CSV bit", csv=False),
        _p("self-starting", "enters OPERATIONAL by itself after boot-up", auto_operational=True),
        _p("sdo-preop-only", "answers SDO in PRE-OPERATIONAL only", sdo_preoperational_only=True),
        _p("no-block-transfer", "refuses SDO block transfer", block_transfer=False),
        _p("zero-status", "6041 is 0 until the first controlword", statusword_zero=True),
        _p("toggling-status", "bits 8 and 14 of 6041 toggle every 7 ms", status_toggles=0x4100),
        _p("step-by-step", "0F straight from Ready to switch on is ignored", needs_switch_on=True),
        _p("level-reset", "fault reset acts by level", reset_by_level=True),
        _p("frozen-reset", "frozen while the reset bit stays set", frozen_while_reset=True),
        _p("lagging", "6041 and 6061 lag a write by 10 ms", lag_ms=10),
        _p("brief-quick-stop", "Quick stop active lasts one tick", quick_stop_one_tick=True),
        _p("no-quick-stop", "ignores the quick stop", quick_stop_ignored=True),
        _p("dead-after-quick-stop", "dead after a quick stop until 6060 changes", dead_after_quick_stop=True),
        _p("cycle-time", "does not move before 60C2 is written", needs_cycle_time=True),
        _p("halting", "the halt bit stops in CSV too", halt_in_csv=True),
        _p("early-enabled", "Operation enabled while the brake opens, bit 12 = 0", enabled_before_brake=True),
        _p("silent-faults", "faults without EMCY and without 603F", silent_faults=True, absent=(0x603F,)),
        _p(
            "sparse",
            "no 603F, 6502, 60B1, 60B2, 60C2, 60FD, 1029; 6077 cannot be mapped",
            absent=(0x603F, 0x6502, 0x60B1, 0x60B2, 0x60C2, 0x60FD, 0x1029),
            not_mappable=(0x6077,),
        ),
        _p("array-mapping", "EDS with mapping objects as ARRAY, no default of 6502", array_mapping=True,
           no_mode_default=True),
        _p("odd-identity", "1000h byte-swapped, with a product code", device_type=0x9201_3412),
        _p("unwatched", "no 1016, no 1400:05: the last speed goes on when the controller is gone", no_deadline=True,
           absent=(0x1016,)),
        _p("no-1005", "1005, 1006 and 1007 absent", sync_cob_id=None, absent=(0x1005, 0x1006, 0x1007)),
        _p("odd-1005", "1005 is 80000080h", sync_cob_id=0x8000_0080),
        _p("dangerous-defaults", "6007 = 0, 605E = 0, 6085 = 360 000 deg/s2", quick_dec_deg_s2=360_000.0,
           defaults=((0x6007, 0, 0), (0x605E, 0, 0))),
        _p("rpm", "velocities in 0.1 r/min, 65536 increments per turn", velocity_unit="0.1 r/min",
           counts_per_turn=1 << 16),
        _p("centre-wrap", "2^20 increments per turn: 6064 wraps in the middle of the multiturn range",
           counts_per_turn=1 << 20),
        _p("around-zero", "6064 runs from minus half the multiturn range to plus half", position_around_zero=True),
        _p("fine-counts", "2^22 increments per turn: 6064 wraps within the multiturn range",
           counts_per_turn=1 << 22),
        _p("standstill-torque", "torques in 0.1 % of 1.2 x rated torque", torque_reference=1.2),
        _p("short-frames", "EMCY of 3 bytes, empty heartbeats", short_emcy=True, empty_heartbeat=True),
        _p("emcy-only", "lie: sends an EMCY when commands or heartbeats are lost, and goes on", silence_emcy_only=True),
        _p("stops-at-rest-only", "lie: obeys its watch at standstill, and goes on while it turns",
           silence_obeyed_at_rest_only=True),
        _p("fault-shown-only", "lie: shows Fault when commands or heartbeats are lost, and goes on",
           fault_shown_only=True),
        _p("brake-open-in-silence", "lie: its brake stays open after lost commands or heartbeats until it is commanded",
           brake_open_in_silence=True),
        _p("heartbeat-ignored", "lie: 1016 is taken without effect", heartbeat_without_effect=True),
        _p("deadline-ignored", "lie: 1400:05 is taken without effect", deadline_without_effect=True),
        _p("quick-stop-option-ignored", "lie: 605A is taken, a quick stop takes the torque off at once",
           quick_stop_option_ignored=True),
        _p("slow-quick-stop", "lie: the quick-stop ramp is a third of 6085", quick_stop_ramp_share=1.0 / 3.0),
        _p("hard-quick-stop", "lie: the quick-stop ramp is 1.6 times 6085", quick_stop_ramp_share=1.6),
        _p("torque-limit-ignored", "lie: 6072 is taken without effect", torque_limit_ignored=True),
        _p("follows-bit-stuck", "lie: bit 12 of 6041 is 1 in every state", follows_bit_stuck=True),
        _p("wrong-sign-at-speed", "lie: turns the other way beyond 60 r/min", sign_wrong_at_speed=True),
        _p("position-frozen", "lie: 6064 stands still and 606C is 0 while there is torque", position_frozen=True),
        _p("slow-save", "1010 takes 1.2 s and leaves the bus for 0.4 s", save_ms=1200, save_silence_ms=400),
    )
}  # fmt: skip


def personality(names: Sequence[str]) -> Personality:
    """Combine personalities; the later one wins where two set the same switch.

    Raises:
        UsageError: an unknown name.
    """
    plain = Personality()
    result = plain
    for name in names:
        found = PERSONALITIES.get(name)
        if found is None:
            raise UsageError(f"there is no personality '{name}'; there are: {', '.join(PERSONALITIES)}")
        changed = {
            f.name: getattr(found, f.name)
            for f in fields(found)
            if getattr(found, f.name) != getattr(plain, f.name)
        }
        for key in ("absent", "not_mappable", "defaults"):
            if key in changed:
                changed[key] = getattr(result, key) + changed[key]
        result = replace(result, **changed)
    if len(names) > 1:
        result = replace(
            result, name="+".join(names), summary="; ".join(PERSONALITIES[n].summary for n in names)
        )
    return result
