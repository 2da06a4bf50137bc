"""`gantryctl tune`: what it prints and writes; the proposal is a machine file, never the one in use."""

import json
from itertools import pairwise

import pytest
from click.testing import CliRunner

from gantryctl.cli.main import cli
from gantryctl.engineering.tuning.proposal import write_proposal
from gantryctl.errors import ConfigError, GantryctlError, UsageError
from gantryctl.machine import (
    config_hash,
    configs_folder,
    default_machine,
    default_machine_path,
    diff_machines,
    load_machine,
    with_values,
)
from gantryctl.machine.effective import to_toml
from gantryctl.machine.schema import MACHINE_LINE

WRITTEN = {"proposal.toml", "machine.schema.json", "tuning.json", "report.html"}


def run(*arguments):
    result = CliRunner().invoke(cli, ["tune", *map(str, arguments)], standalone_mode=False)
    if isinstance(result.exception, GantryctlError):
        raise result.exception
    assert result.exception is None, result.exception
    return result


@pytest.fixture
def ready(monkeypatch, as_paper, designed):
    """Both results as they were made before."""

    def answer(machine, method, **_):
        return as_paper if method == "trials" else designed

    monkeypatch.setattr("gantryctl.engineering.tuning.result.tune", answer)


def test_the_paper_s_procedure_in_words(ready, tmp_path):
    result = run("--plant", "paper-drive", "--log", "--out", tmp_path)
    words = " ".join(result.output.split())
    assert result.return_value == 1  # not stable on every uncertain plant
    assert "Against the paper found paper difference % within 20 %" in words
    assert words.count("yes") == 3
    assert "trials: Kvp" in words
    assert "too much" in words
    assert "proposal: UNSTABLE on" in words
    assert {path.name for path in tmp_path.iterdir()} == WRITTEN


@pytest.mark.parametrize("method", ["trials", "margins"])
def test_a_person_is_told_how_far_it_has_got(ready, parts, method):
    told = parts[method]
    assert told == sorted(told)
    assert told[-1] == 1.0
    # Often enough for a line every two seconds on a computer ten times slower.
    assert max(after - before for before, after in pairwise(told)) < 0.3


def test_by_margins_with_a_report(ready, tmp_path):
    result = run("--method", "margins", "--out", tmp_path / "new")
    words = " ".join(result.output.split())
    assert result.return_value == 0
    assert "proposal: stable on all of 156 uncertain plants" in words
    assert "confirmed on the whole uncertain set; one encoder step permits Kvp up to 214" in words
    assert "configured: UNSTABLE on 12 of 156 uncertain plants" in words
    names = {path.name for path in (tmp_path / "new").iterdir()}
    assert names == WRITTEN
    page = (tmp_path / "new" / "report.html").read_text(encoding="utf-8")
    assert "The proposal is stable on 156 of 156 uncertain plants" in page
    assert page.count("<svg") == 2
    assert page.count('class="recording"') == 1


def test_the_trials_are_a_picture(ready, tmp_path):
    run("--out", tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "What every trial measured" in page
    assert page.count("<svg") == 3


def test_json(ready, tmp_path):
    data = json.loads(run("--json", "--out", tmp_path).output)
    assert data == json.loads((tmp_path / "tuning.json").read_text(encoding="utf-8"))
    assert set(data["candidates"]) == {"configured", "proposal", "paper"}
    assert {trial["phase"] for trial in data["log"]} == {"Kvp", "Tvi", "Kpp", "Kvf", "acceleration"}
    assert data["start"]["kvp_nm_s_per_rad"] == 10.0
    assert set(data["difference_to_paper"]) == {"Kvp", "Tvi", "Kpp"}


def test_the_proposal_is_a_machine_file_that_differs_in_the_gains_only(ready, tmp_path):
    before = default_machine_path().read_bytes()
    run("--method", "margins", "--out", tmp_path)
    path = tmp_path / "proposal.toml"
    proposed = load_machine(path)
    assert {difference.path for difference in diff_machines(default_machine(), proposed)} == {
        "control.kpp_per_s",
        "drive.speed_loop.kvp_nm_s_per_rad",
        "drive.speed_loop.tvi_ms",
    }
    assert default_machine_path().read_bytes() == before
    text = path.read_text(encoding="utf-8")
    assert text.startswith(MACHINE_LINE + "# Proposal of `gantryctl tune --method margins` for hust_gantry")
    assert "# uncertain plants, unstable of all" in text


def test_the_file_in_use_is_never_written(designed, tmp_path):
    path = tmp_path / "proposal.toml"
    path.write_text(to_toml(default_machine()), encoding="utf-8")
    with pytest.raises(UsageError, match="is the machine file in use; choose another --out"):
        write_proposal(designed, path, path)
    assert config_hash(load_machine(path)) == config_hash(default_machine())


def test_the_calibration_goes_with_the_proposal(designed, tmp_path):
    """A machine with compensations reads its calibration beside its file."""
    from dataclasses import replace

    source = configs_folder() / "hust_improved.toml"
    improved = replace(designed, machine=load_machine(source))
    first, second, schema = write_proposal(improved, tmp_path / "proposal.toml", source)
    assert second.name == improved.machine.control.compensation.calibration
    assert schema.read_bytes() == (configs_folder() / "machine.schema.json").read_bytes()
    assert load_machine(first).calibration is not None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--base-limit", "0"), "--base-limit 0: must be above 0 um"),
        (("--sensitivity", "0.9"), "--sensitivity 0.9: must be above 1"),
        (("--damping-left", "-1"), "--damping-left -1: must be above 0"),
        (("--out", "/dev/null/x"), "cannot be made"),
    ],
)
def test_what_cannot_be_done_is_refused(ready, arguments, message):
    with pytest.raises(UsageError, match=message):
        run(*arguments)


def test_an_ideal_drive_is_not_tuned(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(to_toml(with_values(default_machine(), {"drive.kind": "ideal"})), encoding="utf-8")
    with pytest.raises(UsageError, match="tune needs a drive with an axis behind it"):
        run("--config", path)


def test_a_wrong_machine_file_is_a_list_of_problems(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text("[control]\nkpp_per_s = nan\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="kpp_per_s = nan: is not a finite number"):
        run("--config", path)
