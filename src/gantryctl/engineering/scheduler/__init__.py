"""The scheduler: rows of any job on threads, processes or a Dask cluster, each row once and the same everywhere.

job        Job: a pure function of a range of row numbers;  Chunk, Rows, collected
identity   what decides the bits of a row: version, sources, compiled core, arithmetic of the processor
one_thread  linear algebra whose bits do not depend on the number of cores
pools      threads and processes of this computer
cluster    workers of a Dask cluster
schedule   chunk sizes, chunks that were lost with a worker, progress
"""
