"""Entry point: `python -m gantryctl.service.recorder`, the name of the process in a process list."""

import sys

from gantryctl.errors import GantryctlError
from gantryctl.service.recorder.process import main
from gantryctl.terminal import tell

try:
    sys.exit(main(sys.argv[1:]))
except GantryctlError as fault:
    tell(f"recorder: {fault}")
    sys.exit(fault.exit_code)
