"""Where simulation and recording differ, and why.

    explain           a campaign in, an Explanation out: the stages in one file
    rounds            its fits and searches, begun again where recordings were not right
    online_monitor    the windows of a session so far in, what to tell its operator out

The packages, each of which imports only those below it:

    next_experiment   what to record next, so that a doubt is settled
    conclusion        where the search ended → verdict → an Explanation
    selection         which effects are left out: a search over fits and held-out windows
    cleaning          what is cut out of recordings, and what is put back    | unknown_force   the unknown wrench
    session           what differs from window to window: errors of lengths and cameras, a body that changes
    scores            what a fit of effects would gain, to first order
    fitting           fits with effects, and predictions of held-out windows
    residuals         whether what a fit leaves is noise, and where it lies
    linearised        hypotheses and their sensitivities

What needs no dynamics (`identification.markers`, `identification.data_checks`) lies below: identification cleans with
it as well.
"""
