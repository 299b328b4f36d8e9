"""Compiled kernels of `worldsim`: every module here imports only numpy and numba, and every kernel takes
arrays and scalars under one explicit signature and calls no kernel of another file."""
