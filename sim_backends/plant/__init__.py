"""The simulated physical world: `world` says what is true, `plant` lets it move, `sensors` look at it."""
