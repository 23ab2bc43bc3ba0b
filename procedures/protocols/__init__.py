"""The procedures themselves: generators of frozen steps, by name in `catalogue`; `experiment` checks one."""
