"""What the periods of a pendulum, by stopwatch or light gate, show of its body."""
