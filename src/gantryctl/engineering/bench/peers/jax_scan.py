"""JAX: `lax.scan` over the scans, compiled by XLA, in double precision."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

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


def jax_scan(seconds: int, _folder: Path) -> Run:
    """Eight cycles unrolled in the body; compiled before time is measured."""
    import jax
    import jax.numpy as jnp
    from jax import lax

    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_platforms", "cpu")
    points = jnp.array(set_points(seconds))

    def scan(state: Any, point: Any) -> Any:
        pos, vel, last, integral = state
        command = KPP * (RATIO * point[0] - pos) + KVF * RATIO * point[1]
        for _ in range(CYCLES):
            error = command - (pos - last) / CYCLE_S
            last = pos
            wanted = KVP * (error + integral)
            torque = jnp.clip(wanted, -LIMIT_NM, LIMIT_NM)
            free = (torque == wanted) | ((wanted - torque) * error < 0.0)
            integral = jnp.where(free, integral + error * CYCLE_S / TVI, integral)
            load = ECCENTRIC_NM * jnp.sin(pos / RATIO) / RATIO
            vel = vel + CYCLE_S * (torque + load) / INERTIA_KG_M2
            pos = pos + CYCLE_S * vel
        return (pos, vel, last, integral), pos

    def all_scans(table: Any) -> Any:
        zero = jnp.zeros((), dtype=table.dtype)
        return lax.scan(scan, (zero, zero, zero, zero), table)[1]

    job = jax.jit(all_scans)
    job(points).block_until_ready()

    def run() -> Timed:
        begin = time.process_time()
        angles = job(points).block_until_ready()
        spent = time.process_time() - begin
        return Timed([float(angle) for angle in angles[999::1000]], spent)

    return run
