#!/usr/bin/env python3
"""Shows how a robot's software uses its agent: stores a reading, a pose and a local map, and takes the merged map.

Usage: survey.py TEAM_FILE AGENT AGENT_ID    The agent runs on this machine, as this user.
"""
import sys
import time

from moondb import Client, endpoint_of, key_text, messages, occupancy, pack_cells, team_of


def node_at(agent_id, index, x, y):
    """Returns a pose-graph node: odometry's pose of the body in the frame `map`, in metres, quaternion x y z w."""
    record = messages.Record(timestamp_ns=time.time_ns())
    node = record.pose_graph_node
    node.node.agent_id, node.node.index = agent_id, index
    node.map_from_node.position_m.x, node.map_from_node.position_m.y = x, y
    node.map_from_node.orientation.w = 1.0
    return record


def map_at(agent_id, index, cells, side, resolution_m):
    """Returns a traversability map around a node. Its origin is the middle of the grid; rows are in order of y."""
    record = messages.Record(timestamp_ns=time.time_ns())
    local_map = record.local_traversability_map
    local_map.node.agent_id, local_map.node.index = agent_id, index
    local_map.node_from_map.position_m.x = 0.0
    local_map.node_from_map.orientation.w = 1.0
    local_map.layers.add(width_cells=side, height_cells=side, resolution_um=round(resolution_m * 1e6),
                         cells=pack_cells(cells))
    return record


def main():
    team_file, agent, agent_id = sys.argv[1], sys.argv[2], int(sys.argv[3])
    client = Client(endpoint_of(team_file, agent), team_of(team_file)[1])
    status = client.status()
    print(f"{status.name} of team {status.team}, moondb {status.version}")

    index = client.next_node_index()  # Nodes of earlier runs have lower indexes.
    side = 40
    hazard_ahead = [2 if column > 35 else 1 for row in range(side) for column in range(side)]
    keys = client.insert([
        messages.Record(timestamp_ns=time.time_ns(), temperature={"celsius": -40.5}),
        node_at(agent_id, index, x=5.0 + index, y=2.0),
        map_at(agent_id, index, hazard_ahead, side, resolution_m=0.1),
    ])
    print("stored", len(keys), "records, the first as", key_text(keys[0]))

    for key, content in client.follow([messages.TEMPERATURE], wait_s=0.2):
        print("read", key_text(key), messages.Record.FromString(content).temperature.celsius)

    merged, cells = client.merged_map()
    grid = occupancy(cells)
    cell_m = merged.resolution_um / 1e6
    x_m, y_m = merged.origin_cell_x * cell_m, merged.origin_cell_y * cell_m
    print(f"merged map of {merged.map_count:.0f}: {merged.width_cells} x {merged.height_cells} cells of {cell_m} m, "
          f"lower left corner at ({x_m:.2f}, {y_m:.2f}), {grid.count(0)} free, {grid.count(100)} hazard")


if __name__ == "__main__":
    main()
