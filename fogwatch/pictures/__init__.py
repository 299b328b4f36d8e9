"""Still pictures: maps, runs, and the results of experiments."""
