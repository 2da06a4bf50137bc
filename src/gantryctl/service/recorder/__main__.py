"""Entry point: `python -m gantryctl.service.recorder`, the name of the process in a process list."""

import sys

from gantryctl.errors import GantryctlError
from gantryctl.service.recorder.process import main

try:
    sys.exit(main(sys.argv[1:]))
except GantryctlError as fault:
    sys.stderr.write(f"recorder: {fault}\n")
    sys.exit(fault.exit_code)
