"""`python -m gantryctl`."""

from gantryctl.cli.main import main

main()
