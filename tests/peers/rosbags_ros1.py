"""Random ROS 1 messages as the package rosbags serialises them: a line of JSON for each type."""

import dataclasses
import json
import random

import numpy
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS1_NOETIC)
RANDOM = random.Random(7)
INTEGERS = {
    "bool": (0, 1), "byte": (0, 127), "char": (0, 127), "octet": (0, 127),
    "int8": (-128, 127), "uint8": (0, 255), "int16": (-2**15, 2**15 - 1), "uint16": (0, 2**16 - 1),
    "int32": (-2**31, 2**31 - 1), "uint32": (0, 2**32 - 1),
    "int64": (-2**63, 2**63 - 1), "uint64": (0, 2**64 - 1),
}
# Seconds: rosbags holds both in ROS 2's types, so none beyond 2038.
TIMES = {
    "builtin_interfaces/msg/Time": (0, 2**31 - 1),
    "builtin_interfaces/msg/Duration": (-2**31, 2**31 - 1),
}


def one(kind):
    """A random value of a type as rosbags describes it: (node type, details)."""
    node, details = int(kind[0]), kind[1]
    if node == 1:
        name = details[0]
        if name == "string":
            return "".join(RANDOM.choice("aZ0 /ß車") for _ in range(RANDOM.randrange(6)))
        if name == "bool":
            return RANDOM.random() < 0.5
        if name.startswith("float"):
            return RANDOM.randrange(-(2**15), 2**15) / 8
        return RANDOM.randint(*INTEGERS[name])
    if node == 2:
        return message(details)
    item, count = details
    count = count if node == 3 else RANDOM.randrange(4)
    items = [one(item) for _ in range(count)]
    if int(item[0]) == 1 and item[1][0] != "string":
        kinds = {"byte": "uint8", "octet": "uint8", "char": "uint8"}
        return numpy.array(items, dtype=kinds.get(item[1][0], item[1][0]))
    return items


def message(name):
    if name in TIMES:
        return STORE.types[name](sec=RANDOM.randint(*TIMES[name]), nanosec=RANDOM.randrange(10**9))
    fields = {field: one(kind) for field, kind in STORE.fielddefs[name][1]}
    return STORE.types[name](**fields)


def plain(value):
    """The same as JSON, with the names that ROS 1 gives the parts of a time."""
    if dataclasses.is_dataclass(value):
        # Constants are fields of the class, too, and the member that ROS 2 puts into empty types.
        names = [name for name, _ in STORE.fielddefs[value.__msgtype__][1]]
        names = [name for name in names if name != "structure_needs_at_least_one_member"]
        fields = {name: plain(getattr(value, name)) for name in names}
        if value.__msgtype__ in TIMES:
            fields["nsec"] = fields.pop("nanosec")
        return fields
    if isinstance(value, numpy.ndarray):
        return value.tolist()
    if isinstance(value, list):
        return [plain(item) for item in value]
    return value


for name in sorted(STORE.types):
    if name.startswith("builtin_interfaces/") or "/msg/" not in name:
        continue
    made = message(name)
    print(json.dumps({
        "type": name.replace("/msg/", "/"),
        "definition": STORE.generate_msgdef(name, ros_version=1)[0],
        "message": bytes(STORE.serialize_ros1(made, name)).hex(),
        "values": plain(made),
    }))
