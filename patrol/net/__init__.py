"""The network: keys, links, and the messages between processes."""
