"""What every process of a fleet does alike: command-line options, warm kernels, leaving in order."""
