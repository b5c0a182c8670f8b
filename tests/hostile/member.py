"""A member of the team that was taken over: it has an agent's true keys, and says whatever an attacker wants.

    with Member(team, "rover3") as member:             # The real rover3 must not run.
        member.send("rover1", "lease", lease_announce={"number": 1, "driving_s": 60})
        reply = member.ask("rover1", status={})
        session = member.session("rover1")
        have = session.bring([messages.stored(...)])

It listens at its agent's address, as the others expect, and reports what it got, so that their links to it stay up. It
sends without waiting: the sender itself keeps to its credit (runtime/transport/link_credit.h).
"""
import collections
import contextlib
import random
import struct
import threading
import time

import zmq

import messages
from messages import control, message, record, types
from team import NAMES, Failure

ANSWER_TIMEOUT_S = 10
LINK_TIMEOUT_S = 20
KEPT_MESSAGES = 20000  # Maximum number of received messages that are kept until a call consumes them.
REPORT_AFTER_BYTES = 8192
LINK_NUMBER_TAG = 2 << 3 | 5  # Tag of the field PeerFrame.link_number, a fixed32.
LINK_NUMBER_BYTES = 5
SYNC, REPLICATION = 1, 2
ACTOR_OF_KIND = {SYNC: "sync", REPLICATION: "replica"}
CODEC_PLAIN, CODEC_ZSTD, CODEC_COMPACT, CODEC_PAPER_SQL = 1, 2, 3, 4


class Link:
    """Link to one agent: the connection on which this member sends, and the counts received from that agent."""

    def __init__(self, socket):
        self.socket, self.lock = socket, threading.Lock()
        self.number = random.randrange(1, 1 << 32)
        self.reported_link, self.received_bytes, self.unreported_bytes = 0, 0, 0
        self.is_up = threading.Event()


class Member:
    def __init__(self, team, name):
        self.team, self.name, self.number = team, name, NAMES.index(name) + 1
        self.context = zmq.Context()
        self.links = {}
        self.messages = collections.deque(maxlen=KEPT_MESSAGES)
        self.received = threading.Condition()
        # Maps the name of a message body to a function. The receiving thread calls the function with each message of
        # that body.
        self.answers = {}
        self.last_request_id = random.getrandbits(40)
        self.is_over = threading.Event()
        self.receiver = threading.Thread(target=self._receive, daemon=True)

    def __enter__(self):
        self._listen()
        for agent in NAMES:
            if agent != self.name:
                self.links[agent] = Link(self._connect(agent))
        self.receiver.start()
        for agent in self.links:
            self._report(agent)
        for agent, link in self.links.items():
            if not link.is_up.wait(LINK_TIMEOUT_S):
                raise Failure(f"{agent} did not connect to {self.name} within {LINK_TIMEOUT_S} s")
        return self

    def __exit__(self, *_):
        self.is_over.set()
        self.receiver.join()
        self.router.close(linger=0)
        for link in self.links.values():
            link.socket.close(linger=0)
        self.context.term()

    # --- Sending ---

    def message(self, agent, actor, source=None, **fields):
        """Returns a Message as this agent would send it; `fields` override its fields."""
        envelope = {"destination_id": NAMES.index(agent) + 1, "hop_sender": self.number, "ms_type": message.CONTROL,
                    "agent_id": self.number, "destination_actor": actor.encode(),
                    "source_actor": (actor if source is None else source).encode()}
        return message.Message(**{**envelope, **fields})

    def send(self, agent, actor, source=None, **fields):
        self.send_frame(agent, frame_of(self.message(agent, actor, source, **fields)))

    def send_frame(self, agent, frame):
        """Sends `frame`, which may be any bytes, after the link number."""
        link = self.links[agent]
        with link.lock:
            link.socket.send(struct.pack("<BI", LINK_NUMBER_TAG, link.number) + frame)

    def ask(self, agent, timeout_s=ANSWER_TIMEOUT_S, source="gateway", **request):
        """Sends a request as if this agent relayed it for a client. Returns the ControlReply."""
        asked = control.ControlRequest(for_agent=NAMES.index(agent) + 1, team_id=self.team.team_id,
                                       **{"by": "anna@hill", **request})
        self.last_request_id += 1
        request_id = self.last_request_id
        self.send(agent, "gateway", source, request_id=request_id, control_request=asked.SerializeToString())
        answer = self.wait_for(agent, "control_reply", timeout_s, lambda heard: heard.request_id == request_id)
        return control.ControlReply.FromString(answer.control_reply)

    def ask_until_answered(self, agent, timeout_s, **request):
        """Repeats the request every 5 s, since a link under attack may lose a message. Fails if no reply arrives
        within timeout_s."""
        end = time.monotonic() + timeout_s
        while True:
            try:
                return self.ask(agent, **request, timeout_s=5)
            except Failure:
                if time.monotonic() > end:
                    raise

    def session(self, agent, kind=SYNC, **hello):
        return Session(self, agent, kind, **hello)

    # --- Receiving ---

    def wait_for(self, agent, body, timeout_s=ANSWER_TIMEOUT_S, is_meant=lambda heard: True):
        """Returns the next message of that kind from the agent, and discards earlier messages."""
        number, end = NAMES.index(agent) + 1, time.monotonic() + timeout_s
        with self.received:
            while True:
                while self.messages:
                    heard = self.messages.popleft()
                    if heard.hop_sender == number and heard.WhichOneof("body") == body and is_meant(heard):
                        return heard
                if not self.received.wait(end - time.monotonic()):
                    raise Failure(f"{agent} sent no {body} within {timeout_s} s")

    def forget(self):
        with self.received:
            self.messages.clear()

    def agent_of(self, heard):
        """Returns the name of the sending agent."""
        return NAMES[heard.hop_sender - 1]

    def vouch_for_everything(self):
        """Makes this member answer have-set requests, which precede a prune, with all possible seqs of the
        requester's streams."""
        def answer(asked):
            request = control.ControlRequest.FromString(asked.control_request)
            if request.WhichOneof("request") != "have":
                return
            agent = self.agent_of(asked)
            had = [messages.have_stream(origin, epoch, types.DataType.Value(table.upper()), messages.SEQ_MAX)
                   for table, origin, epoch in {key[:3] for key in self.team.records(agent)}]
            reply = control.ControlReply(have={"have": {"streams": had}})
            self.send(agent, "retention", request_id=asked.request_id, control_reply=reply.SerializeToString())
        self.answers["control_request"] = answer

    # --- The transport ---

    def _listen(self):
        _, secret = self.team.z85_keys(self.name)
        self.router = self.context.socket(zmq.ROUTER)
        self.router.curve_server, self.router.curve_secretkey = True, secret
        self.router.router_handover = True
        host, port = self.team.address(self.name)
        for _ in range(50):  # The real agent may not have closed the port yet.
            with contextlib.suppress(zmq.ZMQError):
                return self.router.bind(f"tcp://{host}:{port}")
            time.sleep(0.1)
        raise Failure(f"port {port} of {self.name} is taken: does the real one run?")

    def _connect(self, agent):
        socket = self.context.socket(zmq.DEALER)
        socket.curve_publickey, socket.curve_secretkey = self.team.z85_keys(self.name)
        socket.curve_serverkey, _ = self.team.z85_keys(agent)
        socket.routing_id = str(self.number).encode()
        socket.sndtimeo = int(1000 * ANSWER_TIMEOUT_S)
        host, port = self.team.address(agent)
        socket.connect(f"tcp://{host}:{port}")
        return socket

    def _report(self, agent):
        link = self.links[agent]
        link.unreported_bytes = 0
        report = {"reported_link": link.reported_link, "received_bytes": link.received_bytes,
                  "report_after_bytes": REPORT_AFTER_BYTES}
        with contextlib.suppress(zmq.ZMQError):  # If the send fails, the agent will ask again.
            self.send(agent, "", link_report=report)

    def _receive(self):
        while not self.is_over.is_set():
            if self.router.poll(50):
                _, *parts = self.router.recv_multipart()
                self._take(parts[-1])

    def _take(self, frame):
        peer_frame = message.PeerFrame.FromString(frame)
        heard = peer_frame.messages
        agent = self.agent_of(heard[0])
        link = self.links[agent]
        if heard[0].HasField("link_report"):
            report = heard[0].link_report
            if peer_frame.link_number != link.reported_link:
                link.reported_link, link.received_bytes = peer_frame.link_number, 0
            link.is_up.set()
            if report.is_asking or report.coming_bytes:
                self._report(agent)
            return
        link.received_bytes += len(frame) - LINK_NUMBER_BYTES
        link.unreported_bytes += len(frame) - LINK_NUMBER_BYTES
        if link.unreported_bytes >= REPORT_AFTER_BYTES:
            self._report(agent)
        for one in heard:
            answer = self.answers.get(one.WhichOneof("body"))
            if answer:
                answer(one)
        with self.received:
            self.messages.extend(heard)
            self.received.notify_all()


class Session:
    """The sending side of a session: sends a Hello, receives the agent's whole have-set `have`, and then sends
    batches."""
    last_id = random.getrandbits(48)

    def __init__(self, member, agent, kind=SYNC, **hello):
        self.member, self.agent, self.kind = member, agent, kind
        Session.last_id += 1
        self.id, self.batch_number = Session.last_id, 0
        member.send(agent, ACTOR_OF_KIND[kind], hello=self.hello(**hello))
        answer = self._answer(lambda have: have.is_whole)
        self.have = answer.have.have

    def hello(self, **fields):
        own = {"wire_version": messages.WIRE_VERSION, "team_id": self.member.team.team_id, "session_id": self.id,
               "kind": self.kind}
        return {**own, **fields}

    def batch(self, records=(), dropped=(), remaining=1, **fields):
        """Returns a batch message with the next batch number."""
        self.batch_number += 1
        coded = record.RecordBatch(records=records).SerializeToString()
        batch = {"session_id": self.id, "batch_number": self.batch_number, "codec": CODEC_PLAIN, "coded": coded,
                 "record_count": len(records), "dropped": dropped}
        return self.member.message(self.agent, ACTOR_OF_KIND[self.kind], ms_type=message.DATA, remaining=remaining,
                                   batch={**batch, **fields})

    def bring(self, records=(), dropped=(), **fields):
        """Sends a batch and waits for its acknowledgment, a have-set of the touched streams."""
        self.member.send_frame(self.agent, frame_of(self.batch(records, dropped, **fields)))
        return self.wait_for(self.batch_number)

    def wait_for(self, number):
        """Returns the have-set with which the agent acknowledges the batch of that number."""
        return self._answer(lambda have: have.batch_number == number).have.have

    def last_of(self, origin, name):
        """Returns (epoch, last seq) of the newest stream of this origin and type in the agent's have-set; None if
        there is none."""
        number = types.DataType.Value(name)
        known = [(stream.epoch, max(interval.last for interval in [*stream.held, *stream.dropped]))
                 for stream in self.have.streams if stream.origin_agent == origin and stream.data_type == number]
        return max(known, default=None)

    def _answer(self, is_meant):
        return self.member.wait_for(self.agent, "have", ANSWER_TIMEOUT_S,
                                    lambda heard: heard.have.session_id == self.id and is_meant(heard.have))


def frame_of(*many):
    """Returns a PeerFrame with these messages in wire format, without the link number."""
    return message.PeerFrame(messages=many).SerializeToString()
