"""Which effects are named without a rival: fits of unlisted effects show where a good fit is no proof.

If an effect is not in the catalogue, others combine to imitate it: a damping of the swivels
becomes friction there with a tone and a drag beside it, that of a joint which sticks first becomes two drags, a cable
that stretches a frame that yields, with a wrong anchor. Each of them may have no rival that is nearly as good, so
odds alone would make it certain (`fidim benchmark explain --without each`).

What the motion does not tell apart, another sensor may: encoders of the swivels show how much friction they have.
"""

from dataclasses import replace
from itertools import combinations

from fidim_lab.effects.dissipation.pulley_friction import SwivelFriction
from fidim_lab.effects.effect import HandContact
from fidim_lab.effects.equivalences import held_by, shared_by
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict
from fidim_lab.mismatch.conclusion.thresholds import CONCLUSION
from fidim_lab.mismatch.residuals.swivels import lag, swivels


def only_certain(told: Explanation) -> Explanation:
    """The explanation with no name as the only one where its effects may be parts of something that is not listed.

    That is: where something stays unexplained, where there are several effects of one family, or many in all, and where
    one of them has a rival: what stands in its place would change the others. A steady force always has one: gravity
    that is tilted does the same.
    """
    laws = [cause for cause in told.effects if cause.id != HandContact.id]
    alike = any(shared_by((one.id, other.id)) for one, other in combinations(told.effects, 2))
    rivalled = any(held_by(cause.id) or not cause.single for cause in laws)
    few = len(laws) < CONCLUSION.certainty_many
    certain = told.verdict is Verdict.EXPLAINED and few and not alike and not rivalled
    return replace(told, effects=tuple(replace(one, single=one.single and certain) for one in told.effects))


def with_swivels(told: Explanation, found: Fit) -> Explanation:
    """The explanation with what the swivels' encoders say of dry friction there, where that is named or may be meant.

    found: the fit that is told, of windows with their readings.
    """
    ours = [one for cause in told.effects for one in (cause, *cause.members) if one.id == SwivelFriction.id]
    sizes = [one.parameters["c"].value for one in ours if "c" in one.parameters]
    behind = lag(swivels(found)) if sizes else None
    if behind is None:
        return told
    angles = f"{1e3 * behind.angle:.2g} ± {1e3 * behind.sd:.1g} mrad"
    says = f"The swivels' encoders lag behind the cables by {angles}: dry friction there is at most "
    says += f"{behind.most_torque:.1g} N m"
    told = replace(told, message=f"{told.message} {says}.")
    if min(sizes) <= behind.most_torque or all(cause.single for cause in told.effects):
        return told
    return replace(told, next_experiment=f"{says}, not {min(sizes):.1g} N m: look at attachments and pulleys first.")
