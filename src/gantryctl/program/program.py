"""Base of custom programs: blocks on an axis, once per scan."""

from __future__ import annotations

from gantryctl.image import InputImage, OutputImage
from gantryctl.program.axis.axis import Axis


class AxisProgram:
    """Base of a program for one axis: override `logic` and call blocks in it.

    `logic` runs between the axis' own halves of the scan: alarms, interlocks and power before it; set-point,
    position loop and output guard after it.

    Args:
        axis: the axis that the blocks act on.
    """

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.trace_columns: tuple[str, ...] = axis.trace_columns

    def logic(self, image: InputImage) -> None:
        """Call the blocks of one scan."""

    def scan(self, image: InputImage) -> OutputImage:
        """One scan."""
        axis = self.axis
        axis.begin(image)
        self.logic(image)
        return axis.end()

    def trace_row(self) -> tuple[float, ...]:
        """Values of the last scan, in the order of `trace_columns`."""
        return self.axis.trace_row()
