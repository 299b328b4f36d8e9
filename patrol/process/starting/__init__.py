"""How processes start: compiled kernels, forks, and the word that one is ready."""
