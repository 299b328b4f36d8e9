"""Still pictures and films of maps and runs."""
