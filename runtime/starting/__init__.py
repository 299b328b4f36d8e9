"""The start of processes: compiled kernels, forks, and the word that one is ready."""
