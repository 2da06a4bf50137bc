"""Virtual drive: a CANopen node (CiA 301, CiA 402) with the whole gantry behind it.

Written against the CiA texts, not against our master. `DriveNode` is the drive: frames in, frames out, time as an
argument. `DirectBus` puts it on a python-can bus in the same thread, `DriveLoop` on any python-can bus, in real time
or stepped by SYNC; `ControlServer` and `Requests` are its side channel for faults and truth.
"""
