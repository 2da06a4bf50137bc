"""The journal: every command, alarm, change of control or setting and login, each bound to the one before."""
