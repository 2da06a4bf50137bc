"""Setting up a drive before the first scan: parameters, checks, read-only access, survey of a bus."""
