"""CasADi: one scan as an expression graph, mapped over all scans, in its virtual machine or compiled by gcc."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from gantryctl.engineering.bench.peers.building import build
from gantryctl.engineering.bench.rigid import (
    CYCLE_S,
    CYCLES,
    ECCENTRIC_NM,
    INERTIA_KG_M2,
    KPP,
    KVF,
    KVP,
    LIMIT_NM,
    RATIO,
    TVI,
    Run,
    Timed,
    set_points,
)


def _scan() -> Any:
    """State (angle, speed, last angle, integral) and set-point to the state after a scan; eight cycles unrolled."""
    import casadi as ca

    state, point = ca.SX.sym("state", 4), ca.SX.sym("point", 2)
    pos, vel, last, integral = (state[n] for n in range(4))
    command = KPP * (RATIO * point[0] - pos) + KVF * RATIO * point[1]
    for _ in range(CYCLES):
        error = command - (pos - last) / CYCLE_S
        last = pos
        wanted = KVP * (error + integral)
        torque = ca.fmin(ca.fmax(wanted, -LIMIT_NM), LIMIT_NM)
        free = ca.logic_or(torque == wanted, (wanted - torque) * error < 0.0)
        integral = ca.if_else(free, integral + error * CYCLE_S / TVI, integral)
        load = ECCENTRIC_NM * ca.sin(pos / RATIO) / RATIO
        vel = vel + CYCLE_S * (torque + load) / INERTIA_KG_M2
        pos = pos + CYCLE_S * vel
    return ca.Function("scan", [state, point], [ca.vertcat(pos, vel, last, integral)])


def _runner(job: Any, seconds: int) -> Run:
    import casadi as ca

    points = ca.DM(set_points(seconds)).T

    def run() -> Timed:
        begin = time.process_time()
        states = job(ca.DM.zeros(4), points)
        spent = time.process_time() - begin
        return Timed([float(states[0, k]) for k in range(999, 1000 * seconds, 1000)], spent)

    return run


def casadi_graph(seconds: int, _folder: Path) -> Run:
    """`mapaccum` over the scans, in CasADi's virtual machine."""
    return _runner(_scan().mapaccum(1000 * seconds), seconds)


def casadi_gcc(seconds: int, folder: Path) -> Run:
    """The same, generated as C, compiled and loaded by `external`."""
    import casadi as ca

    source = folder / "job.c"
    generator = ca.CodeGenerator(source.name)
    generator.add(_scan().mapaccum("job", 1000 * seconds))
    generator.generate(f"{folder}/")
    library = build(source, source.with_suffix(".so"), "-shared", "-fPIC")
    return _runner(ca.external("job", str(library)), seconds)
