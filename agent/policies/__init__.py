"""Policies: what a robot wants next."""
