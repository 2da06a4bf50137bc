"""Files of the program that are not as they were installed: noticed, and the service does not start."""

from __future__ import annotations

import base64
import hashlib
import os
import py_compile
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import Distribution
from pathlib import Path

import pytest

import gantryctl
from gantryctl import _core
from gantryctl.errors import StateError
from gantryctl.service.supervisor.installed import InstalledFiles, check_installed

SOURCES = Path(gantryctl.__file__).parent
# One extension name that this Python finds before `x.py`, whatever its version.
EXTENSION = "x.abi3.so"


def record(site: Path, package: str) -> Distribution:
    """Write the dist-info of everything below `site`, as an installer does."""
    info = site / f"{package}-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1\n")
    lines = []
    for path in sorted(site.rglob("*")):
        if path.is_file() and path.suffix != ".pyc":  # an installer gives those no hash
            digest = (
                base64.urlsafe_b64encode(hashlib.sha256(path.read_bytes()).digest()).rstrip(b"=").decode()
            )
            lines.append(f"{path.relative_to(site)},sha256={digest},{path.stat().st_size}")
    lines += [f"{package}/__pycache__/__init__.cpython-311.pyc,,", f"{info.name}/RECORD,,"]
    (info / "RECORD").write_text("\n".join(lines) + "\n")
    return Distribution.at(info)


@pytest.fixture
def site(tmp_path: Path) -> Path:
    for name in ("__init__.py", "x.py", "room/__init__.py", "room/y.py", "page/z.js"):
        path = tmp_path / "site" / "house" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"# {name}\n")
    return tmp_path / "site"


def found(site: Path) -> InstalledFiles | None:
    return check_installed(record(site, "house"), site / "house")


def test_what_was_installed_is_as_it_was_installed(site: Path) -> None:
    installed = record(site, "house")
    # What Python, an editor and a person leave there does not run.
    (site / "house" / "__pycache__").mkdir()
    (site / "house" / "__pycache__" / "x.cpython-311.pyc").write_bytes(b"x")
    (site / "house" / "x.py~").write_text("old")
    (site / "house" / "notes.txt").write_text("mine")
    parts: list[float] = []
    assert check_installed(installed, site / "house", parts.append) == InstalledFiles(6, ())
    assert parts == pytest.approx([k / 6 for k in range(1, 7)])


def _flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    # Within the first line, a comment or the text of the module: the file stays one that runs.
    content[min(8, len(content) // 2)] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda house: _flip(house / "x.py"), "house/x.py"),
        (lambda house: _flip(house / "page" / "z.js"), "house/page/z.js"),
        (lambda house: (house / "room" / "y.py").unlink(), "house/room/y.py"),
        (lambda house: (house / "x.py").write_text(""), "house/x.py"),
        (lambda house: (house / "room" / "new.py").write_text("import os\n"), "house/room/new.py"),
        (lambda house: (house / EXTENSION).write_bytes(b"x"), f"house/{EXTENSION}"),
        (lambda house: (house / "y.pyc").write_bytes(b"x"), "house/y.pyc"),  # without a source it is a module
    ],
)
def test_any_change_is_named(site: Path, change: Callable[[Path], object], named: str) -> None:
    installed = record(site, "house")
    change(site / "house")
    result = check_installed(installed, site / "house")
    assert result is not None
    assert result.changed == (named,)


def compiled(source: Path) -> Path:
    """A copy compiled as Python does it, of a source whose numbers are found in it."""
    source.write_text("LIMIT_DEG = 180500\n\n\ndef reach() -> int:\n    return 180500\n")
    return Path(py_compile.compile(str(source), doraise=True))


def test_a_compiled_copy_is_what_its_source_gives(site: Path) -> None:
    for name in ("x", "room/y"):
        compiled(site / "house" / f"{name}.py")
    result = found(site)
    assert result is not None
    assert result.changed == ()


@pytest.mark.parametrize("mode", list(py_compile.PycInvalidationMode))
def test_a_compiled_copy_that_would_run_and_says_something_else_is_named(
    site: Path, mode: py_compile.PycInvalidationMode
) -> None:
    source = site / "house" / "x.py"
    compiled(source)
    copy = Path(py_compile.compile(str(source), doraise=True, invalidation_mode=mode))
    data = copy.read_bytes()
    limit = (180500).to_bytes(4, "little")
    assert limit in data
    installed = record(site, "house")
    copy.write_bytes(data.replace(limit, (190500).to_bytes(4, "little")))
    result = check_installed(installed, site / "house")
    assert result is not None
    assert result.changed == (copy.relative_to(site).as_posix(),)
    copy.write_bytes(data[:-8])
    result = check_installed(installed, site / "house")
    assert result is not None
    assert result.changed == (copy.relative_to(site).as_posix(),)


def test_a_compiled_copy_that_python_would_not_run_is_left_alone(site: Path) -> None:
    source = site / "house" / "x.py"
    copy, other = compiled(source), compiled(site / "house" / "room" / "y.py")
    data, limit = copy.read_bytes(), (180500).to_bytes(4, "little")
    assert limit in other.read_bytes()
    copy.write_bytes(data[:8] + bytes(4) + data[12:-8])  # of a source of another time
    # Of another Python, and of something else than its source.
    other.write_bytes(b"old" + other.read_bytes()[3:].replace(limit, (190500).to_bytes(4, "little")))
    result = found(site)
    assert result is not None
    assert result.changed == ()


def test_without_hashes_of_what_runs_there_is_nothing_to_compare_with(site: Path, tmp_path: Path) -> None:
    installed = record(site, "house")
    copy = tmp_path / "sources" / "house"
    shutil.copytree(site / "house", copy)
    assert check_installed(installed, copy) is None
    (site / "house-1.dist-info" / "RECORD").unlink()
    assert check_installed(installed, site / "house") is None


def test_an_install_that_is_gone_is_not_what_runs(site: Path, tmp_path: Path) -> None:
    installed = record(site, "house")
    copy = tmp_path / "sources" / "house"
    shutil.move(site / "house", copy)
    assert check_installed(installed, copy) is None


def test_a_module_that_the_record_names_without_a_hash_was_put_there(site: Path) -> None:
    installed = record(site, "house")
    (site / "house" / "new.py").write_text("import os\n")
    with (site / "house-1.dist-info" / "RECORD").open("a") as lines:
        lines.write("house/new.py,,\n")
    result = check_installed(installed, site / "house")
    assert result is not None
    assert result.changed == ("house/new.py",)


def run_of(site: Path, state: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run Python with what is installed below `site`."""
    # Without -S the hook of an editable install would come first.
    others = [path for path in sys.path if path.endswith("site-packages")]
    return subprocess.run(
        [sys.executable, "-S", *command],
        check=False,
        cwd=state,
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(site), *others]),
            "GANTRYCTL_STATE": str(state),
        },
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_one_changed_byte_of_an_installed_program_keeps_the_service_from_starting(tmp_path: Path) -> None:
    site = tmp_path / "site"
    shutil.copytree(SOURCES, site / "gantryctl")
    # An editable install has the core elsewhere.
    core = Path(_core.__file__)
    shutil.copyfile(core, site / "gantryctl" / core.name)
    record(site, "gantryctl")
    check = "from gantryctl.service.supervisor.selftest import _installed; print(*_installed(lambda _: None))"
    whole = run_of(site, tmp_path, "-c", check)
    assert whole.stdout.startswith("True "), whole.stderr
    assert whole.stdout.endswith(" files as installed\n")
    # Without the check it would move the axis.
    _flip(site / "gantryctl" / "program" / "virtual_axis.py")
    refused = run_of(site, tmp_path, "-m", "gantryctl", "serve", "--no-page")
    said = "SYS-13 files that are not as they were installed: 1, among them gantryctl/program/virtual_axis.py"
    assert f"warning: installed files: {said}\n" in refused.stderr
    assert "the self-test failed: the service does not start" in refused.stderr
    assert refused.returncode == StateError.exit_code
    assert "in service" not in refused.stdout
