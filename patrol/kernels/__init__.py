"""Compiled kernels of `patrol` that belong to no part of it more than to another.

Every module here imports only numpy and numba (and types). A kernel takes arrays and scalars, has one explicit
signature, and calls no kernel of another file.
"""

from patrol.kernel_cache import keep_compiled

keep_compiled(__name__)
