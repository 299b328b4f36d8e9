"""The command, for the tests of this folder."""

from tests.command_line import run

__all__ = ["run"]
