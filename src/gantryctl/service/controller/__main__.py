"""Entry point: `python -m gantryctl.service.controller`, the name of the process in a process list."""

import os
import sys

from gantryctl.errors import GantryctlError
from gantryctl.service.controller.process import main

try:
    code = main(sys.argv[1:])
except GantryctlError as fault:
    sys.stderr.write(f"controller: {fault}\n")
    code = fault.exit_code
sys.stderr.flush()
os._exit(code)  # everything is closed; memory that was frozen cannot be taken apart any more
