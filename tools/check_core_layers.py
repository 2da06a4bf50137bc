"""Check what no linter knows: the includes between the core's folders, and the length of every source file.

`core/control` (the laws) never sees `core/plant` (the physics) or `core/loop`, and `core/plant` never sees
`core/loop`: what runs in a machine controller must not know the physics that the simulator believes in.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

MAX_LINES = 400
FORBIDDEN = {"control": {"plant", "loop"}, "plant": {"loop"}}
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)
SUFFIXES = {".py", ".hpp", ".cpp"}


def wrong_includes(core: Path) -> Iterator[str]:
    """Includes that reach from one folder of the core into a folder it must not know."""
    for folder, forbidden in FORBIDDEN.items():
        for source in sorted((core / folder).rglob("*.[hc]pp")):
            for included in INCLUDE.findall(source.read_text(encoding="utf-8")):
                if forbidden & set(Path(included).parts):
                    yield f"{source}: includes {included}; core/{folder} must not know it"


def long_files(*roots: Path) -> Iterator[str]:
    """Source files longer than a reader wants to hold in the head."""
    for root in roots:
        for source in sorted(root.rglob("*")):
            if source.suffix in SUFFIXES and source.is_file():
                lines = len(source.read_text(encoding="utf-8").splitlines())
                if lines > MAX_LINES:
                    yield f"{source}: {lines} lines, at most {MAX_LINES}"


def main() -> int:
    """Print every finding; 1 when there is one."""
    root = Path(__file__).resolve().parent.parent
    findings = [*wrong_includes(root / "core"), *long_files(root / "src", root / "core")]
    for finding in findings:
        print(finding)
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
