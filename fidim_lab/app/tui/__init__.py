"""The terminal UI: one more client of the service, which owns the robot; the UI may die without touching the run.

`view` is what is known of the service and how old it is, `screens` turn a view into lines of text (pure functions),
`widgets` put lines on the terminal and change only what has changed, `link` finds and connects to a service,
`orders` what keys ask of the service, `app` puts them together; `web` serves the same UI to a browser.
"""
