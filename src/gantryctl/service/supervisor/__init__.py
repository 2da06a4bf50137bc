"""The parent process: starts, watches and ends the others; users and certificates."""
