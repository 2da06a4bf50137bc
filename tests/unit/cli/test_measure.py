"""The attended chord test and the instrument commands on the command line."""

from __future__ import annotations

import io
import json
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from gantryctl.cli.engineering.measure import _report
from gantryctl.drives.virtual.side_channel import control
from gantryctl.engineering.accuracy.attended import report as attended_report
from gantryctl.engineering.accuracy.attended.session import ChordOrder
from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure
from gantryctl.engineering.comparison.variants import without_load_encoder
from gantryctl.engineering.instruments import Instrument, Reading, line_server
from gantryctl.engineering.instruments.line_server import LineServer
from gantryctl.engineering.report.head import Made
from gantryctl.engineering.report.origin import Origin
from gantryctl.errors import CommandRefused
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.machine.effective import to_toml
from support.command_line import cli
from support.command_line import machine_file as machine_with
from support.improved import improved_machine

pytestmark = pytest.mark.can

OUT_AND_BACK = chord_procedure("B", bases_deg=(0.0,), displacements_deg=(2.0,))
SHORT = replace(OUT_AND_BACK, stops=OUT_AND_BACK.stops[:5])
"""0, 2, 0, 0, -2 deg: two chords."""


@pytest.fixture
def machine_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A CAN machine with its virtual drive in this process, and a short procedure."""
    monkeypatch.setattr(ChordOrder, "made", lambda self: SHORT)
    machine = with_values(
        load_machine(configs_folder() / "hust_can.toml"), {"accuracy.dwell_s": 1.0, "accuracy.average_s": 0.5}
    )
    file = tmp_path / "machine.toml"
    file.write_text(to_toml(machine), encoding="utf-8")
    return file


def test_a_simulated_tracker_measures_a_can_machine(tmp_path: Path, machine_file: Path) -> None:
    out = tmp_path / "report"
    answer = cli(
        "accuracy", "measure", "--config", machine_file, "--instrument", "simulated", "--out", out, "--json"
    )
    assert answer.code == 0, answer.err
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert report == answer.json
    assert report["origin"] == "simulated"
    assert report["verdict"]["conformity"] == "pass"
    assert report["uncertainty"]["coverage_factor"] == 2.0
    measured, model = (report["tables"][name]["rows"] for name in ("measured", "simulated"))
    for row, other in zip(measured, model, strict=True):
        # The drive behind the bus has the plant of the model; the tracker errs by some 0.0005 deg on a chord.
        assert row["errors_deg"][1] == pytest.approx(other["errors_deg"][1], abs=0.003)
    assert len(json.loads((out / "readings.json").read_text(encoding="utf-8"))["readings"]) == 5
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "expanded uncertainty of A, k = 2" in page
    assert "on the right: simulated" in page


def test_the_encoder_on_the_ring_measures_the_load(tmp_path: Path, machine_file: Path) -> None:
    order = ("accuracy", "measure", "--config", machine_file, "--instrument", "load-encoder")
    without = cli(*order, "--out", tmp_path / "none")
    assert without.code == 2
    assert "no encoder on the ring: [can.load_encoder] source" in without.err
    ring = {"can.load_encoder.source": "node", "can.load_encoder.node": 4}
    machine_file.write_text(to_toml(with_values(load_machine(machine_file), ring)), encoding="utf-8")
    nameless = cli(*order, "--out", tmp_path / "none")
    assert nameless.code == 2
    assert (
        "--uncertainty-deg is missing: the standard uncertainty of a reading by load-encoder" in nameless.err
    )
    answer = cli(*order, "--uncertainty-deg", 0.0005, "--out", tmp_path / "report", "--json")
    assert answer.code == 0, answer.err
    # The virtual drive is in this process: nobody shall take this for a measurement.
    assert answer.json["origin"] == "simulated"
    assert any("rocking of the base" in warning for warning in answer.json["warnings"])
    measured, model = (answer.json["tables"][name]["rows"] for name in ("measured", "simulated"))
    for row, other in zip(measured, model, strict=True):
        # Scale error of the ring on 2 deg, rocking of the base: some 0.0005 deg.
        assert row["errors_deg"][1] == pytest.approx(other["errors_deg"][1], abs=0.001)


def test_a_person_types_the_readings_and_may_be_interrupted(
    tmp_path: Path, machine_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, order = (
        tmp_path / "report",
        ("accuracy", "measure", "--config", machine_file, "--uncertainty-deg", 0.0005),
    )
    monkeypatch.setattr("sys.stdin", io.StringIO("12.0\n14,001\n"))
    answer = cli(*order, "--out", out)
    assert answer.code == 3
    assert answer.err.endswith("no reading: the input has ended\n")
    # 12.0 was the first base; the axis stands at 2 deg, whose reading is asked for again.
    monkeypatch.setattr("sys.stdin", io.StringIO("14.0015\nnonsense\n11.9995\n12.0\n10.0005\n"))
    answer = cli(*order, "--out", out)
    assert answer.code == 0, answer.err
    assert "2 readings are there" in answer.out
    assert "reads 2 deg again: has the instrument moved?" in answer.out
    assert "'nonsense' is no angle in deg · asked again" in answer.out
    assert "readings: measured, read by " in answer.out
    assert "PASS: A as measured" in answer.out


def test_a_reading_by_hand_needs_its_uncertainty(machine_file: Path) -> None:
    answer = cli("accuracy", "measure", "--config", machine_file)
    assert answer.code == 2
    assert "--uncertainty-deg is missing" in answer.err


def test_nothing_moves_before_the_instrument_answers(
    machine_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = cli("accuracy", "measure", "--config", machine_file, "--instrument", "tcp:127.0.0.1:1")
    assert answer.code == 3
    assert "instrument tcp:127.0.0.1:1: Connection refused" in answer.err
    assert "stop 1" not in answer.out


def test_one_reading_of_an_instrument() -> None:
    class Level:
        name = "level"

        def read(self, time_s: float) -> Reading:
            return Reading(1.25, 0.0002)

    with LineServer(Level(), lambda: 0.0) as server:
        answer = cli("instrument", "read", f"tcp:127.0.0.1:{server.port}", "--json")
    assert answer.json == {"instrument": "level", "angle_deg": 1.25, "uncertainty_deg": 0.0002}


def test_a_simulated_tracker_needs_a_virtual_drive(tmp_path: Path) -> None:
    answer = cli("instrument", "sim", "--control", tmp_path / "none.sock")
    assert answer.code == 3
    assert "no virtual drive listens" in answer.err


def test_a_served_tracker_has_the_radius_and_the_noise_of_the_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0.5 mm of noise on 3 m are 0.00955 deg; the other errors of a tracker together are a tenth of that."""

    class Served:
        def __init__(self, instrument: Instrument, *_: object) -> None:
            seen.append(instrument)

        def __enter__(self) -> Served:
            raise CommandRefused("seen")

        def __exit__(self, *_: object) -> None: ...

    seen: list[Instrument] = []
    drive = SimpleNamespace(ask=lambda _: {"pos_load_rad": 0.5, "time_s": 0.0})
    monkeypatch.setattr(control, "ControlClient", lambda _: nullcontext(drive))
    monkeypatch.setattr(line_server, "LineServer", Served)
    file = machine_with(
        tmp_path / "m.toml", {"accuracy.chord_radius_m": 3.0, "accuracy.tracker_noise_um": 500.0}
    )
    assert cli("instrument", "sim", "--config", file, "--control", tmp_path / "c.sock").code == 2
    assert seen[0].read(0.0).uncertainty_deg == pytest.approx(0.00955, rel=0.01)


@pytest.mark.parametrize(
    ("place", "active", "origin", "told"),
    [
        ("hand", True, Origin.MEASURED, ()),
        ("simulated", True, Origin.SIMULATED, ()),
        ("load-encoder", False, Origin.SIMULATED, ("its own errors",)),
        # What the position loop is closed with shows what that makes of the axis.
        ("load-encoder", True, Origin.SIMULATED, ("its own errors", "the position loop goes through it")),
    ],
)
def test_a_report_says_what_its_readings_are_of(
    monkeypatch: pytest.MonkeyPatch, place: str, active: bool, origin: Origin, told: tuple[str, ...]
) -> None:
    """A machine in this process: what its own encoder on the ring reads is of a model too."""
    monkeypatch.setattr(attended_report, "session_report", lambda *given: given)
    machine = improved_machine() if active else without_load_encoder(improved_machine())
    session: Any = None
    _, _, found, _, _, notes = cast(Any, _report(machine, session, place, Made("d", "1", "c")))
    assert found is origin
    assert len(notes) == len(told)
    assert all(words in note for words, note in zip(told, notes, strict=True))
