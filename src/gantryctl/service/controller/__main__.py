"""Entry point: `python -m gantryctl.service.controller`, the name of the process in a process list."""

import os
import sys

from gantryctl.errors import GantryctlError
from gantryctl.service.controller.process import main
from gantryctl.terminal import tell

try:
    code = main(sys.argv[1:])
except GantryctlError as fault:
    tell(f"controller: {fault}")
    code = fault.exit_code
os._exit(code)  # everything is closed; memory that was frozen cannot be taken apart any more
