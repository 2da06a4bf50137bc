"""The report of `gantryctl doctor` in words."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.engineering.computer.findings import PRIORITY_WANTED, Check, Finding, Verdict
from gantryctl.engineering.computer.scan_trial import SKIPPED_SHARE_MAX, ScanTrial
from gantryctl.image import StopCause

_WIDTH: Final = 40
_ADVICE: Final = {
    Check.KERNEL: "a kernel with PREEMPT_RT bounds the lateness (Debian: apt install linux-image-rt-amd64)",
    Check.PRIORITY: f"allow priority {PRIORITY_WANTED}: rtprio in /etc/security/limits.d, or LimitRTPRIO= in the unit",
    Check.GOVERNOR: "governor performance: cpupower frequency-set -g performance",
    Check.ISOLATION: "keep a processor for the scan: isolcpus=1 on the kernel's command line, then taskset -c 1",
    Check.CLOCK_SOURCE: "clocksource=tsc on the kernel's command line, where the processor has an invariant one",
    Check.WALL_CLOCK: "the journal takes its dates from it: systemd-timesyncd, chrony or ptp4l keeps it right",
    Check.STATE: "give this user the right, or name another directory in GANTRYCTL_STATE",
    Check.ADAPTER: "ip link set can0 up type can bitrate 500000 for SocketCAN; group dialout for a serial adapter",
    Check.LOAD: "other processes take the processor: end them, or measure again without them",
}


def trial_lines(trial: ScanTrial, speed_deg_s: float) -> list[str]:
    """Histogram, figures and verdict of one scan period."""
    statistics, late = trial.statistics, trial.statistics.lateness
    priority = "real-time priority" if trial.granted else "no real-time priority"
    lines = [f"scan of {statistics.period_s * 1e3:g} ms, {late.count} scans, {priority}"]
    most = max((count for _, count in late.steps()), default=1)
    for edge_s, count in late.steps():
        # On a logarithmic scale: the rare ones are those that count.
        bar = "#" * math.ceil(_WIDTH * math.log1p(count) / math.log1p(most))
        over = math.isinf(edge_s)
        upper = f"{'more':>10}" if over else f"{float(f'{edge_s * 1e3:.1g}'):7g} ms"
        angle = " " * 11 if over else f"{edge_s * speed_deg_s:7.4f} deg"
        lines.append(f"  {upper} {angle} {count:9} {bar}")
    p99, worst = late.quantile_s(0.99), late.worst_s
    lines += [
        f"  late: p50 {late.quantile_s(0.5) * 1e3:.3f}, p99 {p99 * 1e3:.3f}, worst {worst * 1e3:.3f} ms; at "
        f"{speed_deg_s:g} deg/s {p99 * speed_deg_s:.4f} deg and {worst * speed_deg_s:.4f} deg",
        f"  computing: p50 {statistics.run_time.quantile_s(0.5) * 1e3:.3f}, "
        f"p99 {statistics.run_time.quantile_s(0.99) * 1e3:.3f} ms of {statistics.period_s * 1e3:g} ms",
        f"  {_verdict(trial)}",
    ]
    return lines


def _verdict(trial: ScanTrial) -> str:
    if trial.good:
        return "good enough"
    if trial.stops:
        worst = max(trial.stops, key=lambda stop: stop.measured / stop.limit)
        return f"not good enough: stops of an axis on a bus: {len(trial.stops)}, the worst " + (
            f"for {worst.measured:.0f} overruns in a second (limit {worst.limit:.0f})"
            if worst.cause is StopCause.OVERRUNS
            else f"for a scan {worst.measured * 1e3:.1f} ms late (limit {worst.limit * 1e3:.0f} ms)"
        )
    return (
        f"not good enough: {100.0 * trial.skipped_share:.2g} % of the scans are missing "
        f"(limit {100.0 * SKIPPED_SHARE_MAX:g} %)"
    )


def finding_lines(found: tuple[Finding, ...]) -> list[str]:
    """What was found, and what to do where it is weak."""
    lines = []
    for finding in found:
        lines.append(f"{finding.check.value:13} {finding.verdict.value:8} {finding.found}")
        if finding.verdict is Verdict.WEAK:
            lines.append(f"{'':22} {_ADVICE[finding.check]}")
    return lines
