"""The live page: a small server on this machine, and the files that a browser shows."""
