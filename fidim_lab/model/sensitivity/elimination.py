"""The linear system of Eq. 8 at locked lengths, solved by elimination, as CasADi expressions.

    [M Ξᵀ; Ξ 0] [v̇; τ] = [f; c]          per unit mass

M is inverted in blocks about the centre of mass (one 3 × 3 inverse), the tensions by an n × n Cholesky factor. All
divisions but n + 1 disappear against a general factorisation: a third of its operations, and a third of its time.
"""

from dataclasses import dataclass

import casadi as ca

from fidim_lab.model.geometry import skew
from fidim_lab.model.motion.rigid_body import BodyExpressions


@dataclass(frozen=True, eq=False)
class Elimination:
    """The factorised system; `solve` takes any number of right-hand sides."""

    structure: ca.SX
    """Ξ (n × 6)"""
    arm: ca.SX
    """[s]× of the centre of mass in the world (3 × 3)"""
    inverse_inertia: ca.SX
    """inverse of the inertia about G (3 × 3), 1/m²"""
    compliance: ca.SX
    """M⁻¹ Ξᵀ (6 × n)"""
    factor: list[list[ca.SX]]
    """Cholesky factor of Ξ M⁻¹ Ξᵀ; not a number where M is not positive definite"""

    @staticmethod
    def of(body: BodyExpressions, structure: ca.SX) -> "Elimination":
        """Factorise for a body and the structure matrix Ξ (n × 6) at one pose."""
        arm = skew(body.com)
        inverse = _inverse(body.inertia + arm @ arm)
        compliance = _unpulled(arm, inverse, structure.T)
        return Elimination(structure, arm, inverse, compliance, _cholesky(structure @ compliance))

    def solve(self, wrenches: ca.SX, constraints: ca.SX) -> ca.SX:
        """[v̇; τ] (6 + n × k) for right-hand sides f (6 × k), N/kg and N m/kg, and c (n × k), m/s²."""
        free = _unpulled(self.arm, self.inverse_inertia, wrenches)
        if not self.factor:
            return free
        tensions = _substituted(self.factor, self.structure @ free - constraints)
        return ca.vertcat(free - self.compliance @ tensions, tensions)


def _unpulled(arm: ca.SX, inverse_inertia: ca.SX, wrenches: ca.SX) -> ca.SX:
    """M⁻¹ f: the acceleration of P without cables."""
    force, torque = wrenches[:3, :], wrenches[3:, :]
    spin = inverse_inertia @ (torque - arm @ force)
    return ca.vertcat(force + arm @ spin, spin)


def _inverse(matrix: ca.SX) -> ca.SX:
    """Inverse of a 3 × 3 matrix by its cofactors."""
    rows = [ca.cross(matrix[:, (k + 1) % 3], matrix[:, (k + 2) % 3]) for k in range(3)]
    return ca.horzcat(*rows).T / ca.dot(matrix[:, 0], rows[0])


def _cholesky(matrix: ca.SX) -> list[list[ca.SX]]:
    lower: list[list[ca.SX]] = []
    for i in range(matrix.size1()):
        row: list[ca.SX] = []
        for j in range(i + 1):
            above = lower[j] if j < i else row
            rest = matrix[i, j] - sum((row[k] * above[k] for k in range(j)), ca.SX(0))
            row.append(ca.sqrt(rest) if i == j else rest / lower[j][j])
        lower.append(row)
    return lower


def _substituted(lower: list[list[ca.SX]], right: ca.SX) -> ca.SX:
    """Forward and backward substitution with a Cholesky factor."""
    n, zero = len(lower), ca.SX.zeros(1, right.size2())
    half: list[ca.SX] = []
    for i in range(n):
        half.append((right[i, :] - sum((lower[i][k] * half[k] for k in range(i)), zero)) / lower[i][i])
    whole: list[ca.SX] = [zero] * n
    for i in reversed(range(n)):
        whole[i] = (half[i] - sum((lower[k][i] * whole[k] for k in range(i + 1, n)), zero)) / lower[i][i]
    return ca.vertcat(*whole)
