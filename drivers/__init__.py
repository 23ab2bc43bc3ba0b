"""Hardware: protocols without I/O, thin adapters, and the ports that procedures use."""
