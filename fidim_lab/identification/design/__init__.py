"""Design of excitation (paper §4, Eq. 40–42): the most informative equilibria and displacements (`search.design`)."""
