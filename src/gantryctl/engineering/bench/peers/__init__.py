"""Other tools doing the rigid job, each in its best documented way; each file imports its tool when it is asked to."""
