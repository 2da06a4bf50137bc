"""The package as installed: the compiled core, its stub and the machine files are where they belong."""

import re
import shutil
import subprocess
import tomllib
from importlib import import_module, metadata, resources
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_compiled_core_is_importable() -> None:
    assert import_module("gantryctl._core").__doc__


def test_the_package_is_typed() -> None:
    assert resources.files("gantryctl").joinpath("py.typed").is_file()


def test_the_machine_files_are_package_data() -> None:
    configs = resources.files("gantryctl").joinpath("configs")
    assert {file.name for file in configs.iterdir()} == {file.name for file in (ROOT / "configs").iterdir()}


def test_the_version_is_the_one_in_pyproject() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert metadata.version("gantryctl") == project["version"]


def test_every_runtime_dependency_is_locked() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    locked = (ROOT / "requirements" / "run.txt").read_text(encoding="utf-8")
    for dependency in project["dependencies"]:
        name = re.match(r"[\w.-]+", dependency)
        assert name
        assert f"\n{name[0]}==" in f"\n{locked}"


def test_what_reports_need_is_in_the_list_that_make_installs() -> None:
    locked = (ROOT / "requirements" / "run.txt").read_text(encoding="utf-8")
    assert {"matplotlib", "scipy"} <= {line.partition("==")[0] for line in locked.splitlines()}


def test_make_demo_without_a_compiler_says_what_to_type_and_downloads_nothing(tmp_path: Path) -> None:
    for name in ("Makefile", "requirements"):
        (tmp_path / name).symlink_to(ROOT / name)
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("make", "sh", "find", "python3"):
        (tools / name).symlink_to(shutil.which(name) or name)
    environment = {"PATH": str(tools), "HOME": str(tmp_path)}
    done = subprocess.run(
        ["make", "demo"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stdout == "no C++ compiler here; type:  sudo apt install g++ python3-dev python3-venv\n"
    assert not (tmp_path / ".venv").exists()


def test_no_lock_file_names_a_host() -> None:
    for file in (ROOT / "requirements").iterdir():
        assert "://" not in file.read_text(encoding="utf-8")
