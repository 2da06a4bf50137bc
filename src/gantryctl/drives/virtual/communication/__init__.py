"""CiA 301 of the virtual drive: dictionary, SDO, PDO, NMT, heartbeat, EMCY, stored parameters."""
