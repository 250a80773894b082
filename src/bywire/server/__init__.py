"""`bywire serve`: a folder's benches, results and studies in a browser on this machine.

A request passes `serving` (HTTP), `guard` (access control), `routes` (which page), `pages` and
`place` (the folder's contents). Computations are tasks of `task`, each in a separate process
(`jobs` in the server, `job_process` in the process). A task calls the same function as the command
with its name.
"""
