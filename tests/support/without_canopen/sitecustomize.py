"""A Python in which drives/canopen does not exist: put this folder first on PYTHONPATH."""

import sys
from importlib.abc import MetaPathFinder

REMOVED = "gantryctl.drives.canopen"


class Removed(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name == REMOVED or name.startswith(REMOVED + "."):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


sys.meta_path.insert(0, Removed())
