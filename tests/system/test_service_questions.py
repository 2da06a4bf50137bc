"""A person at the command line who is asked before the service's axis moves, and takes time to answer."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from support.service_process import Page, Service, add_users

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux"),
]
THINKING_S = 2.5
"""Longer than control lasts without a sign of life (2 s) and than a command may be old (0.5 s)."""


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    root = tmp_path_factory.mktemp("questions")
    add_users(root)
    with Service(root) as running:
        yield running


class Asked:
    """One command that waits for its answer."""

    def __init__(self, service: Service, *words: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "gantryctl", *words, "--service"],
            env={**os.environ, "GANTRYCTL_STATE": str(service.root)},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        self.said = b""

    def prompted(self, wait_s: float = 0.0) -> bool:
        """Whether the question has come."""
        assert self.process.stderr is not None
        if select.select([self.process.stderr], [], [], wait_s)[0]:
            more = os.read(self.process.stderr.fileno(), 4096)
            assert more, self.said
            self.said += more
        return b"[y/N]" in self.said

    def answer(self, text: str) -> None:
        """What the person types."""
        assert self.process.stdin is not None
        self.process.stdin.write(text.encode())
        self.process.stdin.flush()

    def ended(self) -> bool:
        return self.process.poll() is not None

    def result(self) -> tuple[int, str, str]:
        """Exit code, standard output and the rest of standard error."""
        out, err = self.process.communicate(timeout=30.0)
        return self.process.returncode, out.decode(), err.decode()


def wait(asked: Asked) -> None:
    while not asked.prompted(30.0):
        pass


def free(page: Page) -> None:
    """Power off and control given back, and everybody has seen it."""
    page.do("power", on=False)
    page.until(lambda tags: tags["power_phase"] == "off")
    page.do("give")
    page.until(lambda tags: tags["authority_user"] == "")


def test_a_person_may_think_before_the_answer(service: Service) -> None:
    asked = Asked(service, "move", "0.3")
    wait(asked)
    time.sleep(THINKING_S)
    asked.answer("y\n")
    code, out, err = asked.result()
    assert (code, err) == (0, "")
    assert "from 0.000 to 0.300 deg" in out
    assert "done: 0.0000 -> 0.3" in out or "done: 0.0000 -> 0.29" in out


def test_ctrl_c_at_the_question_is_no(service: Service) -> None:
    asked = Asked(service, "move", "3")
    wait(asked)
    asked.process.send_signal(signal.SIGINT)
    code, _, _ = asked.result()
    assert code != 0
    with service.page("viewer") as page:
        assert (page.tags["power"], page.tags["authority_user"]) == (False, "")


def test_no_takes_nothing_from_anybody(service: Service) -> None:
    """`--take-over` is carried out after the answer, not before."""
    with service.page("operator") as page:
        page.power_up()
        page.do("move", target_deg=2.0)
        asked = Asked(service, "move", "-1", "--take-over")
        page.until(lambda _: asked.prompted())
        asked.answer("n\n")
        page.until(lambda _: asked.ended())
        assert asked.result()[0] == 2
        assert page.tags["authority_user"] == "operator"
        page.until(lambda tags: tags["at_rest"] and abs(tags["pos_act_deg"] - 2.0) < 0.01)
        free(page)


def test_an_axis_that_has_moved_since_the_question_is_not_moved(service: Service) -> None:
    asked = Asked(service, "move", "--by", "-1")
    wait(asked)
    with service.page("operator") as page:
        page.power_up()
        page.do("move", target_deg=1.0)
        page.until(lambda tags: tags["at_rest"] and tags["in_position"])
        free(page)
        asked.answer("y\n")
        page.until(lambda _: asked.ended())
        code, _, err = asked.result()
        assert code == 2
        assert "when you were asked" in err


def test_what_moves_is_left_alone_by_a_command_that_is_not_told_to_stop_it(service: Service) -> None:
    with service.page("operator") as page:
        page.power_up()
        page.do("move", target_deg=30.0)  # 50 s at the speed of a new machine
        page.do("give")  # a move goes on
        other = Asked(service, "move", "0", "--yes")
        page.until(lambda _: other.ended())
        code, _, err = other.result()
        assert code == 2
        assert "the axis moves to 30.00 deg" in err
        assert not page.tags["at_rest"]
        page.do("stop")
        page.until(lambda tags: tags["at_rest"])
        page.do("take", over=False)
        free(page)
