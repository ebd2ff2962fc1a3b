"""The network protocol: messages, keys, and the transports that carry them."""
