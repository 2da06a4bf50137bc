"""The command line with a campaign that merges its files after every few chunks, not after hundreds."""

from gantryctl.cli.main import main
from gantryctl.engineering.campaign import run

vars(run).update(MERGED_FILES=3)

if __name__ == "__main__":
    main()
