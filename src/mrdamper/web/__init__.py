"""The web application: a server for a folder of runs, cards and results, and its pages.

``server`` builds the application, and ``security`` checks every request. Only ``workspace`` turns names into
paths. A long computation is a job: ``schemas`` validates the request, ``job_queue`` starts and stops
processes, ``job_worker`` is the process of one job, and ``adapters`` calls the job function. Short queries
run in processes of a pool (``queries``). The server process reads no measured file and computes no physics.
The functions of ``mrdamper.jobs`` do this in other processes; the command line calls the same functions.
"""
