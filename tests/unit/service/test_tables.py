"""The tag table, the role table and the reference page that is made of them.

INV-10: the table of roles, cell by cell.
"""

from pathlib import Path

import pytest

from gantryctl.service.memory.memory import JournalState
from gantryctl.service.protocol.roles import RIGHTS, Action, Role, may
from gantryctl.service.protocol.service_page import reference_page
from gantryctl.service.protocol.tags import BY_NAME, TAGS

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "service.md"
UNITS = {
    "_deg": "deg",
    "_deg_s": "deg/s",
    "_deg_s2": "deg/s2",
    "_nm": "N m",
    "_ms": "ms",
    "_us": "us",
    "_s": "s",
}


def test_the_tag_of_the_journal_has_the_states_of_the_recorder() -> None:
    assert BY_NAME["journal_state"].labels == tuple(state.name.lower() for state in JournalState)


# The table a second time, by hand: v viewer, o operator, p physicist, s service, a admin.
WANTED = {
    "view": "vopsa", "stop": "vopsa", "quick_stop": "vopsa", "authority": "ops", "take_over": "ops",
    "power": "ops", "mode": "ops", "jog": "ops", "move": "ops", "halt": "ops", "reset": "ops",
    "acknowledge": "ops", "set_speed": "ops", "set_increment": "ops", "set_override": "ops",
    "set_acceleration": "ps", "brake_test": "ps", "reset_locked": "s", "commission": "s", "traces": "ops",
    "journal": "psa", "users": "a", "note": "ops",
}  # fmt: skip


@pytest.mark.parametrize("role", Role)
def test_every_cell_of_the_role_table(role: Role) -> None:
    assert {action for action in Action if may(role, action)} == {
        action for action in Action if role.value[0] in WANTED[action]
    }


def test_who_has_control_alone_moves_and_sets() -> None:
    everybody = {Action.VIEW, Action.STOP, Action.QUICK_STOP, Action.AUTHORITY, Action.TAKE_OVER}
    everybody |= {Action.ACKNOWLEDGE, Action.NOTE, Action.TRACES, Action.JOURNAL, Action.USERS}
    assert {action for action in Action if not RIGHTS[action].control} == everybody


def test_the_admin_moves_nothing_and_stop_is_for_everybody() -> None:
    assert not any(may(Role.ADMIN, action) for action, right in RIGHTS.items() if right.control)
    assert RIGHTS[Action.STOP].roles == RIGHTS[Action.QUICK_STOP].roles == frozenset(Role)


def test_every_action_is_in_the_table_and_explained() -> None:
    assert set(RIGHTS) == set(Action)


def test_tag_names_are_unique_and_end_with_their_unit() -> None:
    assert len(BY_NAME) == len(TAGS)
    for tag in TAGS:
        ending = next((e for e in sorted(UNITS, key=len, reverse=True) if tag.name.endswith(e)), "")
        if tag.kind == "float" and ending:
            assert tag.unit == UNITS[ending], tag.name
        assert bool(tag.labels) == (tag.kind == "enum"), tag.name


def test_the_reference_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == reference_page()
