"""A local program that opens a connection for each request and closes none. An attacker runs it as a process of its own.

Usage: leaking_program.py ENDPOINT REQUEST AT_ONCE COUNT

REQUEST is the hexadecimal form of a ClientMessage. The program opens AT_ONCE connections at once, then COUNT others, each
after the answer to the one before or 20 ms later. Then it prints a line, and keeps them until its standard input ends.
"""
import resource
import sys

import zmq

HARD_FILES = resource.getrlimit(resource.RLIMIT_NOFILE)[1]


def main():
    endpoint, request, at_once, count = sys.argv[1], bytes.fromhex(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    resource.setrlimit(resource.RLIMIT_NOFILE, (HARD_FILES, HARD_FILES))
    context = zmq.Context(io_threads=1)
    context.max_sockets = at_once + count + 10
    dealers = []
    for i in range(at_once + count):
        dealers.append(context.socket(zmq.DEALER))
        dealers[-1].connect(endpoint)
        dealers[-1].send(request)
        if i >= at_once:
            dealers[-1].poll(20)
    print("open", flush=True)
    sys.stdin.read()
    context.destroy(linger=0)


if __name__ == "__main__":
    main()
