"""The recorder process: journal and recordings on the disk."""
