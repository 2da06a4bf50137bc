"""Campaigns of faults: scenarios drawn from seeds or from the whole matrix, judged by the true plant, kept in rows."""
