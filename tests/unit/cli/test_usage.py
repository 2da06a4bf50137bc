"""Help, version, completion; and every wrong command line: one line, exit code 2, nothing moved, nothing written."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import click
import pytest

from gantryctl.cli.main import COMMANDS
from gantryctl.cli.main import cli as root
from gantryctl.machine import configs_folder
from support.command_line import cli, done, machine_file, plant_truth, refused


def all_commands() -> list[tuple[str, ...]]:
    """Every command and sub-command by its words."""
    found: list[tuple[str, ...]] = []
    for name in COMMANDS:
        command = root.get_command(click.Context(root), name)
        found.append((name,))
        if isinstance(command, click.Group):
            found += [(name, sub) for sub in command.commands]
    return found


OF_ISSUE_2 = {
    "move", "jog", "stops", "speed-test", "accuracy run", "accuracy report", "accuracy stats", "status", "alarms",
    "explain", "reset", "encoder show", "encoder set-zero", "retain show", "config init", "config check",
    "config show", "config schema", "config diff", "trace show", "trace plot", "trace export", "sim reset",
    "completion",
}  # fmt: skip


def test_every_command_that_was_promised_is_there() -> None:
    assert {" ".join(words) for words in all_commands()} >= OF_ISSUE_2


@pytest.mark.parametrize("words", [(), *all_commands()], ids=" ".join)
def test_help_fits_a_terminal_and_needs_no_machine(words: tuple[str, ...], state: Path) -> None:
    text = done(*words, "--help").out
    assert text.startswith(f"Usage: {' '.join(('gantryctl', *words))} ")
    assert text == done(*words, "-h").out
    assert max(len(line) for line in text.splitlines()) <= 80
    assert not state.exists()


def test_the_help_names_every_command_and_says_what_it_does() -> None:
    text = " ".join(done("--help").out.split())
    for name, entry in COMMANDS.items():
        assert f" {name} {entry.help}" in text


def test_version() -> None:
    assert done("--version").out == f"gantryctl {version('gantryctl')}\n"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion(shell: str) -> None:
    assert "_GANTRYCTL_COMPLETE" in done("completion", shell).out


def test_a_group_alone_shows_its_help_and_is_no_success() -> None:
    for words in (
        (),
        *[words for words in all_commands() if words[0] in ("config", "trace") and len(words) == 1],
    ):
        answer = cli(*words)
        assert (answer.code, answer.out) == (2, "")
        assert answer.err.startswith("Usage:")


WRONG = [
    # words                                            what the line must say
    (["mvoe"], "did you mean 'move'?"),
    (["fly"], "no command 'fly'"),
    (["--config", "x.toml", "status"], "no option '--config' before the command: options stand behind it"),
    (["--json"], "no option '--json' before the command: options stand behind it"),
    (["--verison"], "Did you mean '--version'?"),
    (["--bogus"], "--bogus"),
    (["config", "chekc"], "chekc"),
    (["move"], "give a target angle, or --by"),
    (["move", "1", "--by", "1"], "give a target angle, or --by"),
    (["move", "1", "2"], "unexpected extra argument (2)"),
    (["move", "ninety"], "'ninety' is not a number"),
    (["move", "nan"], "not a finite number"),
    (["move", "--", "-inf"], "not a finite number"),
    (["move", "1e400"], "not a finite number"),
    (["move", "--by", "nan"], "'--by'"),
    (["move", "--by"], "requires an argument"),
    (["move", "200"], "target 200.00 deg is beyond +180.00 deg; you are at 0.00 deg, so 180.00 deg are left"),
    (["move", "-180.5"], "beyond -180.00 deg"),
    (["move", "1e300"], "target must be within -180.00 and 180.00 deg"),
    (["move", "5", "--speed", "0.5"], "speed must be within 0.6 and 6 deg/s, got 0.5 deg/s"),
    (["move", "5", "--speed", "6.0000001"], "got 6.0000001 deg/s"),
    (["move", "5", "--speed", "-1"], "got -1 deg/s"),
    (["move", "5", "--speed", "inf"], "'--speed'"),
    (["move", "5", "--override", "0"], "--override 0: from 1 to 100 percent"),
    (["move", "5", "--override", "101"], "from 1 to 100 percent"),
    (["move", "5", "--seed", "-1"], "'--seed'"),
    (["move", "5", "--seed", "0.5"], "'--seed'"),
    (["move", "5", "--sped", "3"], "'--speed'"),
    (["move", "5", "--program", "nowhere.py:Mine"], "there is no file nowhere.py"),
    (["move", "5", "--program", "mine"], "write FILE:CLASS"),
    (["move", "5", "--config", "nowhere.toml"], "nowhere.toml: does not exist"),
    (["move", "5", "--config", "."], "is not a file"),
    (["move", "5", "--config", ""], "an empty name"),
    (["move", "5", "--out", "\udcff"], "is not a name in UTF-8"),
    (["move", "5", "--out", "a_file"], "--out a_file: cannot be made"),
    (["jog"], "Missing argument '[+|-]'"),
    (["jog", "+"], "Missing option '--for'"),
    (["jog", "up", "--for", "1"], "'up' is not one of '+', '-'"),
    (["jog", "+", "--for", "0"], "--for 0: above 0 and at most 3600 s"),
    (["jog", "+", "--for", "3601"], "at most 3600 s"),
    (["jog", "+", "--for", "1", "--speed", "7"], "got 7 deg/s"),
    (["stops", "--speed", "0"], "--speed 0: must be above 0 and at most 6 deg/s"),
    (["stops", "--speed", "6.1"], "[speed] setting_max_deg_s"),
    (["speed-test", "--speed", "0.5"], "speed 0.5 deg/s: the setting goes from 0.6 to 6 deg/s"),
    (["speed-test", "--speed", "-0.5"], "from 0.6 to 6 deg/s"),
    (["speed-test", "--out", "a_file"], "--out a_file"),
    (["accuracy", "run", "--procedure", "F"], "'F' is not one of 'A', 'B', 'C', 'D', 'E'"),
    (["accuracy", "run", "--chord", "x"], "'base', 'adjacent'"),
    (["accuracy", "run", "--runs", "0"], "1<=x<=100"),
    (["accuracy", "run", "--radius-m", "0"], "chord_radius_m = 0.0: allowed 0.01..100 m"),
    (["accuracy", "run", "--noise-um", "-1"], "tracker_noise_um = -1.0: allowed 0..500 um"),
    (["accuracy", "run", "--out", "a_file"], "--out a_file"),
    (["accuracy", "run", "--instrument", "eye"], "'eye'"),
    (["accuracy", "report"], "Missing option '--measured'"),
    (["accuracy", "report", "--measured", "nowhere.csv"], "nowhere.csv: cannot be read"),
    (["accuracy", "stats"], "Missing argument 'TABLE'"),
    (["accuracy", "stats", "a_file"], "a_file: line 1: column base_deg is missing"),
    (["accuracy", "stats", "paper_table2.csv", "--radius-m", "nan"], "not a finite number"),
    (["explain", "ENC"], "did you mean ENC-"),
    (["explain", "\x1b[31m"], "unknown code '\\x1b[31m'"),
    (["encoder", "set-zero", "--angle", "1"], "Missing option '--witness'"),
    (["encoder", "set-zero", "--angle", "1", "--witness", " "], "say what proves the angle"),
    (["encoder", "set-zero", "--angle", "1", "--witness", "a\nb"], "printable"),
    (["encoder", "set-zero", "--angle", "1", "--witness", "x" * 201], "at most 200"),
    (["encoder", "set-zero", "--angle", "187", "--witness", "mark"], "the mechanical stops are at -187 and 187 deg"),
    (["encoder", "set-zero", "--angle", "nan", "--witness", "mark"], "not a finite number"),
    (["config", "init", "nowhere/machine.toml"], "cannot be written"),
    (["config", "check", "nowhere.toml"], "does not exist"),
    (["config", "check", "a.toml", "--config", "b.toml"], "two machine files"),
    (["config", "diff"], "Missing argument 'A'"),
    (["trace", "show"], "no recording under"),
    (["trace", "export", "a_file"], "Missing option '--format'"),
    (["sim", "reset", "--angle", "187"], "the mechanical stops are at -187 and 187 deg"),
    (["sim", "reset", "--angle", "x"], "'x' is not a number"),
    (["completion", "powershell"], "'bash', 'zsh', 'fish'"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "says"),
    WRONG,
    ids=[" ".join(words)[:60].encode("unicode_escape").decode() for words, _ in WRONG],
)
def test_a_wrong_command_line_gets_one_line_and_nothing_moves(words: list[str], says: str) -> None:
    Path("a_file").write_text("hello")
    done("sim", "reset")
    before = plant_truth()
    assert says in refused(*words)
    assert plant_truth() == before
    assert [path.name for path in Path().iterdir()] == ["a_file"]


def test_every_wrong_field_of_a_machine_file_gets_its_line(tmp_path: Path) -> None:
    file = machine_file(tmp_path / "m.toml", {})
    text = file.read_text(encoding="utf-8")
    file.write_text(
        text.replace("kpp_per_s = 10.0", "kpp_per_s = -1\nkppp = 3").replace("kvf = 1.0", "kvf = nan")
    )
    for command in (
        ["move", "5"],
        ["status"],
        ["stops"],
        ["speed-test"],
        ["accuracy", "run"],
        ["sim", "reset"],
    ):
        answer = cli(*command, "--config", file)
        assert answer.code == 2
        assert [line.partition(": ")[0] for line in answer.err.splitlines()] == ["error"] * 3
        for word in ("kpp_per_s", "kppp", "kvf"):
            assert word in answer.err


@pytest.mark.parametrize("given", [("--at", "30"), ("--torque", "5")])
def test_an_analysis_without_a_measurement_is_at_no_angle(given: tuple[str, str]) -> None:
    assert f"{given[0]}: is for --measure" in refused("analyse", *given)


def test_where_no_file_tells_of_the_structure_nobody_knows_the_isocentre(tmp_path: Path) -> None:
    """That of the reference gantry was told for a telescope; another gantry of its size is not it either."""
    file = machine_file(tmp_path / "m.toml", {"plant.load.inertia_kg_m2": 2.0e6})
    file.write_text(file.read_text("utf-8").partition("[plant.structure]")[0], "utf-8")
    assert "[plant.structure]: is missing" in refused("accuracy", "isocentre", "--config", file)
    dish = configs_folder() / "azimuth_dish.toml"
    assert "machine file of azimuth_dish" in refused("accuracy", "isocentre", "--config", dish)


@pytest.mark.parametrize("given", [("--instrument", "tcp:127.0.0.1:9"), ("--certificate", "K 17")])
def test_an_instrument_that_nothing_would_ask_is_refused(given: tuple[str, str]) -> None:
    answer = refused("compare", "paper", "improved", *given)
    assert f"{given[0]}: is for a machine on a bus" in answer


def test_columns_of_a_picture_that_nobody_asked_for_are_refused(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("time_s,pos_act_deg\n0,1\n1,2\n", "utf-8")
    given = ("trace", "compare", tmp_path / "a.csv", tmp_path / "b.csv", "--columns", "pos_act_deg")
    assert "name its file with --out" in refused(*given)


def test_the_search_for_a_quick_stop_takes_no_speed_and_writes_no_report(tmp_path: Path) -> None:
    """A speed that is named and not heeded would be read as that of the certificate."""
    assert "leave out --speed" in refused("stops", "--find-quick", "--speed", "3")
    assert "leave out --out" in refused("stops", "--find-quick", "--out", tmp_path)


def test_a_quick_stop_that_the_gear_cannot_give_is_refused_before_anything_moves(tmp_path: Path) -> None:
    file = machine_file(tmp_path / "m.toml", {"virtual_axis.quick_dec_deg_s2": 8.0})
    answer = cli("move", "5", "--config", file)
    assert answer.code == 2
    assert "`gantryctl stops --find-quick`" in answer.err
    assert done("status", "--config", file, "--json").json["power_ups"] == 0


def test_a_plant_that_cannot_be_simulated_is_refused(tmp_path: Path) -> None:
    """What the rules let through, the stops of every command that moves find: a base of 1 kg m2 under 2e6."""
    file = machine_file(tmp_path / "m.toml", {"plant.base.inertia_kg_m2": 1.0})
    for command in (["move", "5"], ["stops"], ["stops", "--find-quick"], ["config", "check"]):
        assert "does not stay finite" in refused(*command, "--config", file)
