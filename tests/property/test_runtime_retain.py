"""Any record that may be stored comes back as it was; any damage is found."""

import tempfile
from dataclasses import fields

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.errors import StateError
from gantryctl.runtime import AlarmEntry, Retained, RetainedMemory
from gantryctl.runtime.retained_store import decode, encode

finite = st.floats(allow_nan=False, allow_infinity=False)
whole = st.integers(-(2**62), 2**62)
text = st.text(max_size=12)
alarms = st.builds(
    AlarmEntry, text, text, text, finite, st.none() | finite, st.none() | finite, st.none() | finite
)
records = st.builds(
    Retained,
    machine=text,
    config_hash=text,
    speed_rad_s=st.none() | finite,
    increment_rad=st.none() | finite,
    encoder_serial=text,
    zero_offset_counts=st.none() | whole,
    previous_offset_counts=st.none() | whole,
    zero_set_by=text,
    zero_set_at=text,
    zero_witness=text,
    rest_position_counts=st.none() | whole,
    holding_torque_nm=st.none() | finite,
    brake_tested_at=text,
    brake_tested_power_ups=whole,
    brake_test_outcome=text,
    brake_test_text=text,
    brake_plus_nm=st.none() | finite,
    brake_minus_nm=st.none() | finite,
    brake_failed=text,
    brake_tests=whole,
    brake_tests_failed=whole,
    power_ups=whole,
    moves=whole,
    emergency_brake_stops=whole,
    emergency_brake_energy_j=finite,
    torque_weights=text,
    travelled_rad=finite,
    error_stop=text,
    doubted_by=text,
    last_result=text,
    alarms=st.lists(alarms, max_size=4).map(tuple),
)


@settings(max_examples=60)
@given(record=records, sequence=st.integers(1, 2**62))
def test_a_record_comes_back_as_it_was(record: Retained, sequence: int) -> None:
    assert decode(encode(record, sequence)) == (sequence, record)


@settings(max_examples=15)
@given(history=st.lists(records, min_size=1, max_size=5))
def test_the_last_stored_record_is_loaded(history: list[Retained]) -> None:
    with tempfile.TemporaryDirectory() as directory:
        for record in history:
            RetainedMemory(directory).store(record)
        memory = RetainedMemory(directory)
        assert memory.load() == history[-1]
        assert memory.notes == ()


@settings(max_examples=60)
@given(record=records, data=st.data())
def test_any_change_of_bytes_is_found(record: Retained, data: st.DataObject) -> None:
    whole_copy = encode(record, 1)
    start = data.draw(st.integers(0, len(whole_copy) - 1))
    end = data.draw(st.integers(start, min(len(whole_copy), start + 20)))
    put = data.draw(st.binary(max_size=20))
    changed = whole_copy[:start] + put + whole_copy[end:]
    if changed == whole_copy:
        return
    with pytest.raises(StateError):
        decode(changed)


@given(
    name=st.sampled_from([field.name for field in fields(Retained) if field.name != "alarms"]),
    value=st.sampled_from([float("nan"), float("inf"), True, b"x", [], {}, 1j]),
)
def test_no_field_takes_what_json_or_the_axis_cannot_hold(name: str, value: object) -> None:
    with pytest.raises(StateError, match=name):
        encode(Retained(**{"machine": "m", "config_hash": "c", name: value}), 1)
