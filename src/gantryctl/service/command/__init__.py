"""Commands from people: control authority, permissions, arming, the operator of the scan."""
