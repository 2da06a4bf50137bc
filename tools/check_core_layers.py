"""Check the includes between the folders of the core.

`core/control` (the laws) never sees `core/plant` (the physics) or `core/loop`, and `core/plant` never sees
`core/loop`: what runs in a machine controller must not know the physics that the simulator believes in.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

FORBIDDEN = {"control": {"plant", "loop"}, "plant": {"loop"}}
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)


def wrong_includes(core: Path) -> Iterator[str]:
    """Includes that reach from one folder of the core into a folder it must not know."""
    for folder, forbidden in FORBIDDEN.items():
        for source in sorted((core / folder).rglob("*.[hc]pp")):
            for included in INCLUDE.findall(source.read_text(encoding="utf-8")):
                if forbidden & set(Path(included).parts):
                    yield f"{source}: includes {included}; core/{folder} must not know it"


def main() -> int:
    """Print every finding; 1 when there is one."""
    root = Path(__file__).resolve().parent.parent
    findings = list(wrong_includes(root / "core"))
    for finding in findings:
        print(finding)
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
