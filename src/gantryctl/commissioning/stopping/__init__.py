"""Stops with the position loop open: by a quick stop, and by the drive alone when its controller is silent."""
