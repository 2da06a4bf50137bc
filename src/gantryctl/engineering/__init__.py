"""Engineering of a gantry: sizing, analysis, tuning, identification, accuracy. Nothing that runs one imports it."""
