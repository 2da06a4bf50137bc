"""The alarm table, the latch, the texts, and the page made from them."""

import re
import string
from pathlib import Path

import pytest

from gantryctl.errors import CommandRefused
from gantryctl.program import ALARMS, AlarmLog, Code, Reaction, Severity, all_codes, explain
from gantryctl.program.alarms.alarms_page import reference_page
from gantryctl.program.alarms.log import HISTORY_LENGTH, refusal

ROOT = Path(__file__).parents[3]


def filled(row):
    """The message with a number in every place."""
    names = [name for _, name, _, _ in string.Formatter().parse(row.message) if name]
    return row.message.format(**dict.fromkeys(names, 1.0))


def test_every_code_has_its_row():
    assert list(ALARMS) == [row.code for row in ALARMS.values()]
    assert set(ALARMS) == set(Code)


@pytest.mark.parametrize("row", ALARMS.values(), ids=str)
def test_rows_are_complete_and_plain(row):
    assert re.fullmatch(r"(CFG-)?[A-Z]{3}-\d\d", row.code)
    for text in (row.title, row.cause, row.to_do):
        assert text
        assert text[0].isupper()
    assert row.cause.endswith(".")
    assert row.to_do.endswith(".")
    assert not re.search(r"0x[0-9A-Fa-f]", row.message), "no bare hexadecimal"
    assert filled(row)


@pytest.mark.parametrize("row", ALARMS.values(), ids=str)
def test_severity_and_reaction_fit(row):
    stops = row.reaction >= Reaction.QUICK_STOP
    assert (row.severity is Severity.STOP) == stops
    if row.lock:
        assert row.reaction in (Reaction.TORQUE_OFF, Reaction.HOLD) or row.blocks_motion
    if row.blocks_motion:
        assert row.severity is Severity.WARNING


@pytest.mark.parametrize(
    "code", ["ENC-01", "ENC-02", "ENC-04", "ENC-05", "CTL-05", "DRV-01", "DRV-04", "DRV-07"]
)
def test_feedback_or_obedience_in_doubt_is_never_a_quick_stop(code):
    assert ALARMS[Code(code)].reaction is Reaction.TORQUE_OFF


def test_explain_gives_the_page():
    page = explain("ctl-03")
    for part in ("CTL-03 Following error (STOP)", "Message", "Cause", "Reaction", "QUICK STOP", "What to do"):
        assert part in page


@pytest.mark.parametrize(("asked", "near"), [("CTL-33", "CTL-03"), ("ENC", "ENC-01"), ("BRK03", "BRK-03")])
def test_explain_an_unknown_code_names_near_ones(asked, near):
    with pytest.raises(CommandRefused, match=near) as refused:
        explain(asked)
    assert f"unknown code {asked!r}" in str(refused.value)


def test_explain_nonsense_still_helps():
    with pytest.raises(CommandRefused, match="there are ENC-01"):
        explain("???")


def test_all_codes_lists_each_once():
    assert len(all_codes()) == len(ALARMS)
    assert "CTL-03 Following error" in all_codes()


def test_reference_page_is_made_from_the_table():
    committed = (ROOT / "docs" / "reference" / "alarms.md").read_text(encoding="utf-8")
    assert committed == reference_page(), (
        "run: python -m gantryctl.program.alarms.alarms_page docs/reference/alarms.md"
    )


# --- latch --------------------------------------------------------------------------------------


def test_first_out_is_the_first_stop_not_the_first_warning():
    log = AlarmLog()
    log.raise_(Code.DRV_02)
    log.raise_(Code.LIM_02, measured=180.6, limit=180.5)
    log.raise_(Code.INT_03, measured=180.7)
    assert log.first_out.code == "LIM-02"
    assert [alarm.code for alarm in log.first_out.consequences] == ["INT-03"]
    assert log.pending is Reaction.TORQUE_OFF, "the strongest reaction that waits"


def test_an_active_alarm_is_raised_once():
    log = AlarmLog()
    for _ in range(1000):
        log.raise_(Code.DRV_02)
    assert len(log.history) == 1


def test_the_same_alarm_with_a_stronger_reaction_counts():
    log = AlarmLog()
    log.raise_(Code.CTL_04, measured=6.7, limit=6.6)
    log.pending = Reaction.W
    log.raise_(Code.CTL_04, Reaction.TORQUE_OFF, measured=7.3, limit=6.6)
    assert log.pending is Reaction.TORQUE_OFF
    assert len(log.history) == 1


def test_a_reaction_is_never_weaker_than_the_table():
    log = AlarmLog()
    log.raise_(Code.INT_03, Reaction.W, measured=0.0)
    assert log.pending is Reaction.TORQUE_OFF


def test_history_is_bounded():
    log = AlarmLog()
    for _ in range(10 * HISTORY_LENGTH):
        log.note(Code.LIM_01, measured=180.0)
    assert len(log.history) == HISTORY_LENGTH
    assert not log.active


def test_clear_keeps_the_history():
    log = AlarmLog()
    log.raise_(Code.INT_03, measured=1.0)
    log.clear()
    assert log.first_out is None
    assert not log.active
    assert log.history[-1].code == "INT-03"


def test_text_has_its_four_parts():
    log = AlarmLog()
    log.raise_(Code.CTL_03, measured=0.111, limit=0.102, speed=6.0)
    log.first_out.done = "Quick stop, at rest after 1090 ms, gantry moved 3.30 deg to 12.44 deg"
    assert log.first_out.text == (
        "CTL-03 STOP · Following error 0.111 deg, limit 0.102 deg at 6.00 deg/s · Quick stop, at rest after 1090 ms, "
        "gantry moved 3.30 deg to 12.44 deg · Look at torque and following error in the trace, remove the cause, "
        "then reset."
    )


def test_a_refusal_is_one_sentence():
    assert refusal(Code.PWR_03).text == "power is off"
