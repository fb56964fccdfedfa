"""The decoder's process, forked from one that has its libraries loaded.

A file that crashes a library costs the start of another decoder: half a second, most of it for imports. Here
a process that has imported them, and has done nothing else, forks one for each start: some milliseconds.
``python -m fuzz.forks NUMBER LIBRARY`` is that process; the socket of that number brings the pipes.
"""

from __future__ import annotations

import importlib
import os
import signal
import socket
import subprocess
import sys
from typing import IO

from mrdamper.data.formats import decoder
from mrdamper.data.formats.sandbox import DECODER
from mrdamper.runtime.worker_process import WorkerOptions, run

__all__ = ["Forked"]


class Forked:
    """Stands for ``subprocess.Popen`` where a decoder is started."""

    _source: socket.socket | None = None
    returncode = None  # nobody is told

    def __init__(self, library: str, _options: WorkerOptions) -> None:
        asked, answers = os.pipe(), os.pipe()
        source = self._running(library)
        socket.send_fds(source, [b"+"], [asked[0], answers[1]])
        self.pid = int.from_bytes(source.recv(4), "little")
        os.close(asked[0])
        os.close(answers[1])
        self.stdin: IO[bytes] = os.fdopen(asked[1], "wb")
        self.stdout: IO[bytes] = os.fdopen(answers[0], "rb")

    @classmethod
    def _running(cls, library: str) -> socket.socket:
        if cls._source is None:
            cls._source, other = socket.socketpair()
            command = [sys.executable, "-m", "fuzz.forks", f"{other.fileno()}", library]
            subprocess.Popen(command, pass_fds=[other.fileno()], stderr=subprocess.DEVNULL)
            other.close()
        return cls._source

    def poll(self) -> None:
        """Return what a running process returns: its end is told by its pipe's."""

    def kill(self) -> None:
        """End the process, unless it has ended."""
        try:
            os.kill(self.pid, signal.SIGKILL)
        except ProcessLookupError:
            return

    def wait(self, _timeout: float | None = None) -> None:
        """Return: the process it was forked from takes what it leaves."""


def _serve(orders: socket.socket) -> None:
    """Fork a decoder for each pair of pipe ends that is sent, until no more can come."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while True:
        said, ends, _, _ = socket.recv_fds(orders, 1, 2)
        if not said:
            return
        child = os.fork()
        if child == 0:
            orders.close()
            for place, end in enumerate(ends):
                os.dup2(end, place)
                os.close(end)
            run(DECODER)
        orders.send(child.to_bytes(4, "little"))
        for end in ends:
            os.close(end)


if __name__ == "__main__":
    decoder.leave_no_file()
    importlib.import_module(sys.argv[2])
    if sys.argv[2] == "asammdf":  # names in no known encoding: the guesser takes a tenth of a second to load
        importlib.import_module("chardet").detect(bytes(range(128, 192)))
    _serve(socket.socket(fileno=int(sys.argv[1])))
