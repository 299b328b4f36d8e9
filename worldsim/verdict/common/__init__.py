"""The code that all checks of the verdict share."""
