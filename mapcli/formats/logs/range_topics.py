"""Topics of sensor_msgs/msg/Range as readings of range sensors, each with its mount."""

from __future__ import annotations

from mapcli.errors import DataError
from mapcli.formats.logs.log import Log
from mapcli.formats.logs.mounts import rounded_mount
from mapcli.formats.logs.range_sensors import RangeSensor
from mapcli.formats.logs.ros.decode import RangeMessage
from mapcli.formats.logs.ros.robot import Robot
from mapcli.formats.logs.ros.robots import namespace_of
from mapcli.formats.logs.ros.transforms import mount_of_axis
from mapcli.formats.logs.units import METRES
from mapcli.model.log import Topic
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import Mount


class RangeTopics:
    """The range sensors of a log (stateful: a sensor is known from its first message on).

    Args:
        log: whose `beams` and `sensors` are filled.
        robot: whose frames tell where sensors sit, unless `log.options.sensors` do.
    """

    def __init__(self, log: Log, robot: Robot) -> None:
        self._log, self._robot = log, robot
        self._told = {topic: rounded_mount(mount) for topic, mount in log.options.sensors}
        self._scale = METRES[log.options.range_unit]
        self._sensors: dict[tuple[str, str], RangeSensor] = {}

    def reading(self, message: RangeMessage, stamp_ns: int, topic: Topic) -> RangeReading | None:
        """A message as a record; None of a sensor that looks at the floor, or up.

        Raises:
            DataError: nothing tells where the sensor sits.
        """
        key = topic.name, message.frame
        if key not in self._sensors:
            self._sensors[key] = self._sensor(message, topic)
        sensor = self._sensors[key]
        counts = self._log.sensors.setdefault(sensor.name, sensor.counts())
        return sensor.reading(message.reading * self._scale, stamp_ns, self._log.beams, counts)

    def _sensor(self, message: RangeMessage, topic: Topic) -> RangeSensor:
        """A sensor, from its first message. Several may share a topic, each with its own frame."""
        shared = any(name == topic.name for name, _ in self._sensors)
        return RangeSensor(
            f"{topic.name}/{message.frame}" if shared else topic.name,
            self._mount(message.frame, topic),
            message.range_min * self._scale,
            message.range_max * self._scale,
            message.field_of_view,
        )

    def _mount(self, frame: str, topic: Topic) -> Mount | None:
        if topic.name in self._told:
            return self._told[topic.name]
        if self._log.laser_pose is not None:
            return self._log.laser_pose
        frame = self._robot.tree.named(frame, namespace_of(topic.name))
        motion, remark = self._robot.placed(frame)
        if motion is None:
            raise DataError(
                f"nothing tells where the sensor {frame!r} sits on {self._robot.frame!r}",
                file=self._log.sources[0].name,
                where=topic.name,
                expected=f"a transform to it, or --sensor {topic.name}=X,Y,YAW_DEG",
            )
        if remark is not None:
            self._log.note(f"sensor {topic.name}: {remark}")
        return mount_of_axis(motion)
