"""Commands out of the rings, replies and events back: the operator's link to the other processes."""

from __future__ import annotations

from collections import Counter, OrderedDict, deque
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.command.arming import Arming
from gantryctl.service.memory.events import EventLog, printable
from gantryctl.service.memory.memory import Source
from gantryctl.service.memory.refusals import RefusalLog, in_words, kind_of
from gantryctl.service.memory.ring import Ring
from gantryctl.service.protocol import messages
from gantryctl.service.protocol.messages import NOTE, SILENT, Identity, Message, MessageRefused, compact

# Records taken from a ring in one scan: sorting them takes time too.
_PER_SCAN: Final = 32
_CLIENTS: Final = 1024
_TEXT_MAX: Final = 300
# Most commands that wait. The console of the machine is a source of its own: no flood of a page fills its places.
OF_CLIENT: Final = 16
OF_SOURCE: Final = 128
# Decision 0011: stops are judged first and never refused; they carry no age and no epoch that could be wrong.
_FIRST: Final = ("stop", "quick_stop", "release")
# What a connection asks for itself alone: it ends with the connection, also while it waits.
_OWN: Final = ("take", "arm")


class PendingCommand(NamedTuple):
    """A message with its sender, and the source that its reply goes to."""

    source: int
    who: Identity
    message: Message


class CommandQueue:
    """Commands that wait for their scan, in the order they came."""

    def __init__(self) -> None:
        self._waiting: deque[PendingCommand] = deque()
        self._count: Counter[str | int] = Counter()

    def __len__(self) -> int:
        return len(self._waiting)

    def append(self, pending: PendingCommand) -> bool:
        """Add one; False when too many wait already. Of signs of life only the newest of a client waits."""
        client, source = pending.who.client, pending.source
        if pending.message.kind in SILENT:
            self._drop(client, pending.message.kind)
        if self._count[client] >= OF_CLIENT or self._count[source] >= OF_SOURCE:
            return False
        self._waiting.append(pending)
        self._count[client] += 1
        self._count[source] += 1
        return True

    def take(self) -> PendingCommand:
        """Remove and return the oldest command."""
        pending = self._waiting.popleft()
        self._leave(pending)
        return pending

    def forget(self, gone: Gone) -> None:
        """Drop what connections that have ended asked for themselves: nobody is there to have it."""
        for each in [*self._waiting]:
            ended = each.source == gone.source if gone.everyone else each.who.client == gone.client
            if ended and each.message.kind in _OWN:
                self._waiting.remove(each)
                self._leave(each)

    def _drop(self, client: str, kind: str) -> None:
        for each in self._waiting:
            if each.who.client == client and each.message.kind == kind:
                self._waiting.remove(each)
                self._leave(each)
                return

    def _leave(self, pending: PendingCommand) -> None:
        for key in (pending.who.client, pending.source):
            self._count[key] -= 1
            if not self._count[key]:
                del self._count[key]


class Gone(NamedTuple):
    """The end of a connection; with `everyone`, of all connections of a source."""

    source: int
    client: str
    everyone: bool

    def end(self, arming: Arming, holder: Identity | None) -> str | None:
        """Forget what the connections have armed; the client whose control and keys end with them, if any."""
        if not self.everyone:
            arming.gone(self.client)
            return self.client
        local = self.source == Source.LOCAL
        arming.gone_all(local=local)
        return holder.client if holder is not None and holder.local is local else None


class Inbox:
    """The scan's end of the command and reply rings.

    Attributes:
        first: stops and releases of this scan, by kind; always carried out, whatever their age.
        others: commands that wait.
        gone: connections that have ended.
        time_s: nominal time of the present scan, as in the first column of a recording.
    """

    def __init__(self, commands: Sequence[Ring], replies: Sequence[Ring], events: EventLog) -> None:
        self.events = events
        self.first: dict[str, list[PendingCommand]] = {}
        self.others = CommandQueue()
        self.gone: deque[Gone] = deque()
        self.time_s = 0.0
        self.refusals = RefusalLog(events, lambda: self.time_s)
        self._commands, self._replies = commands, replies
        self._last_seq: OrderedDict[str, int] = OrderedDict()

    def receive(self, epoch: int, holder: str) -> None:
        """Sort the commands of this scan; `holder` is the client that has control."""
        self.first.clear()
        for source, ring in enumerate(self._commands):
            if not len(ring):
                continue
            records = ring.peek(_PER_SCAN)
            ring.advance(len(records))
            for record in records:
                if record is not None:
                    self._sort(source, record, epoch, holder)

    def _sort(self, source: int, record: bytes, epoch: int, holder: str) -> None:
        try:
            who, raw = messages.from_record(record)
        except (ValueError, KeyError, TypeError):
            return
        # These two come from the gateway itself: no client can send them past `parse`.
        if raw.get("type") in ("gone", "restart"):
            self._last_seq.pop(who.client, None)
            gone = Gone(source, who.client, raw["type"] == "restart")
            self.others.forget(gone)
            self.gone.append(gone)
            return
        try:
            message = messages.checked(raw)
        except MessageRefused as refused:
            number = self.refusals.put(who, None, refused, {"time_s": self.time_s})
            self._reply(source, who, raw.get("seq"), refused, number, epoch)
            return
        pending = PendingCommand(source, who, message)
        if message.kind in _FIRST:
            self.first.setdefault(message.kind, []).append(pending)
        elif message.kind in SILENT and who.client != holder:
            if message.kind == "renew":
                dead = MessageRefused(Code.SEC_09, reason=Words.LEASE_DEAD(why=Words.LEASE_ENDED))
                self._reply(source, who, message.seq, dead, 0, epoch)
        elif not self.others.append(pending):
            self.answer(pending, MessageRefused(Code.SEC_06, reason=Words.NO_COMMANDS_NOW), epoch)

    def check_sequence(self, pending: PendingCommand) -> None:
        """Refuse a number that a connection used before: a repeated command is not a new one."""
        client, seq = pending.who.client, pending.message.seq
        if not seq > self._last_seq.get(client, -1):
            raise MessageRefused(Code.SEC_04, reason=Words.SEQUENCE_USED(number=seq))
        self._last_seq[client] = seq
        self._last_seq.move_to_end(client)
        if len(self._last_seq) > _CLIENTS:
            self._last_seq.popitem(last=False)

    def answer(self, pending: PendingCommand, refused: MessageRefused | None, epoch: int) -> None:
        """Reply to a command and journal it; signs of life get neither while all is well."""
        source, who, message = pending
        silent, number = message.kind in SILENT, 0
        if silent and refused is None:
            return
        if refused is None:
            number = self._event(pending)
        elif not silent:
            number = self.refusals.put(who, message, refused, {**_values(message), "time_s": self.time_s})
        self._reply(source, who, message.seq, refused, number, epoch)

    def answer_all(self, together: Sequence[PendingCommand], epoch: int) -> None:
        """Reply to each of the stops of one scan, and journal one event for each user."""
        # One event, so that a flood of stops does not fill the journal.
        of_user: dict[str, list[PendingCommand]] = {}
        for each in together:
            of_user.setdefault(each.who.user, []).append(each)
        for same in of_user.values():
            number = self._event(same[0], **({"count": len(same)} if len(same) > 1 else {}))
            for each in same:
                self._reply(each.source, each.who, each.message.seq, None, number, epoch)

    def _event(self, pending: PendingCommand, **more: int) -> int:
        """Journal a command that was carried out; the number of its event."""
        # With the time of its scan, so that a run can be replayed from state and journal (decision 0011).
        message = pending.message
        if message.kind == NOTE:
            return self.events.put(NOTE, message.values["line"], pending.who, time_s=self.time_s)
        values = {**_values(message), **more, "time_s": self.time_s}
        return self.events.put(kind_of(message), f"{in_words(message)}: done", pending.who, **values)

    def _reply(
        self, source: int, who: Identity, seq: Any, refused: MessageRefused | None, number: int, epoch: int
    ) -> None:
        reply = messages.reply_to(seq if isinstance(seq, int) else 0, refused, epoch=epoch, journal=number)
        reply["text"] = printable(reply["text"], _TEXT_MAX)
        ring = self._replies[source]
        record = compact([who.client, reply]).encode()
        # A reason may quote as much as a list of drive parameters: a reply that fits no slot goes without values.
        if len(record) > ring.record_max:
            record = compact([who.client, {**reply, "values": {}}]).encode()
        ring.put(record)


def _values(message: Message) -> dict[str, Any]:
    """Values of the event of a command: a lease is the secret of its press."""
    return {name: value for name, value in message.values.items() if name != "lease"}
