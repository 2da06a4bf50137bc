"""`gantryctl eds`: an EDS or DCF compared with the needs of a speed axis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.options import PATH, json_option, print_json

if TYPE_CHECKING:
    from pathlib import Path

    from gantryctl.drives.od.model import DeviceDescription, Entry
    from gantryctl.drives.od.standard import Finding

_HEADINGS = {
    "must": "Without these there is no CSV axis",
    "stop": "These decide what happens when something breaks",
    "may": "These make the axis better",
}


@click.group()
def eds() -> None:
    """EDS and DCF files of drives."""


@eds.command()
@click.argument("file", type=PATH)
@click.option(
    "--node", "node_id", type=click.IntRange(1, 127), help="Node id that values of a DCF are wanted for."
)
@json_option
def check(file: Path, node_id: int | None, as_json: bool) -> int:
    """Compare FILE with the needs of a CSV axis, with the substitute for each missing object.

    Exit code 1 when an object is missing without which there is no CSV axis.
    """
    from gantryctl.drives.od.reading import read_eds
    from gantryctl.drives.od.standard import check_csv_axis, lacking

    device = read_eds(file, node_id)
    findings = check_csv_axis(device)
    missing = lacking(findings)
    if as_json:
        print_json(_data(device, findings, not missing))
        return int(bool(missing))
    _heading(device, file)
    for need, heading in _HEADINGS.items():
        click.echo(f"\n{heading}")
        for finding in findings:
            if finding.wish.need == need:
                _line(finding)
    # Real files break the standard in many ways (decision 0008): read all the same, but not in silence.
    if device.notes:
        click.echo("\nOdd in this file, read all the same")
        for note in device.notes:
            click.echo(f"  {note}")
    click.echo(f"\n{_verdict(findings, missing)}")
    return int(bool(missing))


def _heading(device: DeviceDescription, file: Path) -> None:
    info = device.info
    # CiA 306: an EDS describes a type of device, a DCF one device with the values of its node.
    kind = "DCF" if device.is_dcf else "EDS"
    maker = " ".join(part for part in (info.vendor_name, info.product_name) if part) or "no names in it"
    rates = ", ".join(f"{rate // 1000}" for rate in info.bit_rates)
    click.echo(f"{file}: {kind}, {maker}; {len(device.objects)} objects; kbit/s: {rates or 'not said'}")
    if device.is_dcf and device.node_id is not None:
        click.echo(
            f"values for node {device.node_id}; they are compared with the drive, never written from here"
        )


def _line(finding: Finding) -> None:
    wish, entry = finding.wish, finding.entry
    mark = "has  " if finding.ok else "LACKS" if wish.need == "must" else "lacks"
    what = f"{wish.place} {wish.standard.name}"
    have = "" if entry is None else _have(entry)
    click.echo(f"  {mark}  {what:44} {have}".rstrip())
    for remark in finding.remarks:
        click.echo(f"           {remark}")


def _have(entry: Entry) -> str:
    maps = "/".join(name for name, can in (("RPDO", entry.rpdo), ("TPDO", entry.tpdo)) if can)
    values = [] if entry.default is None else [f"default {_shown(entry.default, entry.node_relative)}"]
    if entry.value is not None:
        values.append(f"DCF {_shown(entry.value, False)}")
    return ", ".join([f"{entry.data_type.label} {entry.access.value}", *([maps] if maps else []), *values])


def _shown(value: object, relative: bool) -> str:
    # CiA 306 lets a file give values relative to the node id, COB-IDs above all: $NODEID+0x180.
    text = f"0x{value:X}" if isinstance(value, int) and (relative or value > 0xFFF) else str(value)
    return f"$NODEID+{text}" if relative else text


def _verdict(findings: tuple[Finding, ...], missing: tuple[Finding, ...]) -> str:
    if missing:
        names = ", ".join(finding.wish.place for finding in missing)
        return f"No CSV axis by this file: {names} lacking."
    stop = [finding.wish.place for finding in findings if finding.wish.need == "stop" and not finding.ok]
    # Consumer heartbeat time and event timer of RPDO 1 (CiA 301): one of them must end the motion of a drive that no
    # longer hears its controller.
    if {"1016:01", "1400:05"} <= set(stop):
        return (
            "A CSV axis by this file, but nothing in it stops the axis of a silent controller "
            "(neither 1016 nor 1400:05): not without a hard-wired watchdog."
        )
    if not stop:
        return "A CSV axis by this file. A file is a promise: modes, defaults and reactions are read from the drive."
    return f"A CSV axis by this file; to be proved at standstill, for the file lacks {', '.join(stop)}."


def _data(device: DeviceDescription, findings: tuple[Finding, ...], usable: bool) -> dict[str, Any]:
    return {
        "usable": usable,
        "is_dcf": device.is_dcf,
        "node_id": device.node_id,
        "vendor": device.info.vendor_name,
        "product": device.info.product_name,
        "objects": len(device.objects),
        "notes": [note._asdict() for note in device.notes],
        "findings": [
            {
                "object": finding.wish.place,
                "name": finding.wish.standard.name,
                "need": finding.wish.need.value,
                "ok": finding.ok,
                "has": None if finding.entry is None else _have(finding.entry),
                "remarks": list(finding.remarks),
            }
            for finding in findings
        ],
    }
