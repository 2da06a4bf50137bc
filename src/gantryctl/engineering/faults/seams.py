"""Where and how a fault acts: every kind by its place, with the arguments that it takes.

A kind acts once, or stands until its time is over: then it returns what ends it. The table exists in this package only,
which no controller imports: on a real bus there is nothing that could be switched on.
"""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.kinds import axis, bus, controller, nodes
from gantryctl.engineering.faults.kinds.kind import Table

KINDS: Final[Table] = axis.KINDS | bus.KINDS | nodes.KINDS | controller.KINDS
