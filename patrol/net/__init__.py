"""What goes over the network: keys, links, and the messages between processes."""
