"""Login and permission, for REST and WebSocket alike."""

from __future__ import annotations

import asyncio
import math
from typing import Final
from weakref import WeakValueDictionary

from starlette.datastructures import Headers
from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse, RedirectResponse, Response

from gantryctl.errors import StateError
from gantryctl.gateway.guard import address_of, error
from gantryctl.gateway.peers import Consoles, is_forwarded, local_user, peer_of
from gantryctl.gateway.sessions import WHOLE_S, LockOut, Session, Sessions, worth_writing
from gantryctl.gateway.settings import Settings
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients.console_link import LinkTaker
from gantryctl.service.clients.hub import Hub
from gantryctl.service.protocol.messages import Identity, MessageRefused
from gantryctl.service.protocol.roles import Action, Role, may, rights_of
from gantryctl.service.supervisor.users import PASSWORD_MAX, User, Users

# With this prefix a browser takes it from this host only, and for all of it (RFC 6265bis, section 4.1.3.2). It must be
# Secure then; Chromium 156, Firefox 153 and curl 7.88 take and send it over http on 127.0.0.1 and localhost, too.
COOKIE: Final = "__Host-gantryctl_session"
CONSOLE_COOKIE: Final = "__Host-gantryctl_console"


class Access:
    """Sessions, passwords and the journal entries about them."""

    def __init__(self, settings: Settings, hub: Hub, links: LinkTaker) -> None:
        self.settings, self.hub, self.links = settings, hub, links
        self.users = Users(settings.root)
        self.sessions, self.locks = Sessions(self.users), LockOut()
        self._consoles = Consoles()
        # scrypt with n = 2^15 takes 32 MB and 0.1 s of a processor: one check at a time (decision 0011).
        self._checking = asyncio.Semaphore(1)
        # And of a peer one waits for that: others have their turn after it, however many guesses it has sent.
        self._turns: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()

    def session(self, connection: HTTPConnection) -> Session | None:
        """The session of a request."""
        return self.sessions.find(connection.cookies.get(COOKIE))

    def refuse(self, request: Request, action: Action | None) -> Response | None:
        """Why a request may not be answered, or None."""
        if request.method == "POST":
            refused = self._refuse_post(request.headers)
            if refused is not None:
                return refused
        if action is None:
            return None
        session = self.session(request)
        if session is None:
            return error(401, refusal(Code.SEC_01, reason=Words.LOG_IN_FIRST))
        if not may(session.role, action):
            forbidden = MessageRefused(
                Code.SEC_01, reason=Words.ROLE_MAY_NOT(role=session.role, action=action)
            )
            who = Identity("", session.user, session.role, self.place(request))
            asked = f"{request.method} {request.url.path}"
            self.hub.refusals.put_text(who, "read", asked, action, forbidden)
            return error(403, forbidden.refusal)
        self.sessions.use(session)
        return None

    def _refuse_post(self, headers: Headers) -> Response | None:
        origin = headers.get("origin")
        # A form of another site sends the cookie too, but never this Origin; scripts send none.
        if origin is not None and origin.lower() not in self.settings.origins:
            return error(403, refusal(Code.SEC_04, reason=Words.FOREIGN_PAGE))
        if headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
            return error(400, refusal(Code.SEC_05, reason=Words.JSON_NEEDED))
        return None

    def place(self, connection: HTTPConnection) -> str:
        """`console` for a browser that has proved to be on this machine, else `remote`."""
        proved = self._consoles.proves(connection.scope, connection.cookies.get(CONSOLE_COOKIE))
        return "console" if proved else "remote"

    def open_console(self, request: Request, token: str) -> Response:
        """The page as the console of this machine, for a browser that was given a link there; or why not."""
        uid = None if is_forwarded(request.scope) else local_user(request.scope)
        if uid is None or not self.links.take(token, uid):
            return error(403, refusal(Code.SEC_01, reason=Words.LINK_DEAD))
        self.hub.events.put("login", f"the page is open at the console, by user {uid} of the system")
        answer = RedirectResponse("/", 303)
        set_cookie(answer, CONSOLE_COOKIE, self._consoles.open(uid), None)
        return answer

    async def log_in(self, request: Request, name: str, password: str) -> Response:
        """Check name and password; a cookie, or why not."""
        address, account = address_of(request.scope), name[:64]
        pair = (account, peer_of(request.scope))
        async with self._turns.setdefault(pair[1], asyncio.Lock()), self._checking:
            # Judged inside: an attempt that waited here comes after the failures before it.
            wait_s = self.locks.wait_s(*pair)
            if wait_s > 0.0:
                locked = refusal(Code.SEC_01, reason=Words.LOCKED_OUT)
                return error(429, locked, retry_after=str(math.ceil(wait_s)))
            try:
                user = await self._check(name, password)
            except StateError:
                return error(503, refusal(Code.SEC_01, reason=Words.NO_USERS))
            count = 0 if user is not None else self.locks.failed(*pair)
        if user is None:
            # A journal that a stranger can fill is no journal: repeated failures are thinned out.
            if worth_writing(count):
                who = Identity("", account, Role.VIEWER, self.place(request))
                self.hub.events.put(
                    "login", f"refused: wrong name or password, {count} times", who, address=address
                )
            return error(401, refusal(Code.SEC_01, reason=Words.WRONG_PASSWORD))
        self.locks.passed(*pair)
        self._end_session(request, f"logged out: {user.name} logs in from the same browser")
        session = self.sessions.open(user, pair[1])
        who = Identity("", user.name, user.role, self.place(request))
        self.hub.events.put("login", "logged in", who, address=address)
        answer = JSONResponse(person(session))
        set_cookie(answer, COOKIE, session.token, round(WHOLE_S))
        return answer

    async def _check(self, name: str, password: str) -> User | None:
        if len(password) > PASSWORD_MAX:
            return None
        return await asyncio.to_thread(self.users.check, name, password)

    def log_out(self, request: Request) -> Response:
        """End the session of a request."""
        self._end_session(request, "logged out")
        answer = Response(status_code=204)
        set_cookie(answer, COOKIE, "", 0)
        return answer

    def _end_session(self, request: Request, text: str) -> None:
        session = self.session(request)
        if session is not None:
            self.sessions.close(session)
            who = Identity("", session.user, session.role, self.place(request))
            self.hub.events.put("login", text, who)


def set_cookie(answer: Response, name: str, value: str, max_age_s: int | None) -> None:
    """Set a cookie that no script reads and no other site sends; it lasts as long as the browser without an age."""
    answer.set_cookie(name, value, max_age=max_age_s, path="/", secure=True, httponly=True, samesite="strict")


def person(session: Session) -> dict[str, object]:
    """User, person, role and permitted actions of a session."""
    return {
        "user": session.user,
        "person": session.person,
        "role": str(session.role),
        "may": rights_of(session.role),
    }
