"""Narrow ground: rooms and doors, passages, and bodies that do not fit."""
