"""Inside of the service's process: clients' conversations, who may command, what is told, prompts, how it ends.

In: a RunSpec, an opened rig, bytes of clients. Out: messages, the run, an exit code (`service.Service`).
"""
