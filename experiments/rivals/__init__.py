"""The patrols of the literature, as policies: each visits the vertices of a graph by its own rule.

They were written from papers, which their docstrings name. What they send in the literature besides positions is
inferred from positions here, so that they live by the same rule as all others.
"""
