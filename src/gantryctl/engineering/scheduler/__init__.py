"""The scheduler: rows of any job on threads or processes, each row once and the same everywhere.

job        Job: a pure function of a range of row numbers;  Chunk, Rows, collected
pools      threads and processes of this computer
schedule   chunk sizes, chunks that were lost with a worker, progress
"""
