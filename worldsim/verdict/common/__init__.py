"""What all checks of the verdict share."""
