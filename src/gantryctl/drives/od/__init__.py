"""CANopen object dictionaries: data types, objects, EDS and DCF files, and the needs of a speed axis.

The virtual drive is made of such a description and writes its own EDS from it; the master and the command line
read those of real drives.
"""
