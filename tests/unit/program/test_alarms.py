"""The alarm table, the latch, the texts, and the page made from them."""

import ast
import math
import re
import string
from pathlib import Path

import pytest

from gantryctl.errors import CommandRefused
from gantryctl.program import ALARMS, AlarmLog, Code, Reaction, Severity
from gantryctl.program.alarms.alarms_page import chinese_page, reference_page
from gantryctl.program.alarms.log import from_wire, messages_to_wire, refusal, to_wire
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.program.alarms.table import all_codes, explain
from gantryctl.program.alarms.words import Words, drive_error_words

ROOT = Path(__file__).parents[3]


def fields(template):
    return {name for _, name, _, _ in string.Formatter().parse(template) if name}


def test_every_code_has_its_row():
    assert list(ALARMS) == [row.code for row in ALARMS.values()]
    assert set(ALARMS) == set(Code)


@pytest.mark.parametrize("row", ALARMS.values(), ids=lambda row: row.code)
def test_rows_are_complete_and_plain(row):
    assert re.fullmatch(r"(CFG-)?[A-Z]{3}-\d\d", row.code)
    english = row.english
    for text in (english.title, english.cause, english.to_do):
        assert text
        assert text[0].isupper()
    assert english.cause.endswith(".")
    assert english.to_do.endswith(".")
    assert not re.search(r"0x[0-9A-Fa-f]", english.message), "no bare hexadecimal"
    assert english.message.format(**dict.fromkeys(fields(english.message), 1.0))


@pytest.mark.parametrize("row", ALARMS.values(), ids=lambda row: row.code)
def test_both_languages_of_a_row_have_the_same_fields(row):
    assert fields(row.chinese.message) == fields(row.english.message)
    assert all(re.search(r"[\u4e00-\u9fff]", text) for text in row.chinese if not text.startswith("{"))


@pytest.mark.parametrize("words", Words, ids=lambda words: words.name)
def test_both_languages_of_words_have_the_same_fields(words):
    assert fields(words.chinese) == fields(words.english)
    assert re.search(r"[\u4e00-\u9fff°%]|°/s", re.sub(r"\{\w+\}", "", words.chinese))
    assert not re.search(r"\{\w+:", words.chinese), "number formats stand in the English text"


@pytest.mark.parametrize("row", ALARMS.values(), ids=lambda row: row.code)
def test_severity_and_reaction_fit(row):
    stops = row.reaction >= Reaction.QUICK_STOP
    # What sounds the horn is urgent, also where the stop has begun before it (BRK-13).
    assert (row.severity is Severity.STOP) == (stops or row.horn)
    if row.lock:
        # Nobody but service lets an unknown master or an unknown sender go on, though the drive stops on its ramp.
        strangers = (Code.CAN_12, Code.CAN_14)
        alone = row.reaction in (Reaction.TORQUE_OFF, Reaction.HOLD) or row.code in strangers
        assert alone or row.blocks_motion or row.horn
    if row.blocks_motion:
        assert row.severity is Severity.WARNING


# Fault catalogue: an angle or a brake that nobody knows of is for service, and so is whoever else is on the bus.
FOR_SERVICE = {
    "BRK-03", "BRK-04", "BRK-08", "BRK-11", "BRK-13", "CAN-12", "CAN-14", "ENC-01", "ENC-02", "ENC-04", "ENC-05",
    "ENC-07", "ENC-12", "ENC-13", "ENC-14", "INT-04",
}  # fmt: skip
# The load moves by itself.
SOUNDS = {"BRK-04", "BRK-11", "BRK-13"}
# What stops nothing by itself and yet lets nothing begin, with what has to be done first.
KEEPS_BACK = {
    "BRK-06": Words.RESET_FIRST, "BRK-08": Words.TEST_OR_SERVICE, "DRV-09": Words.RESET_FIRST,
    "DRV-14": Words.RESET_FIRST, "ENC-13": Words.SERVICE_FIRST, "INT-07": Words.RESET_FIRST,
    "INT-08": Words.RESET_FIRST, "THM-03": Words.COOL_FIRST,
}  # fmt: skip


def test_what_is_for_service_what_sounds_and_what_keeps_back():
    rows = ALARMS.values()
    assert {row.code for row in rows if row.lock} == FOR_SERVICE
    assert {row.code for row in rows if row.horn} == SOUNDS
    assert {row.code: row.before_motion for row in rows if row.blocks_motion} == KEEPS_BACK


@pytest.mark.parametrize(
    "code", ["ENC-01", "ENC-02", "ENC-04", "ENC-05", "CTL-05", "DRV-01", "DRV-04", "DRV-07"]
)
def test_feedback_or_obedience_in_doubt_is_never_a_quick_stop(code):
    assert ALARMS[Code(code)].reaction is Reaction.TORQUE_OFF


def test_explain_gives_the_page():
    page = explain("ctl-03")
    for part in ("CTL-03 Following error (STOP)", "Message", "Cause", "Reaction", "QUICK STOP", "What to do"):
        assert part in page


@pytest.mark.parametrize("code", Code)
def test_every_entry_names_message_cause_reaction_and_action(code):
    head, _, *rows = explain(code).splitlines()
    assert head.startswith(code + " ")
    assert [row.split()[0] for row in rows] == ["Message", "Cause", "Reaction", "What"]
    assert all(len(row) > 12 for row in rows)
    assert not any("{" in row for row in rows)


def test_codes_are_sorted_and_told_apart():
    codes = [code for code, _, _ in all_codes()]
    assert codes == sorted(ALARMS)
    assert ("CTL-03", "STOP", "Following error") in all_codes()


def test_a_code_is_found_in_small_letters_and_with_spaces():
    assert explain(" enc-09 ") == explain("ENC-09")


@pytest.mark.parametrize(
    ("asked", "near"),
    [("CTL-33", "CTL-03"), ("ENC", "ENC-01.*ENC-09"), ("BRK03", "BRK-03"), ("SYS-99", "SYS-09")],
)
def test_explain_an_unknown_code_names_near_ones(asked, near):
    with pytest.raises(CommandRefused, match=near) as refused:
        explain(asked)
    assert f"unknown code {asked!r}" in str(refused.value)


@pytest.mark.parametrize("asked", ["???", "", "xx", "\x1b[31m"])
def test_explain_nonsense_still_helps(asked):
    with pytest.raises(CommandRefused, match="unknown code"):
        explain(asked)


@pytest.mark.parametrize(
    ("page", "made"), [("reference/alarms.md", reference_page), ("zh/alarms.md", chinese_page)]
)
def test_the_pages_are_made_from_the_table(page, made):
    committed = (ROOT / "docs" / page).read_text(encoding="utf-8")
    assert committed == made(), (
        "run: python -m gantryctl.program.alarms.alarms_page docs/reference/alarms.md docs/zh/alarms.md"
    )


def test_the_chinese_page_has_every_code_and_no_english_but_names():
    page = chinese_page()
    for row in ALARMS.values():
        assert f"\n## {row.code} {row.chinese.title}\n" in page
    assert "{" not in page


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


def test_a_warning_that_becomes_a_stop_is_told_anew_with_its_own_time_and_values():
    log = AlarmLog()
    log.time_s, log.scan = 1.0, 100
    log.raise_(Code.CTL_06, measured=65.0, torque=167.0)
    log.time_s, log.scan = 9.0, 900
    log.raise_(Code.CTL_06, Reaction.QUICK_STOP, measured=95.0, torque=244.0)
    alarm = log.active[Code.CTL_06]
    assert (alarm.time_s, alarm.scan, alarm.values["measured"]) == (9.0, 900, 95.0)
    assert log.first_out is alarm
    assert [each.time_s for each in log.history] == [1.0, 9.0]
    assert (log.history[0].severity, alarm.severity) == (Severity.WARNING, Severity.STOP)


def test_the_horn_sounds_from_the_alarm_that_asks_for_it_until_all_are_cleared():
    log = AlarmLog()
    log.raise_(Code.CTL_04, measured=6.7, limit=6.6)
    assert not log.horn
    log.raise_(Code.BRK_11, measured=1.0, time_s=3.0)
    log.raise_(Code.INT_03, measured=180.7)
    assert log.horn, "another alarm does not silence it"
    log.clear()
    assert not log.horn


def test_a_reset_leaves_no_reaction_that_waits():
    log = AlarmLog()
    log.raise_(Code.BRK_11, measured=1.0, time_s=3.0)
    assert log.pending >= Reaction.QUICK_STOP
    log.clear()
    assert log.pending is Reaction.W
    assert log.first_out is None
    assert not log.horn


def test_a_reaction_is_never_weaker_than_the_table():
    log = AlarmLog()
    log.raise_(Code.INT_03, Reaction.W, measured=0.0)
    assert log.pending is Reaction.TORQUE_OFF


def test_history_is_bounded():
    log = AlarmLog()
    for _ in range(2000):
        log.note(Code.LIM_01, measured=180.0, end=Words.END_OF_TRAVEL)
    assert len(log.history) == 200
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
    log.first_out.steps = (
        Words.QUICK_STOP,
        Words.AT_REST_AFTER(time_ms=1090.0),
        Words.MOVED_TO(way=3.3, position=12.44),
    )
    assert log.first_out.text == (
        "CTL-03 STOP · Following error 0.111 deg, limit 0.102 deg at 6.00 deg/s · Quick stop, at rest after 1090 ms, "
        "axis moved 3.30 deg to 12.44 deg · Look at torque and following error in the trace, remove the cause, "
        "then reset."
    )


def test_a_refusal_is_one_sentence():
    assert refusal(Code.PWR_03).text == "power is off"


@pytest.mark.parametrize(
    ("value", "told"), [(-1e300, "-1e+300"), (1.234567e12, "1.235e+12"), (math.nan, "nan")]
)
def test_a_number_of_absurd_size_has_four_digits(value, told):
    """In messages, words and reasons; 999,999,999,999 is written in full still."""
    assert str(Words.GROWS_AGAINST(speed=value, torque=value)) == (
        f"Speed grew to {told} deg/s against a torque of {told} N m"
    )
    assert refusal(Code.CTL_04, measured=value, limit=6.6).text == f"Speed {told} deg/s, limit 6.60 deg/s"
    assert told in Reason(Code.CTL_04, {"measured": value, "limit": 6.6}, ClearedBy.RESET).text
    assert refusal(Code.CTL_04, measured=999_999_999_999.0, limit=6.6).text.startswith(
        "Speed 999999999999.00 deg/s"
    )


@pytest.mark.parametrize(
    ("torque_nm", "told"), [(-0.0512, "-0.0512"), (9.66, "+9.66"), (257.4, "+257"), (15264.0, "+15300")]
)
def test_a_torque_has_three_digits_on_a_table_of_0_64_n_m_and_on_a_dish(torque_nm, told):
    assert str(Words.TEST_SLIPPED(given=torque_nm)) == f"the brake slipped under {told} N m"


@pytest.mark.parametrize(
    ("code", "values", "told"),
    [
        (Code.BRK_02, {"measured": 0.1984, "share": 31.0}, "needs 0.198 N m more"),
        (Code.BRK_07, {"measured": 0.02, "limit": 0.0512, "time_ms": 501.0}, "at least 0.0512 N m required"),
        (Code.BRK_14, {"measured": 0.4, "speed": 0.0, "command": 6.0}, "Torque 0.4 N m without effect"),
        (Code.CTL_06, {"measured": 61.0, "torque": 0.39}, "0.39 N m at standstill"),
    ],
)
def test_an_alarm_of_a_small_motor_tells_its_torque(code, values, told):
    """[motor] torque_rated_nm = 0.64, proof torque 0.064 N m (configs/rotary_table.toml): tenths say nothing."""
    assert told in refusal(code, **values).text


def test_a_refusal_compares_by_its_values_and_is_read_in_english():
    reason = Words.LATCHED(code=Code.CTL_04, measured=refusal(Code.CTL_04, measured=6.7, limit=6.6))
    assert refusal(Code.PWR_04, reason=reason).text == (
        "cannot switch on: CTL-04 is latched (Speed 6.70 deg/s, limit 6.60 deg/s): reset first"
    )


def test_values_travel_as_json():
    inner = refusal(Code.CTL_04, measured=float("nan"), limit=6.6)
    assert to_wire({"a": inner, "b": Words.OPEN, "c": Words.SPEED(value=2), "d": "CAN-1", "e": True}) == {
        "a": {"code": "CTL-04", "values": {"measured": "nan", "limit": 6.6}},
        "b": {"words": "OPEN", "values": {}},
        "c": {"words": "SPEED", "values": {"value": 2}},
        "d": "CAN-1",
        "e": True,
    }


def test_words_come_back_from_the_wire():
    said = Words.TEST_RESULT(what=Words.TEST_SLIPPED(given=31.5), way=0.2, limit=0.05)
    assert str(from_wire(messages_to_wire(said)[0])) == str(said)
    unknown = {"words": "OF_ANOTHER_VERSION", "values": {}}
    assert from_wire(unknown) == unknown


# --- who says what ------------------------------------------------------------------------------

SAID = re.compile(r"\b((?:CFG-)?(?:ENC|CTL|CAN|LIM|BRK|DRV|INT|PWR|THM|SYS|SEC|JRN)-\d\d)\b")
SOURCES = [
    *(file for file in (ROOT / "src" / "gantryctl").rglob("*.py") if file.parent.name != "alarms"),
    ROOT / "src" / "gantryctl" / "service" / "protocol" / "service_page.md",
    *(file for kind in ("ts", "svelte") for file in (ROOT / "hmi" / "src").rglob(f"*.{kind}")),
]
STRANGERS = {"runtime/engine.py", "runtime/overrun.py"}
"""The engine knows no program (contract): it types its own three codes."""


def test_every_code_in_the_sources_has_its_row():
    assert len(SOURCES) > 300
    found = {code for file in SOURCES for code in SAID.findall(file.read_text(encoding="utf-8"))}
    assert found
    assert found <= set(Code)


def typed(file):
    """String literals with a code in them that are neither docstrings nor pages of the reference."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    prose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in prose:
            yield from SAID.findall(node.value)


def test_no_code_is_typed_outside_the_table():
    prose = {"service/protocol/tags.py"}
    files = {
        str(file.relative_to(ROOT / "src" / "gantryctl")): file for file in SOURCES if file.suffix == ".py"
    }
    wrong = {name: found for name, file in files.items() if (found := list(typed(file)))}
    assert set(wrong) - prose - STRANGERS == set()


def raised(file):
    """Code and field names of every raise, refusal and note with a literal code."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Attribute):
            first = node.args[0]
            if isinstance(first.value, ast.Name) and first.value.id == "Code":
                yield Code[first.attr], node
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            owner = node.func.value
            if isinstance(owner, ast.Name) and owner.id == "Words":
                yield Words[node.func.attr], node


SAYS = {"raise_", "_raise", "note", "complete", "stop_by", "refusal", "MessageRefused", "error"}


def test_every_message_gets_exactly_its_values():
    """The text is made when it is read: a field that is missing would show only then."""
    files = [file for file in SOURCES if file.suffix == ".py"]
    calls = [(file, *call) for file in files for call in raised(file)]
    assert len(calls) > 100
    for file, what, call in calls:
        names = {key.arg for key in call.keywords}
        if isinstance(what, Words):
            english = what.english
        elif ast.unparse(call.func).split(".")[-1] in SAYS and None not in names:
            english = ALARMS[what].english.message
        else:
            continue
        assert names == fields(english), f"{file}:{call.lineno} {what}"


def test_a_new_log_stands_at_no_time_and_place():
    log = AlarmLog()
    assert (log.scan, log.time_s, log.pos_rad, log.horn, log.first_out) == (0, 0.0, 0.0, False, None)


def test_a_warning_that_ends_a_motion_is_told_anew_with_what_ended_it_and_keeps_the_next_one_back():
    """A brake that dragged with 16 % of the rated torque a minute ago drags with 31 % now."""
    log = AlarmLog()
    log.raise_(Code.BRK_02, measured=41.0, share=16.0)
    assert log.blocking() is None
    log.time_s = 60.0
    for share in (31.0, 33.0):
        log.raise_(Code.BRK_02, Reaction.HLT, measured=2.57 * share, share=share)
    warned, ended = log.history
    assert log.active[Code.BRK_02] is ended
    assert (warned.reaction, ended.reaction, ended.time_s) == (Reaction.W, Reaction.HLT, 60.0)
    assert "16 % of rated" in warned.text
    assert "needs 79.7 N m more than expected, 31 % of rated · Stopping on the jog-release ramp" in ended.text
    assert log.blocking() is ended
    assert log.blocking(but=Code.BRK_02) is None
    assert log.first_out is None


def test_what_follows_a_stop_is_folded_under_it():
    log = AlarmLog()
    log.raise_(Code.PWR_01, measured="at 0")
    log.raise_(Code.DRV_07, measured=1.0, limit=1.0)
    first, second = log.history
    assert log.first_out is first
    assert first.consequences == [second]
    assert (first.follows, second.follows) == (None, Code.PWR_01)


def test_the_angle_of_a_scan_is_given_to_the_alarms_of_that_scan():
    log = AlarmLog()
    log.raise_(Code.PWR_01, measured="at 0")
    log.scan = 1
    log.raise_(Code.DRV_07, measured=1.0, limit=1.0)
    log.raise_(Code.CTL_12, measured=1.0, limit=1.0, trip=2.0)
    log.locate(2.0)
    assert [alarm.pos_rad for alarm in log.history] == [0.0, 2.0, 2.0]


def test_torque_that_is_not_kept_is_said_in_every_alarm_that_promised_it():
    log = AlarmLog()
    log.raise_(Code.BRK_03, measured=1.0, limit=1.0)
    log.raise_(Code.CTL_12, measured=1.0, limit=1.0, trip=2.0)
    log.raise_(Code.BRK_04, measured=1.0, limit=1.0)
    log.torque_not_kept()
    kept = [Words.TORQUE_OFF_COMMANDED in alarm.steps for alarm in log.history]
    assert kept == [True, False, True]
    assert not any(Words.TORQUE_KEPT in alarm.steps for alarm in log.history)


# Names of CiA 301 and CiA 402 that nobody may take for another one.
@pytest.mark.parametrize(
    ("error", "english", "chinese"),
    [
        (0x2310, "overcurrent", "过流"),
        (0x2350, "overload", "过载"),
        (0x3210, "overvoltage", "过压"),
        (0x3220, "undervoltage", "欠压"),
        (0x4310, "too hot", "过热"),
        (0x7305, "encoder", "编码器"),
        (0x8130, "heartbeat", "心跳"),
        (0x8250, "commands", "指令"),
        (0x8611, "following error", "跟随误差"),
    ],
)
def test_an_error_of_the_drive_has_the_name_of_its_standard(error, english, chinese):
    words = drive_error_words(error, {})
    assert f"{error:04X}" in str(words)
    assert english in str(words)
    assert chinese in words.values["name"].chinese


def test_a_refusal_in_the_journal_begins_with_its_code():
    assert refusal(Code.PWR_03).line.startswith("PWR-03 ")
