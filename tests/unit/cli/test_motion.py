"""`gantryctl move` and `jog`: what a person and a pipe see, what is kept, how a run may end."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from gantryctl.cli.axis.display import Display
from gantryctl.errors import AlarmStop
from gantryctl.machine import default_machine
from gantryctl.operation.client import Snapshot
from gantryctl.operation.store import StateStore
from gantryctl.trace.reader import read_trace
from support.command_line import Terminal, cli, done, machine_file, plant_truth


def angle() -> float:
    found = done("status", "--json").json["angle_deg"]
    assert isinstance(found, float)
    return found


def test_a_move_in_a_pipe_is_a_plain_log_with_a_summary() -> None:
    lines = done("move", "5").out.splitlines()
    assert "\r" not in "".join(lines)
    assert lines[0] == "a new simulated machine, standing at 0 deg"
    assert lines[1].split()[:2] == ["0.1", "s"]
    assert lines[1].endswith("disabled")
    assert "discrete motion" in lines[2]
    assert lines[2].endswith("s left")
    assert lines[3].startswith("done: 0.0000 -> 5.0000 deg, 7.1")
    assert lines[3].endswith("peak 1.40 deg/s; 1 r/min needs at least 91.5 deg")
    names = ["following error", "speed error", "largest torque", "in position", "trace"]
    assert [line[2:20].strip() for line in lines[4:]] == names
    assert "motor side" in lines[4]
    assert "load side" in lines[4]
    assert lines[6].endswith("N m of 385 N m")
    assert read_trace(Path(lines[8].split()[-1])).complete


def test_a_long_move_says_no_hint_where_the_speed_is_reached() -> None:
    done("sim", "reset", "--angle", "-46")
    (line,) = (line for line in done("move", "46").out.splitlines() if line.startswith("done:"))
    assert line.endswith("peak 6.00 deg/s")


def test_a_move_to_where_it_stands_is_done_and_gives_no_hint() -> None:
    done("move", "0.5")
    (line,) = (line for line in done("move", "0.5").out.splitlines() if line.startswith("done:"))
    assert line.endswith("deg/s")


def test_on_a_terminal_one_line_lives_and_the_summary_follows() -> None:
    out = cli("move", "2", out=Terminal()).out
    first, live, *summary = out.split("\n")
    assert first.startswith("a new simulated machine")
    shown = live.split("\r")[1:]
    assert len(shown) > 30, "every 0.1 s of axis time"
    assert {len(line) for line in shown} == {79}, "each covers the one before, and none breaks the line"
    assert "disabled" in shown[-1], "powered down again"
    moving = [line for line in shown if "discrete motion" in line]
    assert all(line.split()[-2:] == ["s", "left"] for line in moving)
    assert summary[0].startswith("done: ")


def test_moves_follow_each_other_from_power_cycle_to_power_cycle() -> None:
    done("move", "3")
    done("move", "--by", "-5.5")
    assert angle() == pytest.approx(-2.5, abs=0.005)  # the in-position window
    done("move", "-1")
    assert angle() == pytest.approx(-1.0, abs=0.005)


def test_fresh_neither_reads_nor_writes_the_state(state: Path) -> None:
    done("move", "0.5")
    before = plant_truth()
    answer = done("move", "--by", "0.25", "--fresh", "--json").json
    assert answer["summary"]["end_deg"] == pytest.approx(0.25, abs=0.005)
    assert answer["trace"] is None
    assert plant_truth() == before


def test_the_long_way_is_said() -> None:
    done("sim", "reset", "--angle", "91")
    assert "182 deg the long way: cable" in done("move", "-91").out


def test_json_says_the_same_in_numbers() -> None:
    answer = done("move", "1", "--speed", "1", "--json").json
    assert (answer["exit_code"], answer["result"], answer["error"]) == (0, "done", None)
    assert answer["alarms"] == []
    assert answer["summary"]["start_deg"] == pytest.approx(0.0, abs=0.005)
    assert answer["summary"]["end_deg"] == pytest.approx(1.0, abs=0.005)
    # 0.3934 deg/s2 over 1 deg: sqrt(0.3934) deg/s, in two ramps of 1.59 s
    assert answer["summary"]["peak_deg_s"] == pytest.approx(0.627, abs=0.01)
    assert answer["summary"]["duration_s"] == pytest.approx(2.0 / 0.627, abs=0.1)
    assert read_trace(Path(answer["trace"])).metadata["machine"] == "hust_gantry"


def test_json_of_a_refusal_is_json_too_and_the_reason_is_on_standard_error() -> None:
    answer = cli("move", "200", "--json")
    assert answer.code == answer.json["exit_code"] == 2
    assert answer.json["summary"] is None
    assert answer.err == f"error: {answer.json['error']}\n"


def test_out_gets_the_trace_and_no_trace_writes_none(tmp_path: Path, state: Path) -> None:
    done("move", "0.2", "--out", tmp_path / "runs" / "one")
    assert [file.suffix for file in (tmp_path / "runs" / "one").iterdir()] == [".parquet"]
    done("move", "0.1", "--no-trace")
    assert not (state / "hust_gantry" / "traces").exists()


@pytest.mark.parametrize("target", [["1"], ["--by", "2"]])
def test_the_override_makes_it_slower(target: list[str]) -> None:
    done("sim", "reset", "--angle", "-1")
    answer = done("move", *target, "--speed", "6", "--override", "10", "--json").json
    assert answer["summary"]["peak_deg_s"] == pytest.approx(0.6)


@pytest.mark.parametrize(("key", "sign"), [("+", 1.0), ("-", -1.0)])
def test_a_jog_runs_while_the_key_is_held(key: str, sign: float) -> None:
    answer = done("jog", key, "--for", "3", "--json").json
    assert answer["result"] == "done"
    assert answer["settled_s"] is None
    assert answer["summary"]["peak_deg_s"] == pytest.approx(0.6)
    assert sign * angle() > 1.0


# --- how a run may end
# ------------------------------------------------------------------------------------------------


def test_not_in_position_is_exit_code_1(tmp_path: Path) -> None:
    """A weak loop creeps towards the target for longer than the tolerance time."""
    weak = {"control.kpp_per_s": 0.5, "control.kvf": 0.98, "monitors.in_position_window_deg": 1e-4}
    answer = cli("move", "0.5", "--config", machine_file(tmp_path / "weak.toml", weak))
    assert answer.code == 1
    assert "not in position: " in answer.out
    assert "note: CTL-11 WARNING" in answer.out


def into_the_limit_switch() -> None:
    """At 181 deg in truth, by a wrong witness mark at 0: two degrees on, the switch of +182 deg opens."""
    done("sim", "reset", "--angle", "181")
    done("encoder", "set-zero", "--angle", "0", "--witness", "wrong mark")


def test_an_alarm_is_exit_code_4_and_holds_the_axis_until_reset() -> None:
    into_the_limit_switch()
    answer = cli("move", "3")
    assert answer.code == 4
    assert "stopped by an alarm: 0.0000 -> 1." in answer.out
    assert answer.err.startswith("error: LIM-03 STOP · The plus limit switch opened at 1.")
    assert "Quick stop, at rest after" in answer.err
    before = plant_truth()
    for command in (["move", "0"], ["jog", "-", "--for", "1"]):
        again = cli(*command)
        assert again.code == 2
        assert "LIM-03 stopped the axis in an earlier run and is not acknowledged" in again.err
    assert plant_truth() == before
    assert done("reset").out.startswith("LIM-03 acknowledged")
    done("move", "0")
    assert cli("move", "0.5").code == 0


def test_an_alarm_as_json() -> None:
    into_the_limit_switch()
    answer = cli("move", "3", "--json")
    assert answer.code == answer.json["exit_code"] == 4
    assert answer.json["result"] is None
    assert answer.json["error"].startswith("LIM-03 STOP")
    assert [text[:6] for text in answer.json["alarms"]] == ["LIM-03"]
    assert answer.json["summary"]["end_deg"] < 3.0


def test_a_state_directory_in_use_is_exit_code_3() -> None:
    with StateStore(default_machine()):
        for command in (["move", "1"], ["status"], ["reset"], ["sim", "reset"], ["encoder", "show"]):
            answer = cli(*command)
            assert answer.code == 3
            assert "is in use by process" in answer.err
            assert answer.err.count("\n") == 1
        assert cli("move", "0.1", "--fresh").code == 0


@pytest.mark.parametrize("file", ["plant.json", "retain.a.json"])
def test_a_damaged_state_is_told_and_nothing_moves(state: Path, file: str) -> None:
    done("move", "0.2")
    if file == "plant.json":
        (state / "hust_gantry" / file).write_text("{")
        answer = cli("move", "1")
        assert (answer.code, answer.out) == (3, "")
        assert "`gantryctl sim reset` makes a new one" in answer.err
        done("sim", "reset")
        done("move", "0.1")
    else:
        for copy in (state / "hust_gantry").glob("retain.*"):
            copy.write_text("{")
        assert cli("move", "1").code == 3


# --- stops by whoever runs it
# -----------------------------------------------------------------------------------------


def interrupted(
    monkeypatch: pytest.MonkeyPatch, times: int, at_deg: float, number: signal.Signals = signal.SIGINT
) -> None:
    """Ctrl-C comes this often, from an angle on, once every look at the display."""
    left = [times]
    show = Display.show

    def shown(self: Display, snapshot: Snapshot) -> None:
        show(self, snapshot)
        if left[0] and snapshot.angle_deg >= at_deg:
            left[0] -= 1
            signal.raise_signal(number)

    monkeypatch.setattr(Display, "show", shown)


@pytest.mark.parametrize("command", [["move", "60"], ["jog", "+", "--for", "60", "--speed", "3"]])
def test_ctrl_c_stops_on_the_ramp(monkeypatch: pytest.MonkeyPatch, command: list[str]) -> None:
    interrupted(monkeypatch, 1, at_deg=3.0)
    answer = cli(*command)
    assert (answer.code, answer.err) == (1, "")
    assert "stopped by the operator: 0.0000 -> " in answer.out
    assert 3.0 < angle() < 6.0  # 1.5 to 3 deg/s at 2 deg/s2, rounded by the jerk
    assert done("status", "--json").json["condition"] == "power off, brake closed"


def test_a_lost_terminal_is_told_as_that(monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted(monkeypatch, 1, at_deg=1.0, number=signal.SIGHUP)
    answer = cli("move", "10")
    assert answer.code == 1
    assert "stopped: its terminal is gone: 0.0000 -> " in answer.out
    assert done("status", "--json").json["last_result"] == "stopped: its terminal is gone"


def test_a_terminal_that_goes_while_the_axis_stops_is_not_why_it_stops(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Ctrl-C, and the terminal goes behind it: a quick stop, by the operator."""
    numbers = [signal.SIGINT, signal.SIGHUP]
    show = Display.show

    def shown(self: Display, snapshot: Snapshot) -> None:
        show(self, snapshot)
        if numbers and (snapshot.angle_deg or 0.0) >= 1.0:
            signal.raise_signal(numbers.pop(0))

    monkeypatch.setattr(Display, "show", shown)
    assert cli("move", "10").code == 4
    assert "Quick stop by the operator" in done("status", "--json").json["last_result"]


def test_ctrl_c_twice_is_a_quick_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted(monkeypatch, 2, at_deg=3.0)
    answer = cli("move", "60")
    assert answer.code == 4
    assert answer.err.startswith("error: INT-06 STOP · Quick stop by the operator")
    assert 3.0 < angle() < 4.5


def test_after_the_run_ctrl_c_is_python_s_again() -> None:
    before = signal.getsignal(signal.SIGINT)
    done("move", "0.1")
    assert signal.getsignal(signal.SIGINT) is before


# --- custom programs
# --------------------------------------------------------------------------------------------

PROGRAMS = """
import sys
from gantryctl import AxisProgram
from gantryctl.program import GantryProgram

class Good(GantryProgram):
    pass

class Leaves(GantryProgram):
    def logic(self, image):
        super().logic(image)
        if image.time_s > 1.0:
            sys.exit(0)

class Broken(GantryProgram):
    def logic(self, image):
        self.nothing()

class NotMade(GantryProgram):
    def __init__(self, axis):
        raise ValueError("no licence")

class NoBase(GantryProgram):
    def __init__(self, axis):
        pass

class Idle(AxisProgram):
    pass

other = 3
"""


@pytest.fixture
def programs() -> str:
    Path("programs.py").write_text(PROGRAMS)
    return "programs.py"


def test_a_program_of_one_s_own_moves(programs: str) -> None:
    done("move", "0.2", "--program", f"{programs}:Good")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("NotMade", "NotMade(axis) failed: ValueError: no licence"),
        ("NoBase", "NoBase.__init__ must call super().__init__(axis)"),
        ("other", "has no class other derived from gantryctl.AxisProgram"),
        ("Missing", "has no class Missing"),
    ],
)
def test_a_program_that_cannot_be_made_is_refused(programs: str, name: str, says: str) -> None:
    answer = cli("move", "0.2", "--program", f"{programs}:{name}")
    assert answer.code == 2
    assert says in answer.err
    assert answer.err.count("\n") == 1


def test_a_file_that_is_no_program_is_refused() -> None:
    Path("bad.py").write_text("1 +")
    Path("gone.py").write_text("import sys; sys.exit(0)")
    for file, says in (("bad.py", "SyntaxError"), ("gone.py", "SystemExit")):
        answer = cli("move", "0.2", "--program", f"{file}:Mine")
        assert answer.code == 2
        assert says in answer.err


@pytest.mark.parametrize(("name", "code"), [("Leaves", "SYS-09"), ("Broken", "SYS-09"), ("Idle", "SYS-10")])
def test_a_program_that_fails_is_an_alarm(programs: str, name: str, code: str) -> None:
    answer = cli("move", "2", "--program", f"{programs}:{name}", "--json")
    assert answer.code == answer.json["exit_code"] == AlarmStop.exit_code
    assert answer.json["error"].startswith(f"{code} STOP")
    assert done("status", "--json").json["error_stop"] == code
    assert cli("move", "2", "--program", f"{programs}:{name}").code == 2
    assert "acknowledged" in done("reset").out
    assert "nan" not in cli("move", "2", "--program", f"{programs}:{name}").out


# --- determinism
# ------------------------------------------------------------------------------------------------------


def trace_of(*arguments: object) -> str:
    file = cli(*arguments, "--json").json["trace"]
    return read_trace(Path(file)).hash()


def test_the_same_run_has_the_same_trace_bit_for_bit(tmp_path: Path) -> None:
    for command in (["move", "3"], ["jog", "-", "--for", "2"]):
        runs = [trace_of(*command, "--fresh", "--seed", "1", "--out", tmp_path / str(k)) for k in range(2)]
        assert runs[0] == runs[1]
    assert trace_of("move", "3", "--fresh", "--out", tmp_path) != trace_of(
        "move", "3.001", "--fresh", "--out", tmp_path
    )


def test_after_a_reset_the_same_commands_give_the_same_traces_again() -> None:
    def day() -> list[str]:
        done("sim", "reset")
        return [trace_of("move", "1"), trace_of("move", "--by", "-0.5"), trace_of("jog", "+", "--for", "1")]

    assert day() == day()


def test_the_seed_is_kept_with_the_trace() -> None:
    file = done("move", "0.1", "--seed", "7", "--json").json["trace"]
    assert done("trace", "show", file, "--json").json["metadata"]["seed"] == 7
