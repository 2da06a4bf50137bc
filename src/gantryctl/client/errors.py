"""What a client of the service raises beside `DeviceError` and `AlarmStop`."""

from __future__ import annotations

from collections.abc import Mapping

from gantryctl.errors import CommandRefused, GantryctlError


class Refused(CommandRefused):
    """The service has refused; nothing has changed.

    Attributes:
        code: stable, as SEC-07; `gantryctl explain CODE` knows it. text: why, without the code.
        values: fields of the message of the code.
    """

    def __init__(self, code: str, text: str, values: Mapping[str, object] | None = None) -> None:
        super().__init__(f"{code} · {text}")
        self.code, self.text, self.values = code, text, dict(values or {})


class KeyLost(GantryctlError):
    """A held key was let go by the service, and the axis has stopped; to go on, press again.

    Attributes:
        code: of the refusal of its last renewal; "" where there was none.
    """

    exit_code = 4

    def __init__(self, text: str, code: str = "") -> None:
        super().__init__(f"{code} · {text}" if code else text)
        self.code = code


class MotionStopped(GantryctlError):
    """A motion has ended before its target without an alarm: somebody has stopped it, or power was switched off."""

    exit_code = 4
