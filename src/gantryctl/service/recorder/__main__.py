"""Entry point: `python -m gantryctl.service.recorder`, the name of the process in a process list."""

import sys

from gantryctl.service.recorder.process import main

sys.exit(main(sys.argv[1:]))
