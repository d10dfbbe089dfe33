"""Other physics engines on the benchmark scenes."""
