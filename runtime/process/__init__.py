"""The common parts of a fleet's processes: command-line options, warm kernels, leaving in order."""
