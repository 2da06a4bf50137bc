"""Entry point: `python -m gantryctl.commissioning.in_service`, the name of the process in a process list."""

import os
import sys

from gantryctl.commissioning.in_service.process import main
from gantryctl.errors import GantryctlError

try:
    code = main(sys.argv[1:])
except GantryctlError as fault:
    sys.stderr.write(f"commissioning: {fault}\n")
    code = fault.exit_code
sys.stderr.flush()
os._exit(code)
