"""Entry point: `python -m gantryctl.gateway.opcua`, the name of the process in a process list."""

import sys

from gantryctl.gateway.opcua.server import main

sys.exit(main(sys.argv[1:]))
