"""Machine file to engine: the only place that chooses concrete parts, by functions of the machine."""
