"""Hold-to-run over a bad network in virtual time: the real hub, rings, operator and program, the true plant as judge.

Only the network and the person at the page are models. A message takes a lag with jitter, may be lost, doubled or
overtaken, and waits while the network is frozen; then everything arrives at once.
"""

from __future__ import annotations

import heapq
import json
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from typing import Any, NamedTuple

from gantryctl.machine import Machine
from gantryctl.service.clients.hub import Client, Hub
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.memory.snapshot import FAST, publish_fast, publish_json
from gantryctl.service.protocol.limits import RENEW_S
from gantryctl.service.protocol.roles import Role
from gantryctl.units import deg
from support.service_bench import MACHINE, Bench

AT_REST_DEG_S = 0.05
"""The motor side of the true plant stands below it, as in `gantryctl stops`."""
PUBLISHED_S = 0.010
ALIVE_S = 0.4
STALE_S = 0.4
"""The page, as in hmi/src/lib: signs of life, and when it gives a key up."""
_KEPT_S = 2.0
"""No page presses on an older frame: it gives its key up before."""


class Network(NamedTuple):
    """One way: delays in s; loss and doubles as parts of all messages; `fifo` as TCP, else messages overtake."""

    lag_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    doubled: float = 0.0
    fifo: bool = True


class Way:
    """Messages under way in one direction."""

    def __init__(self, network: Network, random_: random.Random) -> None:
        self.network, self._random = network, random_
        self.frozen = False
        self.under_way: list[tuple[float, int, str]] = []
        self._count = count()
        self._last_s = 0.0

    def put(self, text: str, now_s: float) -> None:
        net, chance = self.network, self._random.random
        if chance() < net.loss:
            return
        for _ in range(2 if chance() < net.doubled else 1):
            due_s = now_s + net.lag_s + net.jitter_s * chance()
            if net.fifo:
                self._last_s = due_s = max(due_s, self._last_s)
            heapq.heappush(self.under_way, (due_s, next(self._count), text))

    def arrived(self, now_s: float) -> Iterator[str]:
        while self.under_way and self.under_way[0][0] <= now_s and not self.frozen:
            yield heapq.heappop(self.under_way)[2]


class Told(NamedTuple):
    """A frame as it left the controller: the true angle then, and the longest way to rest that it told."""

    pos_deg: float
    key_lost_deg: float


class Screen:
    """A page and a person at it; what a liar does otherwise is overridden.

    Attributes:
        lease: of the key that is held, or "".
        seen_s: when the newest frame was issued that arrived while the key was held.
        refused: codes of refusals.
    """

    def __init__(self, plant: Axis, network: Network) -> None:
        self._plant = plant
        self.client: Client = plant.hub.connect("anna", Role.OPERATOR, plant.place)
        self.to_screen = Way(network, plant.random)
        self.to_service = Way(network, plant.random)
        self.mark, self.epoch, self.lease = "", 0, ""
        self.seen_s = 0.0
        self.refused: list[str] = []
        self.dead = False
        self._seq = self._press_seq = 0
        self._fresh_s = self._alive_s = self._renewed_s = 0.0

    def press(self, forward: bool) -> None:
        self.lease = f"{self._plant.random.getrandbits(64):016x}"
        self.seen_s = self.issued_s(self.mark)
        self._press_seq = self.say("jog", lease=self.lease, direction="forward" if forward else "reverse")
        self._renewed_s = self._plant.time_s

    def let_go(self) -> None:
        """The page takes the key back whatever the reason."""
        lease, self.lease = self.lease, ""
        if lease:
            self.say("release", lease=lease)

    def say(self, kind: str, **values: Any) -> int:
        self._seq += 1
        message = {"type": kind, "seq": self._seq, "frame": self.mark, "epoch": self.epoch, **values}
        self.to_service.put(json.dumps(message), self._plant.time_s)
        return self._seq

    def freeze(self, frozen: bool) -> None:
        """Both ways of the network stand still, or go on."""
        self.to_screen.frozen = self.to_service.frozen = frozen

    def scan(self) -> None:
        """What arrives now, both ways, and what the page does by its timer."""
        now_s = self._plant.time_s
        for text in self.to_service.arrived(now_s):
            self.client.take(text)
        if self.client.wake.is_set():
            for text in self.client.outgoing():
                self.to_screen.put(text, now_s)
        if self.dead:
            return
        for text in self.to_screen.arrived(now_s):
            self._take(json.loads(text), now_s)
        if self.lease and now_s - self._fresh_s > STALE_S:
            self.let_go()
        elif self.lease and now_s - self._renewed_s >= RENEW_S:
            self.renew()

    def renew(self) -> None:
        self._renewed_s = self._plant.time_s
        self.say("renew", lease=self.lease)

    def _take(self, message: dict[str, Any], now_s: float) -> None:
        if message["type"] == "reply":
            self.epoch = max(self.epoch, message["epoch"] or 0)
            if not message["ok"]:
                self.refused.append(message["code"])
                if message["seq"] == self._press_seq:
                    self.let_go()
                else:
                    self.lease = ""
            return
        self.mark, self.epoch = message["frame"], message["tags"].get("epoch", self.epoch)
        self._fresh_s = now_s
        self.frame_came(message)

    def frame_came(self, message: dict[str, Any]) -> None:
        now_s = self._plant.time_s
        if now_s - self._alive_s > ALIVE_S:
            self._alive_s = now_s
            self.say("alive")
        if self.lease:
            self.seen_s = max(self.seen_s, self.issued_s(self.mark))
            self.renew()

    @staticmethod
    def issued_s(mark: str) -> float:
        return int(mark.partition("-")[0]) * 1e-3


class Axis:
    """One axis behind a hub, and screens.

    Args:
        source: of the hub, page or local socket.

    Attributes:
        told: frames of this gesture, by their time of issue, ms.
        starts: how often the set-point began to move in this gesture. moving: it moves.
        moved_s: when the true plant moved last.
    """

    def __init__(
        self,
        memory: SharedMemory,
        speed_deg_s: float,
        *,
        machine: Machine = MACHINE,
        source: Source = Source.WEB,
        seed: int = 1,
    ) -> None:
        lease_ms = machine.monitors.lease_ms
        memory.words[Word.LEASE_MS] = round(lease_ms)
        self.machine, self.memory, self.random = machine, memory, random.Random(seed)
        for ring in (*memory.commands, *memory.replies):
            ring.clear()
        self.bench = Bench(machine=machine, memory=memory)
        self.bench.lively = False
        self.lease_s, self.speed_deg_s = lease_ms * 1e-3, speed_deg_s
        self.hub = Hub(memory, source, now=lambda: self.time_s)
        self.place = "local" if source is Source.LOCAL else "console"
        self.told: dict[int, Told] = {}
        self.screens: list[Screen] = []
        self.starts = 0
        self.moved_s = 0.0
        self.moving = False
        self._look_s = 0.0
        self._holder: object = self
        self._every = round(PUBLISHED_S / self.bench.engine.period_s)

    @property
    def time_s(self) -> float:
        return self.bench.engine.time_s

    @property
    def truth_deg(self) -> tuple[float, float]:
        """Angle of the motor side at the gantry and its speed, of the true plant."""
        _, _, pos, vel, *_ = self.bench.engine.drive.truth()
        ratio = self.bench.axis.settings.law.ratio
        return deg(pos) / ratio, deg(vel) / ratio

    @property
    def set_speed_deg_s(self) -> float:
        return abs(deg(self.bench.axis.virtual.vel_ref_rad_s))

    def sit_down(self, network: Network, screen: type[Screen] = Screen) -> Screen:
        """A screen that takes control and switches on, over a good network at first."""
        found = screen(self, Network())
        self.screens.append(found)
        self.run(0.1)
        for kind, values in (
            ("take", {"over": False}),
            ("power", {"on": True}),
            ("mode", {"mode": "continuous"}),
            ("set", {"tag": "speed_setting_deg_s", "value": self.speed_deg_s}),
        ):
            found.say(kind, **values)
            self.run(0.2)
            if kind == "power":
                self.until(lambda: self.bench.axis.power.status)
        assert not found.refused, found.refused
        found.to_screen.network = found.to_service.network = network
        return found

    def stand_up(self, screen: Screen) -> None:
        """The connection of a screen ends."""
        self.screens.remove(screen)
        self.hub.leave(screen.client)
        self.run(0.1)

    def begin(self, screen: Screen) -> None:
        """A new gesture: at rest, with control, and with the network that is meant."""
        net = screen.to_service.network
        holder = self.bench.operator.authority.holder
        if holder is None or holder.client != screen.client.who.client:
            screen.to_screen.network = screen.to_service.network = Network()
            self.run(0.1)
            screen.say("take", over=True)
            self.run(0.1)
            screen.to_screen.network = screen.to_service.network = net
        self.run(0.06)
        assert not self.moving
        self.starts, self.moved_s = 0, 0.0
        first_ms = (self.time_s - _KEPT_S) * 1e3
        self.told = {ms: told for ms, told in self.told.items() if ms > first_ms}
        screen.refused.clear()

    def run(self, seconds: float) -> None:
        self.bench.engine.run_until(self._after, seconds)

    def until(self, holds: Callable[[], bool], limit_s: float = 30.0) -> None:
        assert self.bench.engine.run_until(lambda _: self._after(_) or holds(), limit_s)

    def _after(self, _: object) -> bool:
        bench, now_s = self.bench, self.time_s
        bench.operator.settle()
        if bench.engine.scan % self._every == 0:
            self._publish()
        self.hub.pass_replies()
        if now_s >= self._look_s or self.hub._hurried.is_set():
            self.hub._hurried.clear()
            self._look_s = now_s + self.hub.look()
        for screen in self.screens:
            screen.scan()
        moving = abs(self.truth_deg[1]) > AT_REST_DEG_S
        if moving:
            self.moved_s = now_s
        # A beginning is one of the set-point: the load of a big axis swings for a while.
        begins = bench.axis.virtual.vel_ref_rad_s != 0.0
        self.starts += begins and not self.moving
        self.moving = begins
        return False

    def _publish(self) -> None:
        operator, axis = self.bench.operator, self.bench.axis
        values = dict.fromkeys(FAST, 0.0)
        values.update(issued_ms=operator.frames.issued_ms, epoch=operator.authority.epoch)
        publish_fast(self.memory.fast, values, operator.frames.key)
        holder = operator.authority.holder
        if holder != self._holder:
            self._holder = holder
            publish_json(self.memory.slow, {"authority_client": holder.client if holder else ""})
        # The set-point is ahead of the axis by the following error.
        lost_deg = deg(self.bench.program.key_lost_angle_rad()) + abs(deg(axis.pos_err_rad))
        self.told[operator.frames.issued_ms] = Told(self.truth_deg[0], lost_deg)
        self.bench.event_ring.clear()


@contextmanager
def shared_memory() -> Iterator[SharedMemory]:
    memory = SharedMemory.create()
    memory.words[Word.RECORDER_NS] = 2**62  # a recorder that is always alive
    yield memory
    memory.close()


class Outcome(NamedTuple):
    """One gesture.

    Attributes:
        late_s: of the end of the motion after lease and ramp from the issue of the last frame seen; negative in time.
        far_deg: by which the axis went beyond the way that this frame told; negative within.
        starts: how often the axis began to move.
        stopped: it came to rest while the key was still held.
        refused: code of a refused press, or "".
    """

    late_s: float
    far_deg: float
    starts: int
    stopped: bool
    refused: str


class Gesture(NamedTuple):
    """A press, its freezes (begin after the press and length, s), and how it ends."""

    held_s: float
    ending: str
    freezes: tuple[tuple[float, float], ...] = ()


ENDINGS = ("released", "dead", "cut", "stopped", "held on")
_HEALED_S = 0.15


def ramp_s(axis: Axis) -> float:
    """Longest time of the true plant from the release of a key to rest, from this speed and on the way up to it."""
    longest = 0.0
    screen = axis.sit_down(Network())
    # The end of the way up is the worst: the axis still accelerates, and is as good as fast.
    for part in (0.5, 0.9, 0.98, 0.995, 1.0):
        screen.press(axis.truth_deg[0] < 0.0)
        axis.until(lambda part=part: axis.set_speed_deg_s > part * axis.speed_deg_s - 1e-9)
        begin_s = axis.time_s
        screen.let_go()
        axis.run(_calm_s(axis))
        longest = max(longest, axis.moved_s - begin_s)
    axis.stand_up(screen)
    return longest


def _calm_s(axis: Axis) -> float:
    """Longer than a stop on the ramp takes."""
    virtual = axis.machine.virtual_axis
    dec, jerk = virtual.jog_release_dec_deg_s2, virtual.jog_release_jerk_deg_s3
    return axis.speed_deg_s / dec + 2.0 * dec / jerk + 0.25


def gesture(axis: Axis, screen: Screen, asked: Gesture, ramp: float) -> Outcome:
    """Press, hold, end; then long enough for everything that is under way to arrive."""
    net = screen.to_service.network
    axis.begin(screen)
    begin_s = axis.time_s
    screen.press(axis.truth_deg[0] < 0.0)
    while (since_s := axis.time_s - begin_s) < asked.held_s:
        screen.freeze(any(start <= since_s < start + length for start, length in asked.freezes))
        axis.run(0.005)
        if not (screen.lease or axis.moving or screen.to_service.under_way):
            break  # refused
    screen.freeze(False)
    # At rest before the end of the gesture, and once on the way.
    stopped = axis.starts > 0 and not axis.moving
    seen_s = screen.seen_s
    match asked.ending:
        case "released":
            screen.let_go()
        case "dead":  # as a browser that hangs: nothing is said, the connection stays
            screen.dead = True
        case "cut":
            screen.freeze(True)
        case "stopped":
            screen.say("stop")
    if asked.ending in ("held on", "stopped"):  # the hand stays where it is
        axis.run(0.5)
        seen_s = screen.seen_s
        screen.let_go()
    axis.run(axis.lease_s + _calm_s(axis) + 2.0 * (net.lag_s + net.jitter_s))
    # The network heals, and what was under way arrives: nothing starts again.
    screen.dead, screen.lease = False, ""
    screen.freeze(False)
    axis.run(_HEALED_S)
    refused = next((code for code in screen.refused if code in ("SEC-13", "SEC-02")), "")
    if not axis.starts:
        return Outcome(-1.0, -1.0, 0, False, refused)
    told = axis.told[max(ms for ms in axis.told if ms * 1e-3 <= seen_s + 1e-6)]
    far_deg = abs(axis.truth_deg[0] - told.pos_deg) - told.key_lost_deg
    return Outcome(axis.moved_s - (seen_s + axis.lease_s + ramp), far_deg, axis.starts, stopped, refused)
