"""CANopen master: a CiA 402 drive in cyclic synchronous velocity behind the `Drive` port.

SYNC and process data belong to the scan; SDO is used before the first scan and after the last one only.
"""
