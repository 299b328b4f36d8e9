"""Radio models: which frames get from one radio to another."""
