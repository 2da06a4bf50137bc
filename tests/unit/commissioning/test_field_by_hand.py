"""The machine file that a drive of the field is given, and which steps of its commissioning count, by hand."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import field
from gantryctl.commissioning.field import FieldDrive, commission_field_drive
from gantryctl.commissioning.results import Outcome
from gantryctl.errors import CommandRefused
from gantryctl.operation.ledger import LedgerRow, Standing

# 385 N m of 257 N m are 1498 per mille.
BASE: Any = SimpleNamespace(motor=SimpleNamespace(torque_max_nm=385.0, torque_rated_nm=257.0))
INPUTS = ("estop_ok", "enabling_switch", "mains_ready", "brake_open", "limit_minus", "limit_plus")


def a_table(**entries: Any) -> Any:
    """A dictionary with these entries, by index; `None` for one that it is known not to have."""
    keys = {(int(name.removeprefix("x"), 16), 0): entry for name, entry in entries.items()}
    return SimpleNamespace(
        drive="a drive",
        complete=False,
        entries={key: entry for key, entry in keys.items() if entry is not None},
        lacks=lambda index, sub: keys.get((index, sub), "") is None,
    )


def entry(*, writable: bool = True, high: float | None = None, default: object = None) -> Any:
    return SimpleNamespace(access=SimpleNamespace(writable=writable), high=high, default=default)


@pytest.mark.parametrize(
    ("limit", "changes"),
    [
        (None, {"can.torque_limit_in_drive_nm": 385.0}),
        (entry(writable=False, high=3000.0), {"can.torque_limit_in_drive_nm": 385.0}),
        (entry(), {}),
        (entry(high=1499.0), {}),
        (entry(high=1498.0), {"can.torque_reference": pytest.approx(1.0, abs=1e-4)}),
        (entry(high=1000.0), {"can.torque_reference": pytest.approx(1.498054)}),
    ],
)
def test_the_limit_of_the_torque_is_given_where_the_drive_takes_it(
    limit: Any, changes: dict[str, Any]
) -> None:
    """A reference of 1.498 rated torques makes 1000 per mille 385 N m."""
    assert field._torque(BASE, a_table(x6072=limit)) == changes


@pytest.mark.parametrize("unit", ["r/min", None])
def test_a_profile_that_knows_the_unit_of_speed_names_it(
    monkeypatch: pytest.MonkeyPatch, unit: str | None
) -> None:
    profile = SimpleNamespace(units=SimpleNamespace(velocity=unit))
    monkeypatch.setattr(field, "profile_of_table", lambda _: profile)
    # SI unit and dimension of r/min: CiA 301.
    table = a_table(x60A9=entry(default=0x00B44700))
    found = {"can.velocity_unit": "profile"} if unit else {"can.velocity_unit": "r/min"}
    assert field._unit(table) == found


@pytest.mark.parametrize("said", [None, entry(), entry(default="text"), entry(default=0)])
def test_a_unit_of_speed_that_nobody_says_is_left_to_the_person(
    monkeypatch: pytest.MonkeyPatch, said: Any
) -> None:
    monkeypatch.setattr(field, "profile_of_table", lambda _: None)
    assert field._unit(a_table(x60A9=said)) == {}


def test_only_a_drive_without_inputs_has_them_at_a_node() -> None:
    assert field._inputs(a_table(x60FD=entry())) == {}
    assert field._inputs(a_table()) == {}
    assert field._inputs(a_table(x60FD=None)) == {
        "can.io.node": 3,
        **{f"can.io.inputs.{name}": bit for bit, name in enumerate(INPUTS)},
        **{f"can.inputs.{name}": -1 for name in INPUTS},
    }


@pytest.mark.parametrize("watchdog", [False, True])
@pytest.mark.parametrize(("complete", "named"), [(True, "file.eds"), (False, "a drive@file.eds")])
def test_the_machine_of_a_drive_is_virtual_and_its_brake_is_that_of_the_drive(
    monkeypatch: pytest.MonkeyPatch, complete: bool, named: str, watchdog: bool
) -> None:
    given: list[Any] = []
    monkeypatch.setattr(field, "with_values", lambda base, changes: given.append((base, changes)))
    monkeypatch.setattr(field, "profile_of_table", lambda _: None)
    table = a_table(x6072=entry(), x60FD=entry())
    table.complete = complete
    field.field_machine(BASE, table, "file.eds", watchdog=watchdog)
    node = {"can.io.node": 3, "can.io.outputs.drive_enable": 0, "can.io.inputs.watchdog_closed": 15}
    assert given == [
        (
            BASE,
            {
                "can.interface": "simulated",
                "can.channel": "",
                "can.side_channel": "",
                "can.virtual_drive": named,
                "can.encoder.index": 0,
                "brake.owner": "drive",
                **(node if watchdog else {}),
            },
        )
    ]


# --- its commissioning --------------------------------------------------------------------------------


def lacking(what: str, **how: Any) -> LedgerRow:
    return LedgerRow(what, Standing.LACKING, **how)


class Work:
    """A commissioning whose steps end as the test says."""

    def __init__(self) -> None:
        self.ledger: tuple[LedgerRow, ...] = ()
        self.fails = ""
        self.refuses = False
        self.complete = False
        self.done: list[str] = []
        self.watchdogs: list[bool] = []

    def start(self, *, again: bool) -> None:
        assert not again
        if self.refuses:
            raise CommandRefused("it does not start")

    def left(self) -> list[Any]:
        needed = {"bus": True, "report": False, "turn": True, "bands": True, "stop": True}
        return [SimpleNamespace(key=key, required=required) for key, required in needed.items()]

    def do(self, step: Any) -> Any:
        self.done.append(step.key)
        return SimpleNamespace(
            outcome=Outcome.FAILED if step.key == self.fails else Outcome.PASSED, proof="seen"
        )


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> Work:
    made = Work()

    @contextmanager
    def opened(_: object) -> Iterator[Work]:
        yield made

    monkeypatch.setattr(field, "_work", opened)
    monkeypatch.setattr(field, "field_machine", lambda *_, watchdog: made.watchdogs.append(watchdog))
    monkeypatch.setattr(field, "profile_of_table", lambda _: None)
    return made


def commissioned(said: list[str] | None = None, *, whole: bool = True) -> FieldDrive:
    told = [] if said is None else said
    return commission_field_drive(BASE, a_table(), "", told.append, whole=whole)


@pytest.mark.parametrize(
    ("whole", "steps"), [(True, ["bus", "turn", "bands", "stop"]), (False, ["bus", "stop"])]
)
def test_every_step_that_is_required_is_done(work: Work, whole: bool, steps: list[str]) -> None:
    work.complete = True
    said: list[str] = []
    found = commissioned(said, whole=whole)
    assert work.done == steps == [key for key, _ in found.steps]
    assert said == [f"  {key}: passed: seen" for key in steps]
    assert (found.commissioned, found.refused, found.needs_watchdog) == (True, (), False)
    # A node beside the drive is there only where it was asked for.
    assert work.watchdogs == [False]


def test_the_first_step_that_fails_is_the_reason_and_the_last(work: Work) -> None:
    work.fails = "turn"
    work.ledger = (lacking("brake", proof="brake"),)
    found = commissioned()
    assert work.done == ["bus", "turn"]
    assert found.refused == ("step turn: seen",)
    assert found.steps[-1] == ("turn", Outcome.FAILED)


def test_what_no_step_has_shown_refuses_a_whole_commissioning_only(work: Work) -> None:
    row = lacking("brake", proof="brake")
    work.ledger = (row, lacking("watch", acceptable=True), LedgerRow("ramp", Standing.MADE_UP))
    found = commissioned()
    assert found.refused == (row.text,)
    assert [each.what for each in found.made_up] == ["ramp"]
    assert [each.what for each in found.to_accept] == ["watch"]
    short = commissioned(whole=False)
    assert (short.refused, short.commissioned) == ((), False)


@pytest.mark.parametrize(
    ("lacks", "needs_watchdog"),
    [
        (("stops_without_commands", "stops_without_controller"), True),
        (("stops_without_commands",), False),
        (("stops_without_commands", "stops_without_controller", "runs_csv"), False),
    ],
)
def test_a_drive_that_lacks_its_watches_alone_needs_a_watchdog(
    work: Work, lacks: tuple[str, ...], needs_watchdog: bool
) -> None:
    work.refuses = True
    work.ledger = tuple(lacking(name) for name in lacks)
    found = commissioned()
    assert (work.done, found.steps) == ([], ())
    assert found.refused == tuple(row.text for row in work.ledger)
    assert found.needs_watchdog is needs_watchdog


def test_a_drive_that_does_not_start_for_another_reason_is_told_with_it(work: Work) -> None:
    work.refuses = True
    found = commissioned()
    assert (found.refused, found.needs_watchdog) == (("it does not start",), False)
