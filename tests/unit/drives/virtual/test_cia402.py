"""The CiA 402 state machine as pure functions, all words."""

import pytest

from gantryctl.drives.virtual.axis.cia402 import (
    Command,
    Ramp,
    State,
    command_of,
    is_fault_reset,
    leave_ramp,
    next_state,
    quick_stop_plan,
    statusword,
    stop_ramp,
)

S, C = State, Command
TRANSITIONS = {
    (S.SWITCH_ON_DISABLED, C.SHUTDOWN): S.READY,
    (S.READY, C.SWITCH_ON): S.SWITCHED_ON,
    (S.READY, C.ENABLE): S.SWITCHED_ON,
    (S.READY, C.QUICK_STOP): S.SWITCH_ON_DISABLED,
    (S.READY, C.DISABLE_VOLTAGE): S.SWITCH_ON_DISABLED,
    (S.SWITCHED_ON, C.SHUTDOWN): S.READY,
    (S.SWITCHED_ON, C.ENABLE): S.ENABLED,
    (S.SWITCHED_ON, C.QUICK_STOP): S.SWITCH_ON_DISABLED,
    (S.SWITCHED_ON, C.DISABLE_VOLTAGE): S.SWITCH_ON_DISABLED,
    (S.ENABLED, C.SHUTDOWN): S.READY,
    (S.ENABLED, C.SWITCH_ON): S.SWITCHED_ON,
    (S.ENABLED, C.QUICK_STOP): S.QUICK_STOP,
    (S.ENABLED, C.DISABLE_VOLTAGE): S.SWITCH_ON_DISABLED,
    (S.QUICK_STOP, C.DISABLE_VOLTAGE): S.SWITCH_ON_DISABLED,
    (S.QUICK_STOP, C.ENABLE): S.ENABLED,
}
MASKS = {S.NOT_READY: 0x4F, S.SWITCH_ON_DISABLED: 0x4F, S.FAULT: 0x4F, S.FAULT_REACTION: 0x4F}


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("command", Command)
def test_every_pair_of_state_and_command_has_the_transition_of_the_table_or_none(
    state: State, command: Command
) -> None:
    expected = TRANSITIONS.get((state, command), state)
    assert next_state(state, command, power_ok=True, quick_stop_stays=True) is expected


def test_transition_16_needs_an_option_code_that_stays() -> None:
    assert next_state(S.QUICK_STOP, C.ENABLE, power_ok=True, quick_stop_stays=False) is S.QUICK_STOP


@pytest.mark.parametrize("command", [C.SWITCH_ON, C.ENABLE])
def test_nothing_switches_on_without_power(command: Command) -> None:
    assert next_state(S.READY, command, power_ok=False, quick_stop_stays=False) is S.READY


@pytest.mark.parametrize(
    ("word", "command"),
    [(0x00, C.DISABLE_VOLTAGE), (0x0D, C.DISABLE_VOLTAGE), (0x02, C.QUICK_STOP), (0x0B, C.QUICK_STOP),
     (0x06, C.SHUTDOWN), (0x0E, C.SHUTDOWN), (0x07, C.SWITCH_ON), (0x0F, C.ENABLE), (0x10F, C.ENABLE)],
)  # fmt: skip
def test_controlwords_decode_by_their_patterns(word: int, command: Command) -> None:
    assert command_of(word) is command


def test_all_65536_controlwords_are_one_of_five_commands_and_depend_on_bits_0_to_3_only() -> None:
    assert all(command_of(word) is command_of(word & 0x0F) for word in range(0x10000))


def test_fault_reset_is_a_rising_edge_of_bit_7() -> None:
    assert is_fault_reset(0x00, 0x80)
    assert not is_fault_reset(0x80, 0x80)
    assert not is_fault_reset(0x80, 0x00)


@pytest.mark.parametrize("state", State)
def test_a_statusword_decodes_to_its_state_only_whatever_the_other_bits(state: State) -> None:
    for bits in (0x0000, 0x0290, 0x1E80):
        word = statusword(state, bits)
        matching = [other for other in State if word & MASKS.get(other, 0x6F) == other]
        assert matching == [state]


def test_option_codes_mean_what_cia_402_says() -> None:
    assert [quick_stop_plan(code).ramp for code in range(9)] == [
        Ramp.NONE, Ramp.SLOW, Ramp.QUICK, Ramp.LIMIT, Ramp.LIMIT, Ramp.SLOW, Ramp.QUICK, Ramp.LIMIT, Ramp.LIMIT,
    ]  # fmt: skip
    assert [quick_stop_plan(code).stay for code in range(9)] == [False] * 5 + [True] * 4
    assert [leave_ramp(code) for code in (0, 1)] == [Ramp.NONE, Ramp.SLOW]
    assert [stop_ramp(code) for code in range(5)] == [
        Ramp.NONE, Ramp.SLOW, Ramp.QUICK, Ramp.LIMIT, Ramp.LIMIT,
    ]  # fmt: skip
    assert [stop_ramp(code) for code in (1, 2, 3)] == [Ramp.SLOW, Ramp.QUICK, Ramp.LIMIT]
