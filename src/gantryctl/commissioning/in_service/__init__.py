"""Commissioning in the place of the controller of the service: a process that people talk to by its messages."""
