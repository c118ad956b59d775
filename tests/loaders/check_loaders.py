#!/usr/bin/env python3
"""Opens a recording with other people's loaders and checks that they see all of it.

The `mcap` and `mcap-ros2-support` packages (what Foxglove's own tools are built on) decode every message; Rerun's MCAP loader,
the one behind its viewer's "open file", turns the topics into entities. Both have to agree with the file's own statistics, and
Rerun with the messages: the same picture bytes, measurements, poses and times.

    python3 -m venv target/loaders
    target/loaders/bin/pip install -r tests/loaders/requirements.txt
    target/loaders/bin/python tests/loaders/check_loaders.py RECORDING.mcap

Exit code 0: all is seen. 1: something is not, named on stderr. 2: usage.
"""

import argparse
import pathlib
import sys
import tempfile
from collections import defaultdict

# Topic: ROS 2 schema, and the component by which Rerun shows that it understood the messages.
TOPICS = {
    "/camera/image": ("sensor_msgs/msg/CompressedImage", "EncodedImage:blob"),
    "/camera/info": ("sensor_msgs/msg/CameraInfo", "Pinhole:image_from_camera"),
    "/imu": ("sensor_msgs/msg/Imu", "Scalars:scalars"),
    "/trigger": ("std_msgs/msg/Bool", "std_msgs.msg.Bool:message"),
    "/truth/pose": ("geometry_msgs/msg/PoseStamped", "InstancePoses3D:translations"),
    "/pose": ("geometry_msgs/msg/PoseStamped", "InstancePoses3D:translations"),
    "/camera/image_raw": ("sensor_msgs/msg/Image", "Image:buffer"),
    "/ship": ("nmea_msgs/msg/Sentence", "nmea_msgs.msg.Sentence:message"),
    "/ship/values": ("bowwave_msgs/msg/ShipValues", "bowwave_msgs.msg.ShipValues:message"),
    "/ship/fix": ("bowwave_msgs/msg/ShipFix", "bowwave_msgs.msg.ShipFix:message"),
    "/mark": ("std_msgs/msg/String", "TextDocument:text"),
    "/fault": ("diagnostic_msgs/msg/DiagnosticArray", "diagnostic_msgs.msg.DiagnosticArray:message"),
    "/tick": ("bowwave_msgs/msg/Tick", "bowwave_msgs.msg.Tick:message"),
}


class Failure(Exception):
    """What a loader does not see."""


def expect(condition, message):
    if not condition:
        raise Failure(message)


def stamp_ns(header):
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def vector(v):
    return (v.x, v.y, v.z)


def value_of(topic, message):
    """What Rerun is to show of a message, as plain Python."""
    if topic == "/camera/image":
        return bytes(message.data)
    if topic == "/imu":
        return vector(message.angular_velocity) + vector(message.linear_acceleration)
    if topic == "/trigger":
        return message.data
    if topic == "/camera/info":
        return tuple(message.k)
    if topic == "/tick":
        return (message.inputs, message.records, message.scenes)
    return vector(message.pose.position)


def read_with_mcap(path):
    """Topic to [(log time, header stamp or None, value)], every message decoded by its schema."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    messages = defaultdict(list)
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        expect(reader.get_header().profile == "ros2", "mcap: the profile is not ros2")
        summary = reader.get_summary()
        expect(summary is not None and summary.statistics is not None, "mcap: the file has no index")
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            expect(channel.topic in TOPICS, f"mcap: unknown topic {channel.topic}")
            expect(schema.name == TOPICS[channel.topic][0], f"mcap: {channel.topic} carries {schema.name}")
            stamp = stamp_ns(decoded.header) if hasattr(decoded, "header") else None
            messages[channel.topic].append((message.log_time, stamp, value_of(channel.topic, decoded)))
            if channel.topic == "/camera/image":
                expect(decoded.format == "jpeg" and decoded.data[:2] == b"\xff\xd8", "mcap: a picture that is no JPEG")
        counts = summary.statistics.channel_message_counts
        for channel in summary.channels.values():
            count = counts.get(channel.id, 0)
            expect(
                len(messages[channel.topic]) == count,
                f"mcap: {len(messages[channel.topic])} of {count} messages on {channel.topic}",
            )
        expect({a.name for a in reader.iter_attachments()} >= {"calibration.toml"}, "mcap: no calibration attached")
        expect(any(m.name == "bowwave" for m in reader.iter_metadata()), "mcap: no bowwave properties")
    expect(messages["/camera/image"], "mcap: no pictures")
    expect(messages["/imu"], "mcap: no inertial measurements")
    expect(messages["/tick"], "mcap: no ticks")
    return messages


def rerun_value(topic, cell):
    """The same plain Python out of a cell of Rerun's table."""
    if topic == "/camera/image":
        return bytes(cell[0])
    if topic in ("/imu", "/trigger"):
        return tuple(cell) if topic == "/imu" else cell[0]["data"]
    if topic == "/tick":
        return tuple(cell[0][name] for name in ("inputs", "records", "scenes"))
    if topic == "/camera/info":
        # Rerun stores matrices by columns.
        k = cell[0]
        return tuple(k[column * 3 + row] for row in range(3) for column in range(3))
    return tuple(cell[0])


def read_with_rerun(path):
    """Topic to [(log time, header stamp or None, value)], through the loader of Rerun's viewer."""
    import pyarrow
    import rerun
    from rerun.chunk import RrdReader

    rows = defaultdict(list)
    entities = set()
    with tempfile.TemporaryDirectory() as folder:
        rrd = pathlib.Path(folder) / "recording.rrd"
        with rerun.RecordingStream("check_loaders") as stream:
            stream.save(str(rrd))
            stream.log_file_from_path(str(path))
            stream.flush()
        del stream
        reader = RrdReader(str(rrd))
        for entry in reader.recordings():
            for chunk in reader.stream(store=entry).to_chunks():
                topic = str(chunk.entity_path)
                entities.add(topic)
                component = TOPICS.get(topic, (None, None))[1]
                batch = chunk.to_record_batch()
                if component not in batch.schema.names:
                    continue

                def times(name):
                    if name not in batch.schema.names:
                        return [None] * batch.num_rows
                    return batch.column(name).cast(pyarrow.int64()).to_pylist()

                cells = batch.column(component).to_pylist()
                for log_time, stamp, cell in zip(times("message_log_time"), times("ros2_timestamp"), cells):
                    rows[topic].append((log_time, stamp, rerun_value(topic, cell)))
    return rows, entities


def close(a, b):
    """Equal, but for Rerun's single precision in poses and camera matrices."""
    if isinstance(a, tuple):
        return len(a) == len(b) and all(close(x, y) for x, y in zip(a, b))
    if isinstance(a, float):
        return a == b or (a != a and b != b) or abs(a - b) <= 1e-6 * max(abs(a), abs(b))
    return a == b


def compare(topic, ours, theirs):
    expect(len(ours) == len(theirs), f"rerun: {len(theirs)} of {len(ours)} messages on {topic}")
    by_log_time = lambda row: row[0]
    for mine, other in zip(sorted(ours, key=by_log_time), sorted(theirs, key=by_log_time)):
        expect(mine[0] == other[0], f"rerun: {topic}: log time {other[0]} instead of {mine[0]}")
        expect(mine[1] == other[1], f"rerun: {topic} at {mine[0]}: stamp {other[1]} instead of {mine[1]}")
        expect(close(mine[2], other[2]), f"rerun: {topic} at {mine[0]}: another value")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("recording", type=pathlib.Path)
    path = parser.parse_args().recording
    try:
        from mcap.exceptions import McapError
    except ImportError as error:
        print(f"{error}: install tests/loaders/requirements.txt into a virtual environment", file=sys.stderr)
        return 1
    try:
        messages = read_with_mcap(path)
        rows, entities = read_with_rerun(path)
        print(f"{'topic':<15} {'schema':<33} {'mcap':>6} {'rerun':>6}  shown as")
        for topic, (schema, component) in TOPICS.items():
            if messages[topic]:
                expect(topic in entities, f"rerun: no entity {topic}")
            print(f"{topic:<15} {schema:<33} {len(messages[topic]):>6} {len(rows[topic]):>6}  {component}")
        for topic in TOPICS:
            compare(topic, messages[topic], rows[topic])
    except ImportError as error:
        print(f"{error}: install tests/loaders/requirements.txt into a virtual environment", file=sys.stderr)
        return 1
    except (Failure, OSError, McapError) as error:
        print(f"{path}: {error}", file=sys.stderr)
        return 1
    print("every message is seen by both loaders")
    return 0


if __name__ == "__main__":
    sys.exit(main())
