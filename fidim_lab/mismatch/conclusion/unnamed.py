"""Unknown physics in an explanation: the words and figures of the generic model, and the parameters with it."""

from dataclasses import replace

from fidim_lab.data.records import Campaign
from fidim_lab.errors import RefusedError
from fidim_lab.mismatch.conclusion.explanation import BodyParameter, Explanation, Verdict
from fidim_lab.mismatch.conclusion.message import body_parameters, law_terms
from fidim_lab.mismatch.conclusion.parts import Before
from fidim_lab.mismatch.conclusion.verdict import Judged
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.single_force import modelled
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.unknown_force.unknown import UnknownForce
from fidim_lab.say import Say
from fidim_lab.units import millimetres


def with_unknown(
    explanation: Explanation, judged: Judged, campaign: Campaign, say: Say
) -> tuple[Explanation, Completed]:
    """The explanation with what is left modelled generically, where its verdict says that something is left.

    Figures and parameters "after" are those of a law of force that predicts held-out windows as well as the generic
    model, having fewer parameters; else of that model where it helps there; the explanation is as it was where neither
    does. Also returns the model whose figures are told.
    """
    named, law = judged.named, judged.law
    if explanation.verdict not in (Verdict.UNKNOWN_PHYSICS, Verdict.PARTLY_EXPLAINED):
        return explanation, named.model
    wrench = _with_wrench(explanation, named, campaign, say, judged.outdone_by)
    if law is not None and _predicts_as_well(law, wrench, named):
        much = (wrench.chi2_per_dof.after or 0.0) > SHARED.little * law.held_out.chi2_per_dof
        return _by_law(explanation if much else wrench, law, campaign), law.model
    model = named.model if wrench.unknown is None else Completed((), wrench.unknown.fit, whole=True)
    return wrench, model


def _predicts_as_well(law: Candidate, wrench: Explanation, named: Candidate) -> bool:
    """Whether held-out windows are predicted by the law, none of them lost, about as well as by the generic model."""
    left = wrench.chi2_per_dof.after
    if not (law.model.whole and law.held_out.dof) or left is None:
        return False
    lost = law.held_out.refused.keys() - named.held_out.refused.keys()
    return not lost and law.held_out.chi2_per_dof <= SHARED.little * left


def _by_law(explanation: Explanation, law: Candidate, campaign: Campaign) -> Explanation:
    terms = law_terms(law.model)
    return replace(
        explanation,
        chi2_per_dof=Before(explanation.chi2_per_dof.before, law.held_out.chi2_per_dof),
        rms_mm=Before(explanation.rms_mm.before, millimetres(law.held_out.rms)),
        parameters=body_parameters(law.model.fit, campaign),
        message=f"{explanation.message} The figures and the body are those of the law.",
        next_experiment=f"Look on the robot for what acts like {terms[0].like}.",
        law=terms,
    )


def _with_wrench(
    explanation: Explanation, named: Candidate, campaign: Campaign, say: Say, known: UnknownForce | None
) -> Explanation:
    """With an unknown wrench beside the model whose effects are named. known: that wrench, where it was found."""
    if named.model.mechanism.springs:
        said = "The residual with elastic cables was scored, but no unknown wrench was fitted to it."
        return replace(explanation, message=f"{explanation.message} {said}")
    try:
        if known is None:
            say("modelling unknown physics")
        found = known or modelled(named, campaign)
    except RefusedError as error:
        return replace(explanation, message=f"{explanation.message} {error.message}")
    if found.terms and not found.after.dof:
        said = "No held-out window can be predicted, so an unknown wrench cannot be judged."
        return replace(explanation, message=f"{explanation.message} {said}")
    if not found.terms or not _helps(found):
        said = "No smooth wrench of place, velocity, rotation or time explains it either."
        return replace(explanation, message=f"{explanation.message} {said}")
    if not found.halves:
        found = replace(found, words=())  # the shape of a part would be taken for that of the whole
    return replace(
        explanation,
        chi2_per_dof=Before(explanation.chi2_per_dof.before, found.after.chi2_per_dof),
        rms_mm=Before(explanation.rms_mm.before, 1e3 * found.after.rms),
        parameters=_parameters(found, explanation),
        message=f"{explanation.message} {_says(found)}",
        unknown=found,
    )


def _helps(found: UnknownForce) -> bool:
    """Whether held-out windows are predicted better, and none less that was predicted before."""
    lost = found.after.refused.keys() - found.before.refused.keys()
    return found.after.chi2_per_dof < found.before.chi2_per_dof and not lost


def _parameters(found: UnknownForce, explanation: Explanation) -> dict[str, BodyParameter]:
    return {
        shift.name: BodyParameter(shift.with_it, shift.with_sd, explanation.parameters[shift.name].nominal)
        for shift in found.parameters
    }


def _says(found: UnknownForce) -> str:
    figures = f"held-out χ²/dof {found.before.chi2_per_dof:.3g} → {found.after.chi2_per_dof:.3g}, rms "
    figures += f"{1e3 * found.before.rms:.3g} → {1e3 * found.after.rms:.3g} mm"
    if not found.words:
        return f"An unknown wrench explains less than half of that ({figures}), so it is not described."
    return f"Modelled by an unknown wrench ({figures}): {' '.join(found.words)}"
