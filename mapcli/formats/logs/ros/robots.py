"""Robots apart: which topics and transforms of a log are of one and the same robot.

Logs of several robots tell them apart in two ways. Each has a namespace, `/robot1/scan` and
`/robot1/tf`, in which all frames may have the same names; or all share one `/tf`, and their frames
have prefixes, `robot1/base_link`. With the tf_prefix of ROS 1, messages leave the prefix out. What
is known for sure is that sensors of one robot hang on one body in the tree of its transforms;
names decide where there are none.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import NamedTuple

from mapcli.errors import DataError
from mapcli.formats.logs.ros.decode import Transform
from mapcli.formats.logs.ros.robot import MOVING_TRANSFORMS
from mapcli.formats.logs.ros.transforms import FrameTree, is_base, is_odom, prefix_of
from mapcli.formats.logs.topics import SCANS, listed
from mapcli.model.counting import counted
from mapcli.model.log import Role, Topic

UNDERSCORED_BASE = re.compile(r"(.+)[_.-]base(?:_link|_footprint)?")
"""`robot1_base_link`: a body's name in one tree for several robots, without slashes."""


class Body(NamedTuple):
    """What the sensors of one robot hang on.

    Attributes:
        name: the prefix of a frame that is named as a robot's body; else the frame itself.
        is_prefix: which of them.
    """

    name: str
    is_prefix: bool


def namespace_of(topic: str) -> str:
    """Of `/fleet/robot1/scan`: `fleet/robot1`; empty at the root."""
    return topic.strip("/").rpartition("/")[0]


def encloses(outer: str, inner: str) -> bool:
    """Whether a namespace is another one, or around it."""
    return not outer or f"{inner}/".startswith(f"{outer}/")


class Robots:
    """The robots of a log (what is read of it is remembered).

    Args:
        topics: all of the log.
        frame: tells the frame in the first message of a topic; of odometry, the child.
        transforms: reads the transforms of topics.
    """

    def __init__(
        self,
        topics: Sequence[Topic],
        frame: Callable[[Topic], str],
        transforms: Callable[[Sequence[Topic]], Iterable[Transform]],
    ) -> None:
        self._scans = [topic for topic in topics if topic.role in SCANS and topic.count]
        self._odometry = [topic for topic in topics if topic.role == "odometry" and topic.count]
        self._spaces: dict[str, list[Topic]] = {}
        for topic in topics:
            if topic.role in ("tf", "tf_static") and topic.count:
                self._spaces.setdefault(namespace_of(topic.name), []).append(topic)
        self._read_frame, self._read_transforms = frame, transforms
        self._frames: dict[Topic, str] = {}
        self._trees: dict[str, FrameTree] = {}
        self._children: dict[Topic, set[str]] = {}
        self._spaces_of: dict[Topic, tuple[str, ...]] = {}

    # Transforms

    def transform_topics(self, topic: Topic, role: Role) -> list[Topic]:
        """The topics of the transforms that a topic's own robot sends, its nearest first."""
        spaces = self.spaces_of(topic)
        return [one for space in spaces for one in self._spaces[space] if one.role == role]

    def spaces_of(self, topic: Topic) -> tuple[str, ...]:
        """The namespaces with the transforms of a topic's robot, the nearest first: those around
        it, if they are not another robot's. Without one around it, the only one that is left."""
        if topic not in self._spaces_of:
            around = self._around(topic)
            found = self._joined(around) if around else self._left_over(topic)
            self._spaces_of[topic] = tuple(found)
        return self._spaces_of[topic]

    def _around(self, topic: Topic) -> list[str]:
        """Namespaces with transforms around that of a topic, the nearest first."""
        own = namespace_of(topic.name)
        return sorted((s for s in self._spaces if encloses(s, own)), key=len, reverse=True)

    def _joined(self, around: Sequence[str]) -> Iterator[str]:
        """The nearest, and those around it in which nobody else scans, and no frame is that has
        the name of one here: a frame has one parent."""
        nearest, known = around[0], set[str]()
        yield nearest
        for space in around[1:]:
            known = known or set(self._tree(nearest).children())
            if any(self._around(one)[:1] == [space] for one in self._scans):
                continue
            if known.isdisjoint(self._tree(space).children()):
                yield space

    def _left_over(self, topic: Topic) -> list[str]:
        taken = {space for one in self._scans for space in self._around(one)[:1]}
        free = [space for space in self._spaces if space not in taken]
        if len(free) > 1:
            free = [space for space in free if self._frame(topic) in self._tree(space)]
        return free if len(free) == 1 else []

    def _tree(self, space: str) -> FrameTree:
        """All of what was static in a namespace, and where the rest was first."""
        if space not in self._trees:
            tree = self._trees[space] = FrameTree()
            topics = self._spaces[space]
            static = self._read_transforms([one for one in topics if one.role == "tf_static"])
            moving = self._read_transforms([one for one in topics if one.role == "tf"])
            for transform in [*static, *islice(moving, MOVING_TRANSFORMS)]:
                if transform.child not in tree.children():
                    tree.add(transform.parent, transform.child, transform.motion)
        return self._trees[space]

    def _frame(self, topic: Topic) -> str:
        if topic not in self._frames:
            self._frames[topic] = self._read_frame(topic)
        return self._frames[topic]

    # Robots

    def apart(self, topics: Sequence[Topic]) -> list[list[Topic]]:
        """Topics of scans, those of each robot together."""
        robots: list[list[Topic]] = []
        for topic in topics:
            of_it = (some for some in robots if not any(self._differ(topic, one) for one in some))
            robot = next(of_it, None)
            if robot is None:
                robots.append([topic])
            else:
                robot.append(topic)
        return robots

    def refuse_several(self, topics: Sequence[Topic], file: str) -> None:
        """Refuse scans of several robots.

        Raises:
            DataError: with the options that take one of them.
        """
        robots = self.apart(topics)
        if len(robots) > 1:
            ways = [" ".join(f"--scan-topic {one.name}" for one in robot) for robot in robots]
            raise DataError(
                f"scans of {counted(len(robots), 'robots')}{listed(topics, ': ')}",
                file=file,
                expected=f"those of one: {', or '.join(ways)}",
            )

    def own_odometry(self, scan: Topic) -> list[Topic]:
        """The topics that the odometry of the robot that a scan topic is of may be on: transforms
        of its own, and odometry that is not of another robot for sure; what is in its own
        namespace, if there is any."""
        own = self._odometry
        if not self._is_simple(scan):
            own = [one for one in own if not self._surely_differ(scan, one)]
        named = [one for one in own if (space := namespace_of(one.name))
                 and encloses(space, namespace_of(scan.name))]  # fmt: skip
        return [*(named or own), *self.transform_topics(scan, "tf")]

    def carrying(self, child: str, topics: Sequence[Topic]) -> Topic:
        """The first of some topics of transforms that tells where a frame is."""
        for topic in topics[:-1]:
            if topic not in self._children:
                some = islice(self._read_transforms([topic]), MOVING_TRANSFORMS)
                self._children[topic] = {transform.child for transform in some}
            if child in self._children[topic]:
                return topic
        return topics[-1]

    def others_odometry(self, scan: Topic) -> list[Topic]:
        """Topics of odometry that seem to be of another robot than a scan topic is."""
        own = self.own_odometry(scan)
        return [one for one in self._odometry if one not in own]

    def _is_simple(self, scan: Topic) -> bool:
        """Whether all that may be odometry is of one robot, as far as names tell: transforms need
        not be read to tell."""
        spaces = {namespace_of(one.name) for one in self._odometry}
        own = namespace_of(scan.name)
        is_near = all(encloses(one, own) or encloses(own, one) for one in spaces)
        return len(self._odometry) == 1 and len(self._spaces) < 2 and is_near

    def _surely_differ(self, one: Topic, other: Topic) -> bool:
        """Whether the transforms say that two topics are of different robots."""
        some, others = self.spaces_of(one), self.spaces_of(other)
        if some and others and some[0] not in others and others[0] not in some:
            return True
        body, its = self._body(one), self._body(other)
        return bool(body and its and body.is_prefix and its.is_prefix and body != its)

    def _differ(self, one: Topic, other: Topic) -> bool:
        """Whether two topics of scans seem to be of different robots."""
        if self._surely_differ(one, other):
            return True
        body = self._body(one) or self._named(one)
        its = self._body(other) or self._named(other)
        return body is not None and its is not None and body != its

    def _body(self, topic: Topic) -> Body | None:
        """What a topic's frame hangs on; None where no transform tells."""
        for space in self.spaces_of(topic):
            tree = self._tree(space)
            frame = tree.named(self._frame(topic), namespace_of(topic.name))
            if frame in tree:
                return self._body_above(tree.ancestry(frame))
        return None

    def _body_above(self, line: Sequence[str]) -> Body | None:
        base = next(filter(is_base, line), None)
        if base is not None:
            return Body(prefix_of(base), True)
        odom = next((k for k, frame in enumerate(line) if k and is_odom(frame)), None)
        frame = line[odom - 1 if odom else -1]
        if found := UNDERSCORED_BASE.fullmatch(frame):
            return Body(found[1], True)
        return Body(frame, False) if odom else None

    def _named(self, topic: Topic) -> Body | None:
        """The robot that a topic of scans is of by its names: of its frame, and its namespace."""
        names = [prefix_of(self._frame(topic))]
        space = namespace_of(topic.name)
        while space:
            names.append(space)
            space = namespace_of(space)
        known = self._known_names()
        return next((Body(name, True) for name in names if name in known), None)

    def _known_names(self) -> set[str]:
        """Names that robots have: before their bodies', and around their scans and odometry."""
        frames = [self._frame(topic) for topic in self._odometry]
        frames += [child for space in self._spaces for child in self._tree(space).children()]
        spaces = {namespace_of(topic.name) for topic in self._odometry}
        around = {s for s in spaces for one in self._scans if encloses(s, namespace_of(one.name))}
        return (around | {prefix_of(frame) for frame in frames if is_base(frame)}) - {""}
