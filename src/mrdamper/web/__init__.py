"""The web app: a server over a folder of runs, cards and results, and the pages that it sends.

``server`` joins the parts. Requests come through ``security``; names become paths in ``folder`` alone; what
takes long is a job (``orders`` say what may be asked, ``queue`` starts and stops the processes, ``worker`` is
such a process, ``work`` calls the job); what should take no time is asked of a process that stands by
(``desk``, ``clerk``). The server itself reads no measured file and holds no physics: all of that is in the
jobs of ``mrdamper.jobs``, which the command line calls, too.
"""
