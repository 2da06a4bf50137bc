"""Commands that speak of a machine which is not running: they say what is, and none of them moves it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.machine import default_machine
from gantryctl.operation.store import StateStore
from gantryctl.program.alarms.table import all_codes
from support.command_line import cli, done, plant_truth


def rows(*arguments: object) -> dict[str, str]:
    """Lines of two columns as name and value."""
    found = {}
    for line in done(*arguments).out.splitlines():
        name, _, value = line.strip().partition("  ")
        found[name] = value.strip()
    return found


def test_status_of_a_new_machine(state: Path) -> None:
    text = done("status").out
    assert text.startswith("hust_gantry: power off, brake closed\n")
    found = rows("status")
    assert found["angle"] == "0.0000 deg (motor encoder)"
    assert found["encoder"] == "ok"
    assert found["last alarm"] == found["last result"] == "-"
    assert found["power-ups, moves"] == "0, 0"
    assert found["state kept in"] == str(state / "hust_gantry")
    assert found["note"] == "a new simulated machine, standing at 0 deg"


def test_status_after_a_move_and_after_a_refusal() -> None:
    done("move", "0.5")
    found = rows("status")
    assert found["last result"] == "done"
    assert found["power-ups, moves"] == "1, 1"
    assert found["travelled"] == "0.5 deg"
    cli("move", "200")
    assert rows("status")["last result"].startswith("refused: target 200.00 deg")
    assert rows("status")["power-ups, moves"] == "1, 1"


def test_looking_changes_nothing() -> None:
    done("move", "0.2")
    before = plant_truth()
    for command in (
        ["status"], ["alarms"], ["alarms", "--last"], ["encoder", "show"], ["retain", "show"], ["reset"],
        ["explain"], ["explain", "CTL-03"], ["config", "show"],
    ):  # fmt: skip
        first = done(*command)
        assert done(*command) == first
    assert plant_truth() == before


def alarmed(times: int) -> None:
    """Into the limit switch, by a wrong witness mark."""
    done("sim", "reset", "--angle", "181")
    done("encoder", "set-zero", "--angle", "0", "--witness", "wrong mark")
    for _ in range(times):
        assert cli("move", "3").code == 4
        done("reset")
        done("move", "0")


def test_alarms_are_listed_newest_first_and_say_what_holds_the_axis() -> None:
    assert done("alarms").out == "no alarms\n"
    alarmed(1)
    assert cli("move", "3").code == 4
    lines = done("alarms").out.splitlines()
    assert len(lines) == 4
    assert lines[0].endswith("(holds the axis: gantryctl reset)")
    assert lines[1].startswith("  LIM-03 STOP · ")
    # The one before has the same code, and was reset.
    assert lines[3].startswith("  LIM-03 STOP · ")
    assert "holds the axis" not in lines[2]
    assert "It still holds the axis: gantryctl reset, when its cause is removed." in done("why").out
    last = done("alarms", "--last").out.splitlines()
    assert last == lines[:2]
    assert rows("status")["last alarm"] == lines[1].strip()
    assert "stopped by alarm LIM-03; `gantryctl explain LIM-03`, then reset" in done("status").out
    assert done("reset").out.startswith("LIM-03 acknowledged by ")
    assert "holds the axis" not in done("alarms").out
    assert done("reset").out == "nothing to reset\n"


def test_an_alarm_that_says_not_to_reset_is_not_listed_with_reset() -> None:
    alarmed(1)
    assert cli("move", "3").code == 4
    machine = default_machine()
    text = "ENC-01 STOP · ... · Do not reset. Check encoder cable and plug, then call service."
    with StateStore(machine) as store:
        retained = store.load_retained()
        assert retained is not None
        last = replace(retained.alarms[-1], code="ENC-01", text=text)
        store.store_retained(replace(retained, error_stop="ENC-01", alarms=(*retained.alarms[:-1], last)))
    said = done("alarms", "--last").out
    assert "Do not reset" in said
    assert "(holds the axis: only service resets it)" in said
    assert "gantryctl reset" not in said
    assert "then reset" not in done("status").out.replace(text, "")
    told = done("why").out
    assert "It still holds the axis: only service resets it, when its cause is removed." in told
    assert "gantryctl reset" not in told


def test_explain_knows_every_code() -> None:
    listed = [line.split()[0] for line in done("explain").out.splitlines()]
    assert listed == [code for code, _, _ in all_codes()]
    for code in ("SYS-02", "SYS-03", "SYS-09", "ENC-09", "ENC-10", "ENC-11", "CFG-ENC-01"):
        page = done("explain", code).out
        assert page.startswith(code)
        assert "What to do" in page
        assert done("explain", code.lower()).out == page


def test_encoder_show_and_set_zero() -> None:
    assert rows("encoder", "show")["angle"] == "0.00000 deg"
    assert "464.5 deg below the travel" in rows("encoder", "show")["wrap margin"]
    said = done("encoder", "set-zero", "--angle", "12.5", "--witness", "laser, protocol 7").out
    assert said.endswith("the axis stands at 12.5 deg (laser, protocol 7)\n")
    found = rows("encoder", "show")
    assert float(found["angle"].split()[0]) == pytest.approx(12.5, abs=1e-4)
    assert found["witness"] == "laser, protocol 7"
    assert found["verdict"] == "ok"
    done("move", "--by", "-0.5")
    assert done("status", "--json").json["angle_deg"] == pytest.approx(12.0, abs=0.005)


def test_set_zero_moves_nothing_and_keeps_the_old_offset() -> None:
    done("sim", "reset")
    before, *_ = plant_truth()
    old = done("retain", "show", "--json").json["zero_offset_counts"]
    done("encoder", "set-zero", "--angle", "1", "--witness", "mark")
    kept = done("retain", "show", "--json").json
    assert kept["previous_offset_counts"] == old
    assert old - kept["zero_offset_counts"] == pytest.approx(4194304 * 1144 / 360.0, abs=1)
    assert plant_truth()[0] == before


def test_retain_show() -> None:
    assert done("retain", "show").out == "nothing is retained yet: the machine has never run\n"
    done("move", "0.5")
    found = rows("retain", "show")
    assert found["machine"] == "hust_gantry"
    assert found["moves"] == "1"
    assert found["travelled"].endswith(" deg")
    assert found["holding torque"].endswith(" N m")
    # The longest name, with a gap before its value.
    assert found["emergency brake energy"] == "0 J"


def test_sim_reset_puts_a_new_machine_there() -> None:
    done("move", "0.5")
    assert done("sim", "reset", "--angle", "-30").out == (
        "hust_gantry: a new simulated machine stands at -30 deg, brake closed\n"
    )
    assert done("status", "--json").json["angle_deg"] == pytest.approx(-30.0, abs=0.01)  # gears settle
    assert rows("status")["power-ups, moves"] == "0, 0"


@pytest.mark.parametrize("angle", ["186.9", "-186.9", "181", "-180.2"])
def test_beyond_the_travel_only_the_way_back_is_open(angle: str) -> None:
    done("sim", "reset", "--angle", angle)
    outward, inward = ("+", "-") if float(angle) > 0 else ("-", "+")
    before = plant_truth()
    assert cli("move", f"--by={outward}0.5").code == 2
    assert cli("jog", outward, "--for", "1").code == 2
    assert plant_truth() == before
    assert cli("move", f"--by={inward}0.5").code == 0
    assert abs(done("status", "--json").json["angle_deg"]) == pytest.approx(abs(float(angle)) - 0.5, abs=0.01)
