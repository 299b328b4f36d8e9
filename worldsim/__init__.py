"""The world and its ground truth, and the process around them.

Bodies, motion and collisions, the true fog, the radio between the robots (the ether), the summary and the
verdict. It knows nothing of how an agent decides.
"""
