"""A client of a moondb agent: the control protocol (proto/control.proto) over ZeroMQ.

Needs pyzmq and protobuf, zstandard for merged maps, and PyYAML for team files (Debian: python3-zmq python3-protobuf
python3-zstandard python3-yaml). Use one Client per thread. A forked process, such as a worker of multiprocessing, needs a
Client of its own: that of its parent raises RuntimeError there.

An error of the agent raises AgentError, an agent that does not answer TimeoutError, and an answer that is invalid or exceeds
a limit AnswerError. The limits are those of the client in C++: an agent that somebody took over can neither fill this
process's memory nor keep a call from ending.
"""
import dataclasses
import getpass
import math
import os
import socket
import struct
import time
from typing import Any, Callable, Dict, Iterable, Iterator, List, Optional, Sequence, Tuple

import zmq
from google.protobuf.message import DecodeError
from zmq.utils.monitor import recv_monitor_message

from moondb import messages

Node = Tuple[int, int]  # Agent id, index.

REQUEST_BYTES_MAX = 32 * 1024 * 1024
ANSWER_BYTES_MAX = 32 * 1024 * 1024
RECEIVED_BYTES_MAX = 2 * ANSWER_BYTES_MAX  # Bytes of one call over TCP: an answer, and a late one to an earlier call.
MERGED_CELLS_MAX = 256 * 1024 * 1024  # Cells of a merged map, and of the tiles in one answer.
TILE_SIDE_CELLS_MAX = 4096
ALL_TILES_CELLS_MAX = 1 << 30  # Cells of all tiles of one call: 16,384 pages of 256 x 256, the most that an agent merges.
SMALL_TILE_CELLS = 64 * 64  # A smaller tile counts as this many cells.
NODES_LIMIT_S = 600.0  # Time limit of next_node_index.
TCP_INFO_BYTES, TCP_INFO_RECEIVED = 256, 128  # Size of Linux's tcp_info, and the place of tcpi_bytes_received.
LOOK_S = 0.1  # How often a waiting call checks what it has received.
BEYOND_WAIT_S = 30.0  # Time that a call waits for its answer, in addition to wait_s.
FEED_PAUSE_S = 2.0  # Pause before a feed asks an agent again that did not answer.
PAUSES_S = (0.1, 0.3, 1.0, 2.0, 3.0)  # Pauses before a sync or replication request is repeated.


class AgentError(Exception):
    """Error reported by the agent: `code` is an ErrorCode of error.proto, `field` names the part of the request."""

    def __init__(self, error: Any) -> None:
        text = error.text.decode("utf-8", "replace") if isinstance(error.text, bytes) else error.text
        super().__init__(f"{error.field}: {text}" if error.field else text)
        self.code, self.field = error.code, error.field


class AnswerError(ValueError):
    """An answer of the agent is invalid, or exceeds a limit of this client."""


class TeamError(Exception):
    """The agent belongs to another team, or the leader changed during the call."""


@dataclasses.dataclass
class MergedTiles:
    """Changed tiles of the merged map. The lower left corner of tile (x, y) lies at (x, y) * tile_cells * resolution."""
    is_everything: bool  # True: discard all tiles received earlier.
    tile_cells: int
    resolution_m: float
    tiles: Dict[Tuple[int, int], bytes]  # One byte a cell, row by row: 0 unknown, 1 free, 2 hazard. Empty: all unknown.


class Client:
    def __init__(self, endpoint: str, team_id: str, timeout_s: float = 3.0, server_key: str = "",
                 secret_key: str = "") -> None:
        """`team_id` is that of the team file. An agent of another team refuses requests. `server_key` (the agent's public
        key) and `secret_key` (this client's), in Z85, are for an agent's client_address; clients.yaml must list the
        public key of this client."""
        self._endpoint, self._timeout_s, self._request_id = endpoint, timeout_s, 0
        self._keys = (server_key.encode(), secret_key.encode())
        self._team_id = bytes.fromhex(team_id)
        self._by = f"{_user_name()}@{socket.gethostname()}"
        self._process = os.getpid()
        self._tiles: Dict[str, Any] = {}
        self._connect()

    def _connect(self) -> None:
        self._dealer = zmq.Context.instance().socket(zmq.DEALER)
        self._dealer.linger = 0
        self._dealer.maxmsgsize = ANSWER_BYTES_MAX
        self._events = self._dealer.get_monitor_socket(zmq.EVENT_CONNECTED | zmq.EVENT_DISCONNECTED)
        self._is_broken = False  # True: the connection broke during the present call.
        self._file = -1  # Descriptor of the connection, which libzmq owns. -1: not connected.
        server_key, secret_key = self._keys
        if server_key:
            self._dealer.curve_serverkey, self._dealer.curve_secretkey = server_key, secret_key
            self._dealer.curve_publickey = zmq.curve_public(secret_key)
        self._dealer.connect(self._endpoint)

    def _check_process(self) -> None:
        """Raises RuntimeError in a forked process. libzmq's threads are not there: a call would wait forever."""
        if self._process != os.getpid():
            raise RuntimeError(f"this Client belongs to process {self._process}: make a Client in each process")

    def close(self) -> None:
        """Closes the connection. A second call has no effect, and a call in a forked process has none."""
        if self._process != os.getpid() or self._dealer.closed:
            return
        self._dealer.disable_monitor()
        self._events.close()
        self._dealer.close()

    def _has_disconnected(self) -> bool:
        """Reads the events of the connection. Returns True if it broke since the last call of this function."""
        is_broken = False
        while self._events.poll(0):
            event = recv_monitor_message(self._events)
            self._file = event["value"] if event["event"] == zmq.EVENT_CONNECTED else -1
            is_broken = is_broken or event["event"] == zmq.EVENT_DISCONNECTED
        return is_broken

    def _received_bytes(self) -> int:
        """Returns the bytes received over this TCP connection; 0 for other transports. libzmq keeps the parts of a message
        that never ends, and reports none of them."""
        if self._file < 0 or not self._endpoint.startswith("tcp:"):
            return 0
        try:
            with socket.socket(fileno=os.dup(self._file)) as connection:
                info = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, TCP_INFO_BYTES)
            return struct.unpack_from("Q", info, TCP_INFO_RECEIVED)[0]
        except (OSError, struct.error):  # The connection is gone, or the system does not count.
            return 0

    def __enter__(self) -> "Client":
        self._check_process()
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __reduce__(self) -> Any:
        raise TypeError("a Client cannot be sent to another process: make a Client in each process")

    def call(self, request: Any, timeout_s: Optional[float] = None) -> Any:
        """Sends a ControlRequest and returns the ControlReply. After a TimeoutError, the next call connects again."""
        self._check_process()
        self._request_id += 1
        request.by, request.team_id = self._by, self._team_id
        frame = messages.ClientMessage(request_id=self._request_id, control_request=request).SerializeToString()
        if len(frame) > REQUEST_BYTES_MAX:
            raise ValueError(f"the request has {len(frame)} bytes, and {REQUEST_BYTES_MAX} are the most that an agent takes")
        limit_s = self._timeout_s if timeout_s is None else timeout_s
        end = time.monotonic() + limit_s
        self._has_disconnected()
        self._is_broken = False
        self._dealer.send(frame)
        while True:
            answer = self._receive(end)
            if answer is None:
                break
            if answer.request_id != self._request_id:
                continue  # A late reply to an earlier call.
            if answer.control_reply.team_id != self._team_id:
                raise TeamError(f"{self._endpoint} is of another team")
            if answer.control_reply.error.code:
                raise AgentError(answer.control_reply.error)
            return answer.control_reply
        is_broken = self._is_broken
        self._reconnect()
        if is_broken:
            raise TimeoutError(f"{self._endpoint} closed the connection during the call: the agent stopped, or its answer "
                               f"has more than {ANSWER_BYTES_MAX} bytes")
        raise TimeoutError(f"{self._endpoint} does not answer within {limit_s:g} s: the agent is not running, or it does "
                           "not know this client's key")

    def _reconnect(self) -> None:
        # Requests that are still queued in the socket must not reach an agent that starts later.
        self.close()
        self._connect()

    def _receive(self, end: float) -> Any:
        """Returns the next ClientMessage of the agent. None: there is none before `end`."""
        before = None
        while True:
            left_s = max(0.0, end - time.monotonic())
            if self._dealer.poll(1000 * min(left_s, LOOK_S)):
                frames = self._dealer.recv_multipart()
                if len(frames) != 1:
                    continue  # An answer is a single frame.
                try:
                    return messages.ClientMessage.FromString(frames[0])
                except DecodeError:
                    raise AnswerError(f"{self._endpoint} sent an answer that does not decode") from None
            if left_s == 0:
                return None
            if self._has_disconnected():
                before, self._is_broken = None, True
            before = self._received_bytes() if before is None else before
            if self._received_bytes() > before + RECEIVED_BYTES_MAX:
                self._reconnect()
                raise AnswerError(f"{self._endpoint} sends a message of more than {RECEIVED_BYTES_MAX} bytes that does not "
                                  "end")

    def status(self) -> Any:
        """Returns the AgentStatus (proto/status.proto)."""
        return self.call(messages.ControlRequest(status={})).status

    def insert(self, records: Sequence[Any]) -> List[Any]:
        """Stores records as records of this agent, all or none. They are durable on return. Returns their keys."""
        return list(self.call(messages.ControlRequest(insert={"records": records})).insert.keys)

    def insert_loop_closure(self, from_node: Node, to_node: Node, position_m: Sequence[float],
                            covariance: Sequence[float], source: str, orientation: Sequence[float] = (0, 0, 0, 1),
                            timestamp_ns: Optional[int] = None) -> Any:
        """Stores a relative pose of `to_node` in the frame of `from_node` that is not odometry. A node is a pair
        (agent id, index); one of the two belongs to this agent's robot. `orientation` is x y z w. `covariance` holds the
        standard deviations x y z (m), roll pitch yaw (rad), or the 21 numbers of RelativePose. `source` names the producer,
        such as "apriltag". Returns the record's key."""
        record = messages.Record(timestamp_ns=timestamp_ns or time.time_ns())
        edge = record.pose_graph_edge
        edge.source = source
        for key, (agent_id, index) in ((getattr(edge, "from"), from_node), (edge.to, to_node)):
            key.agent_id, key.index = agent_id, index
        pose = edge.relative_pose.from_from_to
        pose.position_m.x, pose.position_m.y, pose.position_m.z = position_m
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation
        edge.relative_pose.covariance.extend(triangle_of(covariance, 6))
        return self.insert([record])[0]

    def insert_prior(self, node: Node, position_m: Sequence[float], covariance: Sequence[float], source: str,
                     yaw_rad: Optional[float] = None, orientation: Optional[Sequence[float]] = None,
                     point_m: Optional[Sequence[float]] = None, timestamp_ns: Optional[int] = None) -> Any:
        """Stores an absolute measurement of a node in the frame `map`: a position, with yaw_rad a position and a yaw, with
        orientation (x y z w) a pose. `covariance` holds standard deviations (3, 4 or 6: m, then rad), or the upper triangle
        of the covariance. `point_m` is the measured point in the body's frame, such as a GNSS antenna. Returns the
        record's key."""
        record = messages.Record(timestamp_ns=timestamp_ns or time.time_ns())
        prior = record.pose_prior
        prior.node.agent_id, prior.node.index = node
        prior.source = source
        if orientation is not None:
            position, size, turn = prior.pose.position_m, 6, prior.pose.orientation
            turn.x, turn.y, turn.z, turn.w = orientation
        elif yaw_rad is not None:
            position, size = prior.position_yaw.position_m, 4
            prior.position_yaw.yaw_rad = yaw_rad
        else:
            position, size = prior.position_m, 3
        position.x, position.y, position.z = position_m
        position.SetInParent()
        if point_m is not None:
            prior.point_m.x, prior.point_m.y, prior.point_m.z = point_m
        prior.covariance.extend(triangle_of(covariance, size))
        return self.insert([record])[0]

    def follow(self, data_types: Iterable[int], wait_s: float = 10.0) -> Iterator[Tuple[Any, bytes]]:
        """Yields (key, bytes) of each stored record and then of each new record. Ends after wait_s without a new
        record."""
        for _, key, content in self._records(list(data_types), 0, wait_s):
            yield key, content

    def get(self, key: Any) -> Any:
        """Returns the Record with this key (RecordKey, proto/ids.proto), or None if the agent does not hold it."""
        page = self.call(messages.ControlRequest(read={"keys": [key]})).read
        found = [stored for stored in page.records if stored.key == key]
        return messages.Record.FromString(found[0].content) if found else None

    def feed(self, data_types: Iterable[int] = (), after_row_id: int = 0,
             on_error: Optional[Callable[[Exception], None]] = None) -> Iterator[Tuple[int, Any, Any]]:
        """Yields (row id, key, Record) of each record after `after_row_id`, and then of each new record, without end. While
        the agent is away, calls `on_error` and asks again every few seconds. To go on later, keep the last row id. Row
        ids start at 1 again after a restart of the agent with an empty disk."""
        types = list(data_types)
        while True:
            try:
                for after_row_id, key, content in self._records(types, after_row_id, wait_s=20.0):
                    yield after_row_id, key, messages.Record.FromString(content)
            except (TimeoutError, AgentError) as error:
                may_pass = (messages.ERROR_CODE_UNAVAILABLE, messages.ERROR_CODE_TIMED_OUT, messages.ERROR_CODE_FULL)
                if isinstance(error, AgentError) and error.code not in may_pass:
                    raise
                if on_error is not None:
                    on_error(error)
                time.sleep(FEED_PAUSE_S)

    def _records(self, data_types: List[int], after_row_id: int, wait_s: float) -> Iterator[Tuple[int, Any, bytes]]:
        while True:
            read = {"data_types": data_types, "wait_s": wait_s, "records_max": 100, "after_row_id": after_row_id}
            page = self.call(messages.ControlRequest(read=read), timeout_s=wait_s + self._timeout_s).read
            self._check_page(page, after_row_id)
            for row_id, stored in zip(page.row_ids, page.records):
                yield row_id, stored.key, stored.content
            if not page.row_ids:
                return
            after_row_id = page.row_ids[-1]

    def _check_page(self, page: Any, after_row_id: int) -> None:
        """Raises AnswerError unless each record has a row id, all lie above `after_row_id`, and the last one is the highest:
        then each page is a step to the end."""
        if len(page.row_ids) != len(page.records):
            raise AnswerError(f"{self._endpoint} sent a page of {len(page.records)} records with {len(page.row_ids)} row ids")
        for row_id in page.row_ids:
            if not after_row_id < row_id <= page.row_ids[-1]:
                raise AnswerError(f"{self._endpoint} sent row {row_id} in the page after row {after_row_id}: rows must ascend")

    def sync(self, limit_s: float = 600.0, on_progress: Optional[Callable[[Any], None]] = None, **order: Any) -> Any:
        """Shares with each agent if this is the leader, else sends this agent's own records to the leader.
        Returns a ShareProgress (proto/sharing.proto) when all records are acknowledged (is_complete), when no more progress
        is possible (is_over), or after limit_s. `on_progress` is called with each ShareProgress until then. `order` has
        fields of ShareRequest. If the agent's process ends, this is noticed after 90 s, and the order is sent again."""
        return self._share(messages.SHARING_KIND_SYNC, limit_s, on_progress, order)

    def replicate(self, limit_s: float = 600.0, on_progress: Optional[Callable[[Any], None]] = None, **order: Any) -> Any:
        """Replicates all records of the leader to the designated survivor. Requires: the leader."""
        return self._share(messages.SHARING_KIND_REPLICATION, limit_s, on_progress, order)

    def set_lease(self, kind: int, seconds: float) -> List[Any]:
        """Announces that for `seconds` from now this robot drives (messages.LEASE_KIND_DRIVING), sleeps or is paused: its
        agent shares no bulk data meanwhile. At most 86,400; 0 ends the lease. Returns the leases of all agents."""
        return list(self.call(messages.ControlRequest(lease={"kind": kind, "seconds": seconds})).lease.leases)

    def roles(self) -> Any:
        """Returns the RoleAssignment that this agent knows: leader, survivor, term."""
        return self.call(messages.ControlRequest(role_show={})).roles.roles

    def swap_roles(self, limit_s: float = 10.0) -> Any:
        """Swaps leader and survivor. Returns a RoleShowReply; not_confirmed_by names agents that do not act on it yet.
        After a TimeoutError ask for the roles: they may have changed."""
        return self.set_roles(limit_s, is_swap=True)

    def set_roles(self, limit_s: float = 10.0, **change: Any) -> Any:
        """Changes the current roles. `change` has fields of RoleSetRequest."""
        standing = self.roles()
        expected = {"term": standing.term, "leader": standing.leader, "survivor": standing.survivor}
        request = {"expected": expected, "wait_s": limit_s, **change}
        return self.call(messages.ControlRequest(role_set=request), limit_s + BEYOND_WAIT_S).roles

    def _share(self, kind: int, limit_s: float, on_progress: Optional[Callable[[Any], None]], order: Dict[str, Any]) -> Any:
        end, was_leading = time.monotonic() + limit_s, False
        for pause_s in (*PAUSES_S, None):
            try:
                status = self.status()
                is_leading = status.roles.leader == status.agent_id
                if was_leading and not is_leading:
                    raise TeamError(f"{self._endpoint} is no longer the leader: send the command to the current leader")
                was_leading = is_leading
                request = {"kind": kind, **order}
                if not order.get("destination"):
                    request["expected_term"] = status.roles.term
                return self._share_once(request, end, on_progress)
            except (AgentError, TimeoutError) as error:
                is_worth_another = (isinstance(error, TimeoutError) or error.field == "expected_term" or
                                    error.code in (messages.ERROR_CODE_UNAVAILABLE, messages.ERROR_CODE_NOT_FOUND))
                if not is_worth_another or pause_s is None or time.monotonic() >= end:
                    raise
                time.sleep(pause_s)

    def _share_once(self, request: Dict[str, Any], end: float, on_progress: Optional[Callable[[Any], None]]) -> Any:
        order = self.call(messages.ControlRequest(share=request)).share.order
        news = {"kind": request["kind"], "order": order}
        while True:
            news["wait_s"] = min(max(end - time.monotonic(), 0.0), 60.0)
            reply = self.call(messages.ControlRequest(share_progress=news), news["wait_s"] + BEYOND_WAIT_S)
            if on_progress is not None:
                on_progress(reply.share_progress)
            if reply.share_progress.is_over or time.monotonic() >= end:
                return reply.share_progress
            news["after_version"] = reply.share_progress.version

    def next_node_index(self) -> int:
        """One above the highest index of a node of the agent's robot in its store; 0 if there is none. After a lost disk its
        nodes come back with the next sync: ask after it. Raises TimeoutError if reading them takes more than 600 s."""
        read = {"data_types": [messages.POSE_GRAPH_NODE], "origin_agents": [self.status().agent_id]}
        index, end = 0, time.monotonic() + NODES_LIMIT_S
        while True:
            left_s = end - time.monotonic()
            if left_s <= 0:
                raise TimeoutError(f"{self._endpoint} did not send all nodes within {NODES_LIMIT_S:g} s")
            page = self.call(messages.ControlRequest(read=read), timeout_s=left_s).read
            self._check_page(page, read.get("after_row_id", 0))
            for stored in page.records:
                try:
                    record = messages.Record.FromString(stored.content)
                except DecodeError:
                    raise AnswerError(f"{self._endpoint}: record {key_text(stored.key)} does not decode") from None
                index = max(index, 1 + record.pose_graph_node.node.index)
            if page.is_complete or not page.row_ids:
                return index
            read["after_row_id"] = page.row_ids[-1]

    def merged_map(self, of: int = 0) -> Tuple[Any, bytes]:
        """Returns a MergeReply and the map's cells, row by row from the smallest y: 0 unknown, 1 free, 2 hazard.

        of: id of the agent whose merged map is returned; 0: the connected agent. The leader and the designated survivor
        have the maps of the whole team. Another agent has its own maps, and what was shared with it. The connected agent
        relays the question, and needs a connection to the other one. MergeReply.maps_of lists the agents whose maps are
        in. MergeReply.frame_of is not 0 if the map lies in the frame of one rover that is not placed in the team's map.
        """
        reply = self.call(messages.ControlRequest(merge={}, for_agent=of), timeout_s=600).merge
        size = reply.width_cells * reply.height_cells
        if size == 0:
            return reply, b""
        if size > MERGED_CELLS_MAX:
            raise AnswerError(f"{self._endpoint}: the merged map has {size} cells, and {MERGED_CELLS_MAX} are the most that a "
                              "map may have")
        return reply, _decompress(reply.zstd_cells, size)

    def map_tiles(self, wait_s: float = 0.0, region: Optional[Sequence[float]] = None) -> MergedTiles:
        """Returns the tiles of the merged map that changed since the last call; the first call returns all. Waits up to
        wait_s (at most 60 s) for a change. `region` is x_min, y_min, x_max, y_max (m) and stays the same in all calls."""
        request = messages.MapTilesRequest(wait_s=wait_s, **self._tiles)
        if region is not None:
            request.region.x_min_m, request.region.y_min_m, request.region.x_max_m, request.region.y_max_m = region
        merger_id, first, tiles, count = request.merger_id, None, {}, 0
        while True:
            reply = self.call(messages.ControlRequest(map_tiles=request), wait_s + BEYOND_WAIT_S).map_tiles
            if first is not None and reply.merger_id != first.merger_id:
                raise TimeoutError(f"{self._endpoint} restarted its merging during the call: call again")
            first = first or reply
            size, count = reply.tile_cells ** 2, count + len(reply.tiles)
            if (reply.tile_cells > TILE_SIDE_CELLS_MAX or size * len(reply.tiles) > MERGED_CELLS_MAX or
                    max(size, SMALL_TILE_CELLS) * count > ALL_TILES_CELLS_MAX):
                raise AnswerError(f"{self._endpoint}: the {count} tiles of the merged map, of {size} cells each, are more "
                                  "than a map may have")
            tiles.update({(tile.x, tile.y): _decompress(tile.zstd_cells, size) if tile.zstd_cells else b""
                          for tile in reply.tiles})
            if reply.is_complete:
                break
            if not reply.tiles:
                raise AnswerError(f"{self._endpoint} sent an incomplete answer without tiles")
            request.wait_s = 0  # Wait for a change only before the first part.
            request.after.x, request.after.y = reply.tiles[-1].x, reply.tiles[-1].y
        self._tiles = {"merger_id": first.merger_id, "since_version": first.version}
        return MergedTiles(first.merger_id != merger_id, first.tile_cells, first.resolution_um / 1e6, tiles)


def _user_name() -> str:
    """Returns the name of this process's user, or its number if the system knows no name (docker run --user 54321)."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # OSError since Python 3.13.
        return str(os.geteuid())


def _decompress(frame: bytes, size: int) -> bytes:
    """Returns the cells in a zstd frame. Raises AnswerError unless the frame announces and holds `size` cells of value 0, 1
    or 2. The size is checked first, because the frame's own size decides how much memory decompressing takes."""
    import zstandard  # pylint: disable=import-outside-toplevel
    try:
        announced = zstandard.frame_content_size(frame)
        if announced != size:
            raise AnswerError(f"the merged map's cells do not fit its size: expected {size}, and the frame has {announced}")
        cells = zstandard.ZstdDecompressor().decompress(frame)
    except zstandard.ZstdError as error:
        raise AnswerError(f"the merged map's cells do not decode: {error}") from None
    if len(cells) != size or cells.translate(None, b"\x00\x01\x02"):
        raise AnswerError("the merged map's cells do not decode: a cell is neither unknown, free nor hazard")
    return cells


def map_position(site: Dict[str, float], lat_deg: float, lon_deg: float, alt_m: float) -> Tuple[float, float, float]:
    """Returns x y z (m) in the frame `map` of a position in WGS 84, such as a GNSS fix. `site` is the entry `site` of the
    team file as a dictionary: lat_deg, lon_deg, north_yaw_rad, alt_m. The frame is the local tangent plane."""
    flattening = 1 / 298.257223563
    square = flattening * (2 - flattening)

    def to_earth(lat: float, lon: float, alt: float) -> Tuple[float, float, float]:
        lat, lon = math.radians(lat), math.radians(lon)
        normal = 6378137 / math.sqrt(1 - square * math.sin(lat) ** 2)
        radius = (normal + alt) * math.cos(lat)
        return radius * math.cos(lon), radius * math.sin(lon), ((1 - square) * normal + alt) * math.sin(lat)

    origin = to_earth(site["lat_deg"], site["lon_deg"], site.get("alt_m", 0))
    x, y, z = (a - b for a, b in zip(to_earth(lat_deg, lon_deg, alt_m), origin))
    lat, lon = math.radians(site["lat_deg"]), math.radians(site["lon_deg"])
    east = -math.sin(lon) * x + math.cos(lon) * y
    outwards = math.cos(lon) * x + math.sin(lon) * y
    north = -math.sin(lat) * outwards + math.cos(lat) * z
    cosine, sine = math.cos(site.get("north_yaw_rad", 0)), math.sin(site.get("north_yaw_rad", 0))
    return (east * sine + north * cosine, north * sine - east * cosine,
            math.cos(lat) * outwards + math.sin(lat) * z)


def triangle_of(covariance: Sequence[float], size: int) -> Sequence[float]:
    """Returns the upper triangle of a covariance matrix, row by row, from `size` standard deviations. Returns other lists
    unchanged."""
    if len(covariance) != size:
        return covariance
    return [covariance[row] ** 2 if row == column else 0.0 for row in range(size) for column in range(row, size)]


def key_text(key: Any) -> str:
    return f"{key.origin_agent}.{key.epoch:016x}.{key.data_type}.{key.seq}"


def occupancy(cells: bytes) -> List[int]:
    """Returns the cells as in nav_msgs/OccupancyGrid: -1 unknown, 0 free, 100 occupied, in the same order."""
    return [(-1, 0, 100)[cell] for cell in cells]


def pack_cells(cells: Sequence[int]) -> bytes:
    """Packs cells (0 unknown, 1 free, 2 hazard) for MapLayer.cells: four per byte, the first one in the lowest bits."""
    packed = bytearray((len(cells) + 3) // 4)
    for i, cell in enumerate(cells):
        if cell not in (0, 1, 2):
            raise ValueError(f"cells[{i}] is {cell}; a cell is 0 (unknown), 1 (free) or 2 (hazard). For costs and "
                             "occupancies use cells_of_occupancy")
        packed[i // 4] |= cell << 2 * (i % 4)
    return bytes(packed)


def cells_of_occupancy(grid: Sequence[int], unknown: Sequence[int] = (-1,), hazard_from: int = 65) -> List[int]:
    """Returns the cells (0 unknown, 1 free, 2 hazard) of occupancies or costs, for pack_cells, in the same order.

    The defaults are those of nav_msgs/OccupancyGrid. For the costs of a Nav2 costmap (0 to 255) use unknown=(255,) and
    hazard_from=254, without its inflation layer (docs/ROS.md). Values below 0 and above 255 are refused, except those in
    `unknown`.
    """
    cells = []
    for i, value in enumerate(grid):
        if value in unknown:
            cells.append(0)
        elif 0 <= value <= 255:
            cells.append(2 if value >= hazard_from else 1)
        else:
            raise ValueError(f"grid[{i}] is {value}; an occupancy or cost lies between 0 and 255, or is unknown")
    return cells
