"""Whether a window is repeated, by its swing, the planned one, and what a new plan would reach.

`missed` and `may_gain` are asked first: where neither holds no new plan is needed. `why_again` then decides.
"""

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.excitation.plan import Excitation


def missed(seen: Float[np.ndarray, " modes"], plan: Excitation, close: float) -> str:
    """What is amiss with a swing, as a sentence without its full stop; empty where it is as wanted, or as planned.

    seen: how far the marker swung in each mode, m. close: part of a swing by which it may be off.
    """
    found, aim, wanted = _size(seen), _size(plan.reached), _size(plan.wanted)
    if min(abs(found / wanted - 1), abs(found / aim - 1)) <= close:
        return ""
    return f"it swung {1e3 * found:.1f} mm, {1e3 * aim:.1f} mm were planned"


def may_gain(seen: Float[np.ndarray, " modes"], plan: Excitation, close: float) -> bool:
    """Whether a new plan, which knows how it swung (m), may do better: it is amiss, or less than wanted as planned."""
    return bool(missed(seen, plan, close)) or _size(seen) / _size(plan.wanted) < 1 - close


def why_again(seen: Float[np.ndarray, " modes"], plan: Excitation, again: Excitation | None, close: float) -> str:
    """Why a window that swung so (m) is done again by a new plan; empty where it is taken as it is.

    again: None where nothing can be planned. A swing that the new plan brings no nearer to the wanted one is taken;
    so is one as planned, though less than wanted, of which neither the whole is in reach by now, nor a third more.
    """
    if again is None or not may_gain(seen, plan, close):
        return ""
    found, more, wanted = _size(seen), _size(again.reached), _size(again.wanted)
    if abs(more - wanted) >= abs(found - wanted):
        return ""
    amiss = missed(seen, plan, close)
    if amiss or (again.why_less and more <= (1 + 2 * close) * found):
        return amiss
    return f"it swung {1e3 * found:.1f} mm as planned; with what it showed {1e3 * more:.1f} mm can be reached"


def _size(swing: Float[np.ndarray, " modes"]) -> float:
    return float(np.linalg.norm(swing))
