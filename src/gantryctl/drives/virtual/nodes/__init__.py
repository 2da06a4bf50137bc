"""Virtual nodes beside the drive on its bus: digital inputs and outputs (CiA 401), encoder on the ring (CiA 406)."""
