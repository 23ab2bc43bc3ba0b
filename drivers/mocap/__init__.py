"""Motion capture: stream decoders and the sockets that feed them."""
