"""`gantryctl config set`: values of a machine file, changed as a person would; all else stays as it stands."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.values import INPUT, check_lasting

if TYPE_CHECKING:
    from gantryctl.machine import Machine
    from gantryctl.machine.reading import Data
    from gantryctl.machine.specs import FieldSpec

_NUMBER = re.compile(r"[+-]?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?")


@click.command("set")
@click.argument("words", metavar="KEY VALUE [KEY VALUE]...", nargs=-1, required=True)
@click.option("--config", "file", type=INPUT, help="The machine file to change.")
def set_value(words: tuple[str, ...], file: Path | None) -> None:
    """Set KEY (control.kvf) to VALUE in a machine file, keeping its comments.

    Several keys are set at once: those that make a machine only together. The whole machine is checked first, as
    `config check` does; what makes no machine is refused and changes nothing. A running service takes it in force at
    its next start. A negative VALUE stands behind `--`: config set --config FILE -- KEY -5.
    """
    from gantryctl.errors import UsageError
    from gantryctl.files import check_place, write_whole
    from gantryctl.machine import field_specs, load_machine, show_value, warnings_of
    from gantryctl.machine.specs import value_at

    if file is None:
        raise UsageError(
            "--config: the delivered machine is not changed; `gantryctl config init` makes one of your own"
        )
    check_lasting(file, "--config")
    check_place(file)
    text, machine = with_values(file, _pairs(words))
    check_whole(machine)
    before = load_machine(file)
    write_whole(file, text)
    for key in words[::2]:
        spec, old, new = field_specs()[key], value_at(before, key), value_at(machine, key)
        click.echo(f"{file}: {spec.place}: {show_value(old)} -> {show_value(new)}{spec.unit_text}")
    for line in warnings_of(machine):
        click.echo(f"warning: {line}")


def _pairs(words: Sequence[str]) -> dict[str, str]:
    """Value by key, of words that alternate."""
    from gantryctl.errors import UsageError
    from gantryctl.machine.reading import printable

    if len(words) % 2:
        raise UsageError(
            f"{printable(words[-1])} has no value: keys and values alternate, KEY VALUE KEY VALUE"
        )
    keys = words[::2]
    twice = next((key for number, key in enumerate(keys) if key in keys[:number]), None)
    if twice is not None:
        raise UsageError(f"{printable(twice)} is named twice: give it one value")
    return dict(zip(keys, words[1::2], strict=True))


def check_whole(machine: Machine) -> None:
    """Refuse what `move` would: a compensation without its calibration, a quick stop that the full plant does not bear.

    Raises:
        ConfigError: one line per problem.
    """
    from gantryctl.engineering.stops import check_quick_stop

    # Numbers come from a calibration file only, never from [plant] (decision 0010).
    if machine.control.compensation.any_active:
        from gantryctl.wiring.compensation import compensation

        compensation(machine)
    check_quick_stop(machine, propose=True)


def with_values(path: Path, values: Mapping[str, str]) -> tuple[str, Machine]:
    """Set keys in the text of a machine file; nothing is written.

    Args:
        values: by dotted path, "control.kvf", a value as TOML; a word or text may stand without quotation marks.

    Returns:
        The new text, and the whole machine that it describes, checked.

    Raises:
        ConfigError: one line per problem: no such key, a value that it does not take, a rule between keys.
        UsageError: a key stands in the file in a form that has to be changed by hand.
    """
    from gantryctl.errors import ConfigError, UsageError
    from gantryctl.machine import field_specs
    from gantryctl.machine.calibration import load_calibration
    from gantryctl.machine.loading import parse_machine
    from gantryctl.machine.problems import unknown_path
    from gantryctl.machine.reading import parse_toml, printable, read_text

    unknown = [unknown_path(key) for key in values if key not in field_specs()]
    if unknown:
        raise ConfigError(unknown)
    changed = read_text(path)
    wanted = parse_toml(changed, str(path))
    for key, value in values.items():
        spec = field_specs()[key]
        written = _as_toml(spec, value)
        changed = _edited(changed, spec, written)
        wanted = _set(wanted, key, tomllib.loads(f"x = {written}")["x"])
        # Whatever the text looks like: it must mean the same but for this key.
        try:
            same = tomllib.loads(changed) == wanted
        except tomllib.TOMLDecodeError:
            same = False
        if not same:
            raise UsageError(f"{path}: {spec.place} stands there in a form that only an editor can change")
    name = f"{path} with " + ", ".join(f"{key} = {printable(value)}" for key, value in values.items())
    machine = parse_machine(changed, name).read_from(path.resolve())
    named = machine.control.compensation.calibration
    beside = path.parent / named
    return changed, machine.calibrated(load_calibration(beside)) if named and beside.exists() else machine


def _as_toml(spec: FieldSpec, value: str) -> str:
    """The value as it is written: numbers by the digits 0 to 9, words in quotation marks."""
    from gantryctl.errors import ConfigError
    from gantryctl.machine.reading import printable

    value = value.strip()
    if spec.kind in ("word", "text") and not value.startswith(('"', "'")):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if spec.kind in ("number", "integer") and not _NUMBER.fullmatch(value):
        raise ConfigError([f"{spec.place}: {printable(value)} is not a number; allowed: {spec.allowed}"])
    try:
        if "\n" not in value and list(tomllib.loads(f"x = {value}")) == ["x"] and "#" not in value:
            return value
    except tomllib.TOMLDecodeError:
        pass
    raise ConfigError([f"{spec.place}: {printable(value)} is no value in TOML; allowed: {spec.allowed}"])


def _edited(text: str, spec: FieldSpec, written: str) -> str:
    """The text with the line of the key replaced, put at the end of its table, or a table of its own at the end."""
    end = "\r\n" if "\r\n" in text else "\n"
    lines = text.split(end)
    head = re.compile(rf"\s*\[\s*{re.escape(spec.table)}\s*\]\s*(#.*)?")
    at = next((number for number, line in enumerate(lines) if head.fullmatch(line)), None)
    line = f"{spec.key} = {written}"
    if at is None:
        return f"{text.rstrip()}{end}{end}[{spec.table}]{end}{line}{end}"
    # A table ends where the next one begins.
    after = next((n for n in range(at + 1, len(lines)) if lines[n].lstrip().startswith("[")), len(lines))
    for number in range(at + 1, after):
        found = re.fullmatch(rf"(\s*){re.escape(spec.key)}\s*=\s*(.*?)(\s*)(#[^\"']*)?", lines[number])
        if found is not None:
            # The comment stays in its column where there is room.
            comment = (
                f"{' ' * max(1, len(found[3]) + len(found[2]) - len(written))}{found[4]}" if found[4] else ""
            )
            lines[number] = f"{found[1]}{line}{comment}"
            return end.join(lines)
    last = max(
        n for n in range(at, after) if (lines[n].strip() and not lines[n].lstrip().startswith("#")) or n == at
    )
    return end.join([*lines[: last + 1], line, *lines[last + 1 :]])


def _set(data: Data, key: str, value: Any) -> Data:
    *tables, name = key.split(".")
    if not tables:
        return {**data, name: value}
    inner = data.get(tables[0], {})
    return {**data, tables[0]: _set(inner, ".".join([*tables[1:], name]), value)}
