"""Policies that were trained: what they see, what their answers mean, and how a trained network is evaluated.

Learning environments (`fogwatch.learn`) offer observations and actions made here, so that a network decides in a fleet
as it did in training.
"""
