"""What a CANopen object dictionary is: data types, objects, EDS and DCF files, what a speed axis needs of them.

The virtual drive is made of such a description and writes its own EDS from it; the master and the command line
read those of real drives.
"""
