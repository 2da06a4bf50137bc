"""Steps in which nothing moves and nothing is enabled: identity, reference, parameters, telegrams, SYNC."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from operator import or_
from typing import Final, NamedTuple

from gantryctl.commissioning.open_loop_axis import OpenLoopAxis, open_loop_axis, state_name
from gantryctl.commissioning.results import (
    Context,
    Figure,
    Outcome,
    StepResult,
    StepTable,
    failed,
    judged,
    passed,
)
from gantryctl.drives.canopen.process_image import unwrap_of
from gantryctl.drives.canopen.setup.parameters import backup
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.errors import CommandRefused
from gantryctl.image import DriveRequest, DriveState, OutputImage
from gantryctl.operation.home_reference import why_not_referenced
from gantryctl.operation.ledger.kept_facts import facts_path, load_facts
from gantryctl.operation.opening import read_only
from gantryctl.operation.proofs import load_record, record_path
from gantryctl.wiring.canopen import canopen_settings

_WATCH_S: Final = 2.0
# Statuswords by telegram and by SDO; a bit that toggles with each of them by chance looks still once in 2^15.
_SAMPLES: Final = 8
# Scans before the first of them; one more before each that follows, so that no bit toggles in step with them.
_SCANS: Final = 3
# Bits of the CiA 402 state.
_STATE: Final = 0x6F
# One SYNC in a hundred: rarer gaps are bridged by the master for 30 ms (decision 0012).
_MISSED_MAX: Final = 0.01
# The program runs in what is left of the period after the answers.
_ANSWER_PART: Final = 0.75
_DEAD_SCANS: Final = 5.0
# Nothing is enabled in these steps: whatever moves the gantry further is a fault.
_LEASH_DEG: Final = 0.02
_SETTLE_S: Final = 0.1
# For a person to walk to a button, a door or a switch.
_BY_HAND_S: Final = 60.0
_SHOW_S: Final = 3.0
# No hand reaches these: the brake is proven by the steps that move it, the relay by its own.
_BY_OTHER_STEPS: Final = ("brake_open", "watchdog_closed")
_LOOKED_AT: Final = {
    "horn": OutputImage(horn=True),
    "lamp": OutputImage(lamp=True),
    "in_position": OutputImage(in_position=True),
    "at_rest": OutputImage(at_rest=True),
}


def identity(c: Context) -> StepResult:
    """Read the identity of the drive and compare it with the last commissioning."""
    with read_only(c.machine, c.store) as machine:
        name, health = machine.drive.identity().name, machine.drive.health()
    # A CAN machine is commissioned.
    assert health is not None
    before = load_record(record_path(c.store.directory, c.machine))
    proof = f"{name}; {health.drive_key}; {_profile(c)}"
    if before is not None and before.drive != health.drive_key:
        proof += f"; it was {before.drive} before"
    return passed("identity", proof)


def _profile(c: Context) -> str:
    """The profile that the drive is run with."""
    facts = load_facts(facts_path(c.store.directory, c.machine))
    profile = None if facts is None else canopen_settings(c.machine).of_drive(facts).profile
    return "no profile" if profile is None else f"profile {profile.name}, {profile.tried.value}"


def encoder(c: Context) -> StepResult:
    """Check zero offset, wrap margins and rest position."""
    with read_only(c.machine, c.store) as machine:
        retained, reading = machine.retained, machine.reading
    reason = why_not_referenced(reading)
    if reason is not None or reading.angle_deg is None:
        return failed(
            "encoder",
            "the angle is not valid",
            reason.text if reason is not None else "gantryctl encoder set-zero",
        )
    at = c.machine.axis.dial.text(reading.angle_deg, ".4f")
    proof = f"stands at {at} deg, zero set by {retained.zero_set_by} ({retained.zero_witness})"
    # None for a modulo axis, whose encoder may wrap anywhere.
    margins = {"margin_minus_deg": reading.margin_minus_deg, "margin_plus_deg": reading.margin_plus_deg}
    figures = {name: margin for name, margin in margins.items() if margin is not None}
    return passed("encoder", proof, **figures)


def defaults(c: Context) -> StepResult:
    """Compare the drive's parameters with what they must be, before anything is written."""
    rows = c.as_found
    wrong = [row.line for row in rows if row.verdict.refuses]
    for line in wrong:
        c.say(f"  {line}")
    proof = f"{len(rows)} parameters read, {len(wrong)} are not as they must be: the controller writes them"
    return passed("defaults", proof if wrong else f"{len(rows)} parameters read, all as they must be")


def parameters(c: Context) -> StepResult:
    """Write the parameters, read them back, keep a backup."""
    try:
        with open_loop_axis(c, _LEASH_DEG) as axis:
            kept = backup(axis.drive.node, None)
            rows = axis.drive.opened.rows
    except CommandRefused as refused:
        return failed("parameters", str(refused), "set them with the drive maker's tool, then go on")
    file = c.folder / f"{c.machine.name}.drive.json"
    file.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    # A sparse drive may lack optional objects; the proof names them.
    lacking = [row.place for row in rows if row.verdict is ParameterVerdict.ABSENT]
    without = f"; this drive has no {', '.join(lacking)}" if lacking else ""
    done = passed(
        "parameters", f"{len(rows)} parameters read back as written, backup in {file.name}{without}"
    )
    heads = ("object", "parameter", "wanted", "read back", "verdict")
    table = StepTable(heads, tuple((r.place, r.name, r.want, r.have, r.verdict.value) for r in rows))
    return replace(done, table=table)


class StatuswordSample(NamedTuple):
    """The statusword by telegram, then by SDO, then by telegram again."""

    before: int
    by_sdo: int
    after: int


class StatuswordVerdict(NamedTuple):
    """What samples of the statusword show.

    Attributes:
        wrong: bits that stand still in the telegrams and are otherwise by SDO. moving: bits that change in the
            telegrams while nothing is asked of the drive.
    """

    wrong: int
    moving: int
    samples: int

    @property
    def agree(self) -> bool:
        """Both ways show the same word, and the drive stays in its state."""
        return not (self.wrong or self.moving & _STATE)

    @property
    def text(self) -> str:
        """For the proof."""
        said = [f"differs in bits {_bits(self.wrong)}" if self.wrong else f"agrees {self.samples} times"]
        if self.moving & _STATE:
            said.append(f"the state itself changes (bits {_bits(self.moving & _STATE)})")
        if self.moving & ~_STATE:
            said.append(f"bits {_bits(self.moving & ~_STATE)} change by themselves and are not compared")
        return ", ".join(said)


def _bits(word: int) -> str:
    return ", ".join(str(bit) for bit in range(16) if word >> bit & 1)


def judge_statuswords(samples: Sequence[StatuswordSample]) -> StatuswordVerdict:
    """Compare the statusword of telegrams with that of SDO; bits that toggle by design agree by chance only."""
    words = [word for sample in samples for word in (sample.before, sample.after)]
    moving = reduce(or_, (word ^ words[0] for word in words))
    wrong = reduce(or_, (sample.by_sdo ^ sample.before for sample in samples)) & ~moving
    return StatuswordVerdict(wrong, moving, len(samples))


def _statusword_sample(axis: OpenLoopAxis, scans: int) -> StatuswordSample:
    process = axis.drive.process
    before = process.statusword
    by_sdo = axis.drive.node.sdo.number(0x6041)
    axis.run(scans * axis.period_s, DriveRequest.DISABLE)
    return StatuswordSample(before, by_sdo, process.statusword)


def process_data(c: Context) -> StepResult:
    """Compare telegrams with SDO reads, and count missed and late ones."""
    with open_loop_axis(c, _LEASH_DEG) as axis:
        axis.run(_WATCH_S, DriveRequest.DISABLE)
        counters, drive = axis.drive.health(), axis.drive
        words = judge_statuswords([_statusword_sample(axis, _SCANS + n) for n in range(_SAMPLES)])
        # By SDO, not by PDO: a wrong mapping would agree with itself.
        raw, absolute = drive.node.sdo.number(0x6064), unwrap_of(drive.settings)
        by_sdo = absolute(-raw if drive.settings.inverted else raw)
        by_pdo, span = drive.process.counts, absolute.range_counts
    # Counts wrap: the shorter way round is the distance.
    apart = abs((by_pdo - by_sdo + span // 2) % span - span // 2)
    missed = max(counters.missed) / counters.scans
    late = max(counters.late) / counters.scans
    proof = (
        f"{counters.scans} SYNCs, {100 * missed:.2f} % missed, {100 * late:.2f} % late; statusword by SDO "
        f"{words.text}; position {apart} increments apart"
    )
    to_do = "check cable, terminators, bit rate, and that nothing else maps the drive"
    return judged(
        words.agree, "pdo", proof, to_do,
        missed_ratio=Figure(missed, high=_MISSED_MAX), late_ratio=late,
        apart_increments=Figure(float(apart), high=drive.settings.increments_per_turn / 1000),
    )  # fmt: skip


def sync(c: Context) -> StepResult:
    """Measure the time from SYNC to its answers, and the scans from controlword to statusword."""
    with open_loop_axis(c, _LEASH_DEG) as axis:
        times_s = axis.drive.process.answer_times_s
        times_s.clear()
        scans = len(axis.run(_WATCH_S, DriveRequest.DISABLE))
        # What a scan has waited for in vain is later than any answer that it has.
        answers_s = sorted((*times_s, *[math.inf] * (scans - len(times_s))))
        if (begun := axis.feedback.state) is not DriveState.SWITCH_ON_DISABLED:
            proof = f"the drive is in {state_name(begun)}: no command shows a dead time"
            return failed("sync", proof, "find the cause, reset the drive, then go on")
        dead = 0
        while axis.feedback.state is DriveState.SWITCH_ON_DISABLED and dead < 100:
            axis.scan(DriveRequest.ENABLE)
            dead += 1
        axis.run(0.02, DriveRequest.DISABLE)
    p50, p99 = answers_s[scans // 2] * 1e3, answers_s[int(scans * 0.99)] * 1e3
    period_ms = axis.period_s * 1e3
    # A drive that SYNC steps has no time of its own: its answers are as late as this computer is busy.
    high = _ANSWER_PART * period_ms if c.machine.paced_by_clock else None
    shown = [
        f"{ms:.2f} ms" if math.isfinite(ms) else f"over {c.machine.can.answer_ms:g} ms" for ms in (p50, p99)
    ]
    proof = (
        f"answers {shown[0]} after SYNC (p50), {shown[1]} (p99); a command shows {dead} scans later "
        f"({dead * period_ms:g} ms)"
    )
    to_do = "raise the SYNC period, or use a faster adapter"
    return judged(
        True, "sync", proof, to_do,
        answer_p50_ms=p50, answer_p99_ms=Figure(p99, high=high),
        dead_scans=Figure(float(dead), high=_DEAD_SCANS),
    )  # fmt: skip


def nodes(c: Context) -> StepResult:
    """Compare the telegrams of the nodes beside the drive with SDO reads, and count missed ones."""
    if not c.machine.can.io.node and c.machine.can.load_encoder.source != "node":
        return StepResult("nodes", Outcome.NOT_TESTABLE, "no node beside the drive")
    figures: dict[str, Figure] = {}
    lines, apart = [], []
    with open_loop_axis(c, _LEASH_DEG) as axis:
        axis.run(_WATCH_S, DriveRequest.DISABLE)
        for node in axis.drive.beside.nodes:
            watch, identity, number = node.watch, node.identity, node.remote.node
            # Opened above, or this step would have ended there.
            assert identity is not None
            apart += [f"node {number}: {line}" for line in node.compare()]
            missed = watch.missed / max(1, watch.received + watch.missed)
            figures[f"node_{number}_missed_ratio"] = Figure(missed, high=_MISSED_MAX)
            lines.append(f"node {number}: {identity.text}, {100.0 * missed:.2f} % missed")
    proof = "; ".join((*lines, *apart))
    to_do = "look for another node with the same id; reset the node to its maker's parameters, then go on"
    return judged(not apart, "nodes", proof, to_do, **figures)


def wiring(c: Context) -> StepResult:
    """Let a person work every input, one after the other, and look at every output."""
    can, proven, shown = c.machine.can, [], []
    with open_loop_axis(c, _LEASH_DEG) as axis:
        inputs = axis.drive.beside.inputs
        axis.run(_SETTLE_S, DriveRequest.DISABLE)
        for name in (each for each in inputs.levels() if each not in _BY_OTHER_STEPS):
            begun = inputs.levels()
            c.say(
                f"  {name} ({can.input_place(name)}): change it within {_BY_HAND_S:g} s, then change it back"
            )
            for wanted in (not begun[name], begun[name]):
                changed = _wait_for_level(axis, name, wanted)
                if changed is not None:
                    proof = f"{name} ({can.input_place(name)}) has not changed; {changed or 'no input'} has"
                    return failed("wiring", proof, "look at its wire and at the bit in the machine file")
            proven.append(name)
        for output, image in _LOOKED_AT.items():
            if not can.output_place(output):
                continue
            c.say(f"  {output} ({can.output_place(output)}): on for {_SHOW_S:g} s, look")
            axis.show(image, _SHOW_S)
            shown.append(output)
    proof = f"changed by hand, one after the other: {', '.join(proven) or 'none'}"
    if shown:
        proof += f"; switched on for whoever looked: {', '.join(shown)}"
    return passed("wiring", proof)


def _wait_for_level(axis: OpenLoopAxis, name: str, wanted: bool) -> str | None:
    """Wait for the level of an input; in vain, say which others have changed meanwhile."""
    inputs = axis.drive.beside.inputs
    before, others = inputs.levels(), set[str]()
    for _ in range(round(_BY_HAND_S / axis.period_s)):
        axis.scan(DriveRequest.DISABLE)
        levels = inputs.levels()
        if levels.get(name) is wanted:
            return None
        others |= {each for each, level in levels.items() if level is not before.get(each)}
    return ", ".join(sorted(others))
