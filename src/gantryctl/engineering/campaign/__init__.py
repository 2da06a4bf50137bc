"""Campaigns: figures of many plants that differ at random, on one computer or a cluster.

tables          the campaign file: its tables and keys
reading         a campaign file to a Campaign, or the list of all its problems
population      Campaign and its factors: the plant of every row
distributions   laws of a factor: numbers between 0 and 1 to values of keys
sampling        Monte Carlo, Sobol, Latin hypercube, and the design of a sensitivity analysis
measures        what is measured on a plant: chord test, speed test, move, stops
job             rows of a campaign, as a job of the scheduler
result          the folder that a run fills: its head, and the rows that are there
row_files       rows in Parquet files, each named by its range, merged as they become many
run, plan       one run until every row is there; what a large one takes
order_statistics  order statistics of a stream, exact, in little memory
statistics      quantiles, probabilities, sensitivity, with their confidence intervals
"""
