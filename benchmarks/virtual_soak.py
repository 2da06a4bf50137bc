"""A soak in virtual time: treatment days of the service's controller, on a gantry that warms up and wears.

    .venv/bin/python benchmarks/virtual_soak.py --hours 10000 --folder build/virtual_soak     # goes on where it ended
    .venv/bin/python benchmarks/virtual_soak.py --judge build/virtual_soak/log.jsonl     # --keep FILE: with the log
    .venv/bin/python benchmarks/virtual_soak.py --life 300 --folder build/life     # one controller, started once

Each line of the log is a day of 24 h: 16 h computed scan by scan, 8 h switched off. Same seed, same trace, whether it
was broken off or not. With --life there is one line, of so many hours of use without a start: its memory is that of
one process of a service. The exit code is 1 when a criterion fails.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from support.virtual_soak.slices import Soak, read_lines
from support.virtual_soak.verdict import judge, words

DAY_H = 24.0


def main() -> int:
    """Run days until there are so many hours, then judge."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hours", type=float, default=10_000.0, help="of machine time, in whole days")
    parser.add_argument(
        "--life", type=float, metavar="HOURS", help="one controller, in use for so many hours"
    )
    parser.add_argument("--folder", type=Path, default=Path("build/virtual_soak"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scan-ms", type=float, default=10.0)
    parser.add_argument(
        "--judge", type=Path, metavar="LOG", help="judge a log, also of a soak that is running"
    )
    parser.add_argument("--keep", type=Path, metavar="FILE", help="write log and verdict into a file")
    parser.add_argument("--note", default="", help="conditions, for the file")
    asked = parser.parse_args()
    log = asked.judge
    if log is None:
        if asked.life is None:
            soak, days = Soak(asked.folder, asked.seed, asked.scan_ms), math.ceil(asked.hours / DAY_H)
        else:
            soak, days = Soak(asked.folder, asked.seed, asked.scan_ms, asked.life * 3600.0, 0.0), 1
        log = soak.log
        for line in soak.run(days):
            trouble = line["troubles"] or line["stuck"] or "no trouble"
            print(
                f"day {line['day']}: {line['moves']} moves, {trouble}",
                flush=True,
            )
    lines = read_lines(log)
    told = words(lines)
    print(told)
    if asked.keep is not None:
        head = "".join(f"# {line}\n" for line in (*([asked.note] if asked.note else []), *told.splitlines()))
        asked.keep.write_text(head + "".join(json.dumps(line) + "\n" for line in lines))
    return 1 if any(each.passed is False for each in judge(lines)) else 0


if __name__ == "__main__":
    sys.exit(main())
