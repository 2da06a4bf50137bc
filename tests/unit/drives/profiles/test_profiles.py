"""Profiles: chosen by what a drive says, in agreement with the object tables, refused where a drive says otherwise."""

from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.drives.canopen.setup.survey import survey
from gantryctl.drives.od.facts import DriveFacts, facts_of
from gantryctl.drives.od.object_table import ObjectTable, read_object_tables
from gantryctl.drives.profiles import Tried, load_profile, profile_names, profile_of
from gantryctl.drives.profiles.page import reference_page
from gantryctl.drives.profiles.profile import key_of
from gantryctl.drives.virtual.communication.objects import device_tables
from gantryctl.drives.virtual.personality import Personality
from gantryctl.errors import ConfigError, UsageError
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.wiring.virtual import as_in_table, shipped_objects, virtual_node
from support.command_line import cli, done, machine_file
from unit.drives.virtual.bench import hardware

TABLES = read_object_tables(shipped_objects())
PROFILES = [load_profile(name) for name in profile_names()]
MACHINE = load_machine(configs_folder() / "hust_can.toml")


def facts(table: ObjectTable) -> DriveFacts:
    """As a drive in software with this table tells them."""
    device = device_tables(hardware(), as_in_table(Personality(), table, MACHINE))[1]
    # `info` is that of the virtual drive; object 1018 is the model's.
    plate = replace(device.info, vendor_number=None, product_number=None, revision_number=None)
    return facts_of(replace(device, info=plate))


@pytest.mark.parametrize("table", TABLES.values(), ids=lambda t: t.drive)
def test_every_drive_of_the_table_has_one_profile(table: ObjectTable) -> None:
    profile = profile_of(facts(table))
    assert profile is not None
    assert profile.table == table.drive
    assert profile.tried is Tried.VIRTUAL


@pytest.mark.parametrize("profile", [p for p in PROFILES if p.table], ids=lambda p: p.name)
def test_a_profile_agrees_with_the_objects_of_its_drive(profile) -> None:
    table = TABLES[profile.table]
    for bad in profile.dangerous_defaults:
        assert table.entries[key_of(bad.object)].default == bad.value, bad.object
    sixty_a9 = table.entries.get((0x60A9, 0))
    assert profile.units.velocity_by_60A9 is (sixty_a9 is not None and sixty_a9.access.writable)
    modes = table.entries.get((0x6502, 0))
    if modes is not None and isinstance(modes.default, int):
        # Bit n of 6502 is mode n + 1 (CiA 402); the maker's own modes are negative.
        told = {bit + 1 for bit in range(10) if modes.default >> bit & 1}
        assert {mode for mode in profile.modes if mode > 0} == told
    mode = table.entries[0x6060, 0]
    assert all(
        (mode.low is None or m >= mode.low) and (mode.high is None or m <= mode.high) for m in profile.modes
    )


@pytest.mark.parametrize("profile", [p for p in PROFILES if not p.table], ids=lambda p: p.name)
def test_what_nobody_has_tried_says_so(profile) -> None:
    assert profile.tried is Tried.MANUAL


def test_a_stranger_has_no_profile() -> None:
    assert profile_of(DriveFacts(0x1234, 0, 0, 0, "", {})) is None
    with pytest.raises(UsageError, match=r"no drive profile 'nonsense'.*maxon_epos4"):
        load_profile("nonsense")


def test_what_contradicts_a_profile_is_told_with_both_values() -> None:
    ingenia, elmo, example = (load_profile(n) for n in ("ingenia_everest", "elmo_gold", "e35"))
    found = facts(TABLES["Ingenia EVE-NET 1.8.1"])
    assert ingenia.contradictions(found, "mrev/s") == ()
    assert ingenia.contradictions(found, "inc/s") == (
        ("[can] velocity_unit", '"inc/s"', "ingenia_everest", '"mrev/s"'),
    )
    assert elmo.contradictions(found, "inc/s") == (("1018:01", "29Ch", "elmo_gold", "9Ah"),)
    # A drive with a fixed 60A9 is believed before its profile.
    units = example.units.model_copy(update={"velocity_by_60A9": False, "velocity": "r/min"})
    fixed = example.model_copy(update={"units": units})
    assert fixed.contradictions(facts(TABLES["e35 example"]), "r/min") == (
        ("60A9", "B50300h", "e35", "B44700h (r/min)"),
    )


def test_a_unit_that_the_controller_sets_is_no_contradiction() -> None:
    epos4 = load_profile("maxon_epos4")
    assert epos4.contradictions(facts(TABLES["maxon EPOS4 0x1018"]), "0.1 r/min") == ()


def test_the_words_of_the_maker_for_an_error_code() -> None:
    texts = load_profile("kollmorgen_akd").texts_by_code
    assert texts[0x3110] == "F523 DC bus overvoltage, by hardware"
    assert 0x8130 not in texts


GOOD = """
maker = "m"
model = "x"
tried = "from the manual, not tried"
sources = ["s"]
modes = [9]
[match]
vendor = 1
"""


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("maker = ", "x.toml:"),
        (GOOD, "units"),
        (GOOD + '[units]\nvelocity = "rpm"\n', "units.velocity"),
        (GOOD + '[units]\nvelocity = "r/min"\nvelocities = 1\n', "units.velocities"),
        (GOOD + "[units]\nramp_size = 0.0\n", "units.ramp_size"),
        (GOOD + '[units]\n[lacks]\n"605A:00" = ""\n', "lacks.605A:00"),
        (GOOD + '[units]\n[error_texts]\nx8130 = "a"\n', "no error code"),
        (GOOD + '[units]\n[speed_loop.kp]\nobject = "605a:0"\n', "is no object"),
        (GOOD + '[units]\n[speed_loop.kp]\nobject = "605A:00"\nunit = "furlong"\n', "unit 'furlong'"),
        (GOOD.replace("from the manual, not tried", "surely") + "[units]\n", "tried"),
    ],
)
def test_what_is_wrong_with_a_profile_is_told(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "x.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as wrong:
        load_profile(str(file))
    assert told in str(wrong.value)


def test_a_profile_of_the_user_is_read_from_its_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(GOOD + "[units]\n", encoding="utf-8")
    assert load_profile(str(file)).name == "mine"
    with pytest.raises(ConfigError, match="cannot be read"):
        load_profile(str(tmp_path / "other.toml"))


def test_the_page_is_what_the_files_say() -> None:
    page = Path("docs/reference/drive-profiles.md").read_text(encoding="utf-8")
    assert page == reference_page(), (
        "run: python -m gantryctl.drives.profiles.page docs/reference/drive-profiles.md"
    )


@pytest.mark.can
def test_a_survey_of_the_bus_names_the_profile_and_what_it_warns_of() -> None:
    machine = with_values(MACHINE, {"can.virtual_drive": "maxon EPOS4@"})
    link = virtual_node(machine)[0]
    remarks = survey(link, nodes=range(2, 3))[0].remarks
    link.close()
    assert "profile maxon_epos4 (virtual drive)" in remarks
    assert any(remark.startswith("6085:00 = 10000 as delivered: 10 000 r/min/s") for remark in remarks)
    # The motor is entered: the other default that the profile warns of is no longer there.
    assert not any(remark.startswith("6076") for remark in remarks)


@pytest.mark.can
def test_the_gains_of_a_drive_are_shown_at_the_motor(tmp_path: Path) -> None:
    """20 000 uA s/rad is 0.02 A s/rad; 257 N m at the rated current make N m of it."""
    rows = shipped_objects().read_text(encoding="utf-8").splitlines()
    gains = [
        "maxon EPOS4 0x1018,30A2,1,present,0x7,rw,20000,,",
        "maxon EPOS4 0x1018,30A2,2,present,0x7,rw,500000,,",
    ]
    table = tmp_path / "objects.csv"
    table.write_text("\n".join([*rows, *gains]) + "\n", encoding="utf-8")
    config = tmp_path / "m.toml"
    machine_file(config, {"drive.kind": "canopen", "control.scan_period_ms": 4.0, "can.encoder.index": 0,
                          "can.virtual_drive": f"maxon EPOS4@{table}"})  # fmt: skip
    motor = MACHINE.motor
    kp, ki = done("drive", "gains", "--config", config, "--json").json
    assert (kp["object"], kp["value"], kp["unit"]) == ("30A2:01", 20000.0, "uA s/rad")
    assert kp["at_the_motor"] == pytest.approx(0.02 * motor.torque_rated_nm / motor.current_rated_a)
    assert ki["at_the_motor"] == pytest.approx(0.5 * motor.torque_rated_nm / motor.current_rated_a)
    assert "N m s/rad" in done("drive", "gains", "--config", config).out


@pytest.mark.can
def test_a_drive_without_the_object_or_without_a_profile_is_told_so(tmp_path: Path) -> None:
    shared = {"drive.kind": "canopen", "control.scan_period_ms": 4.0, "can.encoder.index": 0}
    config, plain = tmp_path / "m.toml", tmp_path / "plain.toml"
    machine_file(config, {**shared, "can.virtual_drive": "maxon EPOS4@"})
    assert "the drive does not have it" in done("drive", "gains", "--config", config).out
    machine_file(plain, shared)
    refused = cli("drive", "gains", "--config", plain)
    assert refused.code != 0
    assert "no profile fits this drive: read and set them with the maker's tool" in refused.err
