"""Entry point: `python -m gantryctl.commissioning.in_service`, the name of the process in a process list."""

import os
import sys

from gantryctl.commissioning.in_service.process import main
from gantryctl.errors import GantryctlError
from gantryctl.terminal import tell

try:
    code = main(sys.argv[1:])
except GantryctlError as fault:
    tell(f"commissioning: {fault}")
    code = fault.exit_code
os._exit(code)
