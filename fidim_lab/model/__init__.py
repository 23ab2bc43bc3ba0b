"""The physics: pure functions of state and constants, written once as CasADi expressions."""
