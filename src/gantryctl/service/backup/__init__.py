"""Backup and restore of a machine in service: configuration, state, journal, accounts; all settings as one document."""
