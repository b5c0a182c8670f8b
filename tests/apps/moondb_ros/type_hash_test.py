#!/usr/bin/env python3
"""Computes the hashes of ROS 2's types (RIHS01 of REP 2016) from their IDL, and compares them with those of moondb_ros.

Usage: type_hash_test.py FOLDER    FOLDER holds ros.idl and ros_graph.cc.
Exit codes: 0 passed, 1 failed.
"""
import hashlib
import json
import pathlib
import re
import sys

# Ids of type_description_interfaces/msg/FieldType.
NESTED, ARRAY, SEQUENCE = 1, 48, 144
PRIMITIVES = {"int8": 2, "long": 6, "unsigned long": 7, "float": 10, "double": 11, "string": 17}
WRITTEN_AND_READ = ("nav_msgs/msg/OccupancyGrid", "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan",
                    "tf2_msgs/msg/TFMessage")


def field_of(package, kind, name, size):
    sequence = re.fullmatch(r"sequence<(.+)>", kind)
    element = sequence.group(1) if sequence else kind
    nested = "" if element in PRIMITIVES else element
    if nested:
        parts = nested.removesuffix("_").split("::")
        nested = f"{parts[0] if len(parts) > 1 else package}/msg/{parts[-1]}"
    return {"name": name,
            "type": {"type_id": PRIMITIVES.get(element, NESTED) + (SEQUENCE if sequence else ARRAY if size else 0),
                     "capacity": int(size or 0), "string_capacity": 0, "nested_type_name": nested}}


def types_of(idl):
    """Returns the fields of each type by its ROS name."""
    types = {}
    for package, content in re.findall(r"module (\w+) \{ module msg \{ module dds_ \{(.*?)\n\}; \}; \};", idl, re.DOTALL):
        for name, members in re.findall(r"struct (\w+)_ \{(.*?)\};", content, re.DOTALL):
            fields = re.findall(r"([\w:<> ]+?) (\w+)(?:\[(\d+)\])?;", members)
            types[f"{package}/msg/{name}"] = [field_of(package, kind.strip(), *rest) for kind, *rest in fields]
    return types


def hash_of(name, types):
    referenced = set()

    def refer(to):
        for nested in {field["type"]["nested_type_name"] for field in types[to]} - {""} - referenced:
            referenced.add(nested)
            refer(nested)

    refer(name)
    description = {"type_description": {"type_name": name, "fields": types[name]},
                   "referenced_type_descriptions": [{"type_name": other, "fields": types[other]}
                                                    for other in sorted(referenced)]}
    return hashlib.sha256(json.dumps(description).encode()).hexdigest()


def main():
    folder = pathlib.Path(sys.argv[1])
    types = types_of((folder / "ros.idl").read_text(encoding="utf-8"))
    source = (folder / "ros_graph.cc").read_text(encoding="utf-8")
    stated = set(re.findall(r'"([0-9a-f]{64})"', source))
    computed = {hash_of(name, types): name for name in WRITTEN_AND_READ}
    for value, name in computed.items():
        if value not in stated:
            print(f"the hash of {name} is {value}, which ros_graph.cc does not state")
    return 0 if set(computed) == stated else 1


if __name__ == "__main__":
    sys.exit(main())
