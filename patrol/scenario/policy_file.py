"""The names of the built-in policies."""

from __future__ import annotations

from typing import Final

COMMITTED: Final = "committed"
"""The default policy."""

PAPER: Final = "potential-field"
"""The policy of the paper."""

BUILT_IN = (COMMITTED, PAPER)
"""Policies that come with fogwatch."""
