"""Check objects of core/isa: what is compiled for one instruction set must stay its own.

    python tools/kernel_symbols.py OBJECT...

A function that several objects define (an inline one, a template) is linked once, from any of them: compiled for
AVX-512 it would then run on processors without. So each weak symbol must bear the namespace of its set, or be code
without a vector register, which is the same for every set (libc++ throws its errors from such functions). And no
fused multiply-add may occur, or results would differ between the sets.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

WEAK = re.compile(r"^[0-9a-fA-F]+ [VWu] (.*)$")
FUSED = re.compile(r"\bvfn?m(?:add|sub)\w*")
CODE_OF = re.compile(r"^[0-9a-fA-F]+ <(.*)>:$", re.MULTILINE)
VECTOR = re.compile(r"%[xyz]mm|%k[0-7]")
POINTERS = ("DW.ref.",)  # the address of a function of the C++ library, no code


def shared_symbols(names: str, isa: str) -> Iterator[str]:
    """Weak symbols of a listing by `nm -C` outside the namespace of the instruction set."""
    for line in names.splitlines():
        found = WEAK.match(line)
        if found and not found[1].startswith(POINTERS) and f"gantry::{isa}::" not in found[1]:
            yield found[1]


def scalar_functions(code: str) -> set[str]:
    """Functions of a listing by `objdump -d -C` that name no vector register."""
    parts = CODE_OF.split(code)[1:]
    listed = list(zip(parts[::2], parts[1::2], strict=True))
    return {name for name, _ in listed} - {name for name, text in listed if VECTOR.search(text)}


def findings(path: Path) -> Iterator[str]:
    """What is wrong with one object."""
    isa = path.name.partition(".")[0]
    code = _output("objdump", "-d", "-C", "--no-show-raw-insn", str(path))
    scalar = scalar_functions(code)
    for name in shared_symbols(_output("nm", "-C", "--defined-only", str(path)), isa):
        if name not in scalar:
            yield f"{path.name}: {name} is not in namespace gantry::{isa}"
    fused = sorted(set(FUSED.findall(code)))
    if fused:
        yield f"{path.name}: fused multiply-add: {', '.join(fused)}"


def _output(*command: str) -> str:
    return subprocess.run(  # noqa: S603 - a disassembler with the file named by the build, no shell
        command, check=True, capture_output=True, text=True
    ).stdout


def main() -> int:
    """Print every finding; 1 when there is one."""
    found = [finding for name in sys.argv[1:] for finding in findings(Path(name))]
    print(*found, sep="\n", end="\n" if found else "")
    return 1 if found or len(sys.argv) == 1 else 0


if __name__ == "__main__":
    sys.exit(main())
