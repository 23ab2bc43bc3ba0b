"""Design of excitation (paper §4, Eq. 40–42): which equilibria and displacements tell most. `search.design` does it."""
