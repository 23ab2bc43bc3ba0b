"""The result of an identification, and its file; whether its body predicts other windows."""
