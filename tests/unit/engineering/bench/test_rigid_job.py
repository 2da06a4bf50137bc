"""Every program does the same job, and one that does not is found out. One second of the job; no time is measured."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gantryctl.engineering.bench.peers import plain_c
from gantryctl.engineering.bench.peers.compare import WrongJob, compare_peers, peer_figures
from gantryctl.engineering.bench.peers.table import OWN, PEERS, Peer
from gantryctl.engineering.bench.python_loop import rigid_job
from gantryctl.engineering.bench.rigid import (
    CYCLES,
    SCAN_S,
    TOLERANCE_DEG,
    Run,
    Timed,
    acceleration,
    deviation_deg,
    position_law,
    reference,
    same_job,
    set_point,
    speed_loop,
)

BY_NAME = {peer.name: peer for peer in PEERS}


def test_the_reference_is_tight() -> None:
    # Halving the step changes it by rounding only: 1e-13 rad over 12 s.
    for a, b in zip(reference(3), reference(3, 2), strict=True):
        assert a == pytest.approx(b, abs=1e-11)


# The others need the extra [bench].
@pytest.mark.parametrize("name", [peer.name for peer in PEERS if not peer.missing()])
def test_a_peer_does_the_job(name: str, tmp_path: Path) -> None:
    # Scipy's is a second opinion on the reference: another integrator with an error control of its own.
    peer = BY_NAME[name]._replace(seconds=1)
    assert same_job(peer.prepare(tmp_path)().angles, reference(1), 1)


def late_law(seconds: int) -> list[float]:
    """The same loop with the position law one scan late."""
    pos = vel = last = integral = held = 0.0
    angles = []
    for k in range(1000 * seconds):
        command, held = held, position_law(*set_point(k * SCAN_S), pos)
        for _ in range(CYCLES):
            torque, integral = speed_loop(command, pos, last, integral)
            last = pos
            vel += 125e-6 * acceleration(pos, torque)
            pos += 125e-6 * vel
        if k % 1000 == 999:
            angles.append(pos)
    return angles


@pytest.mark.parametrize(
    "angles",
    [
        late_law(2),
        [angle * (1.0 + 6e-6) for angle in rigid_job(2)],  # six digits, as single precision has
        [rigid_job(2)[0], math.nan],
        rigid_job(1),  # half of the job
    ],
)
def test_another_job_is_found_out(angles: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    def liar(_seconds: int, _folder: Path) -> Run:
        return lambda: Timed(angles, 1e-9)

    monkeypatch.setattr(plain_c, "plain_c", liar)
    with pytest.raises(WrongJob, match="plain C does another job"):
        compare_peers(1, 1.0, (BY_NAME["plain C"]._replace(seconds=2),))


def test_a_late_law_is_far_beyond_the_limit() -> None:
    assert deviation_deg(late_law(2), reference(2)) > 10.0 * TOLERANCE_DEG


def test_what_is_not_installed_is_left_out_by_name() -> None:
    absent = Peer("Somebody", "nowhere", "nothing", ("no-such-distribution",), "", 1)
    results = compare_peers(1, 1.0, (BY_NAME[OWN]._replace(seconds=1), absent))
    assert [(result.peer.name, result.why_not) for result in results] == [
        (OWN, ""),
        ("Somebody", "not installed: no-such-distribution"),
    ]
    assert [figure.key for figure in peer_figures(results)] == ["own"]
