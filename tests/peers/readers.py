"""What the official readers of MCAP find in a log of pmp's recorder.

    python readers.py protobuf | foxglove-sdk | ros2 LOG.mcap

Prints one JSON object. Every message is decoded by the definition that the log carries, or with
foxglove-sdk, which has no reader of its own, Foxglove's messages by the definitions that the package
carries; nothing of pmp is used.
"""

import io
import json
import sys

import numpy
from mcap.reader import make_reader
from PIL import Image


def decoder(flavour):
    if flavour == "ros2":
        from mcap_ros2.decoder import DecoderFactory
    else:
        from mcap_protobuf.decoder import DecoderFactory
    return DecoderFactory()


class BySdk:
    """Decodes Foxglove's messages by the definitions of foxglove-sdk."""

    def __init__(self):
        # By name, whether the log's definition is the package's.
        self.same = {}

    def decoder_for(self, encoding, schema):
        from foxglove import messages
        from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

        if encoding != "protobuf" or not schema.name.startswith("foxglove."):
            return None
        known = getattr(messages, schema.name.removeprefix("foxglove.")).get_schema()
        files, said = (
            {file.name: file for file in descriptor_pb2.FileDescriptorSet.FromString(data).file}
            for data in (known.data, schema.data)
        )
        self.same[schema.name] = known.name == schema.name and files == said
        pool = descriptor_pool.DescriptorPool()

        def add(name):
            file = files.pop(name, None)
            if file is not None:
                for other in file.dependency:
                    add(other)
                pool.Add(file)

        for name in list(files):
            add(name)
        kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
        return kind.FromString


def stamp_ns(message):
    if hasattr(message, "timestamp"):
        return message.timestamp.seconds * 10**9 + message.timestamp.nanos
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def main():
    flavour, path = sys.argv[1:]
    topics, pictures, clouds, odometry, boxes, steering = {}, [], [], [], [], []
    sdk = BySdk()
    decoders = [sdk, decoder(flavour)] if flavour == "foxglove-sdk" else [decoder(flavour)]
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=decoders, validate_crcs=True)
        for schema, channel, _, message in reader.iter_decoded_messages():
            kind = schema.name
            topics.setdefault(channel.topic, [kind, 0])[1] += 1
            if kind.endswith("CompressedImage"):
                pictures.append(Image.open(io.BytesIO(message.data)).size)
            elif kind == "foxglove.PointCloud":
                clouds.append(len(message.data) / message.point_stride)
            elif kind.endswith("PointCloud2"):
                clouds.append(len(message.data) / message.point_step)
            elif kind == "foxglove.Odometry":
                p, v = message.pose.position, message.linear_velocity
                odometry.append([stamp_ns(message), p.x, p.y, v.x, v.y])
            elif kind == "nav_msgs/msg/Odometry":
                p, v = message.pose.pose.position, message.twist.twist.linear
                odometry.append([stamp_ns(message), p.x, p.y, v.x, v.y])
            elif kind == "foxglove.SceneUpdate":
                boxes.append([len(message.entities), sum(e.cubes[0].size.z for e in message.entities)])
            elif kind.endswith("ObjectArray"):
                boxes.append([len(message.objects), sum(o.shape.dimensions[2] for o in message.objects)])
            elif kind in ("pmp.Control", "carla_msgs/msg/CarlaEgoVehicleControl"):
                steering.append([stamp_ns(message), message.steer] if "applied" not in channel.topic else None)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    print(json.dumps({
        "topics": topics,
        "same_definitions": sdk.same,
        "metadata": metadata,
        "picture_sizes": sorted(set(pictures)),
        "cloud_points": [float(numpy.min(clouds)), float(numpy.max(clouds)), float(numpy.sum(clouds))],
        "odometry": odometry,
        "boxes": boxes,
        "steering": [one for one in steering if one],
    }))


main()
