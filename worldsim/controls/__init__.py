"""An operator's controls: taken from the network, carried out between ticks."""
