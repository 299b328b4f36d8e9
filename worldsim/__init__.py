"""The world and its ground truth: bodies, motion and collisions, the true fog, the radio between the
robots ("ether"), the journal's contents, the summary and the verdict, and the process around them. It
knows nothing of how an agent decides."""
