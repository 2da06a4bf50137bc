"""Commands for drives on a bus: scan, objects, EDS files, commissioning, the virtual drive."""
