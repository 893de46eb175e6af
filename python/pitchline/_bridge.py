"""Carries the lines between a worker and a waiting Python process: ``python _bridge.py SOCKET``."""

import socket
import sys

with socket.socket(socket.AF_UNIX) as end:
    end.connect(sys.argv[1])
    with end.makefile("rw", encoding="utf-8") as other:
        for request in sys.stdin:
            other.write(request)
            other.flush()
            answer = other.readline()
            if not answer:
                break
            sys.stdout.write(answer)
            sys.stdout.flush()
