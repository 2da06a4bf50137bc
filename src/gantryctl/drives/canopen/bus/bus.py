"""A python-can bus by name, opened or refused in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from gantryctl.errors import DeviceError, UsageError

if TYPE_CHECKING:
    import can

UDP_GROUP: Final = "239.74.163.2"
"""python-can's IPv4 group; its default, the IPv6 one, is lost on many hosts."""
ECHOING: Final = ("udp_multicast",)
"""Interfaces that deliver our own frames back."""


def open_bus(interface: str, channel: str | None = None, bitrate: int | None = None) -> can.BusABC:
    """Open a bus; nothing of python-can's own configuration files is used.

    Raises:
        UsageError: there is no such interface. DeviceError: it cannot be opened.
    """
    import can

    if interface not in can.VALID_INTERFACES:
        known = ", ".join(sorted(can.VALID_INTERFACES))
        raise UsageError(f"CAN interface {interface!r}: python-can has no such interface; it has: {known}")
    if not channel and interface == "udp_multicast":
        channel = UDP_GROUP
    options: dict[str, Any] = {} if bitrate is None else {"bitrate": bitrate}
    if channel:
        options["channel"] = channel
    try:
        return can.Bus(interface=interface, ignore_config=True, **options)
    except (can.CanError, OSError, ValueError, ImportError, TypeError) as fault:
        where = interface if not channel else f"{interface}, channel {channel}"
        raise DeviceError(f"the CAN interface cannot be opened ({where}): {fault}") from None
