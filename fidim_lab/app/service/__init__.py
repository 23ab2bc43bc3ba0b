"""The service: one process that owns bus, guards, engine and recorder, and the clients that watch and command it.

`messages` is what is said on the socket, `codec` and `session` the protocol without I/O, `hub` the asyncio adapter,
`command_handler` what commands do, `status` what is told ten times a second, `service` all of it around one run;
`client` is for whoever writes a user interface or a script.
"""
