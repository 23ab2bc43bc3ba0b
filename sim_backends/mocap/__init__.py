"""A simulated motion-capture server: true positions in, the bytes of a real one out, in process or on real sockets."""
