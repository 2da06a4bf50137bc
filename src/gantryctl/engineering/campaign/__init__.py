"""Campaigns: figures of many plants that differ at random, on one computer or a cluster.

tables          the campaign file: its tables and keys
reading         a campaign file to a Campaign, or the list of all its problems
population      Campaign and its factors: the plant of every row
distributions   laws of a factor: numbers between 0 and 1 to values of keys
sampling        Monte Carlo, Sobol, Latin hypercube, and the design of a sensitivity analysis
tests           what is measured on a plant: chord test, speed test, move, stops
job             rows of a campaign, as a job of the scheduler
result          the folder of Parquet files that a run fills
run, plan       one run until every row is there; what a large one takes
statistics      quantiles, probabilities, sensitivity, with their confidence intervals
"""
