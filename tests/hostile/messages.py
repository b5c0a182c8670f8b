"""The messages of proto/, and what goes into records.

    from messages import message, record
    message.Message(...)
"""
import ctypes
import pathlib
import struct
import time

import moondb.messages
from google.protobuf import message_factory

# Names of the files of proto/ in which the messages are. The package has all of them in one module.
control = errors = have = ids = message = poses = record = term = types = moondb.messages

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SEQ_MAX = (1 << 63) - 1
WIRE_VERSION = 1
FREE_CELLS = b"\x55"  # One byte that codes four free cells.

xxhash = ctypes.CDLL("libxxhash.so.0")
xxhash.XXH64.restype = ctypes.c_uint64


def rights_of(field):
    """Returns the rights that a request needs: the option `command` of its field in ControlRequest."""
    pool = field.file.pool
    options = message_factory.MessageFactory(pool).GetPrototype(pool.FindMessageTypeByName("google.protobuf.FieldOptions"))
    command = pool.FindExtensionByName("moondb.proto.command")
    return options.FromString(field.GetOptions().SerializeToString()).Extensions[command].rights


def xxh64(data):
    return xxhash.XXH64(data, ctypes.c_size_t(len(data)), ctypes.c_uint64(0))


def hash_of(key, content):
    """Returns the hash of a record as HashRecord of model/record_key.h."""
    return xxh64(struct.pack("<IQIQ", key.origin_agent, key.epoch, key.data_type, key.seq) + content)


def stored(origin, epoch, seq, body, data_type=None):
    """Returns a StoredRecord with a valid hash. Without `data_type`, its type is that of the body."""
    name = body.WhichOneof("body")
    number = types.DataType.Value(name.upper()) if data_type is None else data_type
    key = ids.RecordKey(origin_agent=origin, epoch=epoch, data_type=number, seq=seq)
    content = body.SerializeToString()
    return record.StoredRecord(key=key, content=content, hash=hash_of(key, content))


def now_ns():
    return time.time_ns()


def pose(x=0.0, y=0.0, z=0.0):
    return poses.Pose(position_m={"x": x, "y": y, "z": z}, orientation={"w": 1})


def node(agent, index, x=0.0, y=0.0):
    return record.Record(timestamp_ns=now_ns(),
                         pose_graph_node={"node": {"agent_id": agent, "index": index}, "map_from_node": pose(x, y)})


def edge(agent, index):
    """Returns the odometry from the node to the next node, one metre ahead."""
    covariance = [0.0] * 21
    for diagonal in (0, 6, 11, 15, 18, 20):
        covariance[diagonal] = 1e-4
    measurement = {"from_from_to": pose(1), "covariance": covariance}
    return record.Record(timestamp_ns=now_ns(),
                         pose_graph_edge={"from": {"agent_id": agent, "index": index},
                                          "to": {"agent_id": agent, "index": index + 1},
                                          "relative_pose": measurement})


def map_at(agent, index, cells=40):
    """Returns a map with one layer around a node; all its cells are free."""
    layer = {"width_cells": cells, "height_cells": cells, "resolution_um": 50000,
             "cells": FREE_CELLS * (cells * cells // 4)}
    return record.Record(timestamp_ns=now_ns(),
                         local_traversability_map={"node": {"agent_id": agent, "index": index},
                                                   "node_from_map": pose(), "layers": [layer]})


def event(text, kind=record.EVENT_KIND_COMMAND, by=""):
    return record.Record(timestamp_ns=now_ns(), agent_event={"kind": kind, "text": text, "by": by})


def temperature(celsius):
    return record.Record(timestamp_ns=now_ns(), is_state=True, temperature={"celsius": celsius})


def have_stream(origin, epoch, data_type, last, first=1):
    """Returns a StreamHave that holds all seqs from `first` to `last`."""
    return have.StreamHave(origin_agent=origin, epoch=epoch, data_type=data_type,
                            held=[{"first": first, "last": last}])


def dropped_stream(origin, epoch, data_type, last, first=1):
    return have.StreamHave(origin_agent=origin, epoch=epoch, data_type=data_type,
                            dropped=[{"first": first, "last": last}])
