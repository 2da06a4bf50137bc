"""Starts the service for a command line: address, self-test, processes."""

from __future__ import annotations

import asyncio
import ipaddress
import json
import socket
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import click

from gantryctl.cli.progress import metered
from gantryctl.errors import StateError, UsageError
from gantryctl.machine import Machine, default_machine_path, short_hash
from gantryctl.operation.store import StateStore, state_root
from gantryctl.service.backup.settings import keep_service_options
from gantryctl.service.recorder.retention import RetentionPolicy
from gantryctl.service.supervisor.certificates import refuse_expired
from gantryctl.service.supervisor.private_files import private_files
from gantryctl.service.supervisor.process import Options, Supervisor
from gantryctl.service.supervisor.selftest import self_test
from gantryctl.service.supervisor.users import Users
from gantryctl.terminal import tell


class Listen(NamedTuple):
    """Address of the page, as given on the command line."""

    address: str
    certificate: Path | None
    key: Path | None
    names: tuple[str, ...]


def run_service(
    machine: Machine,
    config_file: Path | None,
    page: Listen | None,
    opcua: str | None,
    *,
    keeping: RetentionPolicy,
    second_person: bool = False,
    bus_log: Path | None = None,
) -> int:
    """Check, start, say where, wait for the end; the exit code.

    Raises:
        UsageError: an address or a size that may not be used. StateError: the self-test failed.
    """
    if bus_log is not None and not machine.on_bus:
        raise UsageError(
            f'--bus-log {bus_log}: [drive] kind = "{machine.drive.kind}" has no bus; use "canopen"'
        )
    root = state_root().resolve()
    listener = None if page is None else _listener(page, root)
    store = StateStore(machine, root)
    # Before anything is started, and all of them: a person sees every fault in one go.
    tls_key = None if page is None or page.key is None else page.key.resolve()
    secrets = private_files(root, store.directory, tls_key)
    with metered(1.0) as meter:
        checks = self_test(machine, store, root, keeping.checked(), secrets, meter.reach)
    for check in checks:
        if not check.ok:
            tell(f"warning: {check.name}: {check.text}")
    # A damaged journal is a warning: the service starts and allows no new motion, so that somebody can look at it.
    if any(check.vital and not check.ok for check in checks):
        raise StateError("the self-test failed: the service does not start")
    config = (config_file or default_machine_path()).resolve()
    keep_service_options(
        store.directory,
        {
            "config": str(config),
            "page": None if page is None else _options_of(page),
            "opcua": opcua,
            "second_person": second_person,
            "bus_log": None if bus_log is None else str(bus_log.resolve()),
            **keeping._asdict(),
        },
    )
    gateway = (
        None if page is None or listener is None else gateway_command(page, listener, root, store.directory)
    )
    supervisor = Supervisor(
        machine,
        config,
        store.directory,
        gateway,
        listener.fileno() if listener is not None else -1,
        None if opcua is None else opcua_command(opcua, root, store.directory),
        tell,
        Options(
            keeping,
            lambda: certificate_files(page, store.directory if opcua else None),
            second_person,
            Users(root),
            {check.name: check.text for check in checks},
            "" if page is None or listener is None else address_of(page, listener),
            None if bus_log is None else bus_log.resolve(),
            "gantryctl.commissioning.in_service" if machine.on_bus else "",
        ),
    )

    def ready() -> None:
        lines = [
            f"{machine.name} is in service (configuration {short_hash(machine)}, {machine.drive.kind} drive)"
        ]
        if page is None or listener is None:
            lines += ["no page; `gantryctl attach` sends commands here"]
        else:
            lines += [
                f"page: {address_of(page, listener)}",
                "`gantryctl console` opens it as the console of this machine",
                how_to_log_in(Users(root)),
            ]
        lines += ["Ctrl-C: the axis comes to rest, brake closed, torque off"]
        # It serves whoever reads its lines.
        with suppress(OSError):
            click.echo("\n".join(lines))

    return asyncio.run(supervisor.run(ready))


def _options_of(page: Listen) -> dict[str, object]:
    files = {"tls_cert": page.certificate, "tls_key": page.key}
    return {
        "listen": page.address,
        **{name: str(file.resolve()) if file else None for name, file in files.items()},
        "names": list(page.names),
    }


def opcua_command(address: str, root: Path, directory: Path) -> list[str]:
    """Module and settings of the OPC UA process.

    Raises:
        UsageError: there are no users for an address beyond loopback.
    """
    host, port = split(address, "--opcua", 4840)
    # An extra, because no controller needs it, and in a process of its own: a foreign stack must not disturb a scan.
    if not is_loopback(host) and not Users(root).all():
        raise UsageError(f"--opcua {address}: there are no users: gantryctl user add NAME --role viewer")
    settings = {
        "host": host,
        "port": port,
        "root": str(root),
        "directory": str(directory),
    }
    return ["gantryctl.gateway.opcua", json.dumps(settings)]


def certificate_files(page: Listen | None, opcua: Path | None) -> list[Path]:
    """Of the page and, below the directory given, of OPC UA: its own and those of its clients."""
    found = [] if page is None or page.certificate is None else [page.certificate]
    if opcua is not None:
        folder = opcua / "opcua"
        found += [*folder.glob("certificate.der"), *sorted(folder.glob("trusted/*"))]
    return found


def _listener(page: Listen, root: Path) -> socket.socket:
    """The listening socket, after the checks on where it may listen.

    Raises:
        UsageError: an address beyond loopback without TLS or without users, or one that cannot be had.
    """
    host, port = split(page.address)
    if (page.certificate is None) != (page.key is None):
        raise UsageError("--tls-cert and --tls-key belong together")
    # Found here with its name, not as a failure of the gateway seconds later.
    for file in (page.certificate, page.key):
        if file is not None and not file.is_file():
            raise UsageError(f"{file}: there is no such file")
    # The page commands a heavy machine: beyond this computer it needs TLS, and somebody who may log in.
    if not is_loopback(host):
        if page.certificate is None:
            raise UsageError(
                f"--listen {page.address}: other machines reach it: it needs --tls-cert and --tls-key"
            )
        if not Users(root).all():
            raise UsageError(
                f"--listen {page.address}: there are no users: gantryctl user add NAME --role operator"
            )
    if page.certificate is not None:
        refuse_expired(page.certificate, datetime.now(UTC))
    # Opened by the supervisor and inherited by the gateway: one that restarts misses no connection (decision 0011).
    try:
        family, *_, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        # A crowd of local clients must not keep a page waiting for the next attempt of its SYN, 1 or 3 s later:
        # with 1,024 one page of 17 waited for 3 s beside a thousand clients. The kernel has its own limit too.
        return socket.create_server(address[:2], family=family, backlog=4096)
    except PermissionError as fault:
        raise UsageError(
            f"--listen {page.address}: ports below 1024 need the capability CAP_NET_BIND_SERVICE, which "
            f"packaging/gantryctl.service grants; without it use {host}:8650, for example"
        ) from fault
    except OSError as fault:
        raise UsageError(
            f"--listen {page.address}: {fault.strerror or fault}; a free port: {host}:0"
        ) from fault


def address_of(page: Listen, listener: socket.socket) -> str:
    """The page's address for people."""
    host, port = split(page.address)[0], listener.getsockname()[1]
    shown = page.names[0] if page.names else (f"[{host}]" if ":" in host else host)
    return f"{'https' if page.certificate else 'http'}://{shown}:{port}/"


def how_to_log_in(users: Users) -> str:
    """Name the users who can log in, or the command that makes one."""
    names = sorted(users.all())
    if names:
        return f"log in as: {', '.join(names)}"
    return "there are no users yet: gantryctl user add NAME --role operator"


def split(address: str, option: str = "--listen", usual_port: int = 8650) -> tuple[str, int]:
    """Split HOST:PORT of an option; UsageError for anything else."""
    host, colon, port = address.rpartition(":")
    host = host.strip("[]")
    # `isdigit` alone takes a superscript, which is no number.
    if not colon or not host or not (port.isascii() and port.isdigit()) or not int(port) <= 65535:
        raise UsageError(f"{option} {address}: write HOST:PORT, for example 127.0.0.1:{usual_port}")
    return host, int(port)


def is_loopback(host: str) -> bool:
    """Only this computer reaches the address."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def gateway_command(page: Listen, listener: socket.socket, root: Path, directory: Path) -> list[str]:
    """Module and settings of the gateway process."""
    settings = {
        "host": split(page.address)[0],
        "port": listener.getsockname()[1],
        "listener": listener.fileno(),
        "certificate": str(page.certificate.resolve()) if page.certificate else None,
        "key": str(page.key.resolve()) if page.key else None,
        "names": list(page.names),
        "root": str(root),
        "directory": str(directory),
    }
    # One JSON argument: the gateway is a process of its own.
    return ["gantryctl.gateway", json.dumps(settings)]
