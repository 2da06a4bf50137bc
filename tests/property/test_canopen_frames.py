"""Any bytes as any frame on any identifier: the scan never raises, and the axis never moves for it."""

from __future__ import annotations

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gantryctl.image import DriveRequest, InputImage, OperatorCommand
from gantryctl.program import Axis, GantryProgram
from gantryctl.wiring.program import axis_settings
from unit.drives.canopen.canopen_bench import Bench

# Of the drive, of this master, and some of neither.
IDENTIFIERS = [
    0x000, 0x080, 0x082, 0x100, 0x182, 0x282, 0x382, 0x482, 0x202, 0x302, 0x582, 0x602, 0x702, 0x77F, 0x7FF,
]  # fmt: skip
FRAMES = st.lists(st.tuples(st.sampled_from(IDENTIFIERS), st.binary(max_size=8)), max_size=12)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(FRAMES, min_size=1, max_size=8))
def test_any_frame_from_the_bus_never_raises_and_never_moves_the_axis(
    scans: list[list[tuple[int, bytes]]],
) -> None:
    """What reaches the master reaches the program too, which answers with what it likes: but nothing turns."""
    bench = Bench().open()
    program = GantryProgram(Axis(axis_settings(bench.machine), 0.0))
    before = bench.load_deg
    for k, frames in enumerate(scans):
        for can_id, data in frames:
            bench.virtual._out(can_id, data)  # onto the bus, as from any node
        feedback = bench.drive.read()
        output = program.scan(InputImage(k, 0.004 * k, feedback, OperatorCommand()))
        bench.drive.write(output)
        assert output.request is not DriveRequest.ENABLE
    assert abs(bench.load_deg - before) < 1e-6
    bench.drive.close()
