"""Lines on the terminal: `board` draws them, `plot` makes curves of braille dots."""
