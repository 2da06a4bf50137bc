"""The exception tree. Exceptions live at the edges; inside the scan there are alarm values instead.

GantryctlError                 every error that a user may see
├── CriterionNotMet            a run finished and its criterion failed               exit code 1
├── UsageError                 a command, argument or named file that cannot be used exit code 2
│   ├── ConfigError            a machine file with wrong fields (all of them listed)  exit code 2
│   └── CommandRefused         understood, but not possible in this state             exit code 2
├── DeviceError                drive, bus, service, state directory or disk trouble  exit code 3
│   ├── InstrumentError        a measuring instrument gave no usable reading         exit code 3
│   └── StateError             retained memory or simulator state cannot be used     exit code 3
└── AlarmStop                  the axis was stopped by an alarm                      exit code 4
"""

from __future__ import annotations

from collections.abc import Sequence


# Each class has an exit code of its own kind, so that a script tells a wrong command from a drive that fails.
class GantryctlError(Exception):
    """Base of every error that a user may see; `exit_code` is what the command line returns."""

    exit_code = 1


class CriterionNotMet(GantryctlError):
    """A measurement finished, and its result is outside the criterion."""

    exit_code = 1


class UsageError(GantryctlError):
    """An argument, or a file that it names, that cannot be used.

    The message names the value, the limit, the unit and what to do.
    """

    exit_code = 2


class ConfigError(UsageError):
    """A machine file that cannot be used.

    Attributes:
        problems: one finished line per wrong field ("file: key = value: allowed range, unit; hint").
    """

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(self.problems))


class CommandRefused(UsageError):
    """A command refused in the present state; nothing has moved."""


class DeviceError(GantryctlError):
    """A fault of a drive, a bus, an instrument, the service, the state directory or the disk."""

    exit_code = 3


class InstrumentError(DeviceError):
    """A measuring instrument gave no reading that can be used; it may be asked again."""


class StateError(DeviceError):
    """Retained memory or simulator state that is missing, locked, damaged or of another machine."""


class AlarmStop(GantryctlError):
    """The axis was stopped by an alarm; the message is the alarm's text.

    Attributes:
        code: of the alarm; "" where it has none.
    """

    exit_code = 4

    def __init__(self, text: str, code: str = "") -> None:
        super().__init__(text)
        # The value alone, not its enumeration: retained memory keeps plain text.
        self.code = str(code)
