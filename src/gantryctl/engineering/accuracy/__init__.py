"""The chord test: procedures, error tables, statistics, report.

table        ErrorTable: chord errors by base, direction, run and displacement
statistics   the paper's eq. (6) and the figures of its table 2
iso230       ISO 230-2:2014 figures, directions separated
procedure    chord procedures A to D as stop points, and their evaluation
noise        what the tracker's noise alone does to A
table_csv    error tables as CSV
paper        what the paper printed
report       AccuracyReport, text and JSON;  html, figures: the page
"""
