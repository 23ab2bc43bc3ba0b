"""What an identification answers, and its file; whether its body predicts other windows."""
