"""Steps of commissioning in a service, done from the command line's side."""

from __future__ import annotations

from contextlib import suppress

from gantryctl.errors import DeviceError
from gantryctl.service.clients.link import ServiceLink
from support.service_process import Service

STILL = ("identity", "encoder", "defaults", "parameters", "pdo", "sync", "nodes")
_ORDER = (*STILL, "silence", "watchdog", "brake", "sign", "velocity", "ring", "loop", "stops")


def do_before(service: Service, step: str) -> None:
    """Every required step of a service on hust_can.toml before one; control is given back."""
    with ServiceLink(service.root / "hust_can") as link:
        link.ask("take", over=True)
        link.ask("commission_begin")
        while link.tags["commissioning"] != "waiting":
            with suppress(DeviceError):  # silent for as long as the processes take turns
                link.look()
        link.ask("take", over=True)
        for key in _ORDER[: _ORDER.index(step)]:
            before = link.look()["commissioning_results"]
            link.ask("arm", action="commission", step=key)
            link.ask("commission_step", step=key)
            while link.look()["commissioning_results"] == before or link.tags["commissioning"] != "waiting":
                link.alive()
