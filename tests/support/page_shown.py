"""The built page on a service that only its browser knows: it says what the test wants, as fast as a page is judged.

For looks, not for motion: what a command does is tested on the real service. No process runs beside the browser, so
that a picture has no chance in it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Route

from gantryctl.service.protocol.roles import Role, rights_of
from gantryctl.service.protocol.tags import TAGS

BUILT = Path(__file__).resolve().parents[2] / "src" / "gantryctl" / "gateway" / "page"
_URL = "http://localhost:1/"
_KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
_ROLE = Role.SERVICE
_SESSION = {
    "user": "service", "person": "service", "role": str(_ROLE),
    "may": rights_of(_ROLE),
}  # fmt: skip
_EMPTY = {"bool": False, "int": 0, "float": 0.0, "text": "", "messages": [], "rows": [], "pairs": []}
_GANTRY: dict[str, Any] = {
    "machine": "hust_gantry", "drive_kind": "sim", "axis_kind": "linear", "display": "-180..180", "drawing": "couch",
    "config_hash": "0123456789ab", "version": "0.1.0", "scan_period_ms": 4.0,
    "pos_min_deg": -180.0, "pos_max_deg": 180.0, "reach_min_deg": -180.0, "reach_max_deg": 180.0,
    "over_travel_min_deg": -180.5, "over_travel_max_deg": 180.5, "limit_switch_min_deg": -182.0,
    "limit_switch_max_deg": 182.0, "mechanical_stop_min_deg": -187.0, "mechanical_stop_max_deg": 187.0,
    "following_error_trip_deg": 0.03, "torque_rated_nm": 257.0, "torque_max_nm": 385.0,
    "speed_min_deg_s": 0.6, "speed_max_deg_s": 6.0, "speed_cap_deg_s": 1.0, "speed_setting_deg_s": 0.6,
    "acc_min_deg_s2": 0.04, "acc_max_deg_s2": 0.39, "acc_setting_deg_s2": 0.39, "increment_deg": 1.0,
    "increment_max_deg": 360.0, "override_percent": 100.0, "brake_test_level_nm": 250.0, "brake_test_limit_deg": 0.02,
    "brake_test_available": True, "brake_test_cycles_left": 100, "at_rest": True, "position_valid": True,
    "estop_ok": True, "mains_ready": True, "limit_minus_ok": True, "limit_plus_ok": True, "unheld_power_left_s": None,
}  # fmt: skip
AT_REST: dict[str, Any] = {
    tag.name: tag.labels[0] if tag.kind == "enum" else _EMPTY[tag.kind] for tag in TAGS
} | _GANTRY
"""All tags of a reference machine that has just been started."""

_FAKE = """(() => {
  window.tags = TAGS;
  window.sent = [];
  window.WebSocket = class {
    static OPEN = 1;
    readyState = 0;
    constructor() { setTimeout(() => this.begin()); }
    begin() {
      this.readyState = 1;
      this.say(WELCOME);
      setInterval(() => this.status(), 50);
      this.status();
    }
    status() {
      const now = performance.now();
      const tags = { ...window.tags, issued_ms: now, time_s: now / 1000 };
      this.say({ type: 'status', frame: 'f', fresh: true, age_ms: 0, tags });
    }
    say(message) { this.onmessage?.({ data: JSON.stringify(message) }); }
    send(text) {
      const { type, seq } = JSON.parse(text);
      window.sent.push(type);
      this.say({ type: 'reply', seq, ok: true, code: '', text: '', values: {}, epoch: null, journal: 0 });
    }
    close() {}
  };
})()"""
_WELCOME = {
    "type": "welcome", "client": "mine", "place": "remote", "version": "0.1.0", "lease_ms": 250, "renew_ms": 30,
    "key_view_max_ms": 200, "round_trip_max_ms": 150, "stale_ms": 500, **_SESSION,
}  # fmt: skip
IN_CONTROL = {"authority_user": "service", "authority_client": _WELCOME["client"]}


class Shown:
    """One page with a touch screen; its tags, size, area, language and theme are chosen.

    Args:
        built: the folder of the built page.

    Attributes:
        answers: by path, `api/v1/tags`; every other one gets an empty list.
    """

    def __init__(self, browser: Browser, built: Path = BUILT) -> None:
        self._built = built
        self.answers: dict[str, Any] = {}
        self.context = browser.new_context(locale="en-GB", has_touch=True)
        self.context.route("**/*", self._answer)
        fake = _FAKE.replace("TAGS", json.dumps(AT_REST)).replace("WELCOME", json.dumps(_WELCOME))
        self.context.add_init_script(fake)
        self.page = self.context.new_page()
        self._open()

    def _answer(self, route: Route) -> None:
        path = route.request.url.removeprefix(_URL).partition("?")[0] or "index.html"
        file = self._built / path
        if path == "api/v1/session":
            route.fulfill(json=_SESSION)
        elif path in self.answers:
            route.fulfill(json=self.answers[path])
        elif file.is_file():
            route.fulfill(body=file.read_bytes(), content_type=_KINDS[file.suffix])
        else:
            route.fulfill(json=[])

    def _open(self) -> None:
        self.page.goto(_URL)
        self.page.locator("[data-stale=false]").wait_for()

    def show(self, tags: Mapping[str, Any], language: str = "en", theme: str = "light") -> None:
        """Load anew, with these tags in place of those at rest."""
        self.page.evaluate(
            "([language, theme]) => { localStorage['gantryctl.language'] = language;"
            " localStorage['gantryctl.theme'] = theme }",
            [language, theme],
        )
        self._open()
        self.change(tags)

    def change(self, tags: Mapping[str, Any]) -> None:
        """Other values of some tags, from the next frame on."""
        self.page.evaluate("(tags) => Object.assign(window.tags, tags)", dict(tags))
        self.page.wait_for_timeout(100)

    def go(self, area: str) -> None:
        self.page.evaluate("(area) => { location.hash = area }", area)
        self.page.locator(f"[data-area={area}]").wait_for()

    def resize(self, width: int, height: int) -> None:
        """Also waits until what watches the size has drawn anew."""
        self.page.set_viewport_size({"width": width, "height": height})
        self.page.evaluate(
            "() => new Promise((done) =>"
            " requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 20))))"
        )

    def scroll(self, top: float) -> None:
        self.page.evaluate("(top) => { document.querySelector('main').scrollTop = top }", top)

    def tap(self, selector: str) -> list[str]:
        """What the page sends when a finger meets the middle of an element."""
        self.page.evaluate("() => { window.sent = [] }")
        box = self.page.locator(selector).bounding_box()
        assert box is not None
        self.page.touchscreen.tap(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        return [str(each) for each in self.page.evaluate("() => window.sent")]
