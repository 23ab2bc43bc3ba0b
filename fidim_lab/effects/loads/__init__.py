"""Effects that push, pull or swing with the platform."""
