"""What a recording is: column names, `Trace`, reading and exporting."""
