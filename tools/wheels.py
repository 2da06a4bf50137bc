"""Wheels that need no compiler: built by Zig for both processors, judged by auditwheel.

    python tools/wheels.py dist python3.11 python3.12 python3.13       # `make dist`

One wheel for each Python named and each processor; beside them, wheels of the locked packages that have none for a
processor. The same sources give the same bytes: dates are those of the last commit, or of SOURCE_DATE_EPOCH. It needs
what `requirements/dist.txt` lists in this environment, and for each Python the packages of the build list from the
registry.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import kernel_symbols
from zig import zig

ROOT: Final = Path(__file__).resolve().parent.parent
WORK: Final = ROOT / "build" / "wheels"
GLIBC: Final = (2, 28)
"""The oldest that a wheel runs on: of 2018; numpy and pyarrow ask for it too."""
LACKING: Final = {"aarch64": ("ruckig",)}
"""Locked packages that their makers publish no wheel of (0.19.4 of ruckig)."""
_ZIG_WORDS: Final = {"c++": "c++", "ar": "ar", "ranlib": "ranlib"}
_BUILD: Final = "import sys; from scikit_build_core.build import build_wheel; "


class Target(NamedTuple):
    """A processor."""

    name: str

    @property
    def zig(self) -> str:
        """What Zig calls it, with the oldest C library."""
        return f"{self.name}-linux-gnu.{GLIBC[0]}.{GLIBC[1]}"

    @property
    def platform(self) -> str:
        """Platform tag of its wheels."""
        return f"manylinux_{GLIBC[0]}_{GLIBC[1]}_{self.name}"

    @property
    def here(self) -> bool:
        """Whether this computer has it."""
        return os.uname().machine == self.name


TARGETS: Final = (Target("x86_64"), Target("aarch64"))


def build(out: Path, pythons: Sequence[str]) -> Iterator[Path]:
    """Build every wheel and have it judged.

    Raises:
        SystemExit: an interpreter is missing, or a wheel runs on less than its name says.
    """
    os.environ.setdefault("SOURCE_DATE_EPOCH", _date_of_sources())
    builders = {}
    for python in pythons:
        version = _version(python)
        if not version:
            raise SystemExit(
                f"{python} is not here: a release needs it; `make dist PYTHONS=python3.11` makes less of one"
            )
        builders[version] = _environment(python, WORK / version)
    # This computer's first: a stub is made by importing the module, and serves every processor.
    for target in sorted(TARGETS, key=lambda each: not each.here):
        for version, builder in builders.items():
            wheel = _wheel(builder, version, target, ROOT, out)
            _judge(wheel, target)
            if target.here:
                _judge_kernels(_folder(target, version, ROOT), wheel)
            yield wheel
            for name in LACKING.get(target.name, ()):
                wheel = _wheel(builder, version, target, _sources(builder, name), out)
                _judge(wheel, target)
                yield wheel


def _version(python: str) -> str:
    """Tag of an interpreter, cp311; "" where there is none, or a name of pyenv that stands for none of its versions."""
    if shutil.which(python) is None:
        return ""
    return subprocess.run(  # noqa: S603 - an interpreter named on our own command line
        [python, "-c", "import sys; print('cp%d%d' % sys.version_info[:2])"],
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    ).stdout.strip()


def _date_of_sources() -> str:
    """Seconds since 1970: of the last commit; of the newest source where there is no repository (an sdist)."""
    said = subprocess.run(  # noqa: S603 - git with words of this file
        ["git", "-C", str(ROOT), "log", "-1", "--format=%ct"],  # noqa: S607 - whichever git is here
        capture_output=True,
        text=True,
        check=False,
    ).stdout.strip()
    return said or str(int((ROOT / "pyproject.toml").stat().st_mtime))


def _environment(python: str, folder: Path) -> Path:
    """Interpreter of an environment with the locked build list, which is made where it is missing."""
    builder = folder / "bin" / "python"
    wanted = (ROOT / "requirements" / "build.txt").read_text(encoding="utf-8")
    installed = folder / "build.txt"
    if not installed.is_file() or installed.read_text(encoding="utf-8") != wanted:
        _run(python, "-m", "venv", "--clear", str(folder))
        lists = ("--require-hashes", "-r", str(ROOT / "requirements" / "build.txt"))
        _run(str(builder), "-m", "pip", "--disable-pip-version-check", "install", "--quiet", *lists)
        installed.write_text(wanted, encoding="utf-8")
    return builder


def _sources(builder: Path, name: str) -> Path:
    """Unpacked sources of a locked package, whose hash has been compared."""
    lock = (ROOT / "requirements" / "run.txt").read_text(encoding="utf-8")
    locked = WORK / f"{name}.txt"
    found = re.search(rf"^{name}==.*(?:\n    .*)*\n", lock, re.MULTILINE)
    assert found is not None, name
    locked.write_text(found[0], encoding="utf-8")
    words = ("download", "--quiet", "--no-deps", "--no-binary", name, "--require-hashes", "-r", str(locked))
    _run(str(builder), "-m", "pip", "--disable-pip-version-check", *words, "-d", str(WORK / "sources"))
    (archive,) = (WORK / "sources").glob(f"{name}-*.tar.gz")
    shutil.unpack_archive(archive, WORK / "sources", filter="data")
    return WORK / "sources" / archive.name.removesuffix(".tar.gz")


def _folder(target: Target, version: str, sources: Path) -> Path:
    return WORK / f"{sources.name if sources != ROOT else 'gantryctl'}-{target.name}-{version}"


def _wheel(builder: Path, version: str, target: Target, sources: Path, out: Path) -> Path:
    tools = _zig_tools(target)
    defines = {
        "CMAKE_AR": str(tools / "ar"),
        "CMAKE_RANLIB": str(tools / "ranlib"),
        # No name of a folder of this computer may get into the wheel.
        "CMAKE_CXX_FLAGS": f"-ffile-prefix-map={sources}=.",
    }
    if not target.here:
        defines |= {
            "CMAKE_SYSTEM_NAME": "Linux",
            "CMAKE_SYSTEM_PROCESSOR": target.name,
        }
        if sources == ROOT:
            here = Target(os.uname().machine)
            defines["GANTRYCTL_STUB"] = str(_folder(here, version, sources) / "_core.pyi")
    settings = {
        "build-dir": str(_folder(target, version, sources)),
        # Not in the environment: there the tags of this Python itself would follow it.
        "env._PYTHON_HOST_PLATFORM": target.platform,
        **{f"cmake.define.{name}": text for name, text in defines.items()},
    }
    environment = os.environ | {
        "CXX": str(tools / "c++"),
        "PATH": os.pathsep.join([str(builder.parent), os.environ["PATH"]]),
        "SETUPTOOLS_EXT_SUFFIX": f".cpython-{version[2:]}-{target.name}-linux-gnu.so",
    }
    print(f"building {sources.name} for {target.name}, {version}", flush=True)
    made = subprocess.run(  # noqa: S603 - the interpreter of the build environment
        [str(builder), "-c", f"{_BUILD} print(build_wheel({str(out)!r}, {settings!r}))"],
        cwd=sources,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    if made.returncode:
        raise SystemExit(f"building {sources.name} for {target.name}, {version}, has failed:\n{made.stdout}")
    return out / made.stdout.splitlines()[-1]


def _zig_tools(target: Target) -> Path:
    """Folder with a compiler and an archiver for a processor: CMake wants one word for each."""
    program = zig()
    folder = WORK / f"zig-{target.name}"
    folder.mkdir(parents=True, exist_ok=True)
    for name, word in _ZIG_WORDS.items():
        words = f"{word} -target {target.zig}" if name == "c++" else word
        (folder / name).write_text(f'#!/bin/sh\nexec "{program}" {words} "$@"\n', encoding="utf-8")
        (folder / name).chmod(0o755)
    return folder


def _judge(wheel: Path, target: Target) -> None:
    """Hold a wheel against its name by the symbols that it takes from the system.

    Raises:
        SystemExit: it would not run where it says.
    """
    said = json.loads(_output(Path(sys.executable), "-m", "auditwheel", "show", "--json", str(wheel)))
    allowed = said["overall_policy"]["name"] if "overall_policy" in said else said["overall_tag"]
    print(f"  {wheel.name}: auditwheel: {allowed}")
    if _glibc_of(allowed, target) > GLIBC:
        raise SystemExit(f"{wheel.name}: auditwheel allows no more than {allowed}")


def _judge_kernels(folder: Path, wheel: Path) -> None:
    """Look for code of one instruction set that others would run, with the tools of this processor.

    Raises:
        SystemExit: there is some.
    """
    objects = sorted((folder / "CMakeFiles" / "gantryctl_kernels.dir" / "core" / "isa").glob("*.o"))
    shared = [finding for each in objects for finding in kernel_symbols.findings(each)]
    if shared or not objects:
        raise SystemExit("\n".join([f"{wheel.name}: kernels share code:", *shared]))


def _glibc_of(tag: str, target: Target) -> tuple[int, ...]:
    """Version of the C library that a platform tag asks for; above all others where it names none."""
    words = tag.removesuffix(f"_{target.name}").split("_")
    return tuple(map(int, words[1:])) if words[0] == "manylinux" else (sys.maxsize,)


def _run(*command: str) -> None:
    subprocess.run(command, check=True)  # noqa: S603 - an interpreter named on our own command line


def _output(*command: str | Path) -> str:
    return subprocess.run(  # noqa: S603 - the same
        [str(each) for each in command], check=True, capture_output=True, text=True
    ).stdout.strip()


def main(arguments: Sequence[str]) -> int:
    """Build what the arguments name."""
    if len(arguments) < 2:
        print(__doc__)
        return 2
    out = Path(arguments[0]).resolve()
    out.mkdir(parents=True, exist_ok=True)
    for wheel in build(out, arguments[1:]):
        print(wheel)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
