"""The network: Zenoh links, multicast groups, serial lines and mailboxes."""
