"""Addresses of the door, by hand: hosts, networks, who waits, and whose connection it is."""

from __future__ import annotations

import struct
from pathlib import Path
from types import SimpleNamespace

import pytest

from gantryctl.gateway import peers as peers_module
from gantryctl.gateway.peers import local_user, user_of
from gantryctl.gateway.places import Places, Waiting
from gantryctl.gateway.settings import Settings, neighbourhood
from support.gateway_by_hand import Clock


def test_a_server_without_a_port_has_no_local_users() -> None:
    assert local_user({"client": ("127.0.0.1", 1), "server": ("/run/socket", None)}) is None


def test_a_network_of_ipv6_is_one_whatever_its_interface_is_called() -> None:
    assert {neighbourhood(each) for each in ("fe80::1%eth0", "fe80::2%7", "fe80::3")} == {"fe80::/64"}
    assert neighbourhood("192.0.2.7") == neighbourhood("::ffff:192.0.2.7") == "192.0.2.7"


def test_hosts_have_small_letters_and_brackets() -> None:
    made = Settings("2001:DB8::1", 443, -1, "c", "k", ("Gantry.Example",), Path(), Path())
    assert made.hosts == {"[2001:db8::1]:443", "[2001:db8::1]", "gantry.example:443", "gantry.example"}
    assert made._replace(port=80).hosts == {"[2001:db8::1]:80", "gantry.example:80"}
    # A service on the network is not reached by the names of this machine: any page of it could ask for them.
    assert made._replace(host="0.0.0.0", port=8650, names=()).hosts == {"0.0.0.0:8650"}  # noqa: S104
    here = made._replace(host="localhost", port=8650, names=())
    assert here.hosts == {"localhost:8650", "127.0.0.1:8650", "[::1]:8650"}
    plain = made._replace(certificate=None, port=80)
    assert plain.hosts == {"[2001:db8::1]:80", "[2001:db8::1]", "gantry.example:80", "gantry.example"}


def test_who_waits_for_too_long_is_ended_and_who_came_later_is_next() -> None:
    closed: list[str] = []
    clock = Clock()
    waiting = Waiting(10, 5.0, clock)
    for name in ("old", "new"):
        waiting.add(SimpleNamespace(close=lambda name=name: closed.append(name)), "192.0.2.7", "one")  # type: ignore[arg-type]
        clock.s += 4.0
    assert waiting.next() is not None
    assert (closed, len(waiting), waiting.next()) == (["old"], 0, None)


@pytest.mark.parametrize(
    ("state", "swapped", "kind", "uid"),
    [(1, False, 20, 1000), (10, False, 20, None), (1, True, 20, None), (1, False, 2, None)],
)
def test_only_an_established_connection_with_both_ends_names_its_user(
    monkeypatch: pytest.MonkeyPatch, state: int, swapped: bool, kind: int, uid: int | None
) -> None:
    """An answer of sock_diag, linux/inet_diag.h: where there is none, the system offers a socket that listens (10)."""
    ends = [(4711, b"\x7f\0\0\1"), (8650, b"\x7f\0\0\1")]
    (source, here), (target, there) = ends[::-1] if swapped else ends
    said = struct.pack("=IHHII", 104, kind, 0, 1, 0) + struct.pack("=BBBB", 2, state, 0, 0)
    said += struct.pack("!HH16s16s", source, target, here, there) + struct.pack("=III", 0, 7, 8)
    said += struct.pack("=IIIII", 0, 0, 0, 1000, 99)

    class System:
        def __enter__(self) -> System:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def settimeout(self, _: float) -> None:
            pass

        def send(self, _: bytes) -> None:
            pass

        def recv(self, _: int) -> bytes:
            return said

    monkeypatch.setattr(peers_module.socket, "socket", lambda *_: System())
    assert user_of(("127.0.0.1", 4711), ("127.0.0.1", 8650)) == uid


def test_an_address_without_a_connection_is_forgotten() -> None:
    """Memory must not grow with each address that was ever here."""
    places = Places(10, loopback=2, remote=2)
    for n in range(20):
        taken = [places.take(f"192.0.2.{n}") for _ in range(2)]
        for place in taken:
            assert place is not None
            place.leave()
    assert not places._taken


@pytest.mark.parametrize("address", ["fe80::1%eth0", "fe80::1%2"])
def test_an_address_with_its_interface_is_asked_for_without_it(
    monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    """A socket of the kernel has no name of an interface in its address."""
    sent, times = list[bytes](), list[float]()

    class System:
        def __enter__(self) -> System:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def settimeout(self, time_s: float) -> None:
            times.append(time_s)

        def send(self, asked: bytes) -> None:
            sent.append(asked)

        def recv(self, _: int) -> bytes:
            return b""

    monkeypatch.setattr(peers_module.socket, "socket", lambda *_: System())
    assert user_of((address, 4711), (address, 8650)) is None
    own = b"\xfe\x80" + bytes(13) + b"\1"
    assert own + own in sent[0]
    assert times == [0.2]  # the loop waits meanwhile


def test_where_all_places_are_taken_the_largest_crowd_makes_room_and_not_the_newcomer() -> None:
    ended: list[str] = []
    places = Places(4, loopback=3, remote=3)
    for n, address in enumerate(("192.0.2.7", "192.0.2.8", "192.0.2.8", "192.0.2.8")):
        place = places.take(address)
        assert place is not None
        place.rest(lambda name=f"{n} of {address}": ended.append(name))  # type: ignore[misc]
    assert places.take("192.0.2.7") is not None
    assert ended == ["1 of 192.0.2.8"]
