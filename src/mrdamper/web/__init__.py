"""The web application: a server for a folder of runs, cards and results, and its pages.

``server`` builds the application, and ``security`` checks every request. Only ``workspace`` converts names of
files to paths. A long computation is a job: ``schemas`` validates the request, ``job_queue`` starts and stops
processes, ``job_worker`` is the process of one job, and ``adapters`` calls the job function. Short queries
run in processes of a pool (``queries``). The server process reads no measured file and computes no physics.
Functions of ``mrdamper.jobs`` read and compute in separate processes. The command line calls the same
functions.
"""
