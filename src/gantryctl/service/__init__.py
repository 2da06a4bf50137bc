"""The controller as a service: its processes, commands, control authority, users and journal."""
