"""What commands make of results that are written down by hand: exit codes, figures, and what they pass on."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from gantryctl.cli.axis import service_state
from gantryctl.cli.axis.local_run import TRACES_KEPT, trace_path
from gantryctl.cli.axis.state import _quick_stop
from gantryctl.cli.drive import drive, gains
from gantryctl.cli.drive.can import _data, _print
from gantryctl.cli.engineering import analyse, compare
from gantryctl.cli.engineering.accuracy_end import exit_code
from gantryctl.cli.engineering.at_the_load import SIMULATED_CERTIFICATE, certificate_of
from gantryctl.cli.engineering.experiment import machine_under_test
from gantryctl.cli.engineering.identify import _next_version
from gantryctl.drives.canopen.setup import parameters
from gantryctl.drives.canopen.setup.survey import Found
from gantryctl.engineering import stops
from gantryctl.engineering.accuracy import speed_test
from gantryctl.engineering.accuracy.report import data, text
from gantryctl.engineering.accuracy.verdict import Conformity
from gantryctl.engineering.analysis import study
from gantryctl.engineering.analysis.measured.response import axis_time_s, conditions
from gantryctl.engineering.comparison import drift_file, drift_report, drift_text, on_bus
from gantryctl.engineering.fastest import search
from gantryctl.errors import CommandRefused, ConfigError, UsageError
from gantryctl.image import DriveState
from gantryctl.machine import configs_folder, default_machine
from gantryctl.operation.ledger import judging
from gantryctl.runtime import Retained
from gantryctl.trace.frames.files import alarms_file
from support.command_line import cli, machine_file

CAN = configs_folder() / "hust_can.toml"
HUST = configs_folder() / "hust_gantry.toml"


@pytest.mark.parametrize(
    ("motor", "load", "code"), [(True, True, 0), (True, False, 1), (False, True, 1), (True, None, 0)]
)
def test_a_loop_is_stable_where_the_whole_of_it_is(
    monkeypatch: pytest.MonkeyPatch, motor: bool, load: bool | None, code: int
) -> None:
    side = None if load is None else SimpleNamespace(stable=load)
    monkeypatch.setattr(study, "study", lambda *_: SimpleNamespace(stable=motor, load_side=side))
    monkeypatch.setattr(analyse, "_show", lambda *_: None)
    assert cli("analyse", "--config", HUST).code == code


@pytest.mark.parametrize(("passed", "code"), [(True, 0), (False, 1), (None, 1)])
def test_a_drift_that_is_not_shown_to_pass_has_not_passed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, passed: bool | None, code: int
) -> None:
    file = tmp_path / "drift.toml"
    file.touch()
    found = SimpleNamespace(verdict=SimpleNamespace(passed=passed))
    drift = SimpleNamespace(on_top=lambda _: None)
    monkeypatch.setattr(drift_file, "load_drift", lambda *_: drift)
    monkeypatch.setattr(drift_report, "runs_of", lambda *_: 1)
    monkeypatch.setattr(drift_report, "drift_report", lambda *_, **__: found)
    monkeypatch.setattr(drift_text, "drift_data", lambda _: {})
    monkeypatch.setattr(compare, "_machine", lambda _: default_machine())
    assert cli("compare", HUST, HUST, "--drift", file, "--json").code == code


@pytest.mark.parametrize(("passed", "code"), [(True, 0), (False, 1), (None, 1)])
def test_a_comparison_on_a_bus_that_is_not_shown_to_pass_has_not_passed(
    monkeypatch: pytest.MonkeyPatch, passed: bool | None, code: int
) -> None:
    found = SimpleNamespace(instrument="", verdict=SimpleNamespace(passed=passed), rows=())
    monkeypatch.setattr(on_bus, "compare_on_bus", lambda *_, **__: found)
    monkeypatch.setattr(data, "verdict_data", lambda _: {})
    monkeypatch.setattr(stops, "check_quick_stop", lambda _: None)
    assert cli("compare", CAN, CAN, "--json").code == code


@pytest.mark.parametrize(
    ("place", "told"), [("simulated", SIMULATED_CERTIFICATE), ("hand", "DKD 1"), (None, "DKD 1")]
)
def test_a_simulated_tracker_has_no_certificate(place: str | None, told: str) -> None:
    assert certificate_of(place, "DKD 1") == told


@pytest.mark.parametrize(("passed", "code"), [((True, True), 0), ((True, False), 1), ((False, False), 1)])
def test_a_speed_test_passes_with_all_of_its_speeds(
    monkeypatch: pytest.MonkeyPatch, passed: tuple[bool, ...], code: int
) -> None:
    monkeypatch.setattr(
        speed_test, "speed_test", lambda *_: [SimpleNamespace(passed=each) for each in passed]
    )
    monkeypatch.setattr(text, "speed_lines", lambda _: "")
    assert cli("speed-test", "--config", HUST).code == code


def test_the_fastest_profile_keeps_the_rated_torques(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of motor and reducer, N m and kN m: what comes again and again, not what they bear for a moment."""
    seen: list[search.Limits] = []

    def searched(_machine: object, _ends: object, limits: list[search.Limits], _ramps: object) -> None:
        seen.extend(limits)
        raise CommandRefused("seen")

    monkeypatch.setattr(search, "fastest_moves", searched)
    assert cli("profile", "--base-um", "50", "--after-um", "20", "--config", HUST).code == 2
    machine = default_machine()
    assert [tuple(each) for each in seen] == [
        (50.0, 20.0, machine.motor.torque_rated_nm, pytest.approx(machine.reducer.torque_rated_nm / 1000.0))
    ]


def test_an_axis_that_cannot_be_stopped_is_not_excited(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_: object) -> None:
        raise ConfigError(["no quick stop"])

    monkeypatch.setattr(stops, "check_quick_stop", refused)
    with pytest.raises(ConfigError, match="no quick stop"):
        machine_under_test(CAN, "identify")


def test_a_drive_that_nobody_may_accept_is_not_usable(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    eds = tmp_path / "drive.eds"
    assert cli("drive", "sim", "--write-eds", eds).code == 0
    assert cli("eds", "check", eds).code == 0
    monkeypatch.setattr(judging, "impossible", lambda rows: list(rows)[:1])
    assert cli("eds", "check", eds).code == 1
    assert cli("eds", "check", eds, "--json").code == 1


def test_a_drive_that_did_not_take_every_value_is_not_restored(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file = tmp_path / "drive.json"
    file.write_text(
        '{"drive": "a drive", "values": {"6085:00": "0000", "6086:00": "0000"}}', encoding="utf-8"
    )
    monkeypatch.setattr(drive, "drive_node", lambda _: nullcontext((None, None, None)))
    monkeypatch.setattr(parameters, "restore", lambda *_: ["6085:00 is refused"])
    answer = cli("drive", "restore", "--yes", file)
    assert answer.code == 1
    assert answer.out == "! 6085:00 is refused\n1 of 2 values are in the drive\n"


def test_a_gain_at_the_motor_is_that_in_amperes_times_its_torque_constant() -> None:
    reading = SimpleNamespace(
        name="kp", gain=SimpleNamespace(object="30A2:01", unit="uA s/rad"), value=20_000, si=0.02
    )
    assert gains._row(cast(Any, reading), 3.725)["at_the_motor"] == pytest.approx(0.0745)


@pytest.mark.parametrize(
    ("promised", "words"),
    [((1, 2), "belongs to it"), ((1, 3), "is of another device"), ((4, 2), "is of another device")],
)
def test_an_eds_belongs_to_its_vendor_and_product(promised: tuple[int, int], words: str) -> None:
    node = SimpleNamespace(
        node=2,
        nmt="",
        identity=SimpleNamespace(vendor=1, product=2, _asdict=dict),
        modes=None,
        state=None,
        remarks=(),
    )
    assert _data(cast(Any, node), promised)["eds"] == f"EDS {words}"


@pytest.mark.parametrize(
    ("modes", "words"), [(0x181, "181h, CSV"), (0x81, "81h, no CSV"), (0x100, "100h, CSV")]
)
def test_bit_8_of_the_modes_is_cyclic_velocity(
    modes: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    _print(Found(2, "OPERATIONAL", None, modes, DriveState.SWITCH_ON_DISABLED, ()), None)
    assert f"modes {words}\n" in capsys.readouterr().out


def test_times_of_a_log_count_from_its_first_alarm(tmp_path: Path) -> None:
    """Emergencies of node 2 at 5.5 s and 7.5 s, alarms at 6 s and 8 s."""
    log = tmp_path / "bus-frozen.log"
    log.write_text("".join(f"({at}.500000) can0 082#1023000000000000\n" for at in (5, 7)), encoding="utf-8")
    alarms_file(log).write_text(
        '{"alarms": [{"code": "DRV-01", "time_s": 6.0}, {"code": "INT-01", "time_s": 8.0}]}', encoding="utf-8"
    )
    told = cli("can", "log", log, "--json").json
    assert [row["time_s"] for row in told["alarms"]] == [0.0, 2.0]
    assert [row["time_s"] for row in told["frames"]] == pytest.approx([-0.5, 1.5])


def test_one_machine_file_is_compared_with_the_reference_gantry(tmp_path: Path) -> None:
    """As what it was made from: its own value stands behind the arrow."""
    file = machine_file(tmp_path / "m.toml", {"control.kvf": 0.9})
    assert "[control] kvf: 1.0 -> 0.9" in cli("config", "diff", file).out.splitlines()


def test_status_tells_the_quick_stop_that_the_axis_has() -> None:
    """6 deg/s at 4 deg/s2 take 6^2 / (2 x 4) = 4.5 deg; the ramp of the file may be another."""
    found = cast(Any, SimpleNamespace(quick_dec_deg_s2=4.0))
    assert default_machine().speed.setting_max_deg_s == 6.0
    assert _quick_stop(default_machine(), found) == "4.50 deg from 6 deg/s at 4 deg/s2"


def test_the_way_of_an_axis_in_service_is_told_in_degrees(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = Retained("m", "h", travelled_rad=6.283185307)
    tags = {
        "machine": "m", "axis_state": "disabled", "pos_act_deg": 1.0, "position_valid": True, "alarms": [],
        "quick_dec_deg_s2": 2.0, "config_hash": "h", "alarm_history": [],
    }  # fmt: skip
    monkeypatch.setattr(service_state, "ServiceLink", lambda _: nullcontext(SimpleNamespace(tags=tags)))
    monkeypatch.setattr(service_state, "RetainedMemory", lambda _: SimpleNamespace(load=lambda: kept))
    monkeypatch.setattr(service_state, "_brake_words", lambda *_: "")
    monkeypatch.setattr(service_state, "ledger_shown", lambda *_: ())
    assert service_state.service_status(default_machine())[0].travelled_deg == pytest.approx(360.0)


def test_the_oldest_recordings_make_room(tmp_path: Path) -> None:
    store = cast(Any, SimpleNamespace(traces=tmp_path))
    for number in range(1, TRACES_KEPT + 4):
        (tmp_path / f"move-{number:06d}-20260301T100000000.parquet").touch()
    assert trace_path(store, None, "move") is not None
    left = sorted(int(each.name.split("-")[1]) for each in tmp_path.glob("*.parquet"))
    # With the new one as many as are kept.
    assert left == list(range(5, TRACES_KEPT + 4))


def test_limits_are_json_where_json_is_asked_for() -> None:
    found = cli("size", "--limits", "--json").json
    assert found["machine_values"]["speed.setting_max_deg_s"] == 6.0
    assert found["sheet"] == "hust_gantry"


def test_an_eds_of_another_drive_than_was_named_is_not_tried(tmp_path: Path) -> None:
    eds = tmp_path / "drive.eds"
    assert cli("drive", "sim", "--write-eds", eds).code == 0
    told = cli("drive", "field", "--objects", eds, "--drive", "Nobody 7")
    assert told.code in (2, 3), told
    assert "there is no drive 'Nobody 7'" in told.err


def test_an_axis_turns_no_faster_than_it_may_while_it_is_measured() -> None:
    """Three times 3 + 176 s; half of 180 s x 0.3 deg/s back, 27 deg at 6 deg/s, and a ramp of 6 / 0.3934 s.

    The 180 s: 11 periods of 16 s, 3 s of calm, 0.3 / 0.3934 s of ramp.
    """
    machine = default_machine()
    assert [how.vel_deg_s for how in conditions(machine)] == [0.0, 0.0, 0.3]
    assert axis_time_s(machine, conditions(machine)) == pytest.approx(537.0 + 4.49 + 15.25, abs=0.1)
    speed = machine.speed.model_copy(update={"setting_max_deg_s": 0.2})
    slow = conditions(machine.model_copy(update={"speed": speed}))
    assert [how.vel_deg_s for how in slow] == [0.0, 0.0, 0.2]


def test_a_calibration_that_is_replaced_is_counted_on(tmp_path: Path) -> None:
    file = tmp_path / "a.calibration.toml"
    assert [_next_version(file, force) for force in (False, True)] == [1, 1]
    file.write_text("[origin]\nversion = 4\n", encoding="utf-8")
    assert _next_version(file, force=True) == 5
    with pytest.raises(UsageError, match="exists already"):
        _next_version(file, force=False)
    file.write_text("[speed]\n", encoding="utf-8")
    with pytest.raises(UsageError, match="is no calibration file"):
        _next_version(file, force=True)


@pytest.mark.parametrize(
    ("found", "speed", "code"),
    [
        (Conformity.PASS, None, 0), (Conformity.PASS, True, 0), (Conformity.PASS, False, 1),
        (Conformity.NOT_JUDGED, None, 0), (Conformity.NOT_JUDGED, False, 1),
        (Conformity.UNDECIDED, None, 1), (Conformity.UNDECIDED, True, 1), (Conformity.FAIL, True, 1),
    ],
)  # fmt: skip
def test_what_is_not_shown_to_be_met_is_exit_code_1(found: Conformity, speed: bool | None, code: int) -> None:
    report = SimpleNamespace(verdict=SimpleNamespace(conformity=found), speed_passed=speed)
    assert exit_code(cast(Any, report)) == code
