"""What goes over the network: messages, keys, and the bus that carries them."""
