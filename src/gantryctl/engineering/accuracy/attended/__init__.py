"""The chord test on a machine: its readings on disk one by one, and the run that takes them and resumes."""
