"""The process of a worker: ``python -P -m mrdamper.runtime HANDLER LABEL OPTIONS``, started by ``worker``."""

from mrdamper.runtime.worker_process import main

main()
