"""Compiled kernels of `agent`: fog, ways, forces, choices and manoeuvres.

Every module here imports only numpy and numba. A kernel takes arrays and scalars, has one explicit
signature, and calls no kernel of another file.
"""

from patrol.kernel_cache import keep_compiled

keep_compiled(__name__)
