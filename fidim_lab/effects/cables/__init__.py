"""Effects of cables, winches and swivels that stretch, weigh or give way."""
