"""The pull of the stalest points: forces and claims, their sum or strongest sector, and what need not be computed."""
