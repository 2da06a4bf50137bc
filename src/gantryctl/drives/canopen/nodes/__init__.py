"""Nodes beside the drive on its SYNC: digital inputs and outputs (CiA 401), encoder on the ring (CiA 406)."""
