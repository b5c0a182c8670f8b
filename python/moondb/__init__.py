"""Client of moondb agents: `Client` sends requests, `messages` holds the protobuf messages and enumerations.

    from moondb import Client, endpoint_of, messages, team_of

    client = Client(endpoint_of("team.yaml", "rover1"), team_of("team.yaml")[1])
    client.insert([messages.Record(timestamp_ns=time.time_ns(), temperature={"celsius": -40.5})])
"""
from moondb import messages
from moondb.client import (AgentError, Client, MergedTiles, TeamError, cells_of_occupancy, key_text,
                           map_position, occupancy, pack_cells, triangle_of)
from moondb.endpoint import endpoint_of
from moondb.team_file import TeamFileError, team_of

__all__ = ["AgentError", "Client", "MergedTiles", "TeamError", "TeamFileError", "cells_of_occupancy", "endpoint_of", "key_text",
           "map_position", "messages", "occupancy", "pack_cells", "team_of", "triangle_of"]
