"""Many runs: what to run, who runs it, and what came out."""
