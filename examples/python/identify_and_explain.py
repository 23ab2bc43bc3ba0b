"""Simulate a robot with something hidden, identify it, ask what is missing, and validate: python THIS NEW_FOLDER."""

import sys

import fidim_lab as fl


def main(folder: str, equilibria: int = 6, held_out: int = 2) -> tuple[fl.Identified, fl.Explained, fl.Validated]:
    """Everything that is printed; `folder` must not exist yet."""
    hidden = ["anchor-offset:cable=2,dx=0.006"]
    campaign = fl.simulate("irma4", folder, hide=hidden, equilibria=equilibria, validate=held_out, seed=3)
    print(campaign)  # Campaign('…': 6 identify, 2 validate; 100 Hz, 4 cables)

    found = fl.identify(campaign)
    print(found.outcome.value)
    print(found.to_frame())
    print(found.result.warnings)  # among them: the recordings ask for another geometry than the robot file's

    answer = fl.explain(campaign)
    print(answer)  # as `fidim explain` prints it

    judged = fl.validate(campaign, found)
    print(judged.to_frame()[["chi2_per_dof", "predicted"]])
    fl.report(folder)
    return found, answer, judged


if __name__ == "__main__":
    main(sys.argv[1])
