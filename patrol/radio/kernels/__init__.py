"""Compiled kernels of `patrol.radio`.

Every module here imports only numpy and numba. A kernel takes arrays and scalars, has one explicit
signature, and calls no kernel of another file.
"""
