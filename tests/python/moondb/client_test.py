#!/usr/bin/env python3
"""Tests the Python client against a fake agent: its limits if the agent misbehaves, and its use after a fork.

Usage: client_test.py PYTHON [TEST...]    PYTHON is the folder of the package moondb.
Exit codes: 0 passed, 1 failed, 77 skipped (a package of Python is missing).
"""
import os
import pathlib
import pickle
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from unittest import mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "apps"))
from python_example_test import MODULES, go_on_with  # noqa: E402
from snippets_test import SKIPPED  # noqa: E402

TEAM_ID = "00112233445566778899aabbccddeeff"
ZMTP_GREETING = b"\xff" + bytes(8) + b"\x7f" + bytes([3, 0]) + b"NULL".ljust(20, b"\0") + bytes([0]) + bytes(31)
READY = b"\x05READY" + b"\x0bSocket-Type" + struct.pack(">I", 6) + b"ROUTER"


class FakeAgent:
    """Listens with a ROUTER and answers each request with `answer(request)`: a ControlReply, or a list of frames."""

    def __init__(self, answer):
        self.answer, self.requests, self.is_over = answer, 0, False
        self.router = zmq.Context.instance().socket(zmq.ROUTER)
        self.router.linger = 0
        self.folder = tempfile.TemporaryDirectory(prefix="moondb-")
        self.endpoint = f"ipc://{self.folder.name}/agent"
        self.router.bind(self.endpoint)
        self.thread = threading.Thread(target=self._run)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.is_over = True
        self.thread.join()
        self.router.close()
        self.folder.cleanup()

    def _run(self):
        while not self.is_over:
            if not self.router.poll(10):
                continue
            client, frame = self.router.recv_multipart()
            self.requests += 1
            request = messages.ClientMessage.FromString(frame)
            answer = self.answer(request.control_request)
            if not isinstance(answer, list):
                answer.team_id = bytes.fromhex(TEAM_ID)
                answer = [messages.ClientMessage(request_id=request.request_id, control_reply=answer).SerializeToString()]
            self.router.send_multipart([client, *answer])


class EndlessAgent:
    """Listens on TCP, speaks ZMTP without keys, and sends a message of many parts that never ends."""

    def __init__(self):
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp://127.0.0.1:{self.listener.getsockname()[1]}"
        self.sent = 0
        self.thread = threading.Thread(target=self._run)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.listener.close()
        self.thread.join()

    def _run(self):
        connection, _ = self.listener.accept()
        part = b"\x01\xff" + bytes(255)
        with connection:
            try:
                connection.sendall(ZMTP_GREETING + bytes([4, len(READY)]) + READY)
                received = b""
                # The greeting has 64 bytes. The client's READY follows: its flags, its size, its body.
                while len(received) < 66 or len(received) < 66 + received[65]:
                    received += connection.recv(4096)
                while self.sent < 512 << 20:
                    self.sent += connection.send(part * 4096)
            except OSError:
                pass  # The client closed the connection.


def zstd(cells):
    return zstandard.ZstdCompressor(write_content_size=True).compress(cells)


def merge_reply(cells, width, height):
    return messages.ControlReply(merge={"width_cells": width, "height_cells": height, "zstd_cells": cells})


def tiles_reply(tiles, is_complete=False, tile_cells=64):
    listed = [{"x": x, "y": y, "zstd_cells": cells} for x, y, cells in tiles]
    return messages.ControlReply(map_tiles={"tile_cells": tile_cells, "tiles": listed, "is_complete": is_complete,
                                            "merger_id": 1, "version": 1})


def read_reply(first_row, count=1, index=7):
    record = messages.Record(pose_graph_node={"node": {"agent_id": 1, "index": index}}).SerializeToString()
    return messages.ControlReply(read={"row_ids": range(first_row, first_row + count),
                                       "records": [{"content": record}] * count})


def peak_mb():
    """Returns the peak memory of this process in MB since "5" was written to its clear_refs."""
    text = pathlib.Path("/proc/self/status").read_text()
    return int(text.split("VmHWM:")[1].split()[0]) / 1024


class ClientLimitsTest(unittest.TestCase):
    def setUp(self):
        pathlib.Path("/proc/self/clear_refs").write_text("5")
        self.before_mb = peak_mb()

    def refuses(self, answer, call, words, error=None, mb_max=100):
        """Checks that `call(client)` raises AnswerError with these words, and takes little memory."""
        with FakeAgent(answer) as agent, client.Client(agent.endpoint, TEAM_ID, timeout_s=20) as asked:
            with self.assertRaisesRegex(error or client.AnswerError, words):
                call(asked)
        self.assertLess(peak_mb() - self.before_mb, mb_max)
        return agent.requests

    def test_a_map_larger_than_its_size_is_not_decompressed(self):
        bomb = zstd(bytes(1 << 30))
        self.assertLess(len(bomb), 200_000)
        pathlib.Path("/proc/self/clear_refs").write_text("5")
        self.before_mb = peak_mb()
        self.refuses(lambda _: merge_reply(bomb, 2, 2), lambda c: c.merged_map(), "do not fit its size")
        self.refuses(lambda _: tiles_reply([(0, 0, bomb)], True), lambda c: c.map_tiles(), "do not fit its size")

    def test_a_frame_without_a_size_is_not_decompressed(self):
        frame = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(4))
        self.refuses(lambda _: merge_reply(frame, 2, 2), lambda c: c.merged_map(), "do not fit its size")

    def test_a_map_beyond_the_limit_is_refused(self):
        self.refuses(lambda _: merge_reply(zstd(bytes(1)), 1 << 31, 1 << 31), lambda c: c.merged_map(), "the most that")

    def test_cells_that_are_no_cells_are_refused(self):
        self.refuses(lambda _: merge_reply(zstd(b"\0\1\2\3"), 2, 2), lambda c: c.merged_map(), "neither unknown")
        self.refuses(lambda _: merge_reply(b"no frame", 2, 2), lambda c: c.merged_map(), "do not decode")
        self.refuses(lambda _: merge_reply(zstd(bytes(400))[:-3], 20, 20), lambda c: c.merged_map(), "do not decode")

    def test_a_map_within_the_limits_is_returned(self):
        with FakeAgent(lambda _: merge_reply(zstd(b"\0\1\2\1"), 2, 2)) as agent, \
                client.Client(agent.endpoint, TEAM_ID) as asked:
            self.assertEqual(asked.merged_map()[1], b"\0\1\2\1")

    def test_a_map_is_asked_of_the_named_agent(self):
        asked_of = []

        def answer(request):
            asked_of.append(request.for_agent)
            return merge_reply(zstd(b"\0\1\2\1"), 2, 2)

        with FakeAgent(answer) as agent, client.Client(agent.endpoint, TEAM_ID) as asked:
            asked.merged_map()
            asked.merged_map(of=7)
        self.assertEqual(asked_of, [0, 7])

    def test_only_cells_are_packed(self):
        self.assertEqual(client.pack_cells([0, 1, 2, 1, 2]), bytes([0b01100100, 0b10]))
        for cells in ([100, 0, 0, 0], [254, 1, 1, 1], [3], [0, -1]):
            with self.assertRaisesRegex(ValueError, r"cells\[\d\] is -?\d+; a cell is"):
                client.pack_cells(cells)

    def test_occupancies_and_costs_become_cells(self):
        self.assertEqual(client.cells_of_occupancy([-1, 0, 64, 65, 100]), [0, 1, 1, 2, 2])
        self.assertEqual(client.cells_of_occupancy([255, 0, 253, 254], unknown=(255,), hazard_from=254), [0, 1, 1, 2])
        for value in (-2, 256):
            with self.assertRaisesRegex(ValueError, r"grid\[1\] is"):
                client.cells_of_occupancy([0, value])

    def test_tiles_without_end_are_refused(self):
        last = [0]

        def answer(_):
            last[0] += 10_000
            return tiles_reply([(x, 0, b"") for x in range(last[0] - 10_000, last[0])])

        requests = self.refuses(answer, lambda c: c.map_tiles(), "more than a map may have")
        self.assertLess(requests, 30)

    def test_the_same_tile_without_end_is_refused(self):
        self.refuses(lambda _: tiles_reply([(1, 1, b"")] * 10_000), lambda c: c.map_tiles(), "more than a map may have")

    def test_large_tiles_are_refused(self):
        self.refuses(lambda _: tiles_reply([(0, 0, b"")], tile_cells=4097), lambda c: c.map_tiles(), "more than a map")
        self.refuses(lambda _: tiles_reply([(x, 0, b"") for x in range(17)], tile_cells=4096), lambda c: c.map_tiles(),
                     "more than a map")

    def test_tiles_within_the_limits_are_returned(self):
        answers = [tiles_reply([(0, 0, zstd(bytes([1]) * 4096))]), tiles_reply([(1, 0, b"")], True)]
        with FakeAgent(lambda _: answers.pop(0)) as agent, client.Client(agent.endpoint, TEAM_ID) as asked:
            self.assertEqual(asked.map_tiles().tiles, {(0, 0): bytes([1]) * 4096, (1, 0): b""})

    def test_rows_that_do_not_ascend_end_the_reading(self):
        def answer(request):
            return messages.ControlReply(status={"agent_id": 1}) if request.HasField("status") else read_reply(1)

        self.assertEqual(self.refuses(answer, lambda c: c.next_node_index(), "rows must ascend"), 3)
        self.refuses(answer, lambda c: list(c.follow([1], 0)), "rows must ascend")

    def test_nodes_without_end_end_at_the_time_limit(self):
        def answer(request):
            if request.HasField("status"):
                return messages.ControlReply(status={"agent_id": 1})
            return read_reply(request.read.after_row_id + 1)

        limit_s, client.NODES_LIMIT_S = client.NODES_LIMIT_S, 0.3
        try:
            self.refuses(answer, lambda c: c.next_node_index(), "did not send all nodes|does not answer", TimeoutError)
        finally:
            client.NODES_LIMIT_S = limit_s

    def test_a_page_needs_one_row_for_each_record(self):
        def answer(_):
            return messages.ControlReply(read={"row_ids": [1, 2], "records": [{}]})

        self.refuses(answer, lambda c: list(c.follow([1], 0)), "1 records with 2 row ids")

    def test_the_next_index_is_one_above_the_highest(self):
        def answer(request):
            if request.HasField("status"):
                return messages.ControlReply(status={"agent_id": 1})
            after = request.read.after_row_id
            return read_reply(after + 1, 2, after) if after < 6 else messages.ControlReply(read={})

        with FakeAgent(answer) as agent, client.Client(agent.endpoint, TEAM_ID) as asked:
            self.assertEqual(asked.next_node_index(), 5)

    def test_an_answer_beyond_the_limit_is_not_received(self):
        answer = messages.ControlReply(merge={"zstd_cells": bytes(client.ANSWER_BYTES_MAX)})
        with FakeAgent(lambda _: answer) as agent, client.Client(agent.endpoint, TEAM_ID, timeout_s=1) as asked:
            with self.assertRaisesRegex(TimeoutError, "more than 33554432 bytes"):
                asked.status()

    def test_a_client_may_be_closed_twice(self):
        with FakeAgent(lambda _: messages.ControlReply(status={})) as agent:
            with client.Client(agent.endpoint, TEAM_ID) as asked:
                asked.status()
                asked.close()

    def test_an_answer_that_does_not_decode_is_an_error(self):
        self.refuses(lambda _: [b"\xff\xff"], lambda c: c.status(), "does not decode")

    def test_a_message_of_several_frames_is_skipped(self):
        with FakeAgent(lambda _: [b"a", b"b"]) as agent, client.Client(agent.endpoint, TEAM_ID, timeout_s=0.3) as asked:
            with self.assertRaisesRegex(TimeoutError, "does not answer"):
                asked.status()

    def test_a_message_that_never_ends_closes_the_connection(self):
        with EndlessAgent() as agent, client.Client(agent.endpoint, TEAM_ID, timeout_s=20) as asked:
            begin = time.monotonic()
            with self.assertRaisesRegex(client.AnswerError, "does not end"):
                asked.status()
            self.assertLess(time.monotonic() - begin, 20)
        self.assertLess(agent.sent, 400 << 20)


# Programs that fork while they have a Client. Arguments: the folder of the package moondb, the endpoint, the team id.
FORK_BEGIN = """
import concurrent.futures, gc, multiprocessing, os, sys
sys.path.insert(0, sys.argv[1])
from moondb import Client, messages
client = Client(sys.argv[2], sys.argv[3], timeout_s=20)
client.status()
parent = os.getpid()

def is_refused(call):
    try:
        call()
    except RuntimeError as error:
        return str(error) == f"this Client belongs to process {parent}: make a Client in each process"
    return False
"""

POOL = FORK_BEGIN + """
def work(number):
    return is_refused(lambda: client.insert([messages.Record(timestamp_ns=number)]))

def work_with_own_client(number):
    with Client(sys.argv[2], sys.argv[3], timeout_s=20) as own:
        return len(own.insert([messages.Record(timestamp_ns=number)])) == 1

pool = concurrent.futures.ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("fork"))
with pool:
    refused = [pool.submit(work, number) for number in range(20)]
    own = [pool.submit(work_with_own_client, number) for number in range(5)]
    for _ in range(20):
        client.status()
    print(all(future.result() for future in refused), all(future.result() for future in own))
for number in range(10):
    client.insert([messages.Record(timestamp_ns=number)])
print("done")
"""

# The child leaves the block of the Client, which closes it, and ends by sys.exit, so finalizers and atexit run.
FORK = FORK_BEGIN + """
with client:
    child = os.fork()
    if child == 0:
        refused = is_refused(client.status)
        client.close()
        sys.exit(0 if refused and is_refused(client.status) else 1)
    for _ in range(20):
        client.status()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    client.insert([messages.Record(timestamp_ns=1)])

client = Client(sys.argv[2], sys.argv[3], timeout_s=20)
client.status()
child = os.fork()
if child == 0:
    client = None  # The finalizers of its sockets run.
    gc.collect()
    with Client(sys.argv[2], sys.argv[3], timeout_s=20) as own:
        own.insert([messages.Record(timestamp_ns=1)])
    sys.exit(0)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
for number in range(9):
    client.insert([messages.Record(timestamp_ns=number)])
print("done")
"""

METHODS = FORK_BEGIN + """
node, covariance = (1, 0), [1.0] * 6
calls = {
    "__enter__": client.__enter__,
    "call": lambda: client.call(messages.ControlRequest(status={})),
    "feed": lambda: next(client.feed()),
    "follow": lambda: next(client.follow([1])),
    "get": lambda: client.get(messages.RecordKey()),
    "insert": lambda: client.insert([]),
    "insert_loop_closure": lambda: client.insert_loop_closure(node, node, (0, 0, 0), covariance, "a"),
    "insert_prior": lambda: client.insert_prior(node, (0, 0, 0), [1.0] * 3, "a"),
    "map_tiles": client.map_tiles,
    "merged_map": client.merged_map,
    "next_node_index": client.next_node_index,
    "replicate": client.replicate,
    "roles": client.roles,
    "set_lease": lambda: client.set_lease(0, 0),
    "set_roles": client.set_roles,
    "status": client.status,
    "swap_roles": client.swap_roles,
    "sync": client.sync,
}
missing = {name for name in vars(Client) if not name.startswith("_")} - calls.keys() - {"close"}
child = os.fork()
if child == 0:
    print("missing", *missing, "accepted", *(name for name, call in calls.items() if not is_refused(call)))
    sys.exit(0)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
client.status()
"""


class ClientProcessTest(unittest.TestCase):
    def run_program(self, program):
        """Runs the program with an agent that stores everything. Returns its output, and the number of inserts."""
        inserts = []

        def answer(request):
            if request.HasField("insert"):
                inserts.append(request)
                return messages.ControlReply(insert={"keys": [{}] * len(request.insert.records)})
            return messages.ControlReply(status={"agent_id": 1})

        with FakeAgent(answer) as agent:
            python = pathlib.Path(client.__file__).parents[1]
            done = subprocess.run([sys.executable, "-W", "ignore", "-c", program, python, agent.endpoint, TEAM_ID],
                                  capture_output=True, text=True, timeout=50)
        self.assertEqual((done.returncode, done.stderr), (0, ""), done.stdout)
        return done.stdout, len(inserts)

    def test_a_process_pool_cannot_use_the_client_of_its_parent(self):
        self.assertEqual(self.run_program(POOL), ("True True\ndone\n", 15))

    def test_a_forked_child_ends_without_disturbing_its_parent(self):
        self.assertEqual(self.run_program(FORK), ("0\n0\ndone\n", 11))

    def test_each_method_is_refused_in_a_forked_child(self):
        self.assertEqual(self.run_program(METHODS), ("missing accepted\n0\n", 0))

    def test_a_client_is_not_sent_to_another_process(self):
        with client.Client("ipc:///tmp/moondb-none", TEAM_ID) as asked:
            with self.assertRaisesRegex(TypeError, "make a Client in each process"):
                pickle.dumps(asked)


class UserNameTest(unittest.TestCase):
    def test_a_user_without_a_name_is_named_by_its_number(self):
        unnamed = {name: "" for name in ("LOGNAME", "USER", "LNAME", "USERNAME")}
        requests = []

        def answer(request):
            requests.append(request)
            return messages.ControlReply(status={})

        with FakeAgent(answer) as agent, mock.patch.dict(os.environ, unnamed), \
                mock.patch("pwd.getpwuid", side_effect=KeyError("uid not found")), \
                mock.patch("os.geteuid", return_value=54321), client.Client(agent.endpoint, TEAM_ID) as asked:
            asked.status()
        self.assertEqual([request.by for request in requests], [f"54321@{socket.gethostname()}"])


def main():
    global client, messages, zmq, zstandard  # Only importable with PYTHON in the path.
    if not go_on_with(MODULES):
        return SKIPPED
    sys.path.insert(0, sys.argv.pop(1))
    import zmq
    import zstandard
    from moondb import client, messages
    unittest.main()
    return 0


if __name__ == "__main__":
    sys.exit(main())
