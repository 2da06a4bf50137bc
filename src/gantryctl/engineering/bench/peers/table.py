"""Every program that does the rigid job, from the fastest expected to the slowest."""

from __future__ import annotations

import importlib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.engineering.bench.rigid import SECONDS, Run


class Peer(NamedTuple):
    """One program.

    Attributes:
        name: for people.
        module, function: below this package; the function takes axis seconds and a folder
            for what it compiles, and gives a run.
        needs: distributions of the extra `[bench]`; () without.
        way: how the job is done.
        seconds: axis seconds of a run: the slow ones do the first part of the job.
    """

    name: str
    module: str
    function: str
    needs: tuple[str, ...]
    way: str
    seconds: int = SECONDS

    def missing(self) -> str | None:
        """The distribution that is not installed, or None."""
        for name in self.needs:
            try:
                version(name)
            except PackageNotFoundError:
                return name
        return None

    def versions(self) -> str:
        """What it needs, with versions."""
        return ", ".join(f"{name} {version(name)}" for name in self.needs)

    def prepare(self, folder: Path) -> Run:
        """Import and compile; the folder must outlive the run.

        Raises:
            ImportError: it is not installed as it should be.
            UsageError: a compiler is missing.
        """
        module = importlib.import_module(f"gantryctl.engineering.bench.peers.{self.module}")
        run: Run = getattr(module, self.function)(self.seconds, folder)
        return run


OWN: Final = "gantryctl"
PEERS: Final = (
    Peer("plain C", "plain_c", "plain_c", (), "one loop as it is usually written, -O3 without fused multiply-add"),
    Peer(OWN, "own", "compiled_loop", (), "compiled closed loop of one plant, with its whole log"),
    Peer("CasADi, gcc", "casadi_graph", "casadi_gcc", ("casadi",), "`mapaccum` over the scans, generated as C, -O3"),
    Peer("CasADi", "casadi_graph", "casadi_graph", ("casadi",), "`mapaccum` over the scans, virtual machine"),
    Peer("JAX", "jax_scan", "jax_scan", ("jax", "jaxlib"), "`lax.scan` over the scans, `jit`, double precision"),
    Peer("Python, inlined", "own", "python_inlined", (), "one loop, everything inlined by hand", 10),
    Peer("Python", "own", "python_functions", (), "one function a law", 10),
    Peer("FMPy", "fmpy_fmu", "fmpy_fmu", ("fmpy",), "drive and plant as compiled FMU 2.0, position law its master", 10),
    Peer("MuJoCo", "mujoco_hinge", "mujoco_hinge", ("mujoco",), "hinge, geared motor, `mj_step` each drive cycle", 5),
    Peer("Drake", "drake_symbolic", "drake_symbolic", ("drake",), "`SymbolicVectorSystem`, `Simulator.AdvanceTo`", 5),
    Peer("SciPy", "scipy_ode", "scipy_ode", ("scipy",), "`ode` (dopri5) each drive cycle, laws in Python", 2),
    Peer("python-control", "python_control", "python_control", ("control",), "`nlsys`, `input_output_response`", 1),
)  # fmt: skip
