"""The brake test of a service that wants two persons: one arms, another one executes, at pages and at the console."""

from __future__ import annotations

import json
import os
import pwd
import sys
from collections.abc import Iterator

import pytest

from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor.users import Users
from support.service_process import PASSWORD, Service, add_users

HERE = pwd.getpwuid(os.getuid()).pw_name
"""The account of the system that runs the command line of these tests."""
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")


@pytest.fixture(scope="module")
def for_two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    root = tmp_path_factory.mktemp("two")
    add_users(root)
    Users(root).add("twin", Role.SERVICE, PASSWORD, "physicist")
    Users(root).add(HERE, Role.VIEWER, PASSWORD, "console")
    with Service(root, "--second-person") as made:
        yield made


def test_one_arms_and_another_one_executes(for_two: Service) -> None:
    with for_two.page("service") as second, for_two.page("physicist") as first:
        assert second.look()["second_person"]
        second.do("take", over=False)
        second.do("arm", action="brake_test")
        assert second.refused("brake_test") == "SEC-10"
        first.until(lambda tags: tags["authority_user"] == "service")  # it sees the new epoch
        first.do("arm", action="brake_test")
        assert first.refused("brake_test") == "SEC-07"
        second.do("brake_test")
        second.do("stop")


def test_two_accounts_of_one_person_are_one_person(for_two: Service) -> None:
    with for_two.page("physicist") as first, for_two.page("twin") as second:
        first.do("take", over=False)
        second.until(lambda tags: tags["authority_user"] == "physicist")
        second.do("arm", action="brake_test")
        first.until(lambda tags: (tags["armed_by"], tags["armed_person"]) == ("twin", "physicist"))
        assert first.welcome["person"] == second.welcome["person"] == "physicist"
        assert first.refused("brake_test") == "SEC-10"


def test_an_account_of_the_system_that_is_nobodys_is_no_person(for_two: Service) -> None:
    users = Users(for_two.root)
    users.remove(HERE)
    done = for_two.command("arm", "brake-test")
    assert done.returncode == 2
    assert f"SEC-10 · two persons are needed, and nobody knows whose account {HERE} is" in done.stderr
    users.add(HERE, Role.VIEWER, PASSWORD, "console")


def test_the_console_waits_for_somebody_else_to_arm(for_two: Service) -> None:
    with for_two.page("physicist") as first:
        asking = for_two.start("brake-test", "--service", "--yes", "--json")
        first.until(lambda tags: tags["authority_local"])
        first.do("arm", action="brake_test")
        first.until(lambda _: asking.poll() is not None)
        out, err = asking.communicate()
    assert (asking.returncode, json.loads(out)["result"]) == (0, "passed")
    assert "another person must arm it now" in err


def test_the_console_arms_for_somebody_else(for_two: Service) -> None:
    with for_two.page("service") as second:
        second.do("take", over=False)
        arming = for_two.start("arm", "brake-test")
        second.until(lambda tags: tags["armed_action"] == "brake_test")
        second.do("brake_test")
        second.until(lambda _: arming.poll() is not None)
        assert "not armed any more" in arming.communicate()[0]
        second.do("stop")
