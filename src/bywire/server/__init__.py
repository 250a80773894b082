"""`bywire serve`: a folder's benches, results and studies in a browser of this machine.

A request goes through `handler` (what HTTP asks), `guard` (who asks), `routes` (what for), `pages`
and `place` (what the folder has). What is computed is a task of `tasks`, in a process of its own
(`jobs` here, `job_process` there), and calls the function that the command of that name calls.
"""
