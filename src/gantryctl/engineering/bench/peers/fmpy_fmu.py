"""FMPy: drive and plant as a compiled FMU (FMI 2.0, co-simulation), the position law as its master in Python."""

from __future__ import annotations

import time
import zipfile
from pathlib import Path
from typing import Final

from gantryctl.engineering.bench.peers.building import build
from gantryctl.engineering.bench.rigid import (
    CYCLE_S,
    CYCLES,
    ECCENTRIC_NM,
    INERTIA_KG_M2,
    KVP,
    LIMIT_NM,
    RATIO,
    SCAN_S,
    TVI,
    Run,
    Timed,
    position_law,
    set_points,
)

_GUID: Final = "gantryctl-rigid-1"
_COMMAND, _ANGLE = 0, 1
_DESCRIPTION: Final = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="rigid" guid="{_GUID}">
  <CoSimulation modelIdentifier="rigid" canHandleVariableCommunicationStepSize="false"/>
  <ModelVariables>
    <ScalarVariable name="command" valueReference="{_COMMAND}" causality="input" variability="continuous">
      <Real start="0"/>
    </ScalarVariable>
    <ScalarVariable name="angle" valueReference="{_ANGLE}" causality="output" variability="continuous">
      <Real/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>
"""


def _make_fmu(folder: Path, headers: Path) -> Path:
    """Compile and pack the FMU."""
    from fmpy import platform, sharedLibraryExtension

    numbers = {
        "RATIO": RATIO, "INERTIA": INERTIA_KG_M2, "ECCENTRIC": ECCENTRIC_NM, "KVP": KVP, "TVI": TVI,
        "TORQUE_MAX": LIMIT_NM, "CYCLE_S": CYCLE_S, "CYCLES": CYCLES,
    }  # fmt: skip
    library = folder / f"rigid{sharedLibraryExtension}"
    defined = [f"-D{name}=({value!r})" for name, value in numbers.items()]
    build(Path(__file__).with_name("rigid_fmu.c"), library, "-shared", "-fPIC", f"-I{headers}", *defined)
    fmu = folder / "rigid.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", _DESCRIPTION)
        archive.write(library, f"binaries/{platform}/{library.name}")
    return fmu


def fmpy_fmu(seconds: int, folder: Path) -> Run:
    """The master's loop of FMPy's manual: set, do a step, get, once a scan."""
    import fmpy
    from fmpy.fmi2 import FMU2Slave

    fmu = _make_fmu(folder, Path(fmpy.__file__).parent / "c-code")
    unzipped = fmpy.extract(str(fmu), str(folder / "unzipped"))
    points = set_points(seconds)

    def run() -> Timed:
        slave = FMU2Slave(guid=_GUID, unzipDirectory=unzipped, modelIdentifier="rigid", instanceName="rigid")
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        command, output = [_COMMAND], [_ANGLE]
        begin = time.process_time()
        angles, pos = [], 0.0
        for k, (pos_ref, vel_ref) in enumerate(points):
            slave.setReal(command, [position_law(pos_ref, vel_ref, pos)])
            slave.doStep(currentCommunicationPoint=k * SCAN_S, communicationStepSize=SCAN_S)
            pos = slave.getReal(output)[0]
            if k % 1000 == 999:
                angles.append(pos)
        spent = time.process_time() - begin
        slave.terminate()
        slave.freeInstance()
        return Timed(angles, spent)

    return run
