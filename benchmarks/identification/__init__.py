"""Accuracy, convergence and cost of identification."""
