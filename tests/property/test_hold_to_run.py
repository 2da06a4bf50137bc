"""Hold-to-run and control authority against plain models of what they promise.

INV-10: control authority in any order of requests.
"""

from __future__ import annotations

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from gantryctl.service.command.authority import Authority
from gantryctl.service.command.lease import HoldToRun
from gantryctl.service.protocol.limits import SILENCE_S
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role

LEASE_S = 0.250
SCAN_S = 0.001
AGES = st.sampled_from([0.0, 0.02, 0.15, 0.2])
LEASES = [f"{n:016x}" for n in range(6)]
CLIENTS = ["a", "b"]
PLACES = {"a": "console", "b": "console", "c": "local"}


class Leases(RuleBasedStateMachine):
    """The key is held exactly while the newest lease was begun once, renewed in time, and never ended.

    In time: from the issue of the newest frame named, however late or often it is named.
    """

    def __init__(self) -> None:
        super().__init__()
        self.hold = HoldToRun(LEASE_S, SCAN_S)
        self.now = 100.0
        self.dead: set[str] = set()
        self.live: tuple[str, str] | None = None
        self.issued = 0.0

    def _expire(self) -> None:
        if self.live is not None and not self.now + SCAN_S - self.issued < LEASE_S:
            self.live = None

    @rule(seconds=st.sampled_from([0.001, 0.03, 0.2, 0.249, 0.25, 0.3]))
    def time_passes(self, seconds: float) -> None:
        self.now += seconds
        self.hold.check(self.now)
        self._expire()

    @rule(lease=st.sampled_from(LEASES), client=st.sampled_from(CLIENTS), forward=st.booleans(), age=AGES)
    def press(self, lease: str, client: str, forward: bool, age: float) -> None:
        refused = self.hold.begin(lease, client, forward, self.now - age, self.now)
        fresh = lease not in self.dead
        self.dead.add(lease)
        assert (refused is None) is (fresh and self.live is None)
        if fresh:  # a second key releases the first
            self.live = None if self.live is not None else (lease, client)
            self.issued = self.now - age

    @rule(lease=st.sampled_from(LEASES), client=st.sampled_from(CLIENTS), age=AGES)
    def renew(self, lease: str, client: str, age: float) -> None:
        before = self.hold.count
        refused = self.hold.renew(lease, client, self.now - age, self.now)
        self._expire()
        assert (refused is None) is (self.live == (lease, client))
        newer = refused is None and self.now - age > self.issued
        assert self.hold.count == before + newer
        if newer:
            self.issued = self.now - age

    @rule(lease=st.sampled_from(LEASES), client=st.sampled_from(CLIENTS))
    def release(self, lease: str, client: str) -> None:
        ended = self.hold.release(lease, client)
        assert ended is (self.live == (lease, client))
        self.dead.add(lease)
        if ended:
            self.live = None

    @rule()
    def stop(self) -> None:
        self.hold.end()
        self.live = None

    @invariant()
    def one_key_while_a_lease_lives_and_none_otherwise(self) -> None:
        assert self.hold.alive is (self.live is not None)
        assert (self.hold.forward, self.hold.reverse).count(True) == (self.live is not None)
        left = self.hold.left_s(self.now)
        assert 0.0 <= left <= LEASE_S
        assert (left > 0.0) is (self.live is not None)


TestLeases = Leases.TestCase


class OneControl(RuleBasedStateMachine):
    """One holder at most; every change of holder begins a new epoch and nothing else does."""

    def __init__(self) -> None:
        super().__init__()
        self.authority = Authority(7)
        self.now = 0.0
        self.holder: str | None = None
        self.alive_s = 0.0
        self.epoch = 7

    @rule(client=st.sampled_from(sorted(PLACES)), over=st.booleans(), at_rest=st.booleans())
    def take(self, client: str, over: bool, at_rest: bool) -> None:
        who = Identity(client, client, Role.OPERATOR, PLACES[client])
        refused = self.authority.take(who, over, at_rest, self.now)
        local_holder = self.holder is not None and PLACES[self.holder] == "local"
        allowed = self.holder in (None, client) or client == "c" or (over and at_rest and not local_holder)
        assert (refused is None) is allowed
        if allowed:
            self.epoch += self.holder != client
            self.holder, self.alive_s = client, self.now

    @rule(client=st.sampled_from(sorted(PLACES)))
    def give(self, client: str) -> None:
        assert self.authority.give(client) is (self.holder == client)
        if self.holder == client:
            self.holder, self.epoch = None, self.epoch + 1

    @rule(seconds=st.floats(0.0, 3.0))
    def time_passes(self, seconds: float) -> None:
        self.now += seconds

    @rule(client=st.sampled_from(sorted(PLACES)))
    def sign_of_life(self, client: str) -> None:
        self.authority.alive(Identity(client, client, Role.OPERATOR, PLACES[client]), self.now)
        if client == self.holder:
            self.alive_s = self.now

    @precondition(lambda self: self.holder is not None)
    @rule()
    def silence(self) -> None:
        assert self.authority.silent(self.now) is (self.now - self.alive_s > SILENCE_S)

    @invariant()
    def holder_and_epoch(self) -> None:
        held = self.authority.holder
        assert (held.client if held else None) == self.holder
        assert self.authority.epoch == self.epoch


TestOneControl = OneControl.TestCase
