"""The shared memory between the processes of the service."""
