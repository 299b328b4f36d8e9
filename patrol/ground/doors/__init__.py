"""Where the ground is narrow: rooms and doors, passages, and bodies that do not fit."""
