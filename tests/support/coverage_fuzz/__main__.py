"""Coverage-guided fuzzing of every door by atheris: `python -m support.coverage_fuzz --minutes 10` (`make fuzz`).

Each target runs in a process of its own, so long as is asked, from its kept corpus and from files of the repository.
What it finds is written to `build/fuzz/TARGET/found` and ends with status 1; put it into `tests/data/fuzz/TARGET` with
the correction, where the fast tests run it for good. `--keep` adds the smallest inputs that cover anything new.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

WORK: Final = Path("build/fuzz")
# Of a whole run; a corpus that is kept is small: its inputs are the shortest of their kind.
KEPT_MAX_KB: Final = 20
LONGEST: Final = 16_384
_DONE: Final = re.compile(r"#(\d+)\s+(?:DONE|pulse|NEW|REDUCE|RELOAD)?\s*cov: (\d+) ft: (\d+) corp: (\d+)")


def main() -> int:
    """Run the targets one after the other."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("targets", nargs="*", help="all of them when none is named")
    parser.add_argument("--minutes", type=float, default=10.0, help="of each target")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", action="store_true", help="add to the corpus under tests/data/fuzz")
    parser.add_argument("--log", type=Path, default=None, help="append a line of JSON for each target")
    asked = parser.parse_args()
    try:
        import atheris  # noqa: F401
    except ImportError:
        print(
            "atheris is not installed: `make fuzz` installs it from requirements/fuzz.txt where there is a wheel "
            "(CPython on x86-64 Linux); the kept corpus runs without it: pytest tests/unit/test_fuzz_corpus.py",
            file=sys.stderr,
        )
        return 2
    from support.coverage_fuzz.targets import TARGETS

    unknown = set(asked.targets) - set(TARGETS)
    if unknown:
        parser.error(f"no target {', '.join(sorted(unknown))}; there are: {', '.join(TARGETS)}")
    failed = []
    for name in asked.targets or TARGETS:
        line = fuzz(name, asked.minutes * 60.0, asked.seed, keep=asked.keep)
        print(json.dumps(line), flush=True)
        if asked.log is not None:
            with asked.log.open("a") as log:
                print(json.dumps(line), file=log)
        if line["findings"]:
            failed.append(name)
    if failed:
        print(f"findings: {', '.join(failed)}; see {WORK}/TARGET/found", file=sys.stderr)
    return 1 if failed else 0


def fuzz(name: str, seconds: float, seed: int, *, keep: bool) -> dict[str, object]:
    """Run one target; its figures."""
    from support.coverage_fuzz.run import CORPUS
    from support.coverage_fuzz.targets import TARGETS

    target, work = TARGETS[name], WORK / name
    grown, seeds, found = work / "grown", work / "seeds", work / "found"
    for folder in (grown, seeds, found):
        folder.mkdir(parents=True, exist_ok=True)
    for number, data in enumerate(target.seeds()):
        (seeds / f"seed{number}").write_bytes(data)
    (work / "words").write_text("".join(f'"{_escaped(word)}"\n' for word in target.words))
    kept = CORPUS / name
    kept.mkdir(parents=True, exist_ok=True)
    options = [
        f"-seed={seed}", f"-artifact_prefix={found}/",
        "-timeout=20", "-report_slow_units=600",
        "-rss_limit_mb=1200", "-malloc_limit_mb=200", f"-max_len={LONGEST}", "-print_final_stats=1",
    ]  # fmt: skip
    if target.words:
        options.append(f"-dict={work / 'words'}")
    executed, cov, ft, corp, begun_s, findings = 0, 0, 0, 0, time.monotonic(), len(list(found.iterdir()))
    # libFuzzer ends at its first finding: it goes on until the time is over.
    while (left_s := seconds - (time.monotonic() - begun_s)) > 1.0:
        text = _one(name, [*options, f"-max_total_time={int(left_s)}", *map(str, (grown, kept, seeds))])
        (work / "last.txt").write_text(text)
        figures = _DONE.findall(text)
        if not figures:
            raise SystemExit(f"{name}: atheris did not run, or counted no branch:\n{text[-3000:]}")
        executed += max(int(each[0]) for each in figures)
        cov, ft, corp = (max(int(each[k]) for each in figures) for k in (1, 2, 3))
        if "DONE" in text and "ERROR: libFuzzer" not in text:
            break
        if len(list(found.iterdir())) - findings >= 5:
            break
    new = sorted(path.name for path in found.iterdir())
    if keep:
        _keep(name, kept, grown, seeds)
    return {
        "target": name, "seconds": round(time.monotonic() - begun_s), "executions": executed,
        "coverage": cov, "features": ft, "corpus": corp, "findings": new[findings:],
    }  # fmt: skip


def _one(name: str, options: list[str]) -> str:
    command = [sys.executable, "-m", "support.coverage_fuzz.one", name, *options]
    done = subprocess.run(
        command, capture_output=True, text=True, errors="replace", check=False, env=os.environ
    )
    return done.stderr + done.stdout


def _keep(name: str, kept: Path, grown: Path, seeds: Path) -> None:
    """Add the fewest grown inputs that cover what nothing kept covers, the shortest first, up to the size."""
    merged = WORK / name / "merged"
    shutil.rmtree(merged, ignore_errors=True)
    merged.mkdir()
    _one(
        name,
        ["-merge=1", "-timeout=20", "-rss_limit_mb=1200", str(merged), str(kept), str(grown), str(seeds)],
    )
    size = sum(path.stat().st_size for path in kept.iterdir())
    for path in sorted(merged.iterdir(), key=lambda each: each.stat().st_size):
        here = kept / path.name[:16]
        if size + path.stat().st_size > KEPT_MAX_KB * 1024:
            break
        if not here.exists():
            here.write_bytes(path.read_bytes())
            size += path.stat().st_size


def _escaped(word: str) -> str:
    return "".join(c if c.isalnum() or c in " =.:#[]{},;$+-'" else f"\\x{ord(c):02x}" for c in word)


if __name__ == "__main__":
    sys.exit(main())
