"""The state directory: whose it is, what is in it, and what happens when it is not as it should be."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from gantryctl.errors import StateError, UsageError
from gantryctl.machine import Machine, default_machine, default_machine_path, load_machine, with_values
from gantryctl.operation.opening import keep_machine, new_machine, open_machine
from gantryctl.operation.state import encoder_report, machine_status, reset_machine, reset_simulation
from gantryctl.operation.store import (
    StateStore,
    last_bus,
    last_recording,
    plant_hash,
    state_hash,
    state_root,
)


@pytest.fixture
def machine() -> Machine:
    return default_machine()


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


def kept(machine: Machine, angle_deg: float = 12.5) -> StateStore:
    reset_simulation(machine, angle_deg)
    return StateStore(machine)


def test_where_the_state_lies(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert state_root() == tmp_path
    monkeypatch.delenv("GANTRYCTL_STATE")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "xdg"))
    assert state_root() == tmp_path / "xdg" / "gantryctl"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert state_root() == tmp_path / "home" / ".local" / "state" / "gantryctl"


def test_every_machine_has_a_directory_of_its_own(machine: Machine) -> None:
    other = with_values(machine, {"machine.name": "second"})
    assert StateStore(machine).directory != StateStore(other).directory


# --- two files of one name --------------------------------------------------------------------------------------------


def written(path: Path, inertia: str = "2.18e6") -> Machine:
    """A machine file of the name hust_gantry; its plant has this inertia."""
    text = default_machine_path().read_text(encoding="utf-8")
    path.write_text(text.replace("inertia_kg_m2 = 2.18e6", f"inertia_kg_m2 = {inertia}"), encoding="utf-8")
    return load_machine(path)


def test_two_files_of_one_name_and_different_plants_never_share_a_state(tmp_path: Path) -> None:
    first = written(tmp_path / "first.toml")
    reset_simulation(first, 12.5)
    second = written(tmp_path / "second.toml", "2.0e6")
    for use in (machine_status, encoder_report, reset_machine, lambda m: reset_simulation(m, 0.0)):
        with pytest.raises(
            StateError, match=r"second\.toml and .*first\.toml are different machines of one name"
        ):
            use(second)
    # Nothing of the first was touched, and the directory is not left locked.
    assert machine_status(first).angle_deg == pytest.approx(12.5, abs=0.005)


def test_a_copy_shares_the_state_until_it_becomes_another_machine(tmp_path: Path) -> None:
    reset_simulation(written(tmp_path / "first.toml"), 12.5)
    copy = written(tmp_path / "copy.toml")
    assert machine_status(copy).angle_deg == pytest.approx(12.5, abs=0.005)
    with pytest.raises(StateError, match="different machines of one name"):
        machine_status(written(tmp_path / "copy.toml", "2.0e6"))


def test_a_changed_file_and_a_moved_one_keep_their_state(tmp_path: Path) -> None:
    reset_simulation(written(tmp_path / "first.toml"), 12.5)
    changed = written(tmp_path / "first.toml", "2.0e6")
    assert machine_status(changed).angle_deg == pytest.approx(12.5, abs=0.005)
    (tmp_path / "first.toml").unlink()
    moved = written(tmp_path / "moved.toml", "1.9e6")
    assert machine_status(moved).angle_deg == pytest.approx(12.5, abs=0.005)


def test_plant_and_memory_come_back_as_they_were(machine: Machine) -> None:
    fresh = new_machine(machine, 33.0)
    with StateStore(machine) as store:
        keep_machine(machine, store, fresh.drive, fresh.retained)
        again = open_machine(machine, store)
    assert again.drive.read() == fresh.drive.read()
    assert again.drive.sim.state == fresh.drive.sim.state
    assert again.retained == fresh.retained
    assert again.notes == ()


def test_an_ideal_machine_comes_back_too(machine: Machine) -> None:
    ideal = with_values(machine, {"drive.kind": "ideal"})
    with kept(ideal, -7.25) as store:
        again = open_machine(ideal, store)
    assert machine_status(ideal).angle_deg == pytest.approx(-7.25, abs=1e-5)
    assert again.drive.identity().name == "ideal drive"


def test_a_new_machine_is_said_to_be_new(machine: Machine) -> None:
    with StateStore(machine) as store:
        assert open_machine(machine, store).notes == ("a new simulated machine, standing at 0 deg",)


def test_another_plant_stands_at_the_same_angle_and_is_zeroed_anew(machine: Machine) -> None:
    kept(machine, 45.0)
    heavier = with_values(machine, {"plant.load.inertia_kg_m2": 2.3e6})
    with StateStore(heavier) as store:
        opened = open_machine(heavier, store)
    assert "[plant] has changed" in opened.notes[0]
    assert encoder_report(heavier).reading.angle_deg == pytest.approx(45.0, abs=0.01)


def test_another_encoder_evaluation_needs_a_new_zero(machine: Machine) -> None:
    """Counts of another size mean nothing: the stored zero must not be applied to them."""
    kept(machine, 45.0)
    coarse = with_values(machine, {"encoder.interpolation": 1024})
    assert "set-zero" in machine_status(coarse).encoder
    assert machine_status(coarse).condition == "may not move"


@pytest.mark.parametrize(
    "text", ["", "{}", "[1]", "null", '{"state": {"pos_load": "x"}}', "\0", '{"state": 3}']
)
def test_a_damaged_plant_file_is_refused_with_the_way_out(machine: Machine, text: str) -> None:
    with kept(machine) as store:
        (store.directory / "plant.json").write_text(text, encoding="utf-8")
    with pytest.raises(StateError, match="sim reset"):
        machine_status(machine)
    reset_simulation(machine, 0.0)
    assert machine_status(machine).angle_deg == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("value", [None, float("nan"), float("inf"), "missing"])
def test_a_plant_state_that_cannot_be_is_refused(machine: Machine, value: object) -> None:
    with kept(machine) as store:
        path = store.directory / "plant.json"
        data = json.loads(path.read_text(encoding="utf-8"))
        if value == "missing":
            del data["state"]["pos_motor"]
        else:
            data["state"]["pos_motor"] = value
        path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(StateError, match="sim reset"):
        machine_status(machine)


@pytest.mark.parametrize("lost", ["plant.json", "retain.*"])
def test_half_a_state_is_refused(machine: Machine, lost: str) -> None:
    with kept(machine) as store:
        for file in store.directory.glob(lost):
            file.unlink()
    with pytest.raises(StateError, match="sim reset"):
        machine_status(machine)


def test_one_damaged_copy_of_the_memory_is_bridged_and_said(machine: Machine) -> None:
    with kept(machine, 10.0) as store:
        record = store.load_retained()
        assert record is not None
        store.store_retained(record)  # now there are two copies
        (store.directory / "retain.a.json").write_bytes(b"{")
    status = machine_status(machine)
    assert status.angle_deg == pytest.approx(10.0, abs=0.01)
    assert any("retain.a.json" in note for note in status.notes)


def test_both_copies_damaged_is_an_error_that_loses_nothing(machine: Machine) -> None:
    with kept(machine) as store:
        for name in ("retain.a.json", "retain.b.json"):
            (store.directory / name).write_bytes(b"{")
    with pytest.raises(StateError, match="retained memory"):
        machine_status(machine)
    assert (StateStore(machine).directory / "retain.a.json").read_bytes() == b"{"


def test_a_second_user_is_locked_out_and_told_who_is_in(machine: Machine) -> None:
    with StateStore(machine), pytest.raises(StateError, match=r"in use by process \d+"), StateStore(machine):
        pass
    with StateStore(machine):
        pass


def test_a_directory_that_cannot_be_made_is_said(machine: Machine, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(StateError, match="cannot be made"):
        StateStore(machine, tmp_path / "file")


def test_a_reset_angle_beyond_the_stops_is_refused_and_changes_nothing(machine: Machine) -> None:
    kept(machine, 5.0)
    for angle in (187.0, -200.0, 1e300):
        with pytest.raises(UsageError, match="mechanical stops"):
            reset_simulation(machine, angle)
    assert machine_status(machine).angle_deg == pytest.approx(5.0, abs=0.01)


def test_nothing_to_reset_is_said(machine: Machine) -> None:
    kept(machine)
    assert reset_machine(machine) == "nothing to reset"


def test_what_a_killed_writer_left_is_removed_when_the_machine_is_opened(machine: Machine) -> None:
    left = StateStore(machine)
    left.traces.mkdir(parents=True)
    drafts = [folder / "retain.a.toml.1234abcd.part" for folder in (left.directory, left.traces)]
    for draft in drafts:
        draft.write_text("half")
        os.utime(draft, (0.0, 0.0))
    with StateStore(machine):
        assert not any(draft.exists() for draft in drafts)


def test_a_directory_that_was_moved_away_is_not_begun_anew(tmp_path: Path) -> None:
    machine = default_machine()
    with StateStore(machine, tmp_path) as store:
        store.store_plant({"angle": 1.0})
        away = tmp_path / "away"
        store.directory.rename(away)
        with pytest.raises(StateError, match="was moved away or replaced"):
            store.store_plant({"angle": 2.0})
        assert not store.directory.exists()
        store.directory.mkdir()
        with pytest.raises(StateError, match="put it back"):
            store.store_bus(["one"])
        (store.directory / "lock").write_bytes((away / "lock").read_bytes())  # that of another machine
        with pytest.raises(StateError, match="put it back"):
            store.store_bus(["one"])
        (store.directory / "lock").unlink()
        store.directory.rmdir()
        away.rename(store.directory)
        store.store_plant({"angle": 3.0})
    assert (store.load_plant() or ({}, False))[0] == {"angle": 3.0}


def test_nobody_else_reads_what_is_kept(machine: Machine, tmp_path: Path) -> None:
    source = written(tmp_path / "m.toml")
    with kept(source) as store:
        store.store_bus(["12 telegrams"])
        files = [store.directory / name for name in ("plant.json", "bus.json", "machine.json")]
        assert [file.stat().st_mode & 0o777 for file in files] == [0o600] * 3


def test_a_new_plant_has_nothing_of_the_old_machine(machine: Machine) -> None:
    with kept(machine) as store:
        store.forget()
        assert store.load_plant() is None
        assert store.load_retained() is None


def test_a_plant_of_other_figures_is_told_as_another(machine: Machine) -> None:
    with kept(machine) as store:
        found = store.load_plant()
        assert found is not None
        assert found[1]
    with StateStore(with_values(machine, {"plant.load.inertia_kg_m2": 2.0e6})) as store:
        found = store.load_plant()
        assert found is not None
        assert not found[1]


def test_the_directory_is_noted_as_that_of_the_file_as_it_is_now(tmp_path: Path) -> None:
    noted = []
    for inertia in ("2.18e6", "2.0e6", "2.0e6"):
        machine = written(tmp_path / "m.toml", inertia)
        with StateStore(machine) as store:
            note = json.loads((store.directory / "machine.json").read_text(encoding="utf-8"))
        assert note == {"file": str(machine.source), "state": state_hash(machine)}
        noted.append(note["state"])
    assert noted[0] != noted[1] == noted[2]


@pytest.mark.parametrize(
    "change",
    [
        {"drive.speed_loop.kvp_nm_s_per_rad": 100.0},
        {"plant.load.inertia_kg_m2": 2.0e6},
        {"axis.over_travel_max_deg": 180.4},
        {"motor.inertia_kg_m2": 0.231},
        {"brake.close_time_ms": 140.0},
    ],
    ids=lambda change: next(iter(change)),
)
def test_a_plant_is_made_of_five_tables(change: dict[str, object]) -> None:
    assert plant_hash(with_values(default_machine(), change)) != plant_hash(default_machine())
    assert plant_hash(with_values(default_machine(), {"control.kvf": 0.9})) == plant_hash(default_machine())


def test_no_memory_is_written_into_a_directory_that_is_another_one(machine: Machine, tmp_path: Path) -> None:
    with kept(machine) as store:
        retained = store.load_retained()
        assert retained is not None
        away = store.directory.rename(tmp_path / "away")
        store.directory.mkdir()
        with pytest.raises(StateError, match="put it back"):
            store.store_retained(retained)
        assert not list(store.directory.iterdir())
        store.directory.rmdir()
        away.rename(store.directory)


def test_what_the_last_run_counted_on_its_bus_is_read_as_it_was_kept(machine: Machine, state: Path) -> None:
    assert last_bus(machine) is None
    with kept(machine) as store:
        store.store_bus(["12 telegrams", "none lost"])
    found = last_bus(machine)
    assert found is not None
    assert found.lines == ("12 telegrams", "none lost")
    assert found.ended
    (state / machine.name / "bus.json").write_text("{", encoding="utf-8")
    assert last_bus(machine) is None


def test_the_last_recording_is_the_newest_of_all_machines(state: Path) -> None:
    with pytest.raises(UsageError, match="no recording"):
        last_recording()
    made = []
    for name, number, age_s in (("a", 1, 50), ("a", 2, 90), ("b", 7, 100)):
        (state / name / "traces").mkdir(parents=True, exist_ok=True)
        made.append(state / name / "traces" / f"move-{number:06d}-20260101T000000000.parquet")
        made[-1].touch()
        os.utime(made[-1], (10_000 - age_s,) * 2)
    assert last_recording() == made[1], "of one machine the highest number, whatever the clock said"
