"""A scenario: one machine, one person and the faults of thirty seconds, as a value that a file can hold."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from gantryctl.engineering.faults.case import FaultCase
from gantryctl.engineering.faults.catalogue import fault_case
from gantryctl.engineering.faults.injection import Injection, When, read_document
from gantryctl.engineering.faults.kinds.kind import Value
from gantryctl.errors import UsageError

_MODEL: Final = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)
_Time = Annotated[float, Field(ge=0.0, le=3600.0)]
Deed = Literal[
    "power", "power_off", "move", "jog", "increment", "halt", "stop", "quick_stop", "reset", "recover", "override",
    "brake_test",
]  # fmt: skip
"""What a person does at one moment; `recover` is: let everything go, reset, power again."""
Number = Annotated[float, Field(ge=-1e12, le=1e12)]


class Action(BaseModel):
    """One deed of the operator.

    Attributes:
        at_s: virtual time.
        target_deg: of a move. speed_deg_s: of a move, or of a jog; the sign of a jog is its key.
        step_deg: of an increment; the sign is the key. value: of the override.
        for_s: how long a key, stop or quick stop is held.
        lease_s: a key's lease is renewed for so long only, as by a network that goes.
        lease_age_s: age of each renewal.
    """

    model_config = _MODEL

    at_s: _Time
    do: Deed
    target_deg: Number = 0.0
    speed_deg_s: Number = 1.0
    step_deg: Number = 1.0
    value: Number = 1.0
    for_s: _Time = 0.5
    lease_s: _Time | None = None
    lease_age_s: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0


class PlannedFault(BaseModel):
    """One row of the catalogue at one moment.

    Attributes:
        number: of the row. at_s: virtual time.
        for_s: standing faults end after so long; None: they stay.
        args: arguments of the row's first injection that are other than the row's.
    """

    model_config = _MODEL

    number: str
    at_s: _Time
    for_s: Annotated[float, Field(gt=0.0, le=3600.0)] | None = None
    args: dict[str, Value] = Field(default_factory=dict)

    @field_validator("number")
    @classmethod
    def _known(cls, value: str) -> str:
        try:
            return fault_case(value).number
        except UsageError as wrong:
            raise ValueError(str(wrong)) from None

    @model_validator(mode="after")
    def _fits(self) -> PlannedFault:
        self.injections()
        return self

    @property
    def case(self) -> FaultCase:
        """Its row."""
        return fault_case(self.number)

    def injections(self) -> list[Injection]:
        """What is injected, by virtual time."""
        found = []
        for place, each in enumerate(self.case.injections):
            when = When(after_s=self.at_s + (each.when.after_s or 0.0)) if each.when.by_clock else each.when
            args = {**each.args, **(self.args if place == 0 else {})}
            for_s = each.for_s if self.for_s is None or each.for_s is not None else self.for_s
            found.append(
                Injection(where=each.where, kind=each.kind, args=args, when=when, for_s=for_s)
            )  # fmt: skip
        return found


class Scenario(BaseModel):
    """All that decides a run, bit by bit.

    Attributes:
        name: of the campaign and its number, for people.
        template: of `gantryctl new`, which drafts the axis, with `answers` in place of its own; "" for another.
        improved: the gantry of hust_improved.toml; else, and without a template, the reference gantry.
        drive: the simulated drive in process, or the virtual one behind a bus. beside: with nodes beside it.
        inverted: the motor on the bus is mounted the other way round, and the machine file says it.
        scan_ms, answer_ms: scan period; how long a scan waits for the bus.
        plant_seed: of a plant within 20 %; None: that of the machine file. edge: each of its values is 20 % off.
        second_pinion: the gear has one.
        ramp_deg_s2: acceleration and deceleration; None: those of the machine file.
        hold_s: the brake closes after so long at standstill; None: torque holds.
        angle_deg: at the start.
    """

    model_config = _MODEL

    name: str = "file"
    template: str = ""
    answers: dict[str, Number] = Field(default_factory=dict)
    improved: bool = False
    drive: Literal["sim", "bus"] = "sim"
    beside: bool = False
    brake_owner: Literal["drive", "object_60FE"] = "drive"
    inverted: bool = False
    scan_ms: Annotated[float, Field(ge=0.5, le=20.0)] = 4.0
    answer_ms: Annotated[float, Field(ge=0.1, le=20.0)] = 2.0
    plant_seed: Annotated[int, Field(ge=0)] | None = None
    edge: bool = False
    second_pinion: bool = False
    ramp_deg_s2: Annotated[float, Field(gt=0.0, le=2.0)] | None = None
    hold_s: Annotated[float, Field(gt=0.0, le=60.0)] | None = None
    angle_deg: Annotated[float, Field(ge=-3600.0, le=3600.0)] = 0.0
    duration_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 30.0
    actions: tuple[Action, ...] = ()
    faults: tuple[PlannedFault, ...] = ()

    @field_validator("actions", "faults", mode="before")
    @classmethod
    def _rows(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value

    @model_validator(mode="after")
    def _one_axis(self) -> Scenario:
        if self.inverted and self.drive == "sim":
            raise ValueError("inverted: the simulated drive has no mounting, a drive on the bus has")
        if self.of_reference:
            return self
        if self.beside or self.second_pinion or (self.template and self.improved):
            raise ValueError(
                "another axis is of one kind, without nodes beside its drive, and has one pinion"
            )
        if self.improved and self.drive == "bus":
            raise ValueError("the encoder on the ring of the improved gantry is of the simulated drive")
        return self

    @property
    def of_reference(self) -> bool:
        """Its axis is the reference gantry."""
        return not (self.template or self.improved)

    @property
    def label(self) -> str:
        """Its faults in one word, "A2+C12", or "none"."""
        return "+".join(each.number for each in self.faults) or "none"


def scenario_toml(scenario: Scenario) -> str:
    """A file that gives the same scenario again, number for number."""
    lines = []
    plain = scenario.model_dump(exclude={"actions", "faults"}, exclude_none=True)
    for name in ("template", "answers", "improved"):
        if not plain[name]:
            del plain[name]
    lines += [f"{name} = {_literal(value)}" for name, value in plain.items()]
    for table, rows in (("actions", scenario.actions), ("faults", scenario.faults)):
        for row in rows:
            given = row.model_dump(exclude_defaults=True, exclude_none=True)
            lines += ["", f"[[{table}]]"]
            lines += [f"{name} = {_literal(value)}" for name, value in given.items()]
    return "\n".join(lines) + "\n"


def _literal(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        # `repr` gives the same bits again, and TOML reads its exponents.
        return repr(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name} = {_literal(each)}" for name, each in value.items()) + " }"
    assert isinstance(value, str)
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'


def load_scenario(path: Path) -> Scenario:
    """A scenario from a TOML or JSON file.

    Raises:
        UsageError: the file cannot be read, or something in it is wrong.
    """
    data = read_document(path)
    try:
        return Scenario.model_validate(data)
    except ValidationError as wrong:
        first = wrong.errors(include_context=False)[0]
    # Not inside: the context of a raised error keeps its frames (machine/loading.py).
    place = ".".join(str(part) for part in first["loc"])
    raise UsageError(f"{path}: {place}: {first['msg'].removeprefix('Value error, ')}")
