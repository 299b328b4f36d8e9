"""Rights on the network, and the proofs that each side gives of them."""
