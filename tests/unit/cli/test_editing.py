"""`gantryctl config set`: values changed as by hand, and the file stays whole; or nothing at all is changed."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from gantryctl.machine import default_machine, field_specs, load_machine, origins, show_value
from gantryctl.machine.specs import value_at
from support.command_line import cli, done, refused

# Another gain that keeps the quick stop: 382.5 of the motor's 385 N m with the heaviest load, 383.9 as delivered. With
# 0.9 the stop from 3 deg/s meets the torque limit for 5 ms, and `config set` refuses it.
KVF = "1.05"


@pytest.fixture
def file() -> Path:
    done("config", "init", "my.toml")
    return Path("my.toml")


def changed_lines(before: str, after: str) -> list[tuple[str, str]]:
    return [pair for pair in zip(before.splitlines(), after.splitlines(), strict=True) if pair[0] != pair[1]]


def test_one_line_changes_and_its_comment_stays(file: Path) -> None:
    before = file.read_text(encoding="utf-8")
    answer = done("config", "set", "control.kpp_per_s", "2.5", "--config", file)
    assert "-> 2.5" in answer.out
    ((old, new),) = changed_lines(before, file.read_text(encoding="utf-8"))
    assert old.partition("#")[2] == new.partition("#")[2] != ""
    assert load_machine(file).control.kpp_per_s == 2.5


def test_keys_that_make_a_machine_only_together_are_set_together(file: Path) -> None:
    """A drive on the bus answers within 2 ms, which a scan of 1 ms has no room for."""
    before = file.read_text(encoding="utf-8")
    assert "[can] answer_ms" in refused("config", "set", "drive.kind", "canopen", "--config", file)
    assert file.read_text(encoding="utf-8") == before
    told = done("config", "set", "drive.kind", "canopen", "control.scan_period_ms", "4", "--config", file).out
    assert told.splitlines() == [
        'my.toml: [drive] kind: "sim" -> "canopen"',
        "my.toml: [control] scan_period_ms: 1.0 -> 4.0 ms",
    ]
    assert len(changed_lines(before, file.read_text(encoding="utf-8"))) == 2
    machine = load_machine(file)
    assert (machine.drive.kind, machine.control.scan_period_ms) == ("canopen", 4.0)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("control.kvf", KVF, "drive.kind"), "drive.kind has no value: keys and values alternate"),
        (("control.kvf", KVF, "control.kvf", "1.0"), "control.kvf is named twice"),
        (("control.kvf", KVF, "control.kvff", "1"), "did you mean control.kvf"),
        (("control.kvf", KVF, "control.kpp_per_s", "fast"), "fast is not a number"),
    ],
)
def test_one_wrong_pair_changes_none(file: Path, words: tuple[str, ...], told: str) -> None:
    before = file.read_text(encoding="utf-8")
    assert told in refused("config", "set", *words, "--config", file)
    assert file.read_text(encoding="utf-8") == before


def test_a_key_that_is_not_there_comes_to_the_end_of_its_table_and_a_table_to_the_end_of_the_file(
    file: Path,
) -> None:
    text, machine = file.read_text(encoding="utf-8"), load_machine(file)
    absent = [
        path
        for path, origin in origins(machine).items()
        if origin == "default" and field_specs()[path].kind in ("number", "integer")
    ]
    tables = [path for path in absent if f"\n[{field_specs()[path].table}]" not in text]
    keys = [path for path in absent if path not in tables]
    for path in (*keys[:2], *tables[:1]):
        value = show_value(value_at(machine, path), None)
        done("config", "set", path, value, "--config", file)
        assert tomllib.loads(file.read_text(encoding="utf-8"))
        assert origins(load_machine(file))[path] != "default"
    assert load_machine(file).name == "my"


@pytest.mark.parametrize(
    ("key", "value", "named"),
    [
        ("control.kvff", "2.5", "did you mean control.kvf"),
        ("control.kpp_per_s", "-1", "[control] kpp_per_s"),
        ("control.kpp_per_s", "fast", "not a number"),
        ("control.kpp_per_s", "1_0", "not a number"),
        ("control.kpp_per_s", "٣", "not a number"),
        ("control.kpp_per_s", "nan", "not a number"),
        ("control.kpp_per_s", "2.5\n[x]", "not a number"),
        ("drive.kind", "steam", "[drive] kind"),
        # a rule between keys, and the quick stop on the full plant
        ("speed.setting_min_deg_s", "7.0", "setting_min_deg_s"),
    ],
)
def test_what_makes_no_machine_is_refused_and_changes_nothing(
    file: Path, key: str, value: str, named: str
) -> None:
    before = {path.name: path.read_bytes() for path in Path().iterdir()}
    assert before.keys() == {"my.toml", "machine.schema.json"}
    assert named in cli("config", "set", "--config", file, "--", key, value).err
    assert {path.name: path.read_bytes() for path in Path().iterdir()} == before


def test_a_form_that_only_an_editor_can_change_is_told(file: Path) -> None:
    text = file.read_text(encoding="utf-8").replace("\n[control]\n", "\n[ control ]  # gains\n")
    file.write_text(text.replace("kpp_per_s = ", '"kpp_per_s" = '), encoding="utf-8")
    before = file.read_bytes()
    assert "only an editor" in refused("config", "set", "control.kpp_per_s", "2.5", "--config", file)
    assert file.read_bytes() == before
    # and one that is only written otherwise is changed
    done("config", "set", "control.kvf", KVF, "--config", file)
    assert load_machine(file).control.kvf == float(KVF)


def test_the_delivered_machine_is_not_changed() -> None:
    assert "config init" in refused("config", "set", "control.kvf", "0.9")
    assert default_machine().control.kvf == 1.0


def test_windows_line_ends_stay(file: Path) -> None:
    file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    done("config", "set", "control.kvf", KVF, "--config", file)
    data = file.read_bytes()
    assert f"kvf = {KVF} ".encode() in data
    assert data.count(b"\n") == data.count(b"\r\n")
