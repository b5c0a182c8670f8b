"""A client of a moondb agent in Python: the control protocol (proto/control.proto) over ZeroMQ, and nothing else.

Needs pyzmq, protobuf and zstandard (Debian: python3-zmq python3-protobuf python3-zstandard), and the messages' modules:

    protoc --python_out=. -I proto proto/*.proto

One thread a client. Errors of the agent are AgentError, an agent that does not answer is TimeoutError.
"""
import getpass
import math
import os
import pathlib
import re
import socket
import time

import zmq
import zstandard

import control_pb2
import error_pb2
import record_pb2
import sharing_pb2
import types_pb2

REQUEST_BYTES_MAX = 32 * 1024 * 1024
BEYOND_WAIT_S = 30.0  # Time that a call waits for its answer, in addition to wait_s.
PAUSES_S = (0.1, 0.3, 1.0, 2.0, 3.0)  # Pauses before a sync or replication request is repeated.


class AgentError(Exception):
    """Error reported by the agent: `code` is an ErrorCode of error.proto, `field` names the part of the request."""

    def __init__(self, error):
        super().__init__(f"{error.field}: {error.text}" if error.field else error.text)
        self.code, self.field = error.code, error.field


def team_of(team_file):
    """Returns the team's name and id from a team file as written by `moonctl config init`."""
    fields = dict(re.findall(r"^(team|team_id):\s*\"?([\w-]+)", pathlib.Path(team_file).read_text(), re.MULTILINE))
    return fields["team"], fields["team_id"]


def endpoint_of(team_file, agent):
    """Returns the endpoint on which an agent of this machine accepts clients that run as the agent's user."""
    folder = os.environ.get("MOONDB_RUN_DIR")
    if not folder and os.environ.get("XDG_RUNTIME_DIR"):
        folder = os.path.join(os.environ["XDG_RUNTIME_DIR"], "moondb")
    folder = pathlib.Path(folder or f"/tmp/moondb-{os.geteuid()}").absolute()
    name, team_id = team_of(team_file)
    return f"ipc://{folder}/{name}-{team_id[:8]}/{agent}.sock"


class MoondbClient:
    def __init__(self, endpoint, team_id, timeout_s=3.0):
        """`team_id` is that of the team file. An agent of another team refuses requests."""
        self._dealer = zmq.Context.instance().socket(zmq.DEALER)
        self._dealer.linger = 0
        self._dealer.connect(endpoint)
        self._endpoint, self._timeout_s, self._request_id = endpoint, timeout_s, 0
        self._team_id = bytes.fromhex(team_id)
        self._by = f"{getpass.getuser()}@{socket.gethostname()}"

    def close(self):
        self._dealer.close()

    def call(self, request, timeout_s=None):
        """Sends a ControlRequest and returns the ControlReply."""
        self._request_id += 1
        request.by, request.team_id = self._by, self._team_id
        message = control_pb2.ClientMessage(request_id=self._request_id, control_request=request)
        frame = message.SerializeToString()
        if len(frame) > REQUEST_BYTES_MAX:
            raise ValueError(f"the request has {len(frame)} bytes, and {REQUEST_BYTES_MAX} are the most that an agent takes")
        self._dealer.send(frame)
        while self._dealer.poll(1000 * (timeout_s or self._timeout_s)):
            answer = control_pb2.ClientMessage.FromString(self._dealer.recv())
            if answer.request_id != self._request_id:
                continue  # A late reply to an earlier call.
            if answer.control_reply.team_id != self._team_id:
                raise ValueError(f"{self._endpoint} is of another team")
            if answer.control_reply.error.code:
                raise AgentError(answer.control_reply.error)
            return answer.control_reply
        raise TimeoutError(f"{self._endpoint} does not answer")

    def status(self):
        return self.call(control_pb2.ControlRequest(status={})).status

    def insert(self, records):
        """Stores records as records of this agent, all or none. Returns their keys."""
        return self.call(control_pb2.ControlRequest(insert={"records": records})).insert.keys

    def insert_loop_closure(self, from_node, to_node, position_m, covariance, source, orientation=(0, 0, 0, 1),
                            timestamp_ns=None):
        """Stores a relative pose of `to_node` in the frame of `from_node` that is not odometry. A node is a pair
        (agent id, index); one of the two belongs to this agent's robot. `orientation` is x y z w. `covariance` holds the
        standard deviations x y z (m), roll pitch yaw (rad), or the 21 numbers of RelativePose. `source` names the producer,
        such as "apriltag". Returns the record's key."""
        record = record_pb2.Record(timestamp_ns=timestamp_ns or time.time_ns())
        edge = record.pose_graph_edge
        edge.source = source
        for key, (agent_id, index) in ((getattr(edge, "from"), from_node), (edge.to, to_node)):
            key.agent_id, key.index = agent_id, index
        pose = edge.relative_pose.from_from_to
        pose.position_m.x, pose.position_m.y, pose.position_m.z = position_m
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation
        edge.relative_pose.covariance.extend(triangle_of(covariance, 6))
        return self.insert([record])[0]

    def insert_prior(self, node, position_m, covariance, source, yaw_rad=None, orientation=None, point_m=None,
                     timestamp_ns=None):
        """Stores an absolute measurement of a node in the frame `map`: a position, with yaw_rad a position and a yaw, with
        orientation (x y z w) a pose. `covariance` holds standard deviations (3, 4 or 6: m, then rad), or the upper triangle
        of the covariance. `point_m` is the measured point in the body's frame, such as a GNSS antenna. Returns the
        record's key."""
        record = record_pb2.Record(timestamp_ns=timestamp_ns or time.time_ns())
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

    def follow(self, data_types, wait_s=10.0):
        """Yields (key, bytes) of each stored record and then of each new record. Ends after wait_s without a new
        record."""
        read = {"data_types": data_types, "wait_s": wait_s, "records_max": 100}
        while True:
            page = self.call(control_pb2.ControlRequest(read=read), timeout_s=wait_s + self._timeout_s).read
            for stored in page.records:
                yield stored.key, stored.content
            if not page.row_ids:
                return
            read["after_row_id"] = page.row_ids[-1]

    def sync(self, limit_s=600.0, on_progress=None, **order):
        """Shares with each agent if this is the leader, else sends this agent's own records to the leader.
        Returns a ShareProgress (proto/sharing.proto) when all records are acknowledged (is_complete), when no more progress
        is possible (is_over), or after limit_s. `on_progress` is called with each ShareProgress until then. `order` has
        fields of ShareRequest. If the agent's process ends, this is noticed after 90 s, and the order is sent again."""
        return self._share(sharing_pb2.SHARING_KIND_SYNC, limit_s, on_progress, order)

    def replicate(self, limit_s=600.0, on_progress=None, **order):
        """Replicates all records of the leader to the designated survivor. Requires: the leader."""
        return self._share(sharing_pb2.SHARING_KIND_REPLICATION, limit_s, on_progress, order)

    def swap_roles(self, limit_s=10.0):
        """Swaps leader and survivor. Returns a RoleShowReply; not_confirmed_by names agents that do not act on it yet.
        After a TimeoutError ask for the roles: they may have changed."""
        return self.set_roles(limit_s, is_swap=True)

    def set_roles(self, limit_s=10.0, **change):
        """Changes the current roles. `change` has fields of RoleSetRequest."""
        standing = self.call(control_pb2.ControlRequest(role_show={})).roles.roles
        expected = {"term": standing.term, "leader": standing.leader, "survivor": standing.survivor}
        request = {"expected": expected, "wait_s": limit_s, **change}
        return self.call(control_pb2.ControlRequest(role_set=request), limit_s + BEYOND_WAIT_S).roles

    def _share(self, kind, limit_s, on_progress, order):
        end, was_leading = time.monotonic() + limit_s, False
        for pause_s in (*PAUSES_S, None):
            try:
                status = self.status()
                is_leading = status.roles.leader == status.agent_id
                if was_leading and not is_leading:
                    raise RuntimeError(f"{self._endpoint} leads no longer: ask the leader of now")
                was_leading = is_leading
                request = {"kind": kind, **order}
                if not order.get("destination"):
                    request["expected_term"] = status.roles.term
                return self._share_once(request, end, on_progress)
            except (AgentError, TimeoutError) as error:
                is_worth_another = (isinstance(error, TimeoutError) or error.field == "expected_term" or
                                    error.code in (error_pb2.ERROR_CODE_UNAVAILABLE, error_pb2.ERROR_CODE_NOT_FOUND))
                if not is_worth_another or pause_s is None or time.monotonic() >= end:
                    raise
                time.sleep(pause_s)

    def _share_once(self, request, end, on_progress):
        order = self.call(control_pb2.ControlRequest(share=request)).share.order
        news = {"kind": request["kind"], "order": order}
        while True:
            news["wait_s"] = min(max(end - time.monotonic(), 0.0), 60.0)
            reply = self.call(control_pb2.ControlRequest(share_progress=news), news["wait_s"] + BEYOND_WAIT_S)
            if on_progress is not None:
                on_progress(reply.share_progress)
            if reply.share_progress.is_over or time.monotonic() >= end:
                return reply.share_progress
            news["after_version"] = reply.share_progress.version

    def next_node_index(self):
        """One above the highest index of a node of the agent's robot in its store; 0 if there is none. After a lost disk its
        nodes come back with the next sync: ask after it."""
        read = {"data_types": [types_pb2.POSE_GRAPH_NODE], "origin_agents": [self.status().agent_id]}
        index = 0
        while True:
            page = self.call(control_pb2.ControlRequest(read=read), timeout_s=600).read
            for stored in page.records:
                index = max(index, 1 + record_pb2.Record.FromString(stored.content).pose_graph_node.node.index)
            if page.is_complete or not page.row_ids:
                return index
            read["after_row_id"] = page.row_ids[-1]

    def merged_map(self):
        """Returns a MergeReply and the map's cells, row by row from the smallest y: 0 unknown, 1 free, 2 hazard."""
        reply = self.call(control_pb2.ControlRequest(merge={}), timeout_s=600).merge
        size = reply.width_cells * reply.height_cells
        if size == 0:
            return reply, b""
        return reply, zstandard.ZstdDecompressor().decompress(reply.zstd_cells, max_output_size=size)


def map_position(site, lat_deg, lon_deg, alt_m):
    """Returns x y z (m) in the frame `map` of a position in WGS 84, such as a GNSS fix. `site` is the entry `site` of the
    team file as a dictionary: lat_deg, lon_deg, north_yaw_rad, alt_m. The frame is the local tangent plane."""
    flattening = 1 / 298.257223563
    square = flattening * (2 - flattening)

    def to_earth(lat, lon, alt):
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


def triangle_of(covariance, size):
    """Returns the upper triangle of a covariance matrix, row by row, from `size` standard deviations. Returns other lists
    unchanged."""
    if len(covariance) != size:
        return covariance
    return [covariance[row] ** 2 if row == column else 0.0 for row in range(size) for column in range(row, size)]


def key_text(key):
    return f"{key.origin_agent}.{key.epoch:016x}.{key.data_type}.{key.seq}"


def occupancy(cells):
    """Returns the cells as in nav_msgs/OccupancyGrid: -1 unknown, 0 free, 100 occupied, in the same order."""
    return [(-1, 0, 100)[cell] for cell in cells]
