"""What a screen shows of a run whose procedure adds windows to the plan's."""

from fidim_lab.app.service.process.status import Watcher
from fidim_lab.data.records import Role
from procedures.events import RunFinished, WindowFinished
from procedures.outcomes import Outcome
from procedures.report import RunReport, WindowRow


def test_a_window_that_the_procedure_adds_is_shown_and_the_end_is_kept(tmp_path):
    watcher = Watcher([WindowRow("i01", Role.IDENTIFY)], (20.0, 200.0))
    watcher(WindowFinished(10.0, "more1", Outcome.MARGINAL, "a tension was low", 2, 2, Role.IDENTIFY, attempts=2))
    report = RunReport("compare", tmp_path, Outcome.FAIL, "The verdict is not clear.", (), True, "held", 20.0, False)
    watcher(RunFinished(20.0, report))
    assert watcher.report is report
    first, added = watcher.equilibria()
    assert (first.window, added.window, added.verdict, added.attempts) == ("i01", "more1", "marginal", 2)
